"""Panels that share an axis of time: their axes and titles, in three columns or in one."""

from collections.abc import Sequence

from syncplan.plotting.canvas import Spec, axis, escaped, numbers, panel_title
from syncplan.plotting.figure_style import FigureStyle

MOST_POINTS = 400
"""Moments drawn of a run: every k-th sample."""

_ROW_PX = 150
_NARROW_ROW_PX = 110
_GAP_PX = 38


def every_so_many(samples: int) -> int:
    """Return k, where every k-th of so many samples makes at most MOST_POINTS."""
    return max(1, -(-samples // MOST_POINTS))


def panels(
    names: Sequence[str], ranges: Sequence[float | None], style: FigureStyle
) -> tuple[Spec, list[Spec], int]:
    """Return axes of panels, line by line, their titles, and the height of all in px.

    `ranges` holds half the extent of each vertical axis about zero; None leaves it to the data.
    """
    columns = 1 if style.narrow else 3
    row_px, gap_px = _NARROW_ROW_PX if style.narrow else _ROW_PX, style.px(_GAP_PX)
    lines = -(-len(names) // columns)
    whole = row_px * lines + gap_px * (lines - 1)
    axes: Spec = {}
    titles = []
    for number, (name, half) in enumerate(zip(names, ranges, strict=True)):
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
        )
        fixed: Spec = {} if half is None else {"range": numbers([-half, half], 5)}
        axes[f"yaxis{suffix}"] = axis(
            domain=[max(top - row_px / whole, 0.0), top],
            anchor=f"x{suffix}",
            nticks=5,
            **fixed,
        )
    return axes, titles, whole
