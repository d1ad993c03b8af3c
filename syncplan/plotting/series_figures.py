"""Figures of runs over time: errors, estimates and further states, a panel for each.

Axes of errors fit the run's second half, when errors have settled. Larger errors at the start are
clipped: the note states how large they are, and zooming out on a page shows them. Errors are drawn
as in the paper's Figs. 9-11 and 14-18.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, axis, escaped, layout, line_trace, numbers, panel_title
from syncplan.plotting.figure_style import INK, SKY, VERMILLION, FigureStyle, translucent
from syncplan.reports.replay_report import EstimatedPath, ReplayDocument
from syncplan.reports.run_figures import Series, StateErrorSeries, VehicleSeries
from syncplan.reports.validation_report import ValidationDocument

MOST_POINTS = 400
"""Largest number of samples drawn; longer runs show every k-th."""

MOST_VEHICLES = 8
"""Largest number of vehicles drawn if none are named: those with the largest errors."""

MOST_ROBOTS = 8
"""Largest number of robots drawn: those with the largest position sigmas."""

MOST_STATES = 24
"""Largest number of states drawn: the least known of each kind."""

_ROW_PX = 150
_NARROW_ROW_PX = 110
_GAP_PX = 38

_ERRORS = ("x in m", "y in m", "heading in rad")
_ESTIMATES = ("x in m", "y in m", "own position sigma in m")
_WORTH_CLIPPING = 1.5
"""Ratio to the settled half's range above which a start is clipped."""

_MARKS = 4
_MARK_PX = 7
"""Marks on a curve, and their size."""

_AIR = 1.1
_DIGITS = 4


# --- panels -------------------------------------------------------------------------------------


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


def _band(number: int, key: str, times: Array, middle: Array, sigma: Array) -> Spec:
    """Band of three of the filter's own sigmas about a line."""
    y = numbers(np.concatenate([middle + 3.0 * sigma, (middle - 3.0 * sigma)[::-1]]), 5)
    there_and_back = np.concatenate([times, times[::-1]])
    line = {"color": SKY, "width": 0.5}
    name = "filter's own 3 sigma"
    band = panel_line(number, f"band-{key}", "band", name, there_and_back, y, line, "")
    return {**band, "fill": "toself", "fillcolor": translucent(SKY, 0.35)}


# --- errors -------------------------------------------------------------------------------------


def errors_spec(
    report: ValidationDocument | ReplayDocument,
    style: FigureStyle,
    vehicles: Sequence[str] | None = None,
) -> Spec:
    """Return the figure of errors over time: a row per vehicle; x, y and heading.

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
    traces = [
        trace
        for number, (row, column) in enumerate(places)
        for trace in _error_panel(row, column, times, number, single)
    ]
    settled = [_settled(row, column) for row, column in places]
    ranges = [{} if half is None else {"range": numbers([-half, half], 5)} for half in settled]
    shown = "error" if single else "mean error"
    note = f"{shown} of {report.run}, and the filter's own 3-sigma band"
    if len(rows) < len(report.vehicles) and vehicles is None:
        note += f"; the {len(rows)} of {len(report.vehicles)} vehicles with the largest errors"
    note += _clipped(series, places, settled)
    title = f"{escaped(report.name or 'Plan')}: errors over time"
    names = [f"{row.name}: {_ERRORS[column]}" for row, column in places]
    return panels_spec(title, note, names, traces, style, ranges)


def _settled(row: VehicleSeries, column: int) -> float | None:
    """Half the range of an axis that fits the second half; None if the start is hardly larger."""
    whole = _reach(row, column)
    half = _AIR * float(np.max(whole[len(whole) // 2 :]))
    return half if 0.0 < _WORTH_CLIPPING * half < float(np.max(whole)) else None


def _reach(row: VehicleSeries, column: int) -> Array:
    """Largest magnitude drawn of a coordinate at each sample."""
    mean, sigma, rms = _error_curves(row, column)
    return np.asarray(np.maximum.reduce([np.abs(mean), 3.0 * sigma, 3.0 * rms]))


def _clipped(
    series: Series, places: list[tuple[VehicleSeries, int]], ranges: list[float | None]
) -> str:
    """Note on starts that leave their axes."""
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
    return np.array(mean), np.array(sigma), np.array(rms)


def _error_panel(
    row: VehicleSeries, column: int, times: Array, number: int, single: bool
) -> list[Spec]:
    """Band, spread and mean of one vehicle's coordinate."""
    every = every_so_many(len(times))
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
