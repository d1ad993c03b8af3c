"""Parts that all figures share: layouts, axes, traces, and numbers and texts for Plotly.

A figure's values ("spec") are {"data": [...], "layout": {...}, "frames": [...]} of plain lists,
strings and numbers. The same values go to Plotly in Python, to a page and through the service.
`fitted` lays a figure out for its width:

  14 px
title, in as many lines as it needs
note, likewise
+------------------------------+
| the plot: layout()'s inner   |
+------------------------------+
  ticks and axis title: margin b
  play and slider, if any
legend, in columns
"""

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.figure_style import GRID, INK, MUTED, FigureStyle

Spec = dict[str, Any]

CLEAR = "rgba(0,0,0,0)"
FONT = "system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif"

CONFIG: Mapping[str, Any] = {
    "responsive": True,
    "displaylogo": False,
    "showSendToCloud": False,
    "plotlyServerURL": "",
}
"""Plotly's configuration for pages, without buttons that would send a plan elsewhere."""

_TITLE_FONT_PX = 17
_LEGEND_FONT_PX = 12

_CONTROLS_PX = 96
"""Height of Plotly's play button and slider; pages with controls of their own subtract it."""

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
    """Return a layout: title, note below it, legend in columns at the bottom, clear background.

    `inner` is the height of the plot in px, `above` the room between it and the note, `below` the
    room for the lowest axis; `fitted` adds the rest. Names in `title` and `note` must be escaped.
    uirevision keeps zoom and hidden legend entries when a page draws the figure again.
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
        # "normal" keeps columns of one width although some traces share a legend group
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
        "text": label(text, _MESSAGE_LENGTH),
        "x": 0.5,
        "y": 0.5,
        "xref": "paper",
        "yref": "paper",
        "showarrow": False,
    }
    shown = layout(title, inner=160, below=10, xaxis=hidden, yaxis=hidden, annotations=[note])
    return {"data": [], "layout": shown}


# --- traces -------------------------------------------------------------------------------------


def line_trace(uid: str, name: str, x: Any, y: Any, line: Spec, **more: Any) -> Spec:
    """Return a trace of lines, without hover text unless `more` gives it."""
    said = {} if "hovertemplate" in more and "hoverinfo" not in more else {"hoverinfo": "skip"}
    shown = {"type": "scatter", "uid": uid, "name": name, "mode": "lines", "x": x, "y": y}
    return {**shown, "line": line, **said, **more}


def mark_trace(
    uid: str, name: str, x: Any, y: Any, marker: Spec, hover: str = "", **more: Any
) -> Spec:
    """Return a trace of marks; `hover` is Plotly's template of their hover text."""
    said = {"hovertemplate": hover} if hover else {"hoverinfo": "skip"}
    shown = {"type": "scatter", "uid": uid, "name": name, "mode": "markers", "x": x, "y": y}
    return {**shown, "marker": marker, **more, **said}


def bar_marker(color: str, pattern: str = "", *, edge_px: float = 0.8, size: int = 6) -> Spec:
    """Return the marker of bars: edged, and hatched if there is a pattern."""
    marker: Spec = {"color": color, "line": {"color": INK, "width": edge_px}}
    if pattern:
        marker["pattern"] = {"shape": pattern, "fillmode": "replace", "size": size}
    return marker


def row_bars(
    uid: str, name: str, rows: Sequence[Any], x: list[float | None], marker: Spec, **more: Any
) -> Spec:
    """Return horizontal bars of lengths x, each in its row of a figure of rows."""
    bars = {"type": "bar", "orientation": "h", "uid": uid, "name": name, "y": list(rows), "x": x}
    return {**bars, "marker": marker, **more}


