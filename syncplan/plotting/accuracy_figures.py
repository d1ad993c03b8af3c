"""Figures of errors by vehicle, and of the filter's consistency.

Errors are predicted, found, or the filter's own sigmas. ANEES and NIS are shown with their
intervals, beside the share of errors within 3 sigma.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.consistency import TOLERANCE
from syncplan.planning.plans import Plan
from syncplan.plotting import figure_style
from syncplan.plotting.canvas import (
    Spec,
    axis,
    bar_marker,
    escaped,
    layout,
    line_trace,
    mark_trace,
    message,
    numbers,
    panel_title,
)
from syncplan.reports.replay_report import ReplayDocument
from syncplan.reports.run_figures import Spread, interval_words, verdict_words
from syncplan.reports.validation_report import ValidationDocument

_LEAST_BAR_PX = 5.0
"""Width below which marks replace bars, whose patterns could not be distinguished."""

_MARKS = {"predicted": "line-ew-open", "late": "circle", "whole": "circle-open"}
_MARK_PX = 6
_HOVER = "%{x}: %{y:.3g} m<extra></extra>"


def prediction_spec(plan: Plan, style: figure_style.FigureStyle) -> Spec:
    """Return the figure of the predicted RMS position error of each vehicle."""
    found = plan.prediction
    title = f"{escaped(plan.scenario.name or 'Plan')}: predicted error"
    names = [escaped(name) for name in plan.scenario.vehicle_names]
    traces = []
    if found.rms is not None:
        name = "posterior bound, second half of the run"
        traces.append(bars("predicted", name, names, found.rms, figure_style.BLUE))
    if found.steady is not None and np.isfinite(found.steady).any():
        traces.append(_marks("steady", "bound once periodic", names, found.steady, "diamond"))
    if np.isfinite(found.window).any():
        name = "bound from one window, without motion noise"
        traces.append(_marks("window", name, names, found.window, "line-ew-open"))
    if not traces:
        return message(title, found.note or "no vehicle's position is determined by one window")
    note = "RMS position error that no unbiased filter can be below"
    if found.rms is not None:
        overall = float(np.sqrt(np.mean(found.rms**2)))
        run = f"{plan.scenario.duration_s:g} s from the initial sigmas"
        note = f"posterior Cramer-Rao bound over {run}; {overall:.3g} m over all vehicles"
    undetermined = int(np.sum(~np.isfinite(found.window)))
    if undetermined:
        note += f"; one window leaves {undetermined} of {len(names)} positions undetermined"
    return _drawn(title, note, traces, len(names), style)


def accuracy_spec(
    report: ValidationDocument | ReplayDocument, style: figure_style.FigureStyle
) -> Spec:
    """Return the figure of RMS position errors of a run, beside the predicted ones if known."""
    if isinstance(report, ReplayDocument):
        return _replayed(report, style)
    return _validated(report, style)


def sigmas_spec(report: ReplayDocument, style: figure_style.FigureStyle) -> Spec:
    """Return the figure of the filter's own position sigmas on a recording without truth."""
    names = [escaped(robot.name) for robot in report.robots]
    last = [robot.final_sigma_m for robot in report.robots]
    whole = [robot.rms_sigma_m for robot in report.robots]
    traces = [
        bars("late", "at the end", names, last, figure_style.ORANGE),
        bars("whole", "RMS over the run", names, whole, figure_style.SKY, "/"),
    ]
    title = f"{escaped(report.name)}: the filter's own sigmas"
    note = f"{report.run} without truth: errors are not known"
    return _drawn(title, note, traces, len(names), style, shown="own position sigma, m")


