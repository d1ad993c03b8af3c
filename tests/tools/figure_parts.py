"""Parts of a figure's specification."""

from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.plotting.figures import Subject, specs_of

__all__ = ["lines_of", "note_of", "spec_of", "trace_of", "turns_of"]


def spec_of(subject: Subject, name: str, **given: Any) -> dict[str, Any]:
    """Return one figure of a subject as Plotly's plain values; `given` as for specs_of."""
    return specs_of(subject, [name], **given)[name]


def trace_of(spec: dict[str, Any], uid: str) -> dict[str, Any]:
    """Return the only trace of a figure with this identifier."""
    trace: dict[str, Any]
    (trace,) = (one for one in spec["data"] if one["uid"] == uid)
    return trace


def note_of(spec: dict[str, Any]) -> str:
    """Return what stands below the title, in one line."""
    text: str = spec["layout"]["title"]["subtitle"]["text"]
    return text.replace("<br>", " ")


def lines_of(trace: dict[str, Any]) -> list[Array]:
    """Return the lines (k, 2) of a trace, cut at its gaps; it ends with one."""
    points = np.array([trace["x"], trace["y"]], dtype=float).T
    gaps = np.flatnonzero(np.isnan(points[:, 0]))
    assert gaps[-1] == len(points) - 1
    return [line[np.isfinite(line[:, 0])] for line in np.split(points, gaps)][:-1]


def turns_of(heads: dict[str, Any], centers: Array) -> Array:
    """Return the senses, 1 counter-clockwise, in which the heads of a trace go round centres."""
    arm = np.column_stack([heads["x"], heads["y"]]) - centers
    # Plotly turns markers clockwise from up, in degrees
    turned = np.radians(heads["marker"]["angle"])
    senses: Array = np.sign(arm[:, 0] * np.cos(turned) - arm[:, 1] * np.sin(turned))
    return senses
