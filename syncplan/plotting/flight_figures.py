"""Figures of flights: errors and phases over time, events, meetings, least separation.

On axes of time a band stands for a vehicle that is held, a line for a loss.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.figure_style import (
    BLUE,
    GREEN,
    INK,
    MUTED,
    ORANGE,
    SKY,
    VERMILLION,
    FigureStyle,
    translucent,
)
from syncplan.plotting.series_figures import every_so_many, panels
from syncplan.reports.flight_report import (
    FlightDocument,
    FlightEvent,
    FlownLink,
    FlownSeparation,
    FlownVehicle,
)
from syncplan.reports.flight_series import FlightOverTime, VehicleOverTime

MOST_NAMED = 4
"""Events that a note names."""

_BAND = translucent(MUTED, 0.25)
_LINE: Spec = {"color": INK, "width": 1.5, "dash": "dashdot"}


def event_shapes(events: Sequence[FlightEvent], panels: int) -> list[Spec]:
    """Return the marks of events in each of so many panels, of axes x, x2, ..."""
    return [
        _mark(one, str(number + 1) if number else "") for number in range(panels) for one in events
    ]


def event_entries(events: Sequence[FlightEvent]) -> list[Spec]:
    """Return the legend's entries of what `event_shapes` draws."""
    kinds = {one.kind for one in events}
    entries: list[Spec] = []
    nowhere: Spec = {"type": "scatter", "x": [None], "y": [None], "hoverinfo": "skip"}
    if "loss" in kinds:
        entry = {"mode": "lines", "uid": "losses", "name": "something is lost", "line": _LINE}
        entries.append({**nowhere, **entry})
    if "hold" in kinds:
        marker = {"symbol": "square", "size": 12, "color": _BAND}
        entry = {"mode": "markers", "uid": "holds", "name": "a vehicle is held", "marker": marker}
        entries.append({**nowhere, **entry})
    return entries


def event_words(report: FlightDocument) -> str:
    """Return what happens, in words that a note can have; empty if nothing does."""
    said = [escaped(one.what) for one in report.events[:MOST_NAMED]]
    more = len(report.events) - len(said)
    return ", ".join(said) + (f" and {more} more" if more else "")


def _mark(one: FlightEvent, suffix: str) -> Spec:
    axes = {"xref": f"x{suffix}", "yref": f"y{suffix} domain", "y0": 0, "y1": 1}
    if one.end_s is None:
        return {"type": "line", **axes, "x0": one.begin_s, "x1": one.begin_s, "line": _LINE}
    return {
        "type": "rect",
        **axes,
        "x0": one.begin_s,
        "x1": one.end_s,
        "fillcolor": _BAND,
        "line": {"width": 0},
        "layer": "below",
    }


MOST_VEHICLES = 12
"""Vehicles drawn: of larger teams, the worst."""

_DECADES = 2.5
"""What an axis holds at most below its largest value."""

_AIR = 1.15
_DIGITS = 5


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve of each panel.

    Attributes
    ----------
    key, name : in the figure, and in the legend
    line : Plotly's
    values : over time or, as a level, a single one; None where it is not known
    """

    key: str
    name: str
    line: Spec
    values: Sequence[float | None]


def series_in(report: FlightDocument) -> FlightOverTime:
    """Return a report's figures over time; raises InputError where it has none."""
    if report.series is None:
        raise InputError("the report has no figures over time; --series keeps them", key="series")
    return report.series


def flight_panels_spec(
    report: FlightDocument,
    style: FigureStyle,
    curves: Mapping[str, Sequence[Curve]],
    worst: Mapping[str, float],
    words: tuple[str, str, str],
) -> Spec:
    """Return a figure of curves by vehicle; `words` are what it shows, its unit, and a note.

    Of a large team those vehicles are drawn that are `worst`.
    """
    series, (what, unit, note) = series_in(report), words
    kept = set(sorted(worst, key=lambda name: -worst[name])[:MOST_VEHICLES])
    drawn = [one for one in series.vehicles if one.name in kept]
    axes, titles, inner = panels(
        [f"{one.name}, {unit}" for one in drawn], [None] * len(drawn), style
    )
    low, high = _range([one for vehicle in drawn for one in curves[vehicle.name]])
    for name in axes:
        if name.startswith("yaxis"):
            axes[name] |= _logarithmic(low, high)
    traces = [
        trace
        for number, vehicle in enumerate(drawn)
        for trace in _panel(vehicle, curves[vehicle.name], series.time_s, number)
    ]
    if len(drawn) < len(series.vehicles):
        note += f"; the {len(drawn)} worst of {len(series.vehicles)} vehicles"
    said = event_words(report)
    shown = layout(
        f"{escaped(report.name or 'Plan')}: {what}",
        note=f"{note}; {said}" if said else note,
        inner=inner,
        above=24,
        annotations=titles,
        shapes=event_shapes(report.events, len(drawn)),
        **axes,
    )
    return {"data": traces + event_entries(report.events), "layout": shown}


