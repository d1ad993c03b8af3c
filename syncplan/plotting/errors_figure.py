"""Errors over time with the filter's own 3-sigma band, as the paper's Figs. 9-11 and 14-18.

Axes hold all of the run's second half, the settled one. A start with larger errors leaves them, by
how much the note says; whoever zooms out on a page sees it.
"""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, escaped, layout, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.palette import INK, SKY, VERMILLION, translucent
from syncplan.plotting.panels_over_time import every_so_many, panels
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.reports.run_schemas import Series, ValidationDocument, VehicleSeries

MOST_VEHICLES = 8
"""Vehicles drawn where none are named: of larger teams, those with the largest errors."""

_COLUMNS = ("x in m", "y in m", "heading in rad")
_WORTH_CLIPPING = 1.5
"""How many times larger than the settled half a start must be to be clipped."""

_AIR = 1.1


def errors_spec(
    report: ValidationDocument | ReplayDocument,
    style: FigureStyle,
    vehicles: Sequence[str] | None = None,
) -> Spec:
    """Return the figure of errors over time: a row per vehicle; x, y and heading.

    The line is the mean error over the trials (of a single trial: its error), the band three of
    the filter's own sigmas, the dotted lines three times the errors' RMS: where these leave the
    band, the filter claims more than it knows. Raises InputError for a report without series, or
    a vehicle that it does not hold.
    """
    series = _series_of(report)
    rows = _chosen(report, series, vehicles)
    every = every_so_many(len(series.time_s))
    times = np.array(series.time_s)[::every]
    places = [(row, column) for row in rows for column in range(3)]
    traces = list(
        chain.from_iterable(
            _panel(report, row, column, times, every, number)
            for number, (row, column) in enumerate(places)
        )
    )
    ranges = [_settled(row, column) for row, column in places]
    named = [f"{row.name}: {_COLUMNS[column]}" for row, column in places]
    axes, titles, inner = panels(named, ranges, style)
    shown = "error" if report.trials == 1 else "mean error"
    note = f"{shown} of {report.run}, and the filter's own 3-sigma band"
    if len(rows) < len(report.vehicles) and vehicles is None:
        note += f"; the {len(rows)} of {len(report.vehicles)} vehicles with the largest errors"
    note += _clipped(series, places, ranges)
    title = f"{escaped(report.name or 'Plan')}: errors over time"
    drawn = layout(title, note=note, inner=inner, above=24, annotations=titles, **axes)
    return {"data": traces, "layout": drawn}


def _settled(row: VehicleSeries, column: int) -> float | None:
    """Half the range of an axis that holds the second half; None if the start is hardly larger."""
    whole = _reach(row, column)
    half = _AIR * float(np.max(whole[len(whole) // 2 :]))
    return half if 0.0 < _WORTH_CLIPPING * half < float(np.max(whole)) else None


def _reach(row: VehicleSeries, column: int) -> Array:
    """The largest of what is drawn of a coordinate, at each moment."""
    mean, sigma, rms = _curves(row, column)
    return np.asarray(np.maximum.reduce([np.abs(mean), 3.0 * sigma, 3.0 * rms]))


def _clipped(
    series: Series, places: list[tuple[VehicleSeries, int]], ranges: list[float | None]
) -> str:
    """What a note says of starts that leave their axes."""
    starts = [
        (column, float(np.max(_reach(row, column))))
        for (row, column), half in zip(places, ranges, strict=True)
        if half is not None
    ]
    if not starts:
        return ""
    said = []
    for unit, of in (("m", (0, 1)), ("rad", (2,))):
        largest = max((top for column, top in starts if column in of), default=None)
        if largest is not None:
            said.append(f"{largest:.2g} {unit}")
    settled = series.time_s[len(series.time_s) // 2]
    return f"; axes fit the run from {settled:.4g} s, clipped starts reach {' and '.join(said)}"


def _series_of(report: ValidationDocument | ReplayDocument) -> Series:
    if not report.has_errors:
        problem = "the recording has no truth, so errors are not known"
        raise InputError(problem, key="series")
    if report.series is None:
        raise InputError(
            "the report has no errors over time; --series keeps them",
            key="series",
        )
    return report.series


def _chosen(
    report: ValidationDocument | ReplayDocument, series: Series, vehicles: Sequence[str] | None
) -> list[VehicleSeries]:
    known = {row.name: row for row in series.vehicles}
    if vehicles is not None:
        for name in vehicles:
            if name not in known:
                problem = f"{name!r} is not in the report; it has {', '.join(list(known)[:6])}"
                raise InputError(problem, key="vehicles")
        return [known[name] for name in vehicles]
    errors = {one.name: one.rms_m or 0.0 for one in report.vehicles}
    kept = sorted(errors, key=lambda name: -errors[name])[:MOST_VEHICLES]
    return [row for row in series.vehicles if row.name in kept]


def _curves(row: VehicleSeries, column: int) -> tuple[Array, Array, Array]:
    """(mean, sigma, RMS) over time of one coordinate."""
    mean = (row.mean_x_m, row.mean_y_m, row.mean_heading_rad)[column]
    sigma = (row.sigma_x_m, row.sigma_y_m, row.sigma_heading_rad)[column]
    rms = (row.rms_x_m, row.rms_y_m, row.rms_heading_rad)[column]
    return np.array(mean), np.array(sigma), np.array(rms)


def _panel(
    report: ValidationDocument | ReplayDocument,
    row: VehicleSeries,
    column: int,
    times: Array,
    every: int,
    number: int,
) -> list[Spec]:
    """Band, mean and spread of one vehicle's coordinate."""
    mean, sigma, rms = (curve[::every] for curve in _curves(row, column))
    suffix = str(number + 1) if number else ""
    shared = {
        "type": "scatter",
        "mode": "lines",
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
        "showlegend": number == 0,
    }
    key, at, single = f"{row.name}-{column}", numbers(times, 6), report.trials == 1
    band = {**shared, "uid": f"band-{key}", **_band(at + numbers(times[::-1], 6), sigma)}
    line = {
        **shared,
        "uid": f"mean-{key}",
        "name": "error" if single else "mean error over the trials",
        "legendgroup": "mean",
        "x": at,
        "y": numbers(mean, 5),
        "line": {"color": INK, "width": 1.3},
        "hovertemplate": f"{escaped(row.name)} at %{{x}} s: %{{y}}<extra></extra>",
    }
    if single:
        return [band, line]
    return [band, {**shared, "uid": f"spread-{key}", **_spread(at, rms)}, line]


def _band(there_and_back: list[float | None], sigma: Array) -> Spec:
    return {
        "name": "filter's own 3 sigma",
        "legendgroup": "band",
        "x": there_and_back,
        "y": numbers(np.concatenate([3.0 * sigma, -3.0 * sigma[::-1]]), 5),
        "fill": "toself",
        "fillcolor": translucent(SKY, 0.35),
        "line": {"color": SKY, "width": 0.5},
        "hoverinfo": "skip",
    }


def _spread(at: list[float | None], rms: Array) -> Spec:
    return {
        "name": "3 times the RMS error over the trials",
        "legendgroup": "spread",
        "x": [*at, None, *at],
        "y": [*numbers(3.0 * rms, 5), None, *numbers(-3.0 * rms, 5)],
        "line": {"color": VERMILLION, "width": 1.4, "dash": "dot"},
        "hoverinfo": "skip",
    }
