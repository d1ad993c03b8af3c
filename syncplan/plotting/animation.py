"""One period, animated: where everybody is, and who sees whom at that moment."""

import numpy as np
from numpy.typing import NDArray

from syncplan.contacts import Windows
from syncplan.orbits import heading, position
from syncplan.planner import Plan
from syncplan.plotting.canvas import (
    Array,
    Spec,
    compass,
    decimals,
    escaped,
    gapped,
    layout,
    numbers,
)
from syncplan.plotting.maps import (
    circle_traces,
    landmark_traces,
    map_axes,
    map_height,
    mark_px,
    name_trace,
    view_box,
)
from syncplan.plotting.palette import GREEN, INK, PURPLE
from syncplan.plotting.standing import body_names

__all__ = ["FRAMES", "animation_spec", "live"]

Index = NDArray[np.int64]

FRAMES = 60
"""Moments shown of one period."""

FRAME_MS = 100

_HEAD_AT = 0.68
"""Where on a sight line its arrowhead lies: past the middle, so that both ways can be told."""


def animation_spec(plan: Plan, frames: int = FRAMES) -> Spec:
    """Return the figure of one period in `frames` steps, with buttons and a slider.

    A line joins a vehicle and what it sees at that moment; its arrowhead points at what is seen.
    """
    low, high = view_box(plan)
    places = decimals(float(np.max(high - low))) - 1
    names = body_names(plan)
    still = [
        *circle_traces(plan, places, arrows=False),
        *landmark_traces(plan, names, places),
        name_trace(plan, names, places),
    ]
    times = np.arange(frames) * plan.orbits.period / frames
    moving = [_moving_traces(plan, float(time), places) for time in times]
    first = moving[0]
    for trace, more in zip(first, _looks(names), strict=True):
        trace.update(more)
    index = [len(still) + k for k in range(len(first))]
    steps = [{"name": str(k), "data": traces, "traces": index} for k, traces in enumerate(moving)]
    steps[0] = {**steps[0], "data": _moving_traces(plan, 0.0, places)}
    title = f"{escaped(plan.scenario.name or 'Formation')}: one period"
    note = f"{plan.orbits.period:.4g} s in {frames} steps; arrowheads point at what is seen"
    drawn = layout(
        title, note=note, height=map_height(plan) + 236, **map_axes(plan), **_controls(times)
    )
    drawn["margin"]["b"] = 160
    return {"data": [*still, *first], "layout": drawn, "frames": steps}


def live(windows: Windows, period: float, time: float) -> tuple[Index, Index]:
    """Return (observers, targets) of the sightings in contact at `time` s, windows' edges in."""
    pair = np.repeat(np.arange(len(windows.observers)), np.diff(windows.first))
    now = (time - windows.starts) % period <= windows.ends - windows.starts
    return windows.observers[pair[now]], windows.targets[pair[now]]


def _moving_traces(plan: Plan, time: float, places: int) -> list[Spec]:
    """What changes from frame to frame: sight lines of two kinds, their heads, the vehicles."""
    orbits = plan.orbits
    where = position(orbits, time)
    bodies = np.concatenate([where, plan.landmarks.reshape(-1, 2)])
    observers, targets = live(plan.windows, orbits.period, time)
    between = targets < orbits.count
    both = {(int(a), int(b)) for a, b in zip(observers[between], targets[between], strict=True)}
    pairs = sorted({(min(pair), max(pair)) for pair in both})
    mutual = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    anchored = np.column_stack([observers[~between], targets[~between]])
    start, end = bodies[observers], bodies[targets]
    heads = start + _HEAD_AT * (end - start)
    away = end - start
    return [
        _segments(bodies[mutual], places),
        _segments(bodies[anchored], places),
        {
            "x": numbers(heads[:, 0], places),
            "y": numbers(heads[:, 1], places),
            "marker": {
                "symbol": "arrow",
                "size": mark_px(plan, 9),
                "color": INK,
                "angle": compass(np.arctan2(away[:, 1], away[:, 0])),
            },
        },
        {
            "x": numbers(where[:, 0], places),
            "y": numbers(where[:, 1], places),
            "marker": {
                "symbol": "arrow",
                "size": mark_px(plan, 15),
                "color": INK,
                "angle": compass(heading(orbits, time)),
            },
        },
    ]


def _segments(ends: Array, places: int) -> Spec:
    # of a trace with nothing in it, the legend's entry would come and go
    x, y = gapped(ends.reshape(-1, 2, 2), places)
    return {"x": x or [None], "y": y or [None]}


def _looks(names: list[str]) -> list[Spec]:
    """How the moving traces look; their places come with each frame."""
    line = {"type": "scatter", "mode": "lines", "hoverinfo": "skip"}
    return [
        {
            **line,
            "uid": "sightings",
            "name": "vehicles in contact",
            "line": {"color": GREEN, "width": 2.5},
        },
        {
            **line,
            "uid": "landmark-sightings",
            "name": "sighting of a landmark",
            "line": {"color": PURPLE, "width": 2, "dash": "dash"},
        },
        {
            "type": "scatter",
            "mode": "markers",
            "uid": "directions",
            "name": "direction of sight",
            "hoverinfo": "skip",
        },
        {
            "type": "scatter",
            "mode": "markers",
            "uid": "vehicles",
            "name": "vehicle",
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
                "pad": {"t": 52, "r": 10},
                "buttons": buttons,
            }
        ],
        "sliders": [
            {
                **place,
                "x": 0.2,
                "len": 0.8,
                "pad": {"t": 42},
                "currentvalue": {"prefix": "time ", "suffix": " s"},
                "steps": steps,
            }
        ],
    }
