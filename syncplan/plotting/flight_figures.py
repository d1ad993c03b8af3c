"""Figures of flights: errors and phases over time, events, meetings, least separation.

On time axes, a band marks a hold and a line a loss.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.phrases import percent
from syncplan.planning.plan_records import MeetingsFlown
from syncplan.plotting import canvas, figure_style
from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.panels import Curve, curve_entries, curve_traces, panels_spec
from syncplan.reports.flight_report import (
    FlightDocument,
    FlightEvent,
    FlownSeparation,
    FlownVehicle,
)
from syncplan.reports.flight_series import VehicleOverTime

MOST_NAMED = 4
"""Largest number of events that a note names."""

MOST_VEHICLES = 12
"""Largest number of vehicles drawn; of larger teams, the worst."""

MOST_BARS = 40
"""Largest number of links that stay readable; those that missed most are shown."""

_BAND = figure_style.translucent(figure_style.MUTED, 0.25)
_LINE: Spec = {"color": figure_style.INK, "width": 1.5, "dash": "dashdot"}

_DECADES = 2.5
"""Largest extent of a logarithmic axis below its largest value, in decades."""

_AIR = 1.15
_SEPARATION_AIR = 1.06
_DIGITS = 5
_EVENT_ROW_PX = 26

_EVENTS = (
    ("loss", "lost", canvas.bar_marker(figure_style.VERMILLION, "x", size=7)),
    ("hold", "held where it is", canvas.bar_marker(figure_style.ORANGE, "/", size=7)),
)


# --- over time ----------------------------------------------------------------------------------


def flight_errors_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of tracking and estimation errors over time, one panel per vehicle.

    The bound is that along the paths flown; the level is the plan's own prediction for the second
    half. Raises InputError for a report without series.
    """

    def curves(vehicle: VehicleOverTime, flown: FlownVehicle) -> list[Curve]:
        bound: Spec = {"color": figure_style.VERMILLION, "width": 2, "dash": "dot"}
        tracking: Spec = {"color": figure_style.GREEN, "width": 1.8, "dash": "dash"}
        own: Spec = {"color": figure_style.SKY, "width": 5}
        error: Spec = {"color": figure_style.INK, "width": 1.8}
        # dashes over lines: neither hides the other
        drawn = [
            Curve("sigma", "filter's own sigma", own, vehicle.sigma_m, "square"),
            Curve("error", "error of the estimate", error, vehicle.rms_m, "circle"),
            Curve("bound", "bound along the path", bound, vehicle.bound_m, "diamond"),
            Curve(
                "tracking",
                "distance from the plan",
                tracking,
                vehicle.tracking_rms_m,
                "triangle-up",
            ),
        ]
        if flown.errors is not None and flown.errors.predicted_rms_m:
            level: Spec = {"color": figure_style.ORANGE, "width": 1.5, "dash": "longdash"}
            predicted = [flown.errors.predicted_rms_m]
            drawn.append(Curve("predicted", "the plan's prediction", level, predicted))
        return drawn

    def off(flown: FlownVehicle) -> float:
        return 0.0 if flown.errors is None else flown.errors.tracking_rms_m

    note = f"RMS over {report.run}; guidance {report.guidance}"
    return _over_time(report, style, "errors over time", "m", note, curves, off)


def flight_phases_spec(report: FlightDocument, style: FigureStyle) -> Spec:
    """Return the figure of phase errors and tolerances over time, one panel per vehicle.

    The tolerance is the smallest of a vehicle's links; a level shows the worst error of any trial
    in the second half. Raises InputError for a report without series.
    """

    def curves(vehicle: VehicleOverTime, flown: FlownVehicle) -> list[Curve]:
        line: Spec = {"color": figure_style.BLUE, "width": 1.8}
        drawn = [Curve("phase", "phase error", line, vehicle.phase_rms_s)]
        if flown.phase_error_s is not None:
            line = {"color": figure_style.ORANGE, "width": 1.8, "dash": "dash"}
            name = "worst of any trial, second half"
            drawn.append(Curve("worst", name, line, [flown.phase_error_s.worst]))
        if flown.phase_tolerance_s is not None:
            line = {"color": figure_style.VERMILLION, "width": 2, "dash": "dot"}
            name = "the plan's tolerance"
            drawn.append(Curve("tolerance", name, line, [flown.phase_tolerance_s]))
        return drawn

    def off(flown: FlownVehicle) -> float:
        return 0.0 if flown.phase_error_s is None else flown.phase_error_s.rms

    note = f"ahead of the plan or behind it, RMS over {report.run}; guidance {report.guidance}"
    return _over_time(report, style, "phase error over time", "s", note, curves, off)