def _validated(report: ValidationDocument, style: figure_style.FigureStyle) -> Spec:
    """RMS position errors over the trials beside the predicted ones."""
    names = [escaped(vehicle.name) for vehicle in report.vehicles]
    found = report.vehicles
    traces = _found_traces("Monte Carlo", report)
    intervals = [vehicle.rms_second_half_interval_m for vehicle in found]
    if all(interval is not None for interval in intervals):
        traces[0]["error_y"] = _error_bars(traces[0]["y"], np.array(intervals, dtype=float))
    predicted = [vehicle.predicted_rms_m for vehicle in found]
    if all(value is not None for value in predicted):
        name = "predicted: posterior bound, second half"
        traces.insert(0, bars("predicted", name, names, predicted, figure_style.BLUE, "x"))
    medians = [vehicle.median_rms_second_half_m for vehicle in found]
    if all(value is not None for value in medians):
        values = np.array(medians, dtype=float)
        traces.append(_marks("median", "median trial, second half", names, values, "diamond"))
    note = report.run
    ratio, interval = report.overall.rms_over_predicted, report.overall.rms_over_predicted_interval
    if ratio is not None:
        note += f"; second half over predicted: {ratio:.3g}"
    if interval is not None:
        note += f", 95 % interval {interval[0]:.3g} to {interval[1]:.3g}"
    if not report.observable:
        note += "; the plan is NOT observable"
    title = f"{escaped(report.name or 'Plan')}: error found and predicted"
    return _drawn(title, note, traces, len(names), style)


def _replayed(report: ReplayDocument, style: figure_style.FigureStyle) -> Spec:
    """RMS position errors of the robots of a recording."""
    title = f"{escaped(report.name)}: error found"
    note = f"{report.run}; {report.position_rmse_m:.3g} m over all robots"
    traces = _found_traces("filter", report)
    return _drawn(title, note, traces, len(report.robots), style)


def _found_traces(who: str, report: ValidationDocument | ReplayDocument) -> list[Spec]:
    names = [escaped(vehicle.name) for vehicle in report.vehicles]
    late = [vehicle.rms_second_half_m for vehicle in report.vehicles]
    whole = [vehicle.rms_m for vehicle in report.vehicles]
    return [
        bars("late", f"{who}, second half of the run", names, late, figure_style.ORANGE),
        bars("whole", f"{who}, whole run", names, whole, figure_style.SKY, "/"),
    ]


def bars(
    uid: str,
    name: str,
    vehicles: list[str],
    values: Sequence[float | None] | np.ndarray,
    color: str,
    pattern: str = "",
) -> Spec:
    """Return one bar per vehicle (names escaped), distinguished by pattern as well as colour."""
    y = numbers(np.array(values, dtype=float), 6)
    shown = {"type": "bar", "uid": uid, "name": name, "x": vehicles, "y": y}
    return {**shown, "marker": bar_marker(color, pattern), "hovertemplate": _HOVER}


def _error_bars(values: Sequence[float], intervals: Array) -> Spec:
    """Bars from values to the ends of their intervals (n, 2)."""
    low, high = np.abs(intervals.T - np.array(values, dtype=float))
    look = {"color": figure_style.INK, "thickness": 1.2}
    ends = {"array": numbers(high, 6), "arrayminus": numbers(low, 6)}
    return {"type": "data", "symmetric": False, **ends, **look}


def _marks(uid: str, name: str, vehicles: list[str], values: np.ndarray, symbol: str) -> Spec:
    size, color = (12, figure_style.GREEN) if symbol == "diamond" else (22, figure_style.INK)
    line = {"width": 2.5, "color": figure_style.INK}
    marker = {"symbol": symbol, "size": size, "color": color, "line": line}
    return mark_trace(uid, name, vehicles, numbers(values, 6), marker, _HOVER)


def _drawn(
    title: str,
    note: str,
    traces: list[Spec],
    count: int,
    style: figure_style.FigureStyle,
    shown: str = "RMS position error, m",
) -> Spec:
    """Figure of traces over `count` vehicles; marks replace bars that would be too thin."""
    bars_shown = sum(trace["type"] == "bar" for trace in traces)
    if style.plot_px < _LEAST_BAR_PX * count * (bars_shown + 0.5):
        traces = [_as_marks(trace) for trace in traces]
    # "category" keeps Plotly from reading names as numbers or dates
    drawn = layout(
        title,
        note=note,
        inner=330,
        barmode="group",
        xaxis=axis("vehicle", type="category"),
        yaxis=axis(shown, rangemode="tozero"),
    )
    return {"data": traces, "layout": drawn}