def rows_spec(
    title: str,
    note: str,
    rows: Sequence[str],
    across: Spec,
    traces: Sequence[Spec],
    *,
    row_px: int = 21,
    gap: float = 0.25,
) -> Spec:
    """Return a figure of rows, the first on top, over the axis `across`, without empty traces.

    Names of rows must be escaped.
    """
    named: Spec = {"categoryorder": "array", "categoryarray": list(rows), "showgrid": False}
    shown = layout(
        title,
        note=note,
        inner=max(row_px * len(rows), 90),
        barmode="overlay",
        bargap=gap,
        xaxis=across,
        yaxis=axis(type="category", autorange="reversed", **named),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": shown}


# --- numbers and texts --------------------------------------------------------------------------


def compass(heading: ArrayLike) -> list[float]:
    """Return headings in rad from +x counter-clockwise as Plotly's degrees clockwise from up."""
    turned = 90.0 - np.degrees(np.asarray(heading, dtype=float))
    return [float(value) for value in np.round(turned % 360.0, 1).ravel()]


def decimals(extent: float) -> int:
    """Return the number of decimals that shows a hundred-thousandth of `extent`."""
    return 5 - math.floor(math.log10(extent)) if extent > 0.0 else 3


def numbers(values: ArrayLike, places: int | None = None) -> list[float | None]:
    """Return values of any shape as a flat list, rounded; NaN and infinity become null."""
    flat = np.asarray(values, dtype=float).ravel()
    if places is not None:
        flat = np.round(flat, places)
    listed: list[float] = flat.tolist()
    if np.isfinite(flat).all():
        return list(listed)
    return [value if math.isfinite(value) else None for value in listed]


def gapped(lines: Array, places: int) -> tuple[list[float | None], list[float | None]]:
    """Return (x, y) of (k, p, 2) polylines for one trace, with a gap after each."""
    with_gap = np.concatenate([lines, np.full((len(lines), 1, 2), np.nan)], axis=1)
    return numbers(with_gap[..., 0], places), numbers(with_gap[..., 1], places)


def escaped(text: str) -> str:
    """Return a user's text escaped, so that Plotly does not read < and & as markup."""
    return html.escape(text, quote=False)


def label(text: str, most: int = _LINE_LENGTH) -> str:
    """Return a text, escaped and broken between words into lines of at most `most` characters."""
    words = " ".join(escaped(text).split())
    return "<br>".join(wrap(words, most, break_long_words=False, break_on_hyphens=False))


# --- fit to a width -----------------------------------------------------------------------------

_EM = 0.53
"""Mean width of a character in units of the font's size; somewhat generous."""

_LINE = 1.3
"""Height of a line of text in units of the font's size."""

_SIDE_PX = 14
_LEGEND_SYMBOL_PX = 46
_LEGEND_ROW_GAP_PX = 4
_LEGEND_PAD_PX = 8
_LEAST_PLOT_PX = 80
_NOTE_LINES = 4


def fitted(spec: Spec, style: FigureStyle) -> Spec:
    """Return a figure laid out for a style's width and height, its text at the style's scale.

    If the style has no height, the figure takes what title, plot and legend need. `spec` is not
    modified. Raises InputError if the height leaves no room for the plot.
    """
    layout = {**_with_fonts(spec["layout"], style.font_scale)}
    if not style.legend:
        layout["showlegend"] = False
    size = layout["legend"]["font"]["size"]
    data = [_folded(trace, size, style) for trace in spec["data"]]
    top = _heading(layout, style)
    legend = _legend_px(data, layout, style)
    controls = layout["meta"]["controls_px"] if layout.get("sliders") else 0
    bottom = style.px(layout["margin"]["b"]) + controls + legend
    height = style.height or top + layout["meta"]["inner_px"] + bottom
    if height - top - bottom < _LEAST_PLOT_PX:
        least = top + bottom + _LEAST_PLOT_PX
        raise InputError(
            f"{height} px leave no room for the plot; at this width it needs {least}",
            key="height",
        )
    left, right = style.sides_px
    layout["height"] = height
    if style.width is not None:
        layout["width"] = style.width
    layout["margin"] = {"l": left, "r": right, "t": top, "b": bottom}
    layout["legend"] = {**layout["legend"], "y": round(0.5 * _LEGEND_PAD_PX / height, 4)}
    layout["annotations"] = [_annotation(one, style) for one in layout.get("annotations", [])]
    return {**spec, "data": data, "layout": layout}


def _with_fonts(value: Any, scale: float) -> Any:
    """Scale the size of every font in a layout."""
    if isinstance(value, list):
        return [_with_fonts(one, scale) for one in value]
    if not isinstance(value, dict) or scale == 1.0:
        return value
    scaled = {key: _with_fonts(one, scale) for key, one in value.items()}
    for key, font in scaled.items():
        if key.endswith("font") and "size" in font:
            scaled[key] = {**font, "size": round(font["size"] * scale, 1)}
    return scaled


def _heading(layout: Spec, style: FigureStyle) -> int:
    """Break title and note into lines, each if it is shown; return the room above the plot in px.

    Plotly centres a title of several lines where a single line would stand, so it is moved down.
    """
    title = layout["title"] = _shown_title(layout["title"], style)
    if not title["text"]:
        return _SIDE_PX + style.px(layout["meta"]["above_px"])
    room = style.page_px - 2 * _SIDE_PX
    size = title["font"]["size"]
    lines = _broken(title["text"], room, size)
    title["text"] = "<br>".join(lines)
    rise = _LINE * size * (len(lines) - 1)
    title["pad"] = {**title["pad"], "t": round(_SIDE_PX + 0.5 * rise)}
    height = _SIDE_PX + _LINE * size + rise
    note = title.get("subtitle")
    if note:
        size = note["font"]["size"]
        lines = _broken(note["text"], room, size)[:_NOTE_LINES]
        title["subtitle"] = {**note, "text": "<br>".join(lines)}
        height += _LINE * size * len(lines) + (1.2 * size if len(lines) == 1 else 0.6 * size)
    return int(height + 0.5 * _SIDE_PX) + style.px(layout["meta"]["above_px"])


def _shown_title(title: Spec, style: FigureStyle) -> Spec:
    """Title and note that a style shows; a note without a title stands in its place."""
    note = title.get("subtitle", {"text": ""}) if style.subtitle else {"text": ""}
    shown = {key: value for key, value in title.items() if key != "subtitle"}
    if not style.title:
        return {**shown, **note}
    return {**shown, "subtitle": note} if note["text"] else shown


def _legend_px(data: list[Spec], layout: Spec, style: FigureStyle) -> int:
    """Height of the legend in px: one row if it fits, otherwise columns of the widest entry."""
    named = [t["name"] for t in data if t.get("showlegend", True) and t.get("name")]
    if not named or layout.get("showlegend") is False:
        return 0
    size = layout["legend"]["font"]["size"]
    lines = [name.split("<br>") for name in named]
    widths = [_LEGEND_SYMBOL_PX + max(_width(line, size) for line in one) for one in lines]
    room = style.page_px - 2 * _SIDE_PX
    columns = len(named) if sum(widths) <= room else max(1, int(room / max(widths)))
    rows = [lines[k : k + columns] for k in range(0, len(lines), columns)]
    height = sum(_LINE * size * max(map(len, row)) + _LEGEND_ROW_GAP_PX for row in rows)
    return int(round(height) + _LEGEND_PAD_PX)


def _folded(trace: Spec, size: float, style: FigureStyle) -> Spec:
    """Break the legend entry of a trace into lines that fit the figure's width."""
    if not trace.get("name") or not trace.get("showlegend", True):
        return trace
    room = style.page_px - 2 * _SIDE_PX - _LEGEND_SYMBOL_PX
    if max(_width(line, size) for line in trace["name"].split("<br>")) <= room:
        return trace
    return {**trace, "name": "<br>".join(_broken(trace["name"], room, size))}


def _annotation(note: Spec, style: FigureStyle) -> Spec:
    """Break a left-aligned annotation into lines that end at the plot's right edge."""
    if note.get("xref") != "paper" or note.get("xanchor") != "left":
        return note
    room = (1.0 - float(note["x"])) * style.plot_px
    size = note["font"]["size"]
    lines = [line for part in note["text"].split("<br>") for line in _broken(part, room, size)]
    return {**note, "text": "<br>".join(lines)}


def _width(text: str, size: float) -> float:
    """Width of an escaped text in px."""
    return _EM * size * len(html.unescape(text))


def _broken(text: str, room: float, size: float) -> list[str]:
    """Break an escaped text into lines that fit `room` px, cutting longer words."""
    most = max(8, int(room / (_EM * size)))
    plain = html.unescape(text.replace("<br>", " "))
    return [html.escape(line, quote=False) for line in _lines(plain, most)]


def _lines(text: str, width: int) -> Iterable[str]:
    line = ""
    for word in text.split():
        rest = word
        if line and len(line) + 1 + len(rest) > width:
            yield line
            line = ""
        line = f"{line} {rest}".strip()
        while len(line) > width:
            yield line[:width]
            line = line[width:]
    yield line
