"""One period, animated: where everybody is, and who sees whom at that moment."""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import position
from syncplan.orbits.contacts import Windows
from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import Spec, compass, escaped, gapped, layout, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.link_styles import Standing, body_names, grouped
from syncplan.plotting.map_labels import landmark_trace, name_trace, obstructions
from syncplan.plotting.map_layers import (
    HEAD_PX,
    VEHICLE_PX,
    area_traces,
    circle_traces,
    pointer,
    pointer_entry,
    vehicle_marks,
)
from syncplan.plotting.map_view import MapView, view_of
from syncplan.plotting.palette import INK

FRAMES = 60
"""Moments shown of one period."""

FRAME_MS = 100

_HEAD_AT = 0.68
"""Where on a sight line its arrowhead lies: past the middle, which keeps both ways apart."""


def animation_spec(plan: Plan, style: FigureStyle, frames: int = FRAMES) -> Spec:
    """Return the figure of one period in `frames` steps, with buttons and a slider.

    A line joins a vehicle and what it sees at that moment, in the look that the formation gives a
    link of that worth; its arrowhead points at what is seen.
    """
    view = view_of(style, plan)
    names = body_names(plan)
    about = obstructions(plan, np.empty((0, 2), dtype=int))
    still = [
        *area_traces(plan, view),
        *circle_traces(plan, view, arrows=False),
        *landmark_trace(plan, view, names, about),
        name_trace(plan, view, names, about),
        pointer_entry("directions", "direction of sight", HEAD_PX),
        pointer_entry("vehicles", "vehicle", VEHICLE_PX),
    ]
    times = np.arange(frames) * plan.orbits.period / frames
    kinds, kind_of = _kinds(plan)
    moving = [_moving_traces(plan, kind_of, len(kinds), float(time), view) for time in times]
    first = moving[0]
    for trace, more in zip(first, _looks(kinds, names, view), strict=True):
        trace.update(more)
    index = [len(still) + k for k in range(len(first))]
    steps = [{"name": str(k), "data": traces, "traces": index} for k, traces in enumerate(moving)]
    steps[0] = {**steps[0], "data": _moving_traces(plan, kind_of, len(kinds), 0.0, view)}
    title = f"{escaped(plan.scenario.name or 'Formation')}: one period"
    note = f"{plan.orbits.period:.4g} s in {frames} steps; arrowheads point at what is seen"
    drawn = layout(title, note=note, inner=view.height_px, **view.axes(), **_controls(times))
    return {"data": [*still, *first], "layout": drawn, "frames": steps}


def live(windows: Windows, period: float, time: float) -> tuple[Index, Index]:
    """Return (observers, targets) of the sightings in contact at `time` s, windows' edges in."""
    pair = np.repeat(np.arange(len(windows.observers)), np.diff(windows.first))
    now = (time - windows.starts) % period <= windows.ends - windows.starts
    return windows.observers[pair[now]], windows.targets[pair[now]]


def _kinds(plan: Plan) -> tuple[list[Standing], Index]:
    """What links are worth, in the formation's order, and which it is of each pair of bodies.

    The latter is (b, b), symmetric; -1 for pairs that never meet.
    """
    ordered = sorted(grouped(plan).items(), key=lambda item: item[0].key)
    count = plan.orbits.count + len(plan.landmarks)
    kind_of = np.full((count, count), -1)
    for kind, (_, meetings) in enumerate(ordered):
        for item in meetings:
            kind_of[item.a, item.b] = kind_of[item.b, item.a] = kind
    return [shown for shown, _ in ordered], kind_of


def _moving_traces(
    plan: Plan, kind_of: Index, kinds: int, time: float, view: MapView
) -> list[Spec]:
    """What changes from frame to frame: sight lines of each kind, their heads, the vehicles."""
    orbits, places = plan.orbits, view.places - 1
    bodies = np.concatenate([position(orbits, time), plan.landmarks.reshape(-1, 2)])
    observers, targets = live(plan.windows, orbits.period, time)
    # two that see each other are joined once
    pairs = np.unique(np.sort(np.column_stack([observers, targets]), axis=1), axis=0)
    worth = kind_of[pairs[:, 0], pairs[:, 1]]
    away = bodies[targets] - bodies[observers]
    heads = bodies[observers] + _HEAD_AT * away
    return [
        *(_segments(bodies[pairs[worth == kind]], places) for kind in range(kinds)),
        {
            "x": numbers(heads[:, 0], places) or [None],
            "y": numbers(heads[:, 1], places) or [None],
            "marker": pointer(view, HEAD_PX, compass(np.arctan2(away[:, 1], away[:, 0])), INK),
        },
        vehicle_marks(plan, view, time, places),
    ]


def _segments(ends: Array, places: int) -> Spec:
    # of a trace with nothing in it, the legend's entry would come and go
    x, y = gapped(ends.reshape(-1, 2, 2), places)
    return {"x": x or [None], "y": y or [None]}


def _looks(kinds: list[Standing], names: list[str], view: MapView) -> list[Spec]:
    """How the moving traces look; their places come with each frame."""
    return [
        *(
            {
                "type": "scatter",
                "mode": "lines",
                "hoverinfo": "skip",
                "uid": f"sight-{kind.key}",
                "name": f"in contact: {kind.text}",
                "line": {
                    "color": kind.color,
                    "dash": kind.dash,
                    "width": view.link_px(kind.width),
                },
            }
            for kind in kinds
        ),
        {
            "type": "scatter",
            "mode": "markers",
            "uid": "directions",
            "legendgroup": "directions",
            "showlegend": False,
            "hoverinfo": "skip",
        },
        {
            "type": "scatter",
            "mode": "markers",
            "uid": "vehicles",
            "legendgroup": "vehicles",
            "showlegend": False,
            "text": names,
            "hovertemplate": "%{text}<br>%{x} m, %{y} m<extra></extra>",
        },
    ]


def _controls(times: Array) -> Spec:
    """Play, pause and a slider, below the map."""
    turn = {"frame": {"duration": FRAME_MS, "redraw": True}, "transition": {"duration": 0}}
    at_once = {"frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    now = {"mode": "immediate"}
    buttons = [
        {
            "label": "Play",
            "method": "animate",
            "args": [None, {**turn, "fromcurrent": True, **now}],
        },
        {"label": "Pause", "method": "animate", "args": [[None], {**at_once, **now}]},
    ]
    steps = [
        {"label": f"{time:.4g}", "method": "animate", "args": [[str(k)], {**at_once, **now}]}
        for k, time in enumerate(times)
    ]
    place = {"x": 0, "y": 0, "xanchor": "left", "yanchor": "top"}
    return {
        "updatemenus": [
            {
                **place,
                "type": "buttons",
                "direction": "left",
                "showactive": False,
                "pad": {"t": 66, "r": 10},
                "buttons": buttons,
            }
        ],
        "sliders": [
            {
                **place,
                "x": 0.2,
                "len": 0.8,
                "pad": {"t": 56},
                "currentvalue": {"prefix": "time ", "suffix": " s"},
                "steps": steps,
            }
        ],
    }