def _panel(
    vehicle: VehicleOverTime, curves: Sequence[Curve], times: Sequence[float], number: int
) -> list[Spec]:
    every = every_so_many(len(times))
    suffix = str(number + 1) if number else ""
    traces = []
    for one in curves:
        level = len(one.values) == 1
        at = [times[0], times[-1]] if level else times[::every]
        values = [*one.values, *one.values] if level else one.values[::every]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "uid": f"{one.key}-{vehicle.name}",
                "name": one.name,
                "legendgroup": one.key,
                "showlegend": number == 0,
                "xaxis": f"x{suffix}",
                "yaxis": f"y{suffix}",
                "x": numbers(at, 6),
                "y": numbers(_positive(values), _DIGITS),
                "line": one.line,
                "hovertemplate": f"{escaped(vehicle.name)} at %{{x}} s: %{{y:.3g}}"
                f"<extra>{one.name}</extra>",
            }
        )
    return traces


def _positive(values: Sequence[float | None]) -> Array:
    found = np.array(values, dtype=float)
    return np.where(found > 0.0, found, np.nan)


def _range(curves: Sequence[Curve]) -> tuple[float, float]:
    """What an axis holds of curves: all, but no more than _DECADES below the largest."""
    known = [_positive(one.values) for one in curves]
    every = np.concatenate([np.ones(0), *known])
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.1, 1.0
    high = float(every.max()) * _AIR
    return max(float(every.min()) / _AIR, high * 10.0**-_DECADES), high


def _logarithmic(low: float, high: float) -> Spec:
    """A logarithmic axis, marked at 1, 2, 5, 10, ... or, where these are many, at fewer."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    wide = math.log10(high / low) > 1.7
    digits = (1.0, 3.0) if wide else (1.0, 2.0, 5.0)
    marks = [round(d * 10.0**k, 12) for k in range(first, last + 1) for d in digits]
    marks = [one for one in marks if low <= one <= high]
    return {
        "type": "log",
        "range": numbers([math.log10(low), math.log10(high)], 4),
        "tickvals": marks,
        "ticktext": [f"{one:g}" for one in marks],
    }


def flight_errors_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of tracking and estimation errors over time, a panel a vehicle.

    The bound is that along the paths flown, the level the plan's own prediction for the second
    half. Raises InputError for a report without series.
    """
    predicted = {
        one.name: None if one.errors is None else one.errors.predicted_rms_m
        for one in report.vehicles
    }
    series = series_in(report)
    curves = {one.name: _error_curves(one, predicted.get(one.name)) for one in series.vehicles}
    worst = {
        one.name: 0.0 if one.errors is None else one.errors.tracking_rms_m
        for one in report.vehicles
    }
    note = f"RMS over {report.run}; guidance {report.guidance}"
    words = "errors over time", "m", note
    return flight_panels_spec(report, style, curves, worst, words)


def _error_curves(vehicle: VehicleOverTime, predicted: float | None) -> list[Curve]:
    sigma = Curve("sigma", "filter's own sigma", {"color": SKY, "width": 5}, vehicle.sigma_m)
    bound: Spec = {"color": VERMILLION, "width": 2, "dash": "dot"}
    tracking: Spec = {"color": GREEN, "width": 1.8, "dash": "dash"}
    found = [
        sigma,
        Curve("bound", "bound along the path", bound, vehicle.bound_m),
        Curve("tracking", "distance from the plan", tracking, vehicle.tracking_rms_m),
        Curve("error", "error of the estimate", {"color": INK, "width": 1.3}, vehicle.rms_m),
    ]
    if predicted:
        level: Spec = {"color": ORANGE, "width": 1.5, "dash": "longdash"}
        found.append(Curve("predicted", "the plan's prediction", level, [predicted]))
    return found


