"""A figure's frame fitted to its width: lines of text, rows of the legend, margins, height.

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
from collections.abc import Iterable
from typing import Any

from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import FigureStyle

_EM = 0.53
"""Mean width of a character, of the font's size; somewhat generous."""

_LINE = 1.3
"""Height of a line of text, of the font's size."""

_SIDE_PX = 14
_LEGEND_SYMBOL_PX = 46
_LEGEND_ROW_GAP_PX = 4
_LEGEND_PAD_PX = 8
_LEAST_PLOT_PX = 80
_NOTE_LINES = 4


def fitted(spec: Spec, style: FigureStyle) -> Spec:
    """Return a figure laid out for a style's width and height, its text at the style's scale.

    The height is the style's; if it has none, what title, plot and legend need together. `spec`
    itself stays as it is. Raises InputError where the height leaves no room for the plot.
    """
    layout = {**_with_fonts(spec["layout"], style.font_scale)}
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
    """A layout with every font's size at a scale."""
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
    """Break title and note into lines; return the room above the plot in px.

    Plotly centres a title of several lines on where a single one would stand: it is moved down.
    """
    title = layout["title"] = dict(layout["title"])
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
        told = _broken(note["text"], room, size)[:_NOTE_LINES]
        title["subtitle"] = {**note, "text": "<br>".join(told)}
        height += _LINE * size * len(told) + (1.2 * size if len(told) == 1 else 0.6 * size)
    return int(height + 0.5 * _SIDE_PX) + style.px(layout["meta"]["above_px"])


def _legend_px(data: list[Spec], layout: Spec, style: FigureStyle) -> int:
    """Height of the legend: one row where all entries fit, else columns of the widest."""
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
    """A trace whose entry in the legend is no wider than the figure."""
    if not trace.get("name") or not trace.get("showlegend", True):
        return trace
    room = style.page_px - 2 * _SIDE_PX - _LEGEND_SYMBOL_PX
    if max(_width(line, size) for line in trace["name"].split("<br>")) <= room:
        return trace
    return {**trace, "name": "<br>".join(_broken(trace["name"], room, size))}


def _annotation(note: Spec, style: FigureStyle) -> Spec:
    """An annotation that starts at a share of the plot's width, broken where that ends."""
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
    """An escaped text in lines that fit into `room` px, words longer than that cut."""
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
