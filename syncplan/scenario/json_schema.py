"""Rules that span keys, as far as JSON Schema can tell them."""

from collections.abc import Iterable
from typing import Any

__all__ = ["given"]


def given(*keys: str, absent: Iterable[str] = ()) -> dict[str, Any]:
    """Return the JSON Schema of a mapping in which keys have values, and others none or null."""
    null: dict[str, Any] = {"type": "null"}
    present: dict[str, Any] = {key: {"not": null} for key in keys}
    return {"required": list(keys), "properties": {**present, **dict.fromkeys(absent, null)}}
