"""Names of vehicles as other systems take them: safe, and no two alike."""

import re
import unicodedata
from collections.abc import Sequence

LONGEST_BYTES = 80
"""Longest part of a file's name that comes from the user, in UTF-8."""

_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)", re.IGNORECASE)


def file_title(title: str) -> str:
    """Return a title as the beginning of a file's name: `plan` where nothing is left of it."""
    name = _safe(title) or "plan"
    return f"{name}_" if _RESERVED.fullmatch(name) else name


def file_names(names: Sequence[str]) -> list[str]:
    """Return each name as part of a file's name: letters and digits of any script, - and _.

    Names that would be the same, also where upper case is lower case, get a number.
    """
    return _distinct([_safe(name) or "vehicle" for name in names], "-")


def ros_names(names: Sequence[str]) -> list[str]:
    """Return each name as a token of a ROS 2 topic: ASCII, begins with a letter, no double _.

    Source: ROS 2 design, "Topic and Service name mapping to DDS".
    """
    tokens = []
    for name in names:
        plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
        token = re.sub(r"[^A-Za-z0-9]+", "_", plain).strip("_")
        tokens.append(token if token[:1].isalpha() else f"vehicle_{token}".rstrip("_"))
    return _distinct(tokens, "_")


def _safe(name: str) -> str:
    """A name without what file systems or shells may take amiss, cut at LONGEST_BYTES."""
    plain = unicodedata.normalize("NFC", name)
    kept = "".join(c if c.isalnum() or c in "-_" else "_" for c in plain)
    return kept.encode()[:LONGEST_BYTES].decode(errors="ignore").strip("_-")


def _distinct(names: list[str], joint: str) -> list[str]:
    # a plain name keeps itself, whichever comes first: numbers only go to later ones
    taken: set[str] = set()
    distinct = []
    for name in names:
        chosen, number = name, 2
        while chosen.casefold() in taken:
            chosen, number = f"{name}{joint}{number}", number + 1
        taken.add(chosen.casefold())
        distinct.append(chosen)
    return distinct
