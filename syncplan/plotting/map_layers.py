"""Layers of maps of a formation: areas, circles with their senses, vehicles."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import heading, position, unit
from syncplan.plotting.canvas import Spec, compass, gapped, numbers
from syncplan.plotting.map_subject import Mapped
from syncplan.plotting.map_view import MapView
from syncplan.plotting.palette import BLUE, INK, MUTED, ORANGE, translucent

CIRCLE_POINTS = 72
"""Points of a circle; the chord is a thousandth of the radius inside it."""

VEHICLE_PX = 15.0
HEAD_PX = 10.0

_SENSE_STYLES = (
    (1.0, "ccw", "counter-clockwise circle", BLUE, "solid"),
    (-1.0, "cw", "clockwise circle", ORANGE, "dash"),
)


def circle_points(plan: Mapped) -> Array:
    """Return (n, CIRCLE_POINTS + 1, 2) m: each circle from phase 0, closed."""
    turn = unit(np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS + 1))
    orbits = plan.orbits
    return np.asarray(orbits.centers[:, None] + orbits.radii[:, None, None] * turn)


def circle_traces(plan: Mapped, view: MapView, *, arrows: bool) -> list[Spec]:
    """Return the circles, a trace for each sense; `arrows` adds heads that show the sense."""
    points = circle_points(plan)
    traces: list[Spec] = []
    for sense, key, name, color, dash in _SENSE_STYLES:
        chosen = plan.orbits.senses == sense
        if not chosen.any():
            continue
        x, y = gapped(points[chosen], view.places)
        line = {"color": color, "dash": dash, "width": view.line_px(1.8), "simplify": False}
        traces.append(line_trace(f"circles-{key}", name, x, y, line, legendgroup=key))
        if arrows:
            heads = sense_heads(plan, view, color, chosen)
            traces.append({**heads, "uid": f"heads-{key}", "legendgroup": key})
    return traces


def area_traces(plan: Mapped, view: MapView) -> list[Spec]:
    """Return the area, the keep-out zones and the obstacles, where the scenario has any."""
    scenario = plan.scenario
    traces = []
    if scenario.area_m is not None:
        x, y = gapped(_closed(scenario.area_m), view.places)
        line = {"color": MUTED, "dash": "dot", "width": 1.5}
        traces.append(line_trace("area", "area", x, y, line))
    # what blocks sight as well as paths is drawn as both, the obstacle on top
    for uid, name, polygons, opacity, line in (
        ("keep-out", "keep-out zone", scenario.keep_out_m, 0.25, {"color": MUTED, "width": 1}),
        ("obstacle", "obstacle to sight", scenario.obstacles_m, 0.6, {"color": INK, "width": 2}),
    ):
        drawn = [gapped(_closed(polygon), view.places) for polygon in polygons or []]
        if drawn:
            x = [value for one, _ in drawn for value in one]
            y = [value for _, one in drawn for value in one]
            filled = {"fill": "toself", "fillcolor": translucent(MUTED, opacity)}
            traces.append(line_trace(uid, name, x, y, line, **filled))
    return traces


def vehicle_marks(plan: Mapped, view: MapView, time: float, places: int) -> Spec:
    """Return places, rounded, and arrows of the vehicles at a time in s."""
    where = position(plan.orbits, time)
    return {
        "x": numbers(where[:, 0], places),
        "y": numbers(where[:, 1], places),
        "marker": pointer(view, VEHICLE_PX, compass(heading(plan.orbits, time)), INK),
    }


def pointer(view: MapView, largest: float, angles: Any, color: str) -> Spec:
    """Return a marker: an arrow whose tip is the point, turned by Plotly's `angles`."""
    return {
        "symbol": "arrow",
        "size": view.mark_px(largest),
        "angle": angles,
        "color": color,
    }


def pointer_entry(group: str, name: str, size: float) -> Spec:
    """Return the legend's entry of a trace of pointers, upright and on the line of its words."""
    return {
        "type": "scatter",
        "mode": "markers",
        "uid": f"{group}-entry",
        "name": name,
        "legendgroup": group,
        "x": [None],
        "y": [None],
        "marker": {
            "symbol": "triangle-up",
            "size": 0.8 * size,
            "color": INK,
        },
        "hoverinfo": "skip",
    }


def line_trace(uid: str, name: str, x: Any, y: Any, line: Spec, **more: Any) -> Spec:
    """Return a trace of lines that says nothing when pointed at, unless `more` makes it."""
    return {
        "type": "scatter",
        "uid": uid,
        "name": name,
        "mode": "lines",
        "x": x,
        "y": y,
        "line": line,
        "hoverinfo": "skip",
        **more,
    }


def sense_heads(plan: Mapped, view: MapView, color: str, chosen: Array) -> Spec:
    """Return a head on each chosen circle opposite the vehicle, pointing the way it flies round."""
    orbits = plan.orbits
    across = orbits.phases + np.pi
    where = (orbits.centers + orbits.radii[:, None] * unit(across))[chosen]
    ahead = (across + orbits.senses * np.pi / 2.0)[chosen]
    return {
        "type": "scatter",
        "mode": "markers",
        "x": numbers(where[:, 0], view.places),
        "y": numbers(where[:, 1], view.places),
        "marker": pointer(view, HEAD_PX, compass(ahead), color),
        "showlegend": False,
        "hoverinfo": "skip",
    }


def _closed(polygon: Sequence[tuple[float, float]]) -> Array:
    return np.array([[*polygon, polygon[0]]], dtype=float)