def _over_time(
    report: FlightDocument,
    style: FigureStyle,
    what: str,
    unit: str,
    note: str,
    curves: Callable[[VehicleOverTime, FlownVehicle], list[Curve]],
    off: Callable[[FlownVehicle], float],
) -> Spec:
    """Figure with a panel of curves per vehicle; of a large team, for those furthest `off`."""
    series = report.series
    if series is None:
        raise InputError("the report has no figures over time; --series keeps them", key="series")
    flown = {one.name: one for one in report.vehicles}
    kept = set(sorted(flown, key=lambda name: -off(flown[name]))[:MOST_VEHICLES])
    drawn = {one.name: curves(one, flown[one.name]) for one in series.vehicles if one.name in kept}
    vertical = _logarithmic([curve for of_one in drawn.values() for curve in of_one])
    traces = [
        trace
        for number, (name, of_one) in enumerate(drawn.items())
        for trace in curve_traces(
            of_one,
            name,
            number,
            series.time_s,
            lambda values: canvas.numbers(_positive(values), _DIGITS),
            f"{canvas.escaped(name)} at %{{x}} s: %{{y:.3g}}",
        )
    ]
    traces += curve_entries([curve for of_one in drawn.values() for curve in of_one])
    if len(drawn) < len(series.vehicles):
        note += f"; the {len(drawn)} worst of {len(series.vehicles)} vehicles"
    return panels_spec(
        f"{canvas.escaped(report.name or 'Plan')}: {what}",
        "; ".join(filter(None, [note, event_words(report)])),
        [f"{name}, {unit}" for name in drawn],
        traces + _event_entries(report.events),
        style,
        [vertical] * len(drawn),
        times=series.time_s,
        shapes=[_event_mark(one, n) for n in range(len(drawn)) for one in report.events],
    )


def _positive(values: Sequence[float | None]) -> Array:
    found = np.array(values, dtype=float)
    return np.where(found > 0.0, found, np.nan)


def _logarithmic(curves: Sequence[Curve]) -> Spec:
    """Logarithmic axis that holds curves, down to _DECADES below the largest of their values.

    Ticks are at 1, 2, 5, 10, ... or, on a wide axis, at 1, 3, 10, ...
    """
    low, high = 0.1, 1.0
    known = np.concatenate([np.ones(0), *(_positive(one.values) for one in curves)])
    known = known[np.isfinite(known)]
    if len(known):
        high = float(known.max()) * _AIR
        low = max(float(known.min()) / _AIR, high * 10.0**-_DECADES)
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    wide = math.log10(high / low) > 1.7
    digits = (1.0, 3.0) if wide else (1.0, 2.0, 5.0)
    marks = [round(d * 10.0**k, 12) for k in range(first, last + 1) for d in digits]
    marks = [one for one in marks if low <= one <= high]
    return {
        "type": "log",
        "range": canvas.numbers([math.log10(low), math.log10(high)], 4),
        "tickvals": marks,
        "ticktext": [f"{one:g}" for one in marks],
    }


# --- events -------------------------------------------------------------------------------------


def event_words(report: FlightDocument) -> str:
    """Return the events in words for a note; empty if there are none."""
    said = [canvas.escaped(one.what) for one in report.events[:MOST_NAMED]]
    more = len(report.events) - len(said)
    return ", ".join(said) + (f" and {more} more" if more else "")


def _event_mark(one: FlightEvent, number: int) -> Spec:
    """Shape that marks an event in panel `number`."""
    suffix = str(number + 1) if number else ""
    axes = {"xref": f"x{suffix}", "yref": f"y{suffix} domain", "y0": 0, "y1": 1}
    if one.end_s is None:
        return {"type": "line", **axes, "x0": one.begin_s, "x1": one.begin_s, "line": _LINE}
    ends: Spec = {"x0": one.begin_s, "x1": one.end_s}
    look = {"fillcolor": _BAND, "line": {"width": 0}, "layer": "below"}
    return {"type": "rect", **axes, **ends, **look}


def _event_entries(events: Sequence[FlightEvent]) -> list[Spec]:
    """Legend entries of the shapes that _event_mark draws."""
    kinds = {one.kind for one in events}
    entries: list[Spec] = []
    if "loss" in kinds:
        entries.append(canvas.line_trace("losses", "something is lost", [None], [None], _LINE))
    if "hold" in kinds:
        marker = {"symbol": "square", "size": 12, "color": _BAND}
        entries.append(canvas.mark_trace("holds", "a vehicle is held", [None], [None], marker))
    return entries


