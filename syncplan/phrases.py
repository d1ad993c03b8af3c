"""Words for many things: the first are named, the rest counted."""

from collections.abc import Sequence

__all__ = ["listed"]


def listed(phrases: Sequence[str], most: int) -> str:
    """Return at most so many of the phrases and the number of the rest: "v1, v2 and 3 more"."""
    rest = len(phrases) - most
    return ", ".join(phrases[:most]) + (f" and {rest} more" if rest > 0 else "")
