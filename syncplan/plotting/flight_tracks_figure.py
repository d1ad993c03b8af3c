"""Figure of a flight's true and estimated tracks over the planned circles.

Turns lie on each other: each vehicle's last turn is drawn strongly, the earlier ones faintly.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.orbits.circles import Orbits, unit
from syncplan.plotting import figure_style
from syncplan.plotting.canvas import Spec, escaped, gapped, layout, line_trace, mark_trace, numbers
from syncplan.plotting.flight_figures import event_words
from syncplan.plotting.map_labels import landmark_trace, name_trace, obstructions
from syncplan.plotting.maps import MapView, area_traces, circle_points, view_about
from syncplan.reports.flight_report import FlightDocument
from syncplan.reports.flight_series import (
    FlightGround,
    FlightOverTime,
    FlownTrack,
    PlaceEllipse,
    TrackedVehicle,
)

SIGMAS = 3.0
"""Semi-axes of ellipses, in standard deviations."""

_FURTHEST = 0.75
"""Margin beyond the plan's view in which tracks are shown, as a share of its extent."""

_CORNERS = 36

_FAINT = 0.25
"""Opacity of earlier turns."""


@dataclass(frozen=True, slots=True)
class FlownMap:
    """Subject of a map of a flight."""

    orbits: Orbits
    landmarks: Array
    scenario: FlightGround


def flight_tracks_spec(report: FlightDocument, style: figure_style.FigureStyle) -> Spec:
    """Return the figure of the first trial's tracks, true and estimated, over the plan's circles.

    Ellipses show the filter's own three sigma at moments over the run; a mark shows the vehicle's
    true position at that moment. Of other recorded trials, the last turns are drawn faintly. Raises
    InputError for a report without series.
    """
    series = report.series
    if series is None:
        raise InputError("the report has no tracks; --series keeps them", key="series")
    flown = _map_of(series.ground)
    view = _view(flown, series, style)
    ground = series.ground
    names = [one.name for one in ground.circles] + [one.name for one in ground.landmarks]
    names = [escaped(name) for name in names]
    about = obstructions(flown, np.empty((0, 2), dtype=int))
    first, *others = series.tracks
    turns = _last_turns(series, first)
    traces = [
        *area_traces(flown, view),
        *_other_trials(others, series, view),
        *_ellipses(first, turns, view),
        *_paths(first, series, turns, view),
        _circles(flown, view),
        *_moments(first, series, turns, view),
        *landmark_trace(flown, view, names, about),
        *_ends(report, series, first, view),
        name_trace(flown, view, names, about),
    ]
    title = f"{escaped(report.name or 'Plan')}: tracks"
    drawn = layout(title, note=_note(report, series, view), inner=view.height_px, **view.axes())
    return {"data": traces, "layout": drawn}


def _map_of(ground: FlightGround) -> FlownMap:
    circles = ground.circles
    orbits = Orbits(
        np.array([one.center_m for one in circles]),
        np.array([one.radius_m for one in circles]),
        np.array([1.0 if one.direction == "ccw" else -1.0 for one in circles]),
        np.array([one.phase_rad for one in circles]),
        2.0 * np.pi / ground.period_s,
    )
    places = np.array([one.position_m for one in ground.landmarks]).reshape(-1, 2)
    return FlownMap(orbits, places, ground)


def _view(flown: FlownMap, series: FlightOverTime, style: figure_style.FigureStyle) -> MapView:
    """View that holds all tracks, up to _FURTHEST beyond the view of the plan."""
    near = view_about(style, [flown])
    room = _FURTHEST * float(np.max(near.high - near.low))
    places = [_places(one, true=True) for track in series.tracks for one in track.vehicles]
    every = np.concatenate(places)
    every = every[np.isfinite(every).all(axis=1)]
    return view_about(style, [flown], points=np.clip(every, near.low - room, near.high + room))


