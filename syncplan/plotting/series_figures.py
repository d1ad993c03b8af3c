"""Figures of runs over time: errors, estimates and further states, a panel for each.

Axes of errors hold all of the run's second half, the settled one. A start with larger errors leaves
them, by how much the note says; whoever zooms out on a page sees it. Errors are drawn as in the
paper's Figs. 9-11 and 14-18.
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers, panel_title
from syncplan.plotting.figure_style import INK, SKY, VERMILLION, FigureStyle, translucent
from syncplan.reports.replay_report import EstimatedPath, ReplayDocument
from syncplan.reports.run_figures import Series, StateErrorSeries, VehicleSeries
from syncplan.reports.validation_report import ValidationDocument

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


MOST_VEHICLES = 8
"""Vehicles drawn where none are named: of larger teams, those with the largest errors."""

_ERRORS = ("x in m", "y in m", "heading in rad")
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
            _error_panel(report, row, column, times, every, number)
            for number, (row, column) in enumerate(places)
        )
    )
    ranges = [_settled(row, column) for row, column in places]
    named = [f"{row.name}: {_ERRORS[column]}" for row, column in places]
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
    mean, sigma, rms = _error_curves(row, column)
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


def _error_curves(row: VehicleSeries, column: int) -> tuple[Array, Array, Array]:
    """(mean, sigma, RMS) over time of one coordinate."""
    mean = (row.mean_x_m, row.mean_y_m, row.mean_heading_rad)[column]
    sigma = (row.sigma_x_m, row.sigma_y_m, row.sigma_heading_rad)[column]
    rms = (row.rms_x_m, row.rms_y_m, row.rms_heading_rad)[column]
    return np.array(mean), np.array(sigma), np.array(rms)


def _error_panel(
    report: ValidationDocument | ReplayDocument,
    row: VehicleSeries,
    column: int,
    times: Array,
    every: int,
    number: int,
) -> list[Spec]:
    """Band, mean and spread of one vehicle's coordinate."""
    mean, sigma, rms = (curve[::every] for curve in _error_curves(row, column))
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


MOST_ROBOTS = 8
"""Robots drawn: of larger teams, those that the filter knows least."""

_ESTIMATES = ("x in m", "y in m", "own position sigma in m")


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
    rows = _least_known_robots(kept.robots)
    every = every_so_many(len(kept.time_s))
    times = np.array(kept.time_s)[::every]
    places = [(row, column) for row in rows for column in range(len(_ESTIMATES))]
    traces = chain.from_iterable(
        _estimate_panel(row, column, times, every, number)
        for number, (row, column) in enumerate(places)
    )
    named = [f"{row.name}: {_ESTIMATES[column]}" for row, column in places]
    axes, titles, inner = panels(named, [None] * len(named), style)
    note = f"{report.run} without truth, and the filter's own 3-sigma band"
    if len(rows) < len(kept.robots):
        note += f"; the {len(rows)} of {len(kept.robots)} robots that the filter knows least"
    title = f"{escaped(report.name)}: estimates over time"
    drawn = layout(title, note=note, inner=inner, above=24, annotations=titles, **axes)
    return {"data": list(traces), "layout": drawn}


def _least_known_robots(robots: list[EstimatedPath]) -> list[EstimatedPath]:
    """At most MOST_ROBOTS, in the order given."""
    kept = sorted(robots, key=lambda one: -float(np.mean(one.sigma_m)))[:MOST_ROBOTS]
    names = {one.name for one in kept}
    return [one for one in robots if one.name in names]


