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

_TITLE_FONT_PX = 17
_LEGEND_FONT_PX = 12

_CONTROLS_PX = 96
"""Height of Plotly's own play button and slider; pages that have others take it off."""

_LINE_LENGTH = 46
_BELOW_PX = 52
_MESSAGE_LENGTH = 44


def layout(
    title: str,
    *,
    note: str = "",
    inner: int = 340,
    above: int = 0,
    below: int = _BELOW_PX,
    **more: Any,
) -> Spec:
    """Return a layout: title, a note under it, legend in columns below, clear background.

    `inner` is the height of the plot in px, `above` what stands between it and the note, `below`
    the room for the lowest axis; syncplan.plotting.layout_fitting adds the rest. `title` and
    `note` are shown as they are: names in them must be escaped. uirevision keeps zoom and hidden
    legend entries when a page draws the figure again.
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
        "font": {"size": _TITLE_FONT_PX},
    }
    if note:
        heading["subtitle"] = {"text": note, "font": {"size": 13, "color": MUTED}}
    return {
        "title": heading,
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": CLEAR,
        "plot_bgcolor": CLEAR,
        "height": inner + below,
        "margin": {"l": 70, "r": 24, "t": above, "b": below},
        "meta": {"inner_px": inner, "above_px": above, "controls_px": _CONTROLS_PX},
        # columns of one width, whatever traces are switched together
        "legend": {
            "orientation": "h",
            "x": 0.008,
            "xref": "container",
            "y": 0,
            "yref": "container",
            "yanchor": "bottom",
            "traceorder": "normal",
            "font": {"size": _LEGEND_FONT_PX},
        },
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
        "title": {"text": title, "standoff": 8, "font": {"size": 13}},
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
        "align": "left",
        "font": {"size": 13},
    }


def message(title: str, text: str) -> Spec:
    """Return a figure that says why there is nothing to draw."""
    hidden = {"visible": False}
    note = {
        "text": "<br>".join(_lines(escaped(text), _MESSAGE_LENGTH)),
        "x": 0.5,
        "y": 0.5,
        "xref": "paper",
        "yref": "paper",
        "showarrow": False,
    }
    shown = layout(title, inner=160, below=10, xaxis=hidden, yaxis=hidden, annotations=[note])
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


def label(text: str, most: int = _LINE_LENGTH) -> str:
    """Return an escaped text broken into lines of at most so many characters."""
    return "<br>".join(_lines(escaped(text), most))


def _lines(text: str, width: int) -> Iterable[str]:
    line = ""
    for word in text.split():
        if line and len(line) + len(word) >= width:
            yield line
            line = ""
        line = f"{line} {word}".strip()
    yield line