def _places(vehicle: TrackedVehicle, *, true: bool) -> Array:
    """True or estimated positions (t, 2) in m; NaN where the vehicle is lost."""
    x, y = (
        (vehicle.true_x_m, vehicle.true_y_m)
        if true
        else (vehicle.estimated_x_m, vehicle.estimated_y_m)
    )
    return np.array([x, y], dtype=float).T


def _last_turns(series: FlightOverTime, track: FlownTrack) -> list[float]:
    """Time in s at which each vehicle's last turn begins."""
    times = np.array(series.track_time_s)
    known = [np.isfinite(_places(one, true=True)[:, 0]) for one in track.vehicles]
    ends = [float(times[one].max(initial=times[0])) for one in known]
    return [end - series.ground.period_s for end in ends]


def _lines(
    track: FlownTrack,
    series: FlightOverTime,
    turns: list[float],
    view: MapView,
    *,
    true: bool,
    last: bool,
) -> tuple[list[float | None], list[float | None]]:
    """(x, y) of each vehicle's last turn, or of the turns before it, with gaps between vehicles."""
    times = np.array(series.track_time_s)
    lines = []
    for vehicle, begin in zip(track.vehicles, turns, strict=True):
        places = _places(vehicle, true=true)
        split = int(np.searchsorted(times, begin))
        # the earlier part ends where the last turn begins
        part = places[split:] if last else places[: split + 1] if split else places[:0]
        if len(part):
            lines += [part, np.full((1, 2), np.nan)]
    every = np.concatenate([np.empty((0, 2)), *lines])
    return numbers(every[:, 0], view.places - 1), numbers(every[:, 1], view.places - 1)


def _other_trials(tracks: list[FlownTrack], series: FlightOverTime, view: MapView) -> list[Spec]:
    traces = []
    for number, track in enumerate(tracks):
        x, y = _lines(track, series, _last_turns(series, track), view, true=True, last=True)
        line = {"color": figure_style.MUTED, "width": view.line_px(0.7)}
        entry = {"showlegend": not number, "legendgroup": "others"}
        name = "true path, other trials, last turn"
        traces.append(line_trace(f"trial-{track.trial}", name, x, y, line, **entry))
    return traces


def _circles(flown: FlownMap, view: MapView) -> Spec:
    x, y = gapped(circle_points(flown), view.places)
    # drawn over paths that keep to the circles
    line = {"color": figure_style.INK, "dash": "dot", "width": view.line_px(1.2), "simplify": False}
    return line_trace("planned", "planned circle", x, y, line)


def _paths(
    track: FlownTrack, series: FlightOverTime, turns: list[float], view: MapView
) -> list[Spec]:
    """Earlier turns, faint and below, then the last ones."""
    solid = {"color": figure_style.BLUE, "width": view.line_px(2.2)}
    dotted = {"color": figure_style.VERMILLION, "width": view.line_px(2.2), "dash": "dot"}
    traces = []
    for last in (False, True):
        for uid, name, line in (
            ("true", "true path", solid),
            ("estimated", "estimated path", dotted),
        ):
            x, y = _lines(track, series, turns, view, true=uid == "true", last=last)
            if last:
                traces.append(line_trace(uid, f"{name}, last turn", x, y, line))
            elif x:
                thin = {**line, "width": view.line_px(1.0)}
                faint = line_trace(f"{uid}-earlier", f"{name}, earlier", x, y, thin, opacity=_FAINT)
                traces.append(faint)
    return traces


def _ellipses(track: FlownTrack, turns: list[float], view: MapView) -> list[Spec]:
    """Ellipses in the last turns, and outlines of earlier ones."""
    traces = []
    line = {"color": figure_style.ORANGE, "width": 1.0}
    filled = {"fill": "toself", "fillcolor": figure_style.translucent(figure_style.ORANGE, 0.35)}
    name = f"filter's own {SIGMAS:g} sigma"
    for uid, words, last, look in (
        ("ellipses-earlier", f"{name}, earlier", False, {"opacity": 2.0 * _FAINT}),
        ("ellipses", f"{name}, last turn", True, filled),
    ):
        rims = [
            _rim(one)
            for vehicle, begin in zip(track.vehicles, turns, strict=True)
            for one in vehicle.ellipses
            if (one.time_s >= begin) == last
        ]
        if rims:
            x, y = gapped(np.array(rims), view.places)
            traces.append(line_trace(uid, words, x, y, line, **look))
    return traces