def _estimate_panel(
    row: EstimatedPath, column: int, times: Array, every: int, number: int
) -> list[Spec]:
    """Band and line of one coordinate, or the line of the sigma."""
    suffix = str(number + 1) if number else ""
    at, key = numbers(times, 6), f"{row.name}-{column}"
    shared: Spec = {
        "type": "scatter",
        "mode": "lines",
        "xaxis": f"x{suffix}",
        "yaxis": f"y{suffix}",
    }
    of_sigma = column == len(_ESTIMATES) - 1
    values = np.array((row.x_m, row.y_m, row.sigma_m)[column])[::every]
    name = "filter's own sigma" if of_sigma else "estimate"
    line = {
        **shared,
        "uid": f"line-{key}",
        "name": name,
        "legendgroup": name,
        "showlegend": number in (0, len(_ESTIMATES) - 1),
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


MOST_STATES = 24
"""States drawn: where there are more, the least known of each kind."""

_DIGITS = 4


def states_spec(report: ValidationDocument | ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of further states over time: a panel for each, in its own unit.

    The thin line is the RMS error over the trials (of a single trial: the size of its error), the
    broad one the filter's own sigma, the dotted one the bound. Raises InputError for a report
    without such a series.
    """
    if report.series is None or report.series.errors is None:
        raise InputError(
            "the report has no errors of further states over time; --series keeps them",
            key="series",
        )
    held = report.series.errors
    drawn = _least_known_states(held)
    every = every_so_many(len(report.series.time_s))
    at = numbers(report.series.time_s[::every], 6)
    single = report.trials == 1
    traces = chain.from_iterable(
        _state_panel(state, at, every, number, single) for number, state in enumerate(drawn)
    )
    axes, titles, inner = panels([_title(one) for one in drawn], [None] * len(drawn), style)
    for name in axes:
        if name.startswith("yaxis"):
            axes[name]["rangemode"] = "tozero"
    found = "size of the error" if single else "RMS error"
    note = f"{found} of {report.run}, the filter's own sigma and the predicted error"
    if len(drawn) < len(held):
        note += f"; {len(drawn)} of {len(held)} states, the least known of each kind"
    title = f"{escaped(report.name or 'Plan')}: further states over time"
    shown = layout(title, note=note, inner=inner, above=24, annotations=titles, **axes)
    return {"data": list(traces), "layout": shown}


def _least_known_states(states: Sequence[StateErrorSeries]) -> list[StateErrorSeries]:
    """At most MOST_STATES, as many of each kind as there is room for, in the order given."""
    if len(states) <= MOST_STATES:
        return list(states)
    kinds: dict[str, list[int]] = defaultdict(list)
    for k, one in enumerate(states):
        kinds[one.state.split(" of ")[0]].append(k)
    places = {
        k: place
        for of_kind in kinds.values()
        for place, k in enumerate(sorted(of_kind, key=lambda k: -_left(states[k])))
    }
    kept = sorted(places, key=lambda k: (places[k], k))[:MOST_STATES]
    return [states[k] for k in sorted(kept)]


def _left(state: StateErrorSeries) -> float:
    """How much of the error is left in the second half, as a share of the sigma at the start."""
    late = np.array(state.rms[len(state.rms) // 2 :])
    return float(np.sqrt(np.mean(late**2))) / (state.sigma[0] or 1.0)


def _title(state: StateErrorSeries) -> str:
    return state.state if state.unit == "1" else f"{state.state}, {state.unit}"


def _state_panel(
    state: StateErrorSeries, at: list[float | None], every: int, number: int, single: bool
) -> list[Spec]:
    """The curves of one state."""
    curves: list[tuple[str, str, Sequence[float] | None, Spec]] = [
        ("sigma", "filter's own sigma", state.sigma, {"color": SKY, "width": 4}),
        (
            "predicted",
            "predicted error",
            state.predicted,
            {"color": VERMILLION, "width": 2, "dash": "dot"},
        ),
        (
            "rms",
            "size of the error" if single else "RMS error over the trials",
            state.rms,
            {"color": INK, "width": 1.3},
        ),
    ]
    suffix = str(number + 1) if number else ""
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "uid": f"{key}-{state.state}",
            "name": name,
            "legendgroup": key,
            "showlegend": number == 0,
            "xaxis": f"x{suffix}",
            "yaxis": f"y{suffix}",
            "x": at,
            "y": numbers(_significant(np.array(values)[::every])),
            "line": line,
            "hovertemplate": f"{escaped(state.state)} at %{{x}} s: %{{y}}<extra>{name}</extra>",
        }
        for key, name, values, line in curves
        if values is not None
    ]


def _significant(values: Array) -> Array:
    """Values to _DIGITS digits of the largest: units differ by orders of magnitude."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < largest < np.inf:
        return values
    return np.round(values, _DIGITS - int(np.floor(np.log10(largest))))
