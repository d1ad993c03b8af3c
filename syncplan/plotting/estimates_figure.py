"""Estimates over time of robots of which nobody knows where they truly were."""

from itertools import chain

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, escaped, layout, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.palette import INK, SKY, translucent
from syncplan.plotting.panels_over_time import every_so_many, panels
from syncplan.reports.replay_schemas import EstimatedPath, ReplayDocument

MOST_ROBOTS = 8
"""Robots drawn: of larger teams, those that the filter knows least."""

_COLUMNS = ("x in m", "y in m", "own position sigma in m")


def estimates_spec(report: ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of estimates over time: a row per robot; x, y and position sigma.

    The line is the estimate, the band three of the filter's own sigmas about it. Raises InputError
    for a report without estimates.
    """
    kept = report.estimates
    if kept is None:
        raise InputError(
            "the report has no estimates over time; --series keeps those of a recording without "
            "truth",
            key="series",
        )
    rows = _least_known(kept.robots)
    every = every_so_many(len(kept.time_s))
    times = np.array(kept.time_s)[::every]
    places = [(row, column) for row in rows for column in range(len(_COLUMNS))]
    traces = chain.from_iterable(
        _panel(row, column, times, every, number) for number, (row, column) in enumerate(places)
    )
    named = [f"{row.name}: {_COLUMNS[column]}" for row, column in places]
    axes, titles, inner = panels(named, [None] * len(named), style)
    note = f"{report.run} without truth, and the filter's own 3-sigma band"
    if len(rows) < len(kept.robots):
        note += f"; the {len(rows)} of {len(kept.robots)} robots that the filter knows least"
    title = f"{escaped(report.name)}: estimates over time"
    drawn = layout(title, note=note, inner=inner, above=24, annotations=titles, **axes)
    return {"data": list(traces), "layout": drawn}


def _least_known(robots: list[EstimatedPath]) -> list[EstimatedPath]:
    """At most MOST_ROBOTS, in the order given."""
    kept = sorted(robots, key=lambda one: -float(np.mean(one.sigma_m)))[:MOST_ROBOTS]
    names = {one.name for one in kept}
    return [one for one in robots if one.name in names]


def _panel(row: EstimatedPath, column: int, times: Array, every: int, number: int) -> list[Spec]:
    """Band and line of one coordinate, or the line of the sigma."""
    suffix = str(number + 1) if number else ""
    at, key = numbers(times, 6), f"{row.name}-{column}"
    shared: Spec = {
        "type": "scatter",
        "mode": "lines",
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
    }
    of_sigma = column == len(_COLUMNS) - 1
    values = np.array((row.x_m, row.y_m, row.sigma_m)[column])[::every]
    name = "filter's own sigma" if of_sigma else "estimate"
    line = {
        **shared,
        "uid": f"line-{key}",
        "name": name,
        "legendgroup": name,
        "showlegend": number in (0, len(_COLUMNS) - 1),
        "x": at,
        "y": numbers(values, 5),
        "line": {"color": SKY, "width": 2.5} if of_sigma else {"color": INK, "width": 1.3},
        "hovertemplate": f"{escaped(row.name)} at %{{x}} s: %{{y}}<extra></extra>",
    }
    if of_sigma:
        return [line]
    sigma = np.array((row.sigma_x_m, row.sigma_y_m)[column])[::every]
    band = {
        **shared,
        "uid": f"band-{key}",
        "name": "filter's own 3 sigma",
        "legendgroup": "band",
        "showlegend": number == 0,
        "x": at + numbers(times[::-1], 6),
        "y": numbers(np.concatenate([values + 3.0 * sigma, (values - 3.0 * sigma)[::-1]]), 5),
        "fill": "toself",
        "fillcolor": translucent(SKY, 0.35),
        "line": {"color": SKY, "width": 0.5},
        "hoverinfo": "skip",
    }
    return [band, line]
