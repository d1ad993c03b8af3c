"""Panels of curves over time, which share an axis of time.

panels_spec     an axis for each panel, in three columns or in one
multiples_spec  small multiples: a row for each subject, one scale for each kind of value
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from syncplan.plotting.canvas import Spec, axis, escaped, layout, line_trace, numbers, panel_title
from syncplan.plotting.figure_style import INK, FigureStyle

MOST_POINTS = 400
"""Largest number of samples drawn; longer runs show every k-th."""

_ROW_PX = 150
_NARROW_ROW_PX = 110
_GAP_PX = 38

_SMALL_ROW_PX = 84
_NARROW_SMALL_ROW_PX = 56
_SMALL_GAP_PX = 8
_SMALL_FONT_PX = 11
_COLUMNS = ((0.0, 0.31), (0.34, 0.65), (0.69, 1.0))
"""Heights of rows of small multiples and gaps between them, their text, and their columns."""

_MARKS = 4
_MARK_PX = 7
"""Marks on a curve, and their size."""


def every_so_many(samples: int) -> int:
    """Return the smallest k for which every k-th of `samples` makes at most MOST_POINTS."""
    return max(1, -(-samples // MOST_POINTS))


def panels_spec(
    title: str,
    note: str,
    names: Sequence[str],
    traces: list[Spec],
    style: FigureStyle,
    vertical: Sequence[Spec],
    *,
    times: Sequence[float] = (),
    **more: Any,
) -> Spec:
    """Return a figure of panels that share a time axis, in three columns or in one.

    `vertical` holds further properties of each panel's vertical axis. The time axis ends with
    `times`, as marks would widen it, or with what is drawn.
    """
    ends = {"range": numbers([times[0], times[-1]], 6)} if times else {}
    columns = 1 if style.narrow else 3
    row_px, gap_px = _NARROW_ROW_PX if style.narrow else _ROW_PX, style.px(_GAP_PX)
    lines = -(-len(names) // columns)
    whole = row_px * lines + gap_px * (lines - 1)
    axes: Spec = {}
    titles = []
    for number, (name, further) in enumerate(zip(names, vertical, strict=True)):
        line, column = divmod(number, columns)
        top = 1.0 - line * (row_px + gap_px) / whole
        suffix = str(number + 1) if number else ""
        left = column * 0.35
        lowest = number + columns >= len(names)
        titles.append(panel_title(escaped(name), left, top))
        axes[f"xaxis{suffix}"] = axis(
            "time, s" if lowest else "",
            domain=[left, 1.0 if columns == 1 else left + 0.30],
            anchor=f"y{suffix}",
            showticklabels=lowest,
            **({"matches": "x"} if number else {}),
            **ends,
        )
        axes[f"yaxis{suffix}"] = axis(
            domain=[max(top - row_px / whole, 0.0), top], anchor=f"x{suffix}", nticks=5, **further
        )
    shown = layout(title, note=note, inner=whole, above=24, annotations=titles, **more, **axes)
    return {"data": traces, "layout": shown}


def multiples_spec(
    title: str,
    note: str,
    subjects: Sequence[str],
    kinds: Sequence[str],
    traces: list[Spec],
    style: FigureStyle,
    reach: Sequence[float],
    **more: Any,
) -> Spec:
    """Return small multiples: a row of three panels for each subject, a column for each kind.

    Panels are numbered row by row. All of a kind reach from -reach to reach; the first two kinds
    share their scale, so that its ticks stand beside the first column alone.
    """
    row_px = style.px(_NARROW_SMALL_ROW_PX if style.narrow else _SMALL_ROW_PX)
    whole = row_px * len(subjects) + _SMALL_GAP_PX * (len(subjects) - 1)
    axes: Spec = {}
    texts = [panel_title(escaped(kind), _COLUMNS[k][0], 1.0) for k, kind in enumerate(kinds)]
    small: Spec = {"tickfont": {"size": _SMALL_FONT_PX}}
    for number in range(len(subjects) * len(kinds)):
        row, column = divmod(number, len(kinds))
        suffix = str(number + 1) if number else ""
        top = 1.0 - row * (row_px + _SMALL_GAP_PX) / whole
        lowest = row == len(subjects) - 1
        axes[f"xaxis{suffix}"] = axis(
            "time, s" if lowest else "",
            domain=list(_COLUMNS[column]),
            anchor=f"y{suffix}",
            showticklabels=lowest,
            nticks=4,
            **small,
            **({"matches": "x"} if number else {}),
        )
        axes[f"yaxis{suffix}"] = axis(
            domain=[max(top - row_px / whole, 0.0), top],
            anchor=f"x{suffix}",
            range=numbers([-reach[column], reach[column]], 5),
            side="right" if column == len(kinds) - 1 else "left",
            showticklabels=column != 1,
            nticks=4,
            **small,
        )
        if column == 0:
            # where errors have settled, clear of the curves
            name = panel_title(escaped(subjects[row]), _COLUMNS[0][1], top)
            name |= {"xanchor": "right", "yanchor": "top", "font": {"size": _SMALL_FONT_PX}}
            texts.append(name)
    shown = layout(title, note=note, inner=whole, above=24, annotations=texts, **more, **axes)
    return {"data": traces, "layout": shown}


def panel_line(
    number: int,
    uid: str,
    group: str,
    name: str,
    x: ArrayLike,
    y: list[float | None],
    line: Spec,
    hover: str,
) -> Spec:
    """Return a line of panel `number`; the first panel's line has its group's legend entry.

    An empty `hover` gives no hover text.
    """
    suffix = str(number + 1) if number else ""
    shown: Spec = {"legendgroup": group, "showlegend": number == 0}
    shown |= {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
    said = {"hovertemplate": hover} if hover else {}
    return line_trace(uid, name, numbers(x, 6), y, line, **shown, **said)


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve in each panel of a figure, with marks that keep it apart where curves coincide.

    Attributes
    ----------
    key, name : identifier in the figure, and name in the legend
    line : Plotly's line style
    values : values over time, or a single one for a level; None where unknown
    symbol : Plotly's name of the marks; empty for none
    """

    key: str
    name: str
    line: Spec
    values: Sequence[float | None]
    symbol: str = ""

    @property
    def marker(self) -> Spec:
        """Style of the marks."""
        rim = {"color": INK, "width": 0.5}
        return {"symbol": self.symbol, "size": _MARK_PX, "color": self.line["color"], "line": rim}