def _as_marks(trace: Spec) -> Spec:
    """Replace bars by marks at their ends."""
    if trace["type"] != "bar":
        return trace
    symbol, color = _MARKS[trace["uid"]], trace["marker"]["color"]
    marker = {"symbol": symbol, "size": _MARK_PX, "color": color, "line": {"width": 1.5}}
    if symbol == "line-ew-open":
        marker = {**marker, "line": {"width": 2, "color": color}}
    return {**trace, "type": "scatter", "mode": "markers", "marker": marker}


# --- consistency --------------------------------------------------------------------------------

IDEAL_COVERAGE = 0.9973
"""Probability that a normal error lies within three sigma."""

_TOLERATED = [1.0 - TOLERANCE, 1.0 + TOLERANCE]

_BAND_PX = 78
_WORDS_PX = 96
_COVERAGE_PX = 190
"""Heights of a panel with a band, of the words between panels and of the coverage panel."""

_SYMBOLS = {"consistent": "circle", "optimistic": "triangle-right", "conservative": "triangle-left"}
_COLOURS = {"consistent": figure_style.BLUE, "unknown": figure_style.MUTED}


def consistency_spec(
    report: ValidationDocument | ReplayDocument, style: figure_style.FigureStyle
) -> Spec:
    """Return the figure of ANEES and NIS with 95 % intervals, and of each vehicle's coverage.

    For a recording without truth, NIS alone is shown.
    """
    figures = [("NIS", report.nis)]
    if report.anees is not None:
        figures.insert(0, ("ANEES", report.anees))
    traces = []
    axes: Spec = {}
    inner, places, split = _panels(style, len(figures), _COVERAGE_PX if report.has_errors else 0)
    for number, (name, figure) in enumerate(figures):
        suffix = "" if number == 0 else "2"
        traces += _spread_traces(name, figure, suffix)
        left, right, low, high = places[number]
        values = [*_TOLERATED, *([] if figure.value is None else [figure.value])]
        values += figure.band or ()
        axes[f"xaxis{suffix}"] = axis(
            f"{name}: 1 is consistent",
            domain=[left, right],
            anchor=f"y{suffix}",
            nticks=5,
            range=_room(values),
        )
        axes[f"yaxis{suffix}"] = axis(
            domain=[low, high], range=[-1, 1], visible=False, anchor=f"x{suffix}"
        )
    titles = [
        panel_title(_verdict(name, figure), places[number][0], places[number][3])
        for number, (name, figure) in enumerate(figures)
    ]
    note = report.run
    if report.has_errors:
        covered = [vehicle.coverage_3sigma or 0.0 for vehicle in report.vehicles]
        traces += _coverage_traces([escaped(vehicle.name) for vehicle in report.vehicles], covered)
        axes |= _coverage_axes(covered, split)
        titles.append(panel_title("Coordinates within the filter's own 3 sigma", 0, split))
    else:
        note += " without truth: innovations alone are judged"
    title = f"{escaped(report.name or 'Plan')}: consistency of the filter"
    drawn = layout(title, note=note, inner=inner, above=40, annotations=titles, **axes)
    return {"data": traces, "layout": drawn}


def _panels(
    style: figure_style.FigureStyle, count: int, lowest_px: int
) -> tuple[int, list[tuple[float, float, float, float]], float]:
    """Height in px, (left, right, low, high) of each band's panel, and top of the lowest panel.

    Panels with bands stand side by side, or are stacked in a narrow figure, where words need room.
    """
    below = style.narrow or count == 1
    rows, words_px = count if below else 1, style.px(_WORDS_PX)
    inner = rows * (_BAND_PX + words_px) + lowest_px
    places = []
    for number in range(count):
        row, column = (number, 0) if below else (0, number)
        high = 1.0 - row * (_BAND_PX + words_px) / inner
        left, right = (0.0, 1.0) if below else (0.52 * column, 0.52 * column + 0.48)
        places.append((left, right, high - _BAND_PX / inner, high))
    return inner, places, lowest_px / inner


