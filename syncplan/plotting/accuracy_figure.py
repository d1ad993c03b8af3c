"""Errors vehicle by vehicle: predicted by the bound, found by the Monte Carlo, or stated sigmas."""

from collections.abc import Sequence

import numpy as np

from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.palette import BLUE, GREEN, INK, ORANGE, SKY
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.reports.run_schemas import ValidationDocument

_LEAST_BAR_PX = 5.0
"""Width below which bars become marks: their patterns could not be told apart."""

_MARKS = {"predicted": "line-ew-open", "late": "circle", "whole": "circle-open"}
_MARK_PX = 6


def prediction_spec(plan: Plan, style: FigureStyle) -> Spec:
    """Return the figure of the predicted RMS position error of each vehicle."""
    found = plan.prediction
    title = f"{escaped(plan.scenario.name or 'Plan')}: predicted error"
    names = [escaped(name) for name in plan.scenario.vehicle_names]
    traces = []
    if found.rms is not None:
        name = "posterior bound, second half of the run"
        traces.append(bars("predicted", name, names, found.rms, BLUE, ""))
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


def accuracy_spec(report: ValidationDocument | ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of RMS position errors of a run, beside the predicted ones if known."""
    if isinstance(report, ReplayDocument):
        return _replayed(report, style)
    return _validated(report, style)


def sigmas_spec(report: ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of the filter's own position sigmas on a recording without truth."""
    names = [escaped(robot.name) for robot in report.robots]
    last = [robot.final_sigma_m for robot in report.robots]
    whole = [robot.rms_sigma_m for robot in report.robots]
    traces = [
        bars("late", "at the end", names, last, ORANGE, ""),
        bars("whole", "RMS over the run", names, whole, SKY, "/"),
    ]
    title = f"{escaped(report.name)}: the filter's own sigmas"
    note = f"{report.run} without truth: errors are not known"
    return _drawn(title, note, traces, len(names), style, shown="own position sigma, m")


def _validated(report: ValidationDocument, style: FigureStyle) -> Spec:
    """RMS position errors over the trials beside the predicted ones."""
    names = [escaped(vehicle.name) for vehicle in report.vehicles]
    found = report.vehicles
    traces = _found_traces("Monte Carlo", report)
    predicted = [vehicle.predicted_rms_m for vehicle in found]
    if all(value is not None for value in predicted):
        name = "predicted: posterior bound, second half"
        traces.insert(0, bars("predicted", name, names, predicted, BLUE, "x"))
    medians = [vehicle.median_rms_second_half_m for vehicle in found]
    if all(value is not None for value in medians):
        values = np.array(medians, dtype=float)
        traces.append(_marks("median", "median trial, second half", names, values, "diamond"))
    note = report.run
    ratio = report.overall.rms_over_predicted
    if ratio is not None:
        note += f"; second half over predicted: {ratio:.3g}"
    if not report.observable:
        note += "; the plan is NOT observable"
    title = f"{escaped(report.name or 'Plan')}: error found and predicted"
    return _drawn(title, note, traces, len(names), style)


def _replayed(report: ReplayDocument, style: FigureStyle) -> Spec:
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
        bars("late", f"{who}, second half of the run", names, late, ORANGE, ""),
        bars("whole", f"{who}, whole run", names, whole, SKY, "/"),
    ]


def bars(
    uid: str,
    name: str,
    vehicles: list[str],
    values: Sequence[float | None] | np.ndarray,
    color: str,
    pattern: str,
) -> Spec:
    """Return bars over vehicles (escaped names), distinguished by pattern as well as colour."""
    marker: Spec = {"color": color, "line": {"color": INK, "width": 0.8}}
    if pattern:
        marker["pattern"] = {"shape": pattern, "fillmode": "replace", "size": 6}
    return {
        "type": "bar",
        "uid": uid,
        "name": name,
        "x": vehicles,
        "y": numbers(np.array(values, dtype=float), 6),
        "marker": marker,
        "hovertemplate": "%{x}: %{y:.3g} m<extra></extra>",
    }


def _marks(uid: str, name: str, vehicles: list[str], values: np.ndarray, symbol: str) -> Spec:
    return {
        "type": "scatter",
        "uid": uid,
        "name": name,
        "mode": "markers",
        "x": vehicles,
        "y": numbers(values, 6),
        "marker": {
            "symbol": symbol,
            "size": 12 if symbol == "diamond" else 22,
            "color": GREEN if symbol == "diamond" else INK,
            "line": {"width": 2.5, "color": INK},
        },
        "hovertemplate": "%{x}: %{y:.3g} m<extra></extra>",
    }


def _drawn(
    title: str,
    note: str,
    traces: list[Spec],
    count: int,
    style: FigureStyle,
    shown: str = "RMS position error, m",
) -> Spec:
    """The figure of traces over `count` vehicles: bars, or marks where bars become too thin."""
    bars_shown = sum(trace["type"] == "bar" for trace in traces)
    if style.plot_px < _LEAST_BAR_PX * count * (bars_shown + 0.5):
        traces = [_as_marks(trace) for trace in traces]
    # names may look like numbers or dates: they stay names
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
    """Bars as marks at their ends."""
    if trace["type"] != "bar":
        return trace
    symbol, color = _MARKS[trace["uid"]], trace["marker"]["color"]
    marker = {"symbol": symbol, "size": _MARK_PX, "color": color, "line": {"width": 1.5}}
    if symbol == "line-ew-open":
        marker = {**marker, "line": {"width": 2, "color": color}}
    return {**trace, "type": "scatter", "mode": "markers", "marker": marker}
