"""The formation: circles and senses, poses at time 0, links by worth, unobservable motions."""

from collections.abc import Iterator, Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.circles import heading, position, unit
from syncplan.planning.judged_plan import Plan
from syncplan.planning.judged_team import UnmetLink
from syncplan.plotting.canvas import (
    Spec,
    compass,
    decimals,
    escaped,
    gapped,
    label,
    layout,
    numbers,
)
from syncplan.plotting.link_styles import DROPPED, Standing, body_names, grouped, hover
from syncplan.plotting.map_layers import (
    circle_traces,
    landmark_traces,
    line_trace,
    map_axes,
    map_height,
    mark_px,
    name_trace,
    view_box,
)
from syncplan.plotting.palette import INK, MUTED, PURPLE, translucent

__all__ = ["formation_spec", "verdict_words"]


MOTIONS_SHOWN = 3
"""Unobservable motions drawn at first; the others stand in the legend, to be switched on."""


_HIDDEN_ENDS = 0.45
"""Share of a radius near a centre that link lines leave free, for the names."""

_ARROW = 0.9
_LEAST_ARROW = 0.05
"""Length of the longest arrow of a motion in mean radii, and at least in widths of the map."""

_MOTION_DASHES = ("solid", "dash", "dot")


def formation_spec(plan: Plan) -> Spec:
    """Return the figure of a plan's formation at time 0, both axes to one scale.

    Links run between centres, by what they are worth. An unobservable motion is an arrow at each
    vehicle that it displaces, the longest 0.9 mean radii long (more on a large map).
    Turns are shown when pointed at.
    """
    low, high = view_box(plan)
    places = decimals(float(np.max(high - low)))
    names = body_names(plan)
    traces = [
        *_area_traces(plan, places),
        *_link_traces(plan, names, places),
        *circle_traces(plan, places, arrows=True),
        *landmark_traces(plan, names, places),
        _vehicle_trace(plan, names, places),
        name_trace(plan, names, places),
        *_motion_traces(plan, names, places),
    ]
    title = escaped(plan.scenario.name or "Formation")
    entries = sum(trace.get("showlegend", True) for trace in traces)
    below = 70 + 12 * entries
    height = 80 + map_height(plan) + below
    drawn = layout(title, note=verdict_words(plan), height=height, **map_axes(plan))
    drawn["margin"]["b"] = below
    return {"data": traces, "layout": drawn}


def verdict_words(plan: Plan) -> str:
    """Return in a line whether the plan is observable, with rank and certificate."""
    verdict = plan.observability
    state = "observable" if verdict.observable else "NOT observable"
    holds = "holds" if plan.certificate.holds else "does not hold"
    return f"{state}: rank {verdict.rank} of {verdict.state_dim}; certificate {holds}"


def _vehicle_trace(plan: Plan, names: list[str], places: int) -> Spec:
    orbits = plan.orbits
    where = position(orbits, 0.0)
    turns = ["counter-clockwise" if sense > 0.0 else "clockwise" for sense in orbits.senses]
    texts = [
        f"{names[k]}, {turns[k]}<br>radius {orbits.radii[k]:.4g} m, "
        f"{orbits.speeds[k]:.4g} m/s<br>phase {orbits.phases[k]:.4f} rad"
        for k in range(orbits.count)
    ]
    return {
        "type": "scatter",
        "uid": "vehicles",
        "name": "vehicle at time 0",
        "mode": "markers",
        "x": numbers(where[:, 0], places),
        "y": numbers(where[:, 1], places),
        "marker": {
            "symbol": "arrow",
            "size": mark_px(plan, 15),
            "angle": compass(heading(orbits, 0.0)),
            "color": INK,
        },
        "text": texts,
        "hoverinfo": "text",
    }


def _link_traces(plan: Plan, names: list[str], places: int) -> list[Spec]:
    traces = []
    ordered = sorted(grouped(plan).items(), key=lambda item: item[0].key)
    for shown, meetings in ordered:
        pairs = [(item.a, item.b) for item in meetings]
        texts = [hover(item, names, shown) for item in meetings]
        traces.append(_pair_trace(plan, pairs, texts, shown, places))
    if plan.dropped_links:
        texts = [_dropped_words(item, names) for item in plan.dropped_links]
        pairs = [(item.a, item.b) for item in plan.dropped_links]
        traces.append(_pair_trace(plan, pairs, texts, DROPPED, places))
    return traces


def _dropped_words(item: UnmetLink, names: list[str]) -> str:
    return f"{names[item.a]}-{names[item.b]}, dropped<br>{escaped(item.reason)}"


