"""Parts of a figure's specification."""

from typing import Any

__all__ = ["trace_of"]


def trace_of(spec: dict[str, Any], uid: str) -> dict[str, Any]:
    """Return the only trace of a figure with this identifier."""
    trace: dict[str, Any]
    (trace,) = (one for one in spec["data"] if one["uid"] == uid)
    return trace
