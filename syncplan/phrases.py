"""Wording of keys, of lists, whose first items are named, of shares and of places."""

import math
from collections.abc import Iterable, Mapping, Sequence

_UNITS: Mapping[str, str] = {
    "m_sqrt_s": "m/√s",
    "rad_sqrt_s": "rad/√s",
    "rad_s": "rad/s",
    "mps": "m/s",
    "rad": "rad",
    "deg": "°",
    "m": "m",
    "s": "s",
}
"""Endings of keys, longer ones first, and the units they denote."""


def name_and_unit(key: str) -> tuple[str, str]:
    """Return what a key names, and its unit: ("turn rate", "rad/s") for turn_rate_rad_s."""
    ending = next((ending for ending in _UNITS if key.endswith(f"_{ending}")), "")
    return key.removesuffix(f"_{ending}").replace("_", " "), _UNITS.get(ending, "")


def listed(phrases: Sequence[str], most: int) -> str:
    """Return at most so many of the phrases and the number of the rest: "v1, v2 and 3 more"."""
    rest = len(phrases) - most
    return ", ".join(phrases[:most]) + (f" and {rest} more" if rest > 0 else "")


def in_words(names: Sequence[str]) -> str:
    """Return names of errors in words: "speed scale, wind"."""
    return ", ".join(names).replace("_", " ")


def joined(phrases: Sequence[str], most: int) -> str:
    """Return the phrases with "and" before the last, or as `listed` if there are too many."""
    if len(phrases) > most:
        return listed(phrases, most)
    return " and ".join(filter(None, [", ".join(phrases[:-1]), *phrases[-1:]]))


def percent(share: float, interval: tuple[float, float] | None = None) -> str:
    """Return a share in per cent, to three digits: "12.5 %", or "12.5 % (3.5 % to 29 %)"."""
    text = f"{100.0 * share:.3g} %"
    return text if interval is None else f"{text} ({' to '.join(map(percent, interval))})"


def limit_in_words(message: str) -> str:
    """Return pydantic's message on a limit in fewer words: "must be at least 1"."""
    return message.replace("greater than or equal to", "at least").replace(
        "less than or equal to", "at most"
    )


def metres(value: float, digits: int = 4) -> str:
    """Return a length in m: what is under a tenth of a millimetre is a rounding error, and 0."""
    return f"{round(value, 4) + 0.0:.{digits}g}"


class Places:
    """Words for places of a team, in m: as many decimals as tell its places apart, wherever it is.

    Parameters
    ----------
    team : places (x, y) among which the team is
    radii : of circles around them, m
    """

    def __init__(self, team: Iterable[Sequence[float]], radii: Iterable[float] = ()) -> None:
        spans = [max(values) - min(values) for values in zip(*team, strict=True)]
        extent = max(spans, default=0.0) + 2.0 * max(radii, default=0.0) or 1.0
        self._decimals = max(0, 4 - math.floor(math.log10(extent)))

    def words(self, place: Sequence[float]) -> str:
        """Return the words for a place (x, y)."""
        return ", ".join(map(self._word, place))

    def _word(self, value: float) -> str:
        # mere rounding errors become zero, and never "-0"
        value = round(value, 9) + 0.0
        if abs(value) < 10.0 ** (5 - self._decimals):
            return f"{value:.5g}"
        # five digits would not do
        text = f"{value:.{self._decimals}f}"
        return text.rstrip("0").rstrip(".") if self._decimals else text