def _pair_trace(
    plan: Plan, pairs: Sequence[tuple[int, int]], texts: list[str], shown: Standing, places: int
) -> Spec:
    """Lines between centres (or to landmarks), with a middle point to be pointed at."""
    index = np.array(pairs)
    bodies = np.concatenate([plan.orbits.centers, plan.landmarks.reshape(-1, 2)])
    radii = np.concatenate([plan.orbits.radii, np.zeros(len(plan.landmarks))])
    start, end = bodies[index[:, 0]], bodies[index[:, 1]]
    apart = np.maximum(np.hypot(*(end - start).T), 1e-9)[:, None]
    ahead = (end - start) / apart
    start = start + ahead * np.minimum(_HIDDEN_ENDS * radii[index[:, :1]], 0.3 * apart)
    end = end - ahead * np.minimum(_HIDDEN_ENDS * radii[index[:, 1:]], 0.3 * apart)
    x, y = gapped(np.stack([start, 0.5 * (start + end), end], axis=1), places)
    text = [""] * len(x)
    text[1::4] = texts
    line = {"color": shown.color, "dash": shown.dash, "width": shown.width}
    return line_trace(
        shown.key,
        shown.text,
        x,
        y,
        line,
        text=text,
        hoverinfo="text",
        hovertemplate="%{text}<extra></extra>",
    )


def _area_traces(plan: Plan, places: int) -> list[Spec]:
    scenario = plan.scenario
    traces = []
    if scenario.area_m is not None:
        x, y = gapped(_closed(scenario.area_m), places)
        traces.append(
            line_trace("area", "area", x, y, {"color": MUTED, "dash": "dot", "width": 1.5})
        )
    kept_out = [gapped(_closed(polygon), places) for polygon in scenario.keep_out_m or []]
    if kept_out:
        x = [value for one, _ in kept_out for value in one]
        y = [value for _, one in kept_out for value in one]
        filled = {"fill": "toself", "fillcolor": translucent(MUTED, 0.25)}
        line = {"color": MUTED, "width": 1}
        traces.append(line_trace("keep-out", "keep-out zone", x, y, line, **filled))
    return traces


def _closed(polygon: Sequence[tuple[float, float]]) -> Array:
    return np.array([[*polygon, polygon[0]]], dtype=float)


def _motion_traces(plan: Plan, names: list[str], places: int) -> list[Spec]:
    return [
        _motion_trace(plan, motion, names, places, number)
        for number, motion in enumerate(plan.unobservable)
    ]


def _motion_trace(
    plan: Plan, motion: UnobservableMode, names: list[str], places: int, number: int
) -> Spec:
    """Arrows at the vehicles that move, to one scale; an arc for one that only turns."""
    return {
        "type": "scatter",
        "uid": f"motion-{number}",
        "name": label(f"unobservable: {motion.description}"),
        "mode": "lines+markers",
        **_arrows(plan, motion, names, places, _MOTION_DASHES[number % len(_MOTION_DASHES)]),
        "hovertemplate": "%{text}<extra></extra>",
        "visible": True if number < MOTIONS_SHOWN else "legendonly",
    }


def _arrows(plan: Plan, motion: UnobservableMode, names: list[str], places: int, dash: str) -> Spec:
    """Lines, their heads, and what each of them says."""
    head = mark_px(plan, 15)
    x: list[float | None] = []
    y: list[float | None] = []
    sizes: list[float] = []
    angles: list[float] = []
    text: list[str] = []
    for k, path, ahead in _arrow_paths(plan, motion):
        one_x, one_y = gapped(path[None], places)
        x, y = x + one_x, y + one_y
        plain = len(path) - 1
        sizes += [0] * plain + [head, 0]
        angles += [0.0] * plain + compass(np.arctan2(ahead[1], ahead[0])) + [0.0]
        text += [_motion_words(motion, names[k], k)] * (plain + 1) + [""]
    return {
        "x": x,
        "y": y,
        "line": {"color": PURPLE, "dash": dash, "width": 3.5},
        "marker": {
            "symbol": "arrow",
            "size": sizes,
            "angle": angles,
            "color": PURPLE,
            "opacity": 1,
            "line": {"width": 0},
        },
        "text": text,
    }


def _arrow_paths(plan: Plan, motion: UnobservableMode) -> Iterator[tuple[int, Array, Array]]:
    """Each vehicle that moves, its line (p, 2) in m, and the direction of its head."""
    radius = float(plan.orbits.radii.mean())
    low, high = view_box(plan)
    length = max(_ARROW * radius, _LEAST_ARROW * float(np.max(high - low)))
    where = position(plan.orbits, 0.0)
    shifts = np.hypot(motion.motion[:, 0], motion.motion[:, 1])
    for k in motion.vehicles:
        if shifts[k] > 1e-3:
            ahead = motion.motion[k, :2]
            yield k, where[k] + length * np.array([[0.0, 0.0], ahead]), ahead
        else:
            path = _turning_arc(where[k], radius / 3.0, float(motion.motion[k, 2]))
            yield k, path, path[-1] - path[-2]


def _motion_words(motion: UnobservableMode, name: str, k: int) -> str:
    east, north, turn = motion.motion[k]
    shift = np.hypot(motion.motion[:, 0], motion.motion[:, 1])[k]
    return (
        f"{name} may move unseen: {shift:.2f} toward ({east:.2f}, {north:.2f}), turning "
        f"{turn:.4f} rad<br>{label(motion.description)}"
    )


def _turning_arc(place: Array, radius: float, turn: float) -> Array:
    """Three quarters of a small circle about a place, the way it turns: (p, 2) m."""
    angles = np.linspace(0.0, 1.5 * np.pi, 13) * np.sign(turn or 1.0)
    return np.asarray(place + radius * unit(angles))