def flight_phases_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of phase errors over time, a panel a vehicle, with its tolerance.

    The tolerance is the least of a vehicle's links; a level shows the worst error of any trial in
    the second half. Raises InputError for a report without series.
    """
    series, vehicles = series_in(report), {one.name: one for one in report.vehicles}
    curves = {one.name: _phase_curves(one, vehicles[one.name]) for one in series.vehicles}
    worst = {
        one.name: 0.0 if one.phase_error_s is None else one.phase_error_s.rms
        for one in report.vehicles
    }
    note = f"ahead of the plan or behind it, RMS over {report.run}; guidance {report.guidance}"
    words = "phase error over time", "s", note
    return flight_panels_spec(report, style, curves, worst, words)


def _phase_curves(vehicle: VehicleOverTime, flown: FlownVehicle) -> list[Curve]:
    found = [Curve("phase", "phase error", {"color": BLUE, "width": 1.8}, vehicle.phase_rms_s)]
    if flown.phase_error_s is not None:
        line: Spec = {"color": ORANGE, "width": 1.8, "dash": "dash"}
        name = "worst of any trial, second half"
        found.append(Curve("worst", name, line, [flown.phase_error_s.worst]))
    if flown.phase_tolerance_s is not None:
        line = {"color": VERMILLION, "width": 2, "dash": "dot"}
        name = "the plan's tolerance"
        found.append(Curve("tolerance", name, line, [flown.phase_tolerance_s]))
    return found


_SEPARATION_AIR = 1.06


def flight_separation_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of trials in which two vehicles come nearer than a distance.

    Lines mark the separation that is asked for, and the plan's own.
    """
    title = f"{escaped(report.name or 'Plan')}: least separation"
    found = report.least_separation_m
    if found is None:
        return message(title, "a single vehicle keeps away from all others")
    shares = np.linspace(0.0, 100.0, len(found.quantiles))
    curve = {
        "type": "scatter",
        "mode": "lines",
        "uid": "trials",
        "name": "trials in which two come nearer",
        "x": numbers(found.quantiles, 4),
        "y": numbers(shares, 3),
        "line": {"color": BLUE, "width": 2.5},
        "hovertemplate": "nearer than %{x:.3g} m in %{y:.3g} % of the trials<extra></extra>",
    }
    planned = _level("planned", "the plan's own", found.planned, {"color": INK, "dash": "dash"})
    traces = [curve, planned]
    if found.asked is not None:
        line = {"color": VERMILLION, "dash": "dot"}
        traces.append(_level("asked", "asked for: min_separation_m", found.asked, line))
    drawn = layout(
        title,
        note=_separation_note(report, found),
        inner=300,
        xaxis=axis("least separation, m", range=[0.0, _SEPARATION_AIR * _most(found)]),
        yaxis=axis("share of trials, %", range=[0, 102]),
    )
    return {"data": traces, "layout": drawn}


def _most(found: FlownSeparation) -> float:
    return max(found.planned, found.asked or 0.0, *found.quantiles)


def _level(uid: str, name: str, value: float, line: Spec) -> Spec:
    return {
        "type": "scatter",
        "mode": "lines",
        "uid": uid,
        "name": name,
        "x": numbers([value, value], 4),
        "y": [0, 102],
        "line": {**line, "width": 2},
        "hovertemplate": f"{name}: %{{x:.3g}} m<extra></extra>",
    }


def _separation_note(report: FlightDocument, found: FlownSeparation) -> str:
    pair = escaped("-".join(found.between))
    note = (
        f"{report.run}; {found.median:.3g} m in the median trial, {found.worst:.3g} m in the worst "
        f"({pair} at {found.time_s:.4g} s)"
    )
    if found.below_asked_share is not None:
        note += f"; nearer than asked in {100.0 * found.below_asked_share:.3g} % of the trials"
    return note


MOST_BARS = 40
"""Links shown, those that missed most: more would be too many to read."""

_ROW_PX = 21
_LEAST_PX = 90


