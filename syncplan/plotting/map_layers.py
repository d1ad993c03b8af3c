"""What maps of a formation share: axes to one scale, circles with their senses, landmarks."""

from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import unit
from syncplan.planning.judged_plan import Plan
from syncplan.plotting.canvas import Spec, axis, compass, gapped, numbers
from syncplan.plotting.palette import BLUE, INK, ORANGE

__all__ = [
    "circle_points",
    "circle_traces",
    "landmark_traces",
    "line_trace",
    "map_axes",
    "map_height",
    "mark_px",
    "name_trace",
    "view_box",
]

CIRCLE_POINTS = 72
"""Points of a circle; the chord is a thousandth of the radius inside it."""

MAP_WIDTH_PX = 880
MAP_HEIGHTS_PX = (240, 640)

_SENSE_STYLES = (
    (1.0, "ccw", "counter-clockwise circle", BLUE, "solid"),
    (-1.0, "cw", "clockwise circle", ORANGE, "dash"),
)


def view_box(plan: Plan) -> tuple[Array, Array]:
    """Return the corners (2,), (2,) in m of what is to be seen: circles, landmarks, area."""
    orbits = plan.orbits
    points = [
        orbits.centers - orbits.radii[:, None],
        orbits.centers + orbits.radii[:, None],
        plan.landmarks.reshape(-1, 2),
    ]
    if plan.scenario.area_m is not None:
        points.append(np.array(plan.scenario.area_m, dtype=float))
    everything = np.concatenate(points)
    low, high = everything.min(axis=0), everything.max(axis=0)
    room = 0.06 * float(np.max(high - low))
    return low - room, high + room


def map_axes(plan: Plan) -> Spec:
    """Return the two axes of a map, to one scale, with room around the formation."""
    low, high = view_box(plan)
    return {
        "xaxis": axis("x (east), m", range=numbers([low[0], high[0]], 6), constrain="domain"),
        "yaxis": axis(
            "y (north), m",
            range=numbers([low[1], high[1]], 6),
            scaleanchor="x",
            scaleratio=1,
            constrain="domain",
        ),
    }


def map_height(plan: Plan) -> int:
    """Return the height in px that a map wants where it is some MAP_WIDTH_PX wide."""
    low, high = view_box(plan)
    wide, tall = (high - low).tolist()
    return int(np.clip(MAP_WIDTH_PX * tall / wide, *MAP_HEIGHTS_PX))


def mark_px(plan: Plan, largest: float) -> float:
    """Return the size in px of a mark that suits the circles of a map, at most `largest`."""
    low, high = view_box(plan)
    radius_px = MAP_WIDTH_PX * float(plan.orbits.radii.min()) / float(np.max(high - low))
    return round(float(np.clip(0.45 * radius_px, 5.0, largest)), 1)


def circle_points(plan: Plan) -> Array:
    """Return (n, CIRCLE_POINTS + 1, 2) m: each circle from phase 0, closed."""
    turn = unit(np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS + 1))
    orbits = plan.orbits
    return np.asarray(orbits.centers[:, None] + orbits.radii[:, None, None] * turn)


def circle_traces(plan: Plan, places: int, *, arrows: bool) -> list[Spec]:
    """Return the circles, a trace for each sense; `arrows` adds heads that show the sense."""
    points = circle_points(plan)
    traces: list[Spec] = []
    for sense, key, name, color, dash in _SENSE_STYLES:
        chosen = plan.orbits.senses == sense
        if not chosen.any():
            continue
        x, y = gapped(points[chosen], places)
        line = {"color": color, "dash": dash, "width": 1.8, "simplify": False}
        traces.append(line_trace(f"circles-{key}", name, x, y, line, legendgroup=key))
        if arrows:
            traces.append(_sense_heads(plan, chosen, key, color, places))
    return traces


def landmark_traces(plan: Plan, names: list[str], places: int) -> list[Spec]:
    """Return the landmarks with their names, if there are any."""
    if not len(plan.landmarks):
        return []
    return [
        {
            "type": "scatter",
            "uid": "landmarks",
            "name": "landmark",
            "mode": "markers+text",
            "x": numbers(plan.landmarks[:, 0], places),
            "y": numbers(plan.landmarks[:, 1], places),
            "text": names[plan.orbits.count :],
            "textposition": "top center",
            "marker": {"symbol": "star", "size": 13, "color": INK},
            "hovertemplate": "%{text}<br>%{x} m, %{y} m<extra></extra>",
        }
    ]


def name_trace(plan: Plan, names: list[str], places: int) -> Spec:
    """Return the names at the centres; vehicles that share one share a label."""
    shared: dict[tuple[float, float], list[str]] = {}
    for k, center in enumerate(np.round(plan.orbits.centers, places).tolist()):
        shared.setdefault((center[0], center[1]), []).append(names[k])
    return {
        "type": "scatter",
        "uid": "names",
        "mode": "text",
        "x": [x for x, _ in shared],
        "y": [y for _, y in shared],
        "text": [", ".join(who) for who in shared.values()],
        "textfont": {"size": 13 if plan.orbits.count <= 24 else 10},
        "showlegend": False,
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


def _sense_heads(plan: Plan, chosen: Array, key: str, color: str, places: int) -> Spec:
    """A head on each circle opposite the vehicle, pointing the way it flies round."""
    orbits = plan.orbits
    across = orbits.phases + np.pi
    where = (orbits.centers + orbits.radii[:, None] * unit(across))[chosen]
    ahead = (across + orbits.senses * np.pi / 2.0)[chosen]
    return {
        "type": "scatter",
        "uid": f"heads-{key}",
        "mode": "markers",
        "x": numbers(where[:, 0], places),
        "y": numbers(where[:, 1], places),
        "marker": {
            "symbol": "arrow",
            "size": mark_px(plan, 9),
            "angle": compass(ahead),
            "color": color,
        },
        "legendgroup": key,
        "showlegend": False,
        "hoverinfo": "skip",
    }