def flight_events_spec(report: FlightDocument) -> Spec:
    """Return the figure of events: bars from each loss to the end, and over each hold.

    After a hold, a thin bar shows how long the median trial takes to regain its phase.
    """
    title = f"{canvas.escaped(report.name or 'Plan')}: what was lost, and when"
    if not report.events:
        return canvas.message(title, "nothing was lost, and no vehicle held")
    rows = list(dict.fromkeys(canvas.escaped(one.subject) for one in report.events))
    traces = []
    for kind, name, marker in _EVENTS:
        events = [one for one in report.events if one.kind == kind]
        ends = [report.duration_s if one.end_s is None else one.end_s for one in events]
        traces.append(
            canvas.row_bars(
                kind,
                name,
                [canvas.escaped(one.subject) for one in events],
                canvas.numbers(
                    [end - one.begin_s for end, one in zip(ends, events, strict=True)], 4
                ),
                marker,
                base=canvas.numbers([one.begin_s for one in events], 4),
                text=[canvas.escaped(one.what) for one in events],
                textposition="none",
                hovertemplate="%{text}<extra></extra>",
            )
        )
    settled = [one for one in report.events if one.settled_s and one.end_s is not None]
    traces.append(
        canvas.row_bars(
            "settling",
            "until back in phase, median trial",
            [canvas.escaped(one.subject) for one in settled],
            canvas.numbers([one.settled_s or 0.0 for one in settled], 4),
            canvas.bar_marker(figure_style.GREEN),
            base=canvas.numbers([one.end_s or 0.0 for one in settled], 4),
            width=0.3,
            hovertemplate="in phase again after %{x:.3g} s<extra></extra>",
        )
    )
    across = canvas.axis("time, s", range=canvas.numbers([0.0, report.duration_s], 4))
    note = f"the same in each of {report.run}"
    return canvas.rows_spec(title, note, rows, across, traces, row_px=_EVENT_ROW_PX, gap=0.35)


# --- meetings and separation --------------------------------------------------------------------


def flight_meetings_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of meetings kept, one bar per link, the worst on top.

    Links that missed a meeting in any trial are hatched.
    """
    title = f"{canvas.escaped(report.name or 'Plan')}: meetings kept"
    if not report.links:
        return canvas.message(title, "the plan has no meeting that the flight is long enough for")
    shown = sorted(report.links, key=lambda one: one.kept_share)[:MOST_BARS]
    some = [one for one in shown if one.kept_share < 1.0]
    traces = [
        _meeting_bars(
            "missed", "some were missed", some, canvas.bar_marker(figure_style.VERMILLION, "/")
        ),
        _meeting_bars(
            "kept", "all were kept", shown[len(some) :], canvas.bar_marker(figure_style.BLUE)
        ),
    ]
    missed = sum(one.kept_share < 1.0 for one in report.links)
    note = (
        f"planned meetings with a sighting in {report.run}; {missed} of {len(report.links)} links "
        "missed some"
    )
    if len(shown) < len(report.links):
        note += f"; the {len(shown)} worst are shown"
    across = canvas.axis("meetings kept, %", range=[0, 104])
    return canvas.rows_spec(title, note, [_link(one) for one in shown], across, traces)


def _meeting_bars(uid: str, name: str, links: list[MeetingsFlown], marker: Spec) -> Spec:
    return canvas.row_bars(
        uid,
        name,
        [_link(one) for one in links],
        canvas.numbers([100.0 * one.kept_share for one in links], 4),
        marker,
        text=[f"{one.meetings} in a trial" for one in links],
        textposition="none",
        hovertemplate="%{y}: %{x:.4g} % of %{text}<extra></extra>",
    )


def _link(one: MeetingsFlown | FlownSeparation) -> str:
    return canvas.escaped("-".join(one.between))


def flight_separation_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of trials in which two vehicles come nearer than a distance.

    Lines mark the required separation, and the plan's own.
    """
    title = f"{canvas.escaped(report.name or 'Plan')}: least separation"
    found = report.least_separation_m
    if found is None:
        return canvas.message(title, "a single vehicle keeps away from all others")
    traces = [
        canvas.line_trace(
            "trials",
            "trials in which two come nearer",
            canvas.numbers(found.quantiles, 4),
            canvas.numbers(np.linspace(0.0, 100.0, len(found.quantiles)), 3),
            {"color": figure_style.BLUE, "width": 2.5},
            hovertemplate="nearer than %{x:.3g} m in %{y:.3g} % of the trials<extra></extra>",
        )
    ]
    planned: Spec = {"color": figure_style.INK, "dash": "dash", "width": 2}
    asked: Spec = {"color": figure_style.VERMILLION, "dash": "dot", "width": 2}
    for uid, name, value, line in (
        ("planned", "the plan's own", found.planned, planned),
        ("asked", "asked for: min_separation_m", found.asked, asked),
    ):
        if value is not None:
            x, hover = canvas.numbers([value, value], 4), f"{name}: %{{x:.3g}} m<extra></extra>"
            traces.append(canvas.line_trace(uid, name, x, [0, 102], line, hovertemplate=hover))
    most = max(found.planned, found.asked or 0.0, *found.quantiles)
    drawn = canvas.layout(
        title,
        note=_separation_note(report, found),
        inner=300,
        xaxis=canvas.axis("least separation, m", range=[0.0, _SEPARATION_AIR * most]),
        yaxis=canvas.axis("share of trials, %", range=[0, 102]),
    )
    return {"data": traces, "layout": drawn}


def _separation_note(report: FlightDocument, found: FlownSeparation) -> str:
    note = (
        f"{report.run}; {found.median:.3g} m in the median trial, {found.worst:.3g} m in the worst "
        f"({_link(found)} at {found.time_s:.4g} s)"
    )
    if found.below_asked_share is not None:
        share = percent(found.below_asked_share, found.below_asked_interval)
        note += f"; nearer than asked in {share} of the trials"
    return note
