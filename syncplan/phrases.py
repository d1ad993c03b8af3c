"""Wording of lists, whose first items are named and the rest counted, and of shares."""

from collections.abc import Sequence


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