def curve_traces(
    curves: Sequence[Curve],
    subject: str,
    number: int,
    times: Sequence[float],
    drawn: Callable[[Sequence[float | None]], list[float | None]],
    hover: str,
) -> list[Spec]:
    """Return the lines and marks of the curves of a subject in panel `number`.

    `drawn` rounds values. Marks of different curves stand at different times.
    """
    every = every_so_many(len(times))
    marked = [one for one in curves if one.symbol]
    traces = []
    for one in curves:
        level = len(one.values) == 1
        at = [times[0], times[-1]] if level else times[::every]
        y = drawn([*one.values, *one.values] if level else one.values[::every])
        said = f"{hover}<extra>{one.name}</extra>"
        uid = f"{one.key}-{subject}"
        line = panel_line(number, uid, one.key, one.name, at, y, one.line, said)
        traces.append({**line, "showlegend": False})
        if one in marked:
            where = _mark_places(y, marked.index(one), len(marked))
            x, y = [at[k] for k in where], [y[k] for k in where]
            marks = panel_line(number, f"marks-{uid}", one.key, one.name, x, y, {}, "")
            marks |= {"mode": "markers", "marker": one.marker, "showlegend": False}
            traces.append({key: value for key, value in marks.items() if key != "line"})
    return traces


def curve_entries(curves: Sequence[Curve]) -> list[Spec]:
    """Return the legend entries of curves, each with its line and its mark, one for a key."""
    entries = []
    for one in {one.key: one for one in curves}.values():
        look: Spec = {"mode": "lines+markers", "marker": one.marker} if one.symbol else {}
        entry = line_trace(f"entry-{one.key}", one.name, [None], [None], one.line, **look)
        entries.append({**entry, "legendgroup": one.key})
    return entries


def _mark_places(y: Sequence[float | None], place: int, of: int) -> list[int]:
    """Indices of the marks of curve `place` of so many: evenly spaced, between those of others."""
    known = [k for k, value in enumerate(y) if value is not None]
    steps = range(_MARKS) if len(known) > of * _MARKS else ()
    return [known[int((k + (place + 0.5) / of) * len(known) / _MARKS)] for k in steps]