def flight_meetings_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of meetings kept, a bar a link, the worst on top.

    Links that missed a meeting in any trial are hatched.
    """
    title = f"{escaped(report.name or 'Plan')}: meetings kept"
    if not report.links:
        return message(title, "the plan has no meeting that the flight is long enough for")
    shown = sorted(report.links, key=lambda one: one.kept_share)[:MOST_BARS]
    traces = [
        _meeting_bars(
            "missed", "some were missed", [o for o in shown if o.kept_share < 1.0], VERMILLION
        ),
        _meeting_bars("kept", "all were kept", [o for o in shown if o.kept_share >= 1.0], BLUE),
    ]
    missed = sum(one.kept_share < 1.0 for one in report.links)
    note = (
        f"planned meetings with a sighting in {report.run}; {missed} of {len(report.links)} links "
        "missed some"
    )
    if len(shown) < len(report.links):
        note += f"; the {len(shown)} worst are shown"
    drawn = layout(
        title,
        note=note,
        inner=max(_ROW_PX * len(shown), _LEAST_PX),
        barmode="overlay",
        bargap=0.25,
        xaxis=axis("meetings kept, %", range=[0, 104]),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=[_label(one) for one in shown],
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _meeting_bars(uid: str, name: str, links: list[FlownLink], color: str) -> Spec:
    marker: Spec = {"color": color, "line": {"color": INK, "width": 0.8}}
    if uid == "missed":
        marker["pattern"] = {"shape": "/", "fillmode": "replace", "size": 6}
    return {
        "type": "bar",
        "orientation": "h",
        "uid": uid,
        "name": name,
        "x": numbers([100.0 * one.kept_share for one in links], 4),
        "y": [_label(one) for one in links],
        "text": [f"{one.meetings} in a trial" for one in links],
        "textposition": "none",
        "marker": marker,
        "hovertemplate": "%{y}: %{x:.4g} % of %{text}<extra></extra>",
    }


def _label(one: FlownLink) -> str:
    return escaped("-".join(one.between))


_EVENT_ROW_PX = 26

_STYLES = (
    ("loss", "lost", VERMILLION, "x"),
    ("hold", "held where it is", ORANGE, "/"),
)


def flight_events_spec(report: FlightDocument) -> Spec:
    """Return the figure of events: bars from a loss to the end, and over the time of a hold.

    After a hold, a thin bar shows how long the median trial takes to have its phase again.
    """
    title = f"{escaped(report.name or 'Plan')}: what was lost, and when"
    if not report.events:
        return message(title, "nothing was lost, and no vehicle held")
    rows = list(dict.fromkeys(escaped(one.subject) for one in report.events))
    traces = [
        _event_bars(kind, name, [one for one in report.events if one.kind == kind], look, report)
        for kind, name, *look in _STYLES
    ]
    traces.append(_settling(report))
    drawn = layout(
        title,
        note=f"the same in each of {report.run}",
        inner=max(_EVENT_ROW_PX * len(rows), _LEAST_PX),
        barmode="overlay",
        bargap=0.35,
        xaxis=axis("time, s", range=numbers([0.0, report.duration_s], 4)),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=rows,
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _event_bars(
    uid: str, name: str, events: list[FlightEvent], look: list[str], report: FlightDocument
) -> Spec:
    color, shape = look
    ends = [report.duration_s if one.end_s is None else one.end_s for one in events]
    return {
        "type": "bar",
        "orientation": "h",
        "uid": uid,
        "name": name,
        "y": [escaped(one.subject) for one in events],
        "base": numbers([one.begin_s for one in events], 4),
        "x": numbers([end - one.begin_s for end, one in zip(ends, events, strict=True)], 4),
        "marker": {
            "color": color,
            "line": {"color": INK, "width": 0.8},
            "pattern": {"shape": shape, "fillmode": "replace", "size": 7},
        },
        "text": [escaped(one.what) for one in events],
        "textposition": "none",
        "hovertemplate": "%{text}<extra></extra>",
    }


def _settling(report: FlightDocument) -> Spec:
    found = [one for one in report.events if one.settled_s and one.end_s is not None]
    return {
        "type": "bar",
        "orientation": "h",
        "uid": "settling",
        "name": "until its phase is kept again, median trial",
        "y": [escaped(one.subject) for one in found],
        "base": numbers([one.end_s or 0.0 for one in found], 4),
        "x": numbers([one.settled_s or 0.0 for one in found], 4),
        "width": 0.3,
        "marker": {"color": GREEN, "line": {"color": INK, "width": 0.8}},
        "hovertemplate": "in phase again after %{x:.3g} s<extra></extra>",
    }