def _rim(one: PlaceEllipse) -> Array:
    """Closed outline (_CORNERS + 1, 2) in m of an ellipse."""
    turn = unit(np.linspace(0.0, 2.0 * np.pi, _CORNERS + 1))
    ahead = unit(one.angle_rad)
    across = np.array([-ahead[1], ahead[0]])
    axes = SIGMAS * np.array([one.major_sigma_m * ahead, one.minor_sigma_m * across])
    return np.asarray(np.array(one.center_m) + turn @ axes)


def _moments(
    track: FlownTrack, series: FlightOverTime, turns: list[float], view: MapView
) -> list[Spec]:
    """Marks at the true positions of vehicles at the times of the ellipses."""
    where, said, opacity = [], [], []
    times = np.array(series.track_time_s)
    for vehicle, begin in zip(track.vehicles, turns, strict=True):
        places = _places(vehicle, true=True)
        for one in vehicle.ellipses:
            opacity.append(1.0 if one.time_s >= begin else _FAINT)
            place = places[int(np.argmin(np.abs(times - one.time_s)))]
            off = np.hypot(*(place - one.center_m))
            where.append(place)
            said.append(
                f"{escaped(vehicle.name)} at {one.time_s:.4g} s<br>{off:.2g} m from its estimate, "
                f"sigmas {one.major_sigma_m:.2g} and {one.minor_sigma_m:.2g} m"
            )
    if not where:
        return []
    x, y = np.array(where).T
    dot_px = round(float(np.clip(0.1 * view.scale * view.least_radius, 1.5, 5.0)), 1)
    return [
        mark_trace(
            "moments",
            "true place at that moment",
            numbers(x, view.places),
            numbers(y, view.places),
            {"symbol": "circle", "size": dot_px, "color": figure_style.INK, "opacity": opacity},
            "%{text}<extra></extra>",
            text=said,
        )
    ]


def _ends(
    report: FlightDocument, series: FlightOverTime, track: FlownTrack, view: MapView
) -> list[Spec]:
    """Marks where vehicles were lost or held, and at lost landmarks."""
    times = np.array(series.track_time_s)
    spots = {one.name: np.array([one.position_m]) for one in series.ground.landmarks}
    spots.update({one.name: _places(one, true=True) for one in track.vehicles})
    traces = []
    for kind, symbol, name in (("loss", "x", "lost here"), ("hold", "square", "held here")):
        found = [one for one in report.events if one.kind == kind and one.subject in spots]
        if not found:
            continue
        where = []
        for one in found:
            places = spots[one.subject]
            known = np.flatnonzero(np.isfinite(places[:, 0]))
            before = np.searchsorted(times[known], one.begin_s + 1e-6) - 1 if len(known) > 1 else 0
            where.append(places[known[max(before, 0)]])
        x, y = np.array(where).T
        marker = {"symbol": symbol, "size": view.mark_px(12.0), "color": figure_style.VERMILLION}
        marker["line"] = {"color": figure_style.INK, "width": 1}
        traces.append(
            mark_trace(
                kind,
                name,
                numbers(x, view.places),
                numbers(y, view.places),
                marker,
                "%{text}<extra></extra>",
                text=[escaped(one.what) for one in found],
            )
        )
    return traces


def _note(report: FlightDocument, series: FlightOverTime, view: MapView) -> str:
    first = series.tracks[0].trial
    note = f"trial {first + 1} of {report.run}; guidance {report.guidance}"
    places = [_places(one, true=True) for one in series.tracks[0].vehicles]
    if any(np.any((place < view.low) | (place > view.high)) for place in places):
        note += "; tracks leave the map"
    said = event_words(report)
    return f"{note}; {said}" if said else note