def _verdict(name: str, figure: Spread) -> str:
    if figure.value is None:
        return f"{name}: nothing to judge"
    value, _, interval = interval_words(figure).partition(", ")
    verdict, _, reason = verdict_words(figure).partition(", ")
    return f"{name} {value}: {verdict}<br>{interval or reason}"


def _room(values: list[float]) -> list[float | None]:
    low, high = min(values), max(values)
    room = 0.15 * max(high - low, 1e-3)
    return numbers([low - room, high + room], 6)


def _spread_traces(name: str, figure: Spread, suffix: str) -> list[Spec]:
    """Interval as a thick line and value as a mark on it, over the tolerated range."""
    shown = {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}", "showlegend": not suffix}

    def line(part: str, words: str, x: list[Any], y: list[float], look: Spec, **more: Any) -> Spec:
        return line_trace(f"{name}-{part}", words, x, y, look, **shown, legendgroup=part, **more)

    edges = [*_TOLERATED, *_TOLERATED[::-1], _TOLERATED[0]]
    filled = {"fill": "toself", "fillcolor": figure_style.translucent(figure_style.MUTED, 0.15)}
    words = f"within {TOLERANCE:.0%} of 1: consistent"
    traces = [line("tolerated", words, edges, [-0.8, -0.8, 0.8, 0.8, -0.8], {"width": 0}, **filled)]
    if figure.value is not None and figure.band:
        words = "95 % band" if figure.basis is None else "95 % interval"
        look: Spec = {"color": figure_style.SKY, "width": 16}
        hover = "%{x}<extra>end of the interval</extra>"
        ends = numbers(figure.band)
        traces.append(line("band", words, ends, [0, 0], look, hovertemplate=hover))
    look = {"color": figure_style.MUTED, "width": 1.5, "dash": "dash"}
    words = "1: errors as large as the filter says"
    traces.append(line("ideal", words, [1, 1], [-0.8, 0.8], look))
    if figure.value is not None:
        marker = {
            "symbol": _SYMBOLS.get(figure.verdict, "circle"),
            "size": 14,
            "color": _COLOURS.get(figure.verdict, figure_style.VERMILLION),
            "line": {"color": figure_style.INK, "width": 1},
        }
        hover = f"{name} %{{x}}, {figure.verdict}<extra></extra>"
        at, group = [figure.value], {"legendgroup": "found"}
        traces.append(
            mark_trace(f"{name}-value", "found", at, [0], marker, hover, **shown, **group)
        )
    return traces


def _coverage_axes(covered: list[float], split: float) -> Spec:
    lowest = min(*covered, IDEAL_COVERAGE, 0.98)
    return {
        "xaxis3": axis("vehicle", type="category", domain=[0, 1], anchor="y3"),
        "yaxis3": axis(
            "share within 3 sigma",
            domain=[0, split],
            anchor="x3",
            range=[lowest - 0.05 * (1.0 - lowest), 1.002],
            tickformat=".1%",
        ),
    }


def _coverage_traces(names: list[str], covered: list[float]) -> list[Spec]:
    axes = {"xaxis": "x3", "yaxis": "y3"}
    marker = {"symbol": "diamond", "size": 11, "color": figure_style.BLUE}
    hover = "%{x}: %{y:.2%}<extra></extra>"
    y, ideal = numbers(covered, 6), [IDEAL_COVERAGE] * len(names)
    line = {"color": figure_style.MUTED, "width": 1.5, "dash": "dot"}
    return [
        mark_trace("coverage", "share within 3 sigma", names, y, marker, hover, **axes),
        line_trace("coverage-ideal", "99.73 %, normal errors", names, ideal, line, **axes),
    ]
