"""Figures of runs over time: errors, estimates and further states, a panel for each.

Axes of errors fit the run's second half, when errors have settled. Larger errors at the start are
clipped: the note states how large they are, and zooming out on a page shows them. Errors are drawn
as in the paper's Figs. 9-11 and 14-18.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, escaped, numbers
from syncplan.plotting.figure_style import INK, SKY, VERMILLION, FigureStyle, translucent
from syncplan.plotting.panels import (
    Curve,
    curve_entries,
    curve_traces,
    every_so_many,
    multiples_spec,
    panel_line,
    panels_spec,
)
from syncplan.reports.replay_report import EstimatedPath, ReplayDocument
from syncplan.reports.run_figures import Series, StateErrorSeries, VehicleSeries
from syncplan.reports.validation_report import ValidationDocument

MOST_VEHICLES = 16
"""Largest number of vehicles drawn if none are named: those with the largest errors."""

FEW_VEHICLES = 3
"""Largest number of vehicles whose panels have an axis each; more are small multiples."""

MOST_ROBOTS = 8
"""Largest number of robots drawn: those with the largest position sigmas."""

MOST_STATES = 24
"""Largest number of states drawn: the least known of each kind."""

_UNITS = ((0, 1), (2,))
"""Columns in m, and in rad."""

_ERRORS = ("x in m", "y in m", "heading in rad")
_ESTIMATES = ("x in m", "y in m", "own position sigma in m")
_WORTH_CLIPPING = 1.5
"""Ratio to the settled half's range above which a start is clipped."""

_AIR = 1.1
_DIGITS = 4


def _band(number: int, key: str, times: Array, middle: Array, sigma: Array) -> Spec:
    """Band of three of the filter's own sigmas about a line."""
    known = np.flatnonzero(np.isfinite(sigma))
    # there and back around each part without a gap; then a gap
    parts = np.split(known, 1 + np.flatnonzero(np.diff(known) > 1))
    places = np.concatenate([np.concatenate([part, part[::-1], part[:1]]) for part in parts])[:-1]
    side = np.concatenate([np.repeat([3.0, -3.0, np.nan], [len(k), len(k), 1]) for k in parts])[:-1]
    x, y = times[places] + 0.0 * side, numbers(middle[places] + side * sigma[places], 5)
    line = {"color": SKY, "width": 0.5}
    name = "filter's own 3 sigma"
    band = panel_line(number, f"band-{key}", "band", name, x, y, line, "")
    return {**band, "fill": "toself", "fillcolor": translucent(SKY, 0.35)}


# --- errors -------------------------------------------------------------------------------------


def errors_spec(
    report: ValidationDocument | ReplayDocument,
    style: FigureStyle,
    vehicles: Sequence[str] | None = None,
) -> Spec:
    """Return the figure of errors over time: a row per vehicle; x, y and heading.

    More than FEW_VEHICLES are small multiples, of one scale for x and y and one for headings.

    The line is the mean error over the trials (for a single trial, its error), the band is three
    of the filter's own sigmas, and the dotted lines are three times the RMS error. Where these
    leave the band, the filter is optimistic. Raises InputError for a report without series, or a
    vehicle that is not in the report.
    """
    series = _series_of(report)
    rows = _chosen(report, series, vehicles)
    times = np.array(series.time_s)
    single = report.trials == 1
    places = [(row, column) for row in rows for column in range(3)]
    many = len(rows) > FEW_VEHICLES
    traces = [
        trace
        for number, (row, column) in enumerate(places)
        for trace in _error_panel(row, column, times, number, single, 2 if many else 1)
    ]
    # panels with one axis: each its own, or all of a unit
    groups = [[k] for k in range(len(places))]
    if many:
        groups = [[k for k, (_, column) in enumerate(places) if column in of] for of in _UNITS]
    reaches = [np.maximum.reduce([_reach(*places[k]) for k in group]) for group in groups]
    settled = [_settled(whole) for whole in reaches]
    shown = "error" if single else "mean error"
    note = f"{shown} of {report.run}, and the filter's own 3-sigma band"
    if len(rows) < len(report.vehicles) and vehicles is None:
        note += f"; the {len(rows)} of {len(report.vehicles)} vehicles with the largest errors"
    note += _clipped(series, places, groups, settled)
    title = f"{escaped(report.name or 'Plan')}: errors over time"
    if many:
        metres, rad = (
            _AIR * float(np.nanmax(whole)) if half is None else half
            for whole, half in zip(reaches, settled, strict=True)
        )
        names = [row.name for row in rows]
        return multiples_spec(title, note, names, _ERRORS, traces, style, [metres, metres, rad])
    ranges = [{} if half is None else {"range": numbers([-half, half], 5)} for half in settled]
    names = [f"{row.name}: {_ERRORS[column]}" for row, column in places]
    return panels_spec(title, note, names, traces, style, ranges)


