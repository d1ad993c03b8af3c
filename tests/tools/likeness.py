"""Whether what was shown is what a page says: numbers nearly, identifiers by their place.

A page's output may hold `...` for anything. Spaces, line ends and rules of tables don't count.
Numbers with a decimal point may differ by 2 %, or by the last digit given; whole ones may not.
An identifier (UUID) stands for the one that was shown in its place, from then on.
"""

import re
from collections.abc import Sequence

_UUID = r"[0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12}"
_MOMENT = r"\d{4}-\d\d-\d\dT[\d:.]+Z"
_DECIMAL = r"\d+\.\d+(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+"
_TOKEN = re.compile(rf"\.\.\.|{_UUID}|{_MOMENT}|{_DECIMAL}|\w+|[^\w\s]")
_RULES = re.compile("[\u2500-\u257f]+")
_COLOURS = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")

RELATIVE = 0.02


class Likeness:
    """Compares outputs of a page in order, and remembers whom its identifiers stand for."""

    def __init__(self) -> None:
        self.known: dict[str, str] = {}

    def matches(self, written: str, shown: str) -> bool:
        """Whether `shown` is what is `written`; if so, its identifiers are known from now on."""
        parts = _parts(_tokens(written))
        actual = _tokens(shown)
        known = dict(self.known)
        at = 0
        for k, part in enumerate(parts):
            last = k == len(parts) - 1
            if last and len(parts) > 1:
                # what comes after the last "..." ends the output
                starts: Sequence[int] = [len(actual) - len(part)]
            else:
                starts = range(at, len(actual) - len(part) + 1) if k else [0]
            found = next((s for s in starts if s >= at and _alike(part, actual[s:], known)), None)
            if found is None:
                return False
            at = found + len(part)
        if at != len(actual):
            return False
        self.known = known
        return True

    def translated(self, command: str) -> str:
        """Return a command with the identifiers that were really shown."""
        return re.sub(_UUID, lambda found: self.known.get(found[0], found[0]), command)


def _tokens(text: str) -> list[str]:
    return _TOKEN.findall(_RULES.sub(" ", _COLOURS.sub("", text)))


def _parts(tokens: list[str]) -> list[list[str]]:
    """Runs of tokens between "..."; empty ones at an end let anything stand there."""
    parts: list[list[str]] = [[]]
    for token in tokens:
        if token == "...":
            parts.append([])
        else:
            parts[-1].append(token)
    return parts


def _alike(written: list[str], shown: list[str], known: dict[str, str]) -> bool:
    if len(shown) < len(written):
        return False
    learnt = dict(known)
    for said, token in zip(written, shown, strict=False):
        if re.fullmatch(_UUID, said) and re.fullmatch(_UUID, token):
            if learnt.setdefault(said, token) != token:
                return False
        elif re.fullmatch(_MOMENT, said) and re.fullmatch(_MOMENT, token):
            continue
        elif re.fullmatch(_DECIMAL, said) and re.fullmatch(_DECIMAL, token):
            if abs(float(said) - float(token)) > _allowed(said):
                return False
        elif said != token:
            return False
    known.update(learnt)
    return True


def _allowed(said: str) -> float:
    mantissa, _, exponent = said.lower().partition("e")
    last_digit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return max(RELATIVE * abs(float(said)), 1.001 * last_digit)
