"""What all figures share: layout, axes, rounding, and the angles and texts that Plotly takes.

A figure's values ("spec") are {"data": [...], "layout": {...}, "frames": [...]} of plain lists,
strings and numbers: the same go to Plotly in Python, to a page and through the service.
"""

import html
import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array
from syncplan.plotting.palette import GRID, INK, MUTED

__all__ = [
    "CONFIG",
    "Spec",
    "axis",
    "compass",
    "decimals",
    "escaped",
    "gapped",
    "label",
    "layout",
    "message",
    "numbers",
    "panel_title",
]

Spec = dict[str, Any]

CLEAR = "rgba(0,0,0,0)"
FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif"

CONFIG: Mapping[str, Any] = {
    "responsive": True,
    "displaylogo": False,
    "showSendToCloud": False,
    "plotlyServerURL": "",
}
"""Plotly's configuration for pages: nothing is offered that would send a plan elsewhere."""

_LINE_LENGTH = 46
_NOTE_LENGTH = 92
_NOTE_LINE_PX = 18


def layout(title: str, *, note: str = "", height: int = 520, **more: Any) -> Spec:
    """Return a layout: title, a note under it, legend below, clear background.

    `title` and `note` are shown as they are: names in them must be escaped. uirevision keeps zoom
    and hidden legend entries when a page draws the figure again.
    """
    heading: dict[str, Any] = {
        "text": title,
        "x": 0,
        "xref": "container",
        "xanchor": "left",
        "y": 1,
        "yref": "container",
        "yanchor": "top",
        "pad": {"t": 14, "l": 14},
        "font": {"size": 17},
    }
    lines = list(_lines(note, _NOTE_LENGTH)) if note else []
    if lines:
        heading["subtitle"] = {"text": "<br>".join(lines), "font": {"size": 13, "color": MUTED}}
    return {
        "title": heading,
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": CLEAR,
        "plot_bgcolor": CLEAR,
        "height": height,
        "margin": {"l": 70, "r": 24, "t": 56 + _NOTE_LINE_PX * len(lines), "b": 60},
        "legend": {"orientation": "h", "x": 0, "y": 0, "yref": "container", "yanchor": "bottom"},
        "hovermode": "closest",
        "modebar": {
            "bgcolor": CLEAR,
            "color": MUTED,
            "activecolor": INK,
            "remove": ["sendChartToCloud"],
        },
        "uirevision": "syncplan",
        "template": {},
        **more,
    }


def axis(title: str = "", **more: Any) -> Spec:
    """Return an axis with its title (unit included) and a quiet grid."""
    return {
        "title": {"text": title},
        "gridcolor": GRID,
        "zeroline": False,
        "showline": True,
        "linecolor": MUTED,
        "ticks": "outside",
        "tickcolor": MUTED,
        "automargin": True,
        **more,
    }


def panel_title(text: str, x: float, y: float) -> Spec:
    """Return an annotation above a panel whose upper left corner is (x, y) of the plot."""
    return {
        "text": text,
        "x": x,
        "y": y,
        "xref": "paper",
        "yref": "paper",
        "xanchor": "left",
        "yanchor": "bottom",
        "showarrow": False,
        "font": {"size": 14},
    }


def message(title: str, text: str) -> Spec:
    """Return a figure that says why there is nothing to draw."""
    hidden = {"visible": False}
    note = {
        "text": "<br>".join(_lines(escaped(text), 70)),
        "x": 0.5,
        "y": 0.5,
        "xref": "paper",
        "yref": "paper",
        "showarrow": False,
    }
    shown = layout(title, height=240, xaxis=hidden, yaxis=hidden, annotations=[note])
    return {"data": [], "layout": shown}


def compass(heading: ArrayLike) -> list[float]:
    """Return headings in rad from +x counter-clockwise as Plotly's degrees clockwise from up."""
    turned = 90.0 - np.degrees(np.asarray(heading, dtype=float))
    return [float(value) for value in np.round(turned % 360.0, 1).ravel()]


def decimals(extent: float) -> int:
    """Return how many decimals show a hundred-thousandth of `extent`."""
    return 5 - math.floor(math.log10(extent)) if extent > 0.0 else 3


def numbers(values: ArrayLike, places: int | None = None) -> list[float | None]:
    """Return values of any shape as a flat list, rounded; NaN and infinity as null."""
    flat = np.asarray(values, dtype=float).ravel()
    if places is not None:
        flat = np.round(flat, places)
    listed: list[float] = flat.tolist()
    if np.isfinite(flat).all():
        return list(listed)
    return [value if math.isfinite(value) else None for value in listed]


def gapped(lines: Array, places: int) -> tuple[list[float | None], list[float | None]]:
    """Return (x, y) of (k, p, 2) polylines in one trace: a gap follows each."""
    with_gap = np.concatenate([lines, np.full((len(lines), 1, 2), np.nan)], axis=1)
    return numbers(with_gap[..., 0], places), numbers(with_gap[..., 1], places)


def escaped(text: str) -> str:
    """Return a user's text so that Plotly shows it as it is: < and & are no markup."""
    return html.escape(text, quote=False)


def label(text: str) -> str:
    """Return an escaped text broken into lines that fit a legend."""
    return "<br>".join(_lines(escaped(text), _LINE_LENGTH))


def _lines(text: str, width: int) -> Iterable[str]:
    line = ""
    for word in text.split():
        if line and len(line) + len(word) >= width:
            yield line
            line = ""
        line = f"{line} {word}".strip()
    yield line