def _settled(whole: Array) -> float | None:
    """Half the range of an axis that fits the second half; None if the start is hardly larger."""
    # a gap may be as long as the second half
    half = _AIR * float(np.nanmax(whole[len(whole) // 2 :], initial=0.0))
    return half if 0.0 < _WORTH_CLIPPING * half < float(np.nanmax(whole)) else None


def _reach(row: VehicleSeries, column: int) -> Array:
    """Largest magnitude drawn of a coordinate at each sample."""
    mean, sigma, rms = _error_curves(row, column)
    return np.asarray(np.maximum.reduce([np.abs(mean), 3.0 * sigma, 3.0 * rms]))


def _clipped(
    series: Series,
    places: list[tuple[VehicleSeries, int]],
    groups: list[list[int]],
    settled: list[float | None],
) -> str:
    """Note on starts that leave their axes."""
    starts = [
        (column, float(np.nanmax(_reach(row, column))))
        for group, half in zip(groups, settled, strict=True)
        if half is not None
        for row, column in (places[k] for k in group)
    ]
    if not starts:
        return ""
    said = []
    for unit, of in zip(("m", "rad"), _UNITS, strict=True):
        largest = max((top for column, top in starts if column in of), default=None)
        if largest is not None:
            said.append(f"{largest:.2g} {unit}")
    begin = series.time_s[len(series.time_s) // 2]
    return f"; axes fit the run from {begin:.4g} s, clipped starts reach {' and '.join(said)}"


def _series_of(report: ValidationDocument | ReplayDocument) -> Series:
    if not report.has_errors:
        problem = "the recording has no truth, so errors are not known"
        raise InputError(problem, key="series")
    if report.series is None:
        problem = "the report has no errors over time; --series keeps them"
        raise InputError(problem, key="series")
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


def _error_curves(row: VehicleSeries, column: int) -> tuple[Array, Array, Array]:
    """Mean, sigma and RMS of one coordinate over time."""
    mean = (row.mean_x_m, row.mean_y_m, row.mean_heading_rad)[column]
    sigma = (row.sigma_x_m, row.sigma_y_m, row.sigma_heading_rad)[column]
    rms = (row.rms_x_m, row.rms_y_m, row.rms_heading_rad)[column]
    # null where errors are not known
    return np.array(mean, dtype=float), np.array(sigma, dtype=float), np.array(rms, dtype=float)


def _error_panel(
    row: VehicleSeries, column: int, times: Array, number: int, single: bool, fewer: int
) -> list[Spec]:
    """Band, spread and mean of one vehicle's coordinate, with so many times fewer points."""
    every = every_so_many(fewer * len(times))
    at = times[::every]
    mean, sigma, rms = (curve[::every] for curve in _error_curves(row, column))
    key = f"{row.name}-{column}"
    name = "error" if single else "mean error over the trials"
    hover = f"{escaped(row.name)} at %{{x}} s: %{{y}}<extra></extra>"
    line: Spec = {"color": INK, "width": 1.3}
    drawn = [
        _band(number, key, at, np.zeros(len(at)), sigma),
        panel_line(number, f"mean-{key}", "mean", name, at, numbers(mean, 5), line, hover),
    ]
    if not single:
        # above and below, with a gap between
        x, y = np.append(at, [np.nan, *at]), 3.0 * np.concatenate([rms, [np.nan], -rms])
        name = "3 times the RMS error over the trials"
        line = {"color": VERMILLION, "width": 1.4, "dash": "dot"}
        spread = panel_line(number, f"spread-{key}", "spread", name, x, numbers(y, 5), line, "")
        drawn.insert(1, spread)
    return drawn


# --- estimates ----------------------------------------------------------------------------------


def estimates_spec(report: ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of estimates over time: a row per robot; x, y and position sigma.

    The line is the estimate, the band is three of the filter's own sigmas about it. Raises
    InputError for a report without estimates.
    """
    kept = report.estimates
    if kept is None:
        raise InputError(
            "the report has no estimates over time; --series keeps those of a recording without "
            "truth",
            key="series",
        )
    rows = _least_known_robots(kept.robots)
    places = [(row, column) for row in rows for column in range(len(_ESTIMATES))]
    traces = [
        trace
        for number, (row, column) in enumerate(places)
        for trace in _estimate_panel(row, column, np.array(kept.time_s), number)
    ]
    note = f"{report.run} without truth, and the filter's own 3-sigma band"
    if len(rows) < len(kept.robots):
        note += f"; the {len(rows)} of {len(kept.robots)} robots that the filter knows least"
    title = f"{escaped(report.name)}: estimates over time"
    names = [f"{row.name}: {_ESTIMATES[column]}" for row, column in places]
    return panels_spec(title, note, names, traces, style, [{}] * len(names))


def _least_known_robots(robots: list[EstimatedPath]) -> list[EstimatedPath]:
    """At most MOST_ROBOTS robots, those with the largest position sigmas, in the order given."""
    kept = sorted(robots, key=lambda one: -float(np.mean(one.sigma_m)))[:MOST_ROBOTS]
    names = {one.name for one in kept}
    return [one for one in robots if one.name in names]


def _estimate_panel(row: EstimatedPath, column: int, times: Array, number: int) -> list[Spec]:
    """Band and line of one coordinate, or the line of the sigma."""
    every = every_so_many(len(times))
    at, key = times[::every], f"{row.name}-{column}"
    values = np.array((row.x_m, row.y_m, row.sigma_m)[column])[::every]
    hover = f"{escaped(row.name)} at %{{x}} s: %{{y}}<extra></extra>"
    of_sigma = column == len(_ESTIMATES) - 1
    name = "filter's own sigma" if of_sigma else "estimate"
    line: Spec = {"color": SKY, "width": 2.5} if of_sigma else {"color": INK, "width": 1.3}
    drawn = panel_line(number, f"line-{key}", name, name, at, numbers(values, 5), line, hover)
    if of_sigma:
        return [{**drawn, "showlegend": number == column}]
    sigma = np.array((row.sigma_x_m, row.sigma_y_m)[column])[::every]
    return [_band(number, key, at, values, sigma), drawn]


# --- further states -----------------------------------------------------------------------------


def states_spec(report: ValidationDocument | ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of further states over time: a panel for each, in its own unit.

    The thin line is the RMS error over the trials (for a single trial, the size of its error), the
    broad line is the filter's own sigma, and the dotted line is the bound; marks keep them apart
    where they coincide. Raises InputError for a
    report without such a series.
    """
    if report.series is None or report.series.errors is None:
        problem = "the report has no errors of further states over time; --series keeps them"
        raise InputError(problem, key="series")
    held = report.series.errors
    drawn = _least_known_states(held)
    single = report.trials == 1
    curves = [_state_curves(state, single) for state in drawn]
    traces = [
        trace
        for number, (state, of_one) in enumerate(zip(drawn, curves, strict=True))
        for trace in curve_traces(
            of_one,
            state.state,
            number,
            report.series.time_s,
            lambda values: numbers(_significant(np.array(values, dtype=float))),
            f"{escaped(state.state)} at %{{x}} s: %{{y}}",
        )
    ]
    traces += curve_entries([curve for of_one in curves for curve in of_one])
    found = "size of the error" if single else "RMS error"
    note = f"{found} of {report.run}, the filter's own sigma and the predicted error"
    if len(drawn) < len(held):
        note += f"; {len(drawn)} of {len(held)} states, the least known of each kind"
    title = f"{escaped(report.name or 'Plan')}: further states over time"
    names = [one.state if one.unit == "1" else f"{one.state}, {one.unit}" for one in drawn]
    up: Spec = {"rangemode": "tozero"}
    times = report.series.time_s
    return panels_spec(title, note, names, traces, style, [up] * len(names), times=times)


def _least_known_states(states: Sequence[StateErrorSeries]) -> list[StateErrorSeries]:
    """At most MOST_STATES states, the least known of each kind, in the order given."""
    if len(states) <= MOST_STATES:
        return list(states)
    kinds: dict[str, list[int]] = defaultdict(list)
    for k, one in enumerate(states):
        kinds[one.state.split(" of ")[0]].append(k)
    places = {
        k: place
        for of_kind in kinds.values()
        for place, k in enumerate(sorted(of_kind, key=lambda k: -_remaining(states[k])))
    }
    kept = sorted(places, key=lambda k: (places[k], k))[:MOST_STATES]
    return [states[k] for k in sorted(kept)]


def _remaining(state: StateErrorSeries) -> float:
    """RMS error in the second half, as a share of the sigma at the start."""
    late = np.array(state.rms[len(state.rms) // 2 :])
    return float(np.sqrt(np.mean(late**2))) / (state.sigma[0] or 1.0)


def _state_curves(state: StateErrorSeries, single: bool) -> list[Curve]:
    """The curves of one state."""
    found = "size of the error" if single else "RMS error over the trials"
    dotted: Spec = {"color": VERMILLION, "width": 2, "dash": "dot"}
    curves = [
        Curve("sigma", "filter's own sigma", {"color": SKY, "width": 4}, state.sigma, "square"),
        Curve("rms", found, {"color": INK, "width": 1.8}, state.rms, "circle"),
    ]
    if state.predicted is not None:
        curves.append(Curve("predicted", "predicted error", dotted, state.predicted, "diamond"))
    return curves


def _significant(values: Array) -> Array:
    """Round values to _DIGITS digits of the largest, as units differ by orders of magnitude."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < largest < np.inf:
        return values
    return np.round(values, _DIGITS - int(np.floor(np.log10(largest))))
