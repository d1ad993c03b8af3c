"""Errors over time with the filter's own 3-sigma band, as the paper's Figs. 9-11 and 14-18."""

from collections.abc import Sequence
from itertools import chain

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers, panel_title
from syncplan.plotting.palette import INK, SKY, VERMILLION, translucent
from syncplan.reports.run_schemas import ReplayDocument, Series, ValidationDocument, VehicleSeries

__all__ = ["MOST_VEHICLES", "errors_spec"]

MOST_VEHICLES = 8
"""Vehicles drawn where none are named: of larger teams, those with the largest errors."""

MOST_POINTS = 400
"""Moments drawn of a run: every k-th sample."""

_ROW_PX = 150
_GAP_PX = 34
_COLUMNS = ("x in m", "y in m", "heading in rad")


def errors_spec(
    report: ValidationDocument | ReplayDocument, vehicles: Sequence[str] | None = None
) -> Spec:
    """Return the figure of errors over time: a row per vehicle; x, y and heading.

    The line is the mean error over the trials (of a single trial: its error), the band three of
    the filter's own sigmas, the dotted lines three times the errors' RMS: where these leave the
    band, the filter claims more than it knows. Raises InputError for a report without series, or
    a vehicle that it does not hold.
    """
    series = _series_of(report)
    rows = _chosen(report, series, vehicles)
    every = max(1, -(-len(series.time_s) // MOST_POINTS))
    times = np.array(series.time_s)[::every]
    traces = list(
        chain.from_iterable(
            _panel(report, row, column, times, every, number)
            for number, (row, column) in enumerate((r, c) for r in rows for c in range(3))
        )
    )
    whole = _ROW_PX * len(rows) + _GAP_PX * (len(rows) - 1)
    axes, titles = _axes(rows, whole)
    shown = "error" if report.trials == 1 else "mean error"
    note = f"{shown} of {report.run}, and the filter's own 3-sigma band"
    if len(rows) < len(report.vehicles) and vehicles is None:
        note += f"; the {len(rows)} of {len(report.vehicles)} vehicles with the largest errors"
    title = f"{escaped(report.name or 'Plan')}: errors over time"
    drawn = layout(title, note=note, height=whole + 216, annotations=titles, **axes)
    drawn["margin"]["t"] += 26
    drawn["margin"]["b"] = 112
    return {"data": traces, "layout": drawn}


def _series_of(report: ValidationDocument | ReplayDocument) -> Series:
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
    errors = {one.name: one.rms_m for one in report.vehicles}
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


def _axes(rows: list[VehicleSeries], whole: int) -> tuple[Spec, list[Spec]]:
    """Three columns of panels, and a title over each row."""
    axes: Spec = {}
    titles = []
    for r, row in enumerate(rows):
        top = 1.0 - r * (_ROW_PX + _GAP_PX) / whole
        bottom = top - _ROW_PX / whole
        for c in range(3):
            number = 3 * r + c
            suffix = str(number + 1) if number else ""
            left = c * 0.35
            last = r == len(rows) - 1
            titles.append(panel_title(f"{escaped(row.name)}: {_COLUMNS[c]}", left, top))
            axes[f"xaxis{suffix}"] = axis(
                "time, s" if last else "",
                domain=[left, left + 0.30],
                anchor=f"y{suffix}",
                showticklabels=last,
                **({"matches": "x"} if number else {}),
            )
            axes[f"yaxis{suffix}"] = axis(
                domain=[max(bottom, 0.0), top], anchor=f"x{suffix}", nticks=5
            )
    return axes, titles
