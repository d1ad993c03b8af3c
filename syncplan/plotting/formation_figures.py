"""Figures of the formation at time 0, and of one period, animated.

The first shows circles, senses, poses, links by worth and unobservable motions; the second shows
positions and sightings at each moment.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.unobservable_modes import UnobservableMode
from syncplan.orbits.circles import position, unit
from syncplan.orbits.contacts import Windows
from syncplan.planning.judged_team import UnmetLink
from syncplan.planning.plans import Plan
from syncplan.plotting import canvas, maps
from syncplan.plotting.figure_style import INK, PURPLE, FigureStyle
from syncplan.plotting.links import (
    DROPPED,
    Standing,
    body_names,
    grouped,
    hover,
    link_ends,
    link_pairs,
)
from syncplan.plotting.map_labels import landmark_trace, name_trace, obstructions

MOTIONS_SHOWN = 3
"""Unobservable motions drawn at first; the legend switches the others on."""


_ARROW = 0.9
_LEAST_ARROW = 0.05
"""Length of a motion's longest arrow in mean radii, and at least as a share of the map's extent."""

_HEAD_PX = 15.0
_SHORT_PX = 9.0
_MARK_PX = 7.0
"""Length of a link's line below which a mark shows it, and the size of marks."""

_MOTION_DASHES = ("solid", "dash", "dot")


def formation_spec(plan: Plan, style: FigureStyle) -> canvas.Spec:
    """Return the figure of a plan's formation at time 0, both axes to one scale.

    Links run from rim to rim, styled by their worth. An unobservable motion is an arrow at each
    vehicle that it displaces, the longest 0.9 mean radii long (more on a large map).
    Hover texts give the turns.
    """
    view = maps.view_of(style, plan)
    names = body_names(plan)
    about = obstructions(plan, link_pairs(plan), _arrow_lines(plan, view))
    traces = [
        *maps.area_traces(plan, view),
        *_link_traces(plan, names, view),
        *maps.circle_traces(plan, view, arrows=True),
        *landmark_trace(plan, view, names, about),
        maps.pointer_entry("vehicles", "vehicle at time 0", maps.VEHICLE_PX),
        _vehicle_trace(plan, names, view),
        name_trace(plan, view, names, about),
        *_motion_traces(plan, names, view),
    ]
    title = canvas.escaped(plan.scenario.name or "Formation")
    drawn = canvas.layout(title, note=verdict_words(plan), inner=view.height_px, **view.axes())
    return {"data": traces, "layout": drawn}


def verdict_words(plan: Plan) -> str:
    """Return one line on whether the plan is observable, with rank and certificate."""
    verdict = plan.observability
    state = "observable" if verdict.observable else "NOT observable"
    holds = "holds" if plan.certificate.holds else "does not hold"
    return f"{state}: rank {verdict.rank} of {verdict.state_dim}; certificate {holds}"


def _vehicle_trace(plan: Plan, names: list[str], view: maps.MapView) -> canvas.Spec:
    orbits = plan.orbits
    turns = ["counter-clockwise" if sense > 0.0 else "clockwise" for sense in orbits.senses]
    texts = [
        f"{names[k]}, {turns[k]}<br>radius {orbits.radii[k]:.4g} m, "
        f"{orbits.speeds[k]:.4g} m/s<br>phase {orbits.phases[k]:.4f} rad"
        for k in range(orbits.count)
    ]
    return {
        "type": "scatter",
        "uid": "vehicles",
        "legendgroup": "vehicles",
        "showlegend": False,
        "mode": "markers",
        **maps.vehicle_marks(plan, view, 0.0, view.places),
        "text": texts,
        "hoverinfo": "text",
    }


def _link_traces(plan: Plan, names: list[str], view: maps.MapView) -> list[canvas.Spec]:
    traces = []
    for shown, meetings in _by_worth(plan):
        texts = [hover(item, names, shown) for item in meetings]
        traces.append(_pair_trace(plan, meetings, texts, shown, view))
    if plan.dropped_links:
        texts = [
            f"{names[item.a]}-{names[item.b]}, dropped<br>{canvas.escaped(item.reason)}"
            for item in plan.dropped_links
        ]
        traces.append(_pair_trace(plan, plan.dropped_links, texts, DROPPED, view))
    return traces


def _by_worth(plan: Plan) -> list[tuple[Standing, list[LinkVerdict]]]:
    """Links by their worth for observability, in the order drawn."""
    return sorted(grouped(plan).items(), key=lambda item: item[0].key)


def _pair_trace(
    plan: Plan,
    links: Sequence[LinkVerdict | UnmetLink],
    texts: list[str],
    shown: Standing,
    view: maps.MapView,
) -> canvas.Spec:
    """Lines from rim to rim, with a middle point for hover texts and the mark of their kind.

    Short lines have a mark in any case. Large teams have none.
    """
    pairs = np.array([(item.a, item.b) for item in links])
    start, end = link_ends(plan.orbits, plan.landmarks, pairs)
    x, y = canvas.gapped(np.stack([start, 0.5 * (start + end), end], axis=1), view.places)
    text = [""] * len(x)
    text[1::4] = texts
    lengths = view.scale * np.hypot(*(end - start).T)
    marked = (lengths < _SHORT_PX) | bool(shown.mark)
    sizes = [0.0] * len(x)
    sizes[1::4] = [_MARK_PX if one and not view.many else 0.0 for one in marked]
    line = {"color": shown.color, "dash": shown.dash, "width": view.link_px(shown.width)}
    marks: canvas.Spec = {}
    if any(sizes):
        marker: canvas.Spec = {"symbol": shown.mark or "diamond", "size": sizes}
        marker |= {
            "color": shown.color,
            "opacity": 1,
            "line": {"width": 2 if shown.mark.endswith("open") else 0},
        }
        marks = {"mode": "lines+markers", "marker": marker}
    return canvas.line_trace(
        shown.key,
        shown.text,
        x,
        y,
        line,
        text=text,
        hoverinfo="text",
        hovertemplate="%{text}<extra></extra>",
        **marks,
    )


def _motion_traces(plan: Plan, names: list[str], view: maps.MapView) -> list[canvas.Spec]:
    """Arrows of each motion, and a legend entry without arrowheads, which have no room there."""
    traces = []
    for number, motion in enumerate(plan.unobservable):
        dash = _MOTION_DASHES[number % len(_MOTION_DASHES)]
        line = {"color": PURPLE, "dash": dash, "width": 3.5}
        shared = {
            "legendgroup": f"motion-{number}",
            "visible": True if number < MOTIONS_SHOWN else "legendonly",
        }
        text = canvas.label(f"unobservable: {motion.description}")
        traces.append(canvas.line_trace(f"entry-{number}", text, [None], [None], line, **shared))
        traces.append(
            {
                "type": "scatter",
                "uid": f"motion-{number}",
                "mode": "lines+markers",
                **_arrows(plan, motion, names, view),
                "line": line,
                "hovertemplate": "%{text}<extra></extra>",
                "showlegend": False,
                **shared,
            }
        )
    return traces


def _arrows(
    plan: Plan, motion: UnobservableMode, names: list[str], view: maps.MapView
) -> canvas.Spec:
    """Coordinates of a motion's arrows, with their heads and hover texts."""
    head = view.mark_px(_HEAD_PX)
    x: list[float | None] = []
    y: list[float | None] = []
    sizes: list[float] = []
    angles: list[float] = []
    text: list[str] = []
    for k, path, ahead in _arrow_paths(plan, motion, view):
        one_x, one_y = canvas.gapped(path[None], view.places)
        x, y = x + one_x, y + one_y
        plain = len(path) - 1
        sizes += [0] * plain + [head, 0]
        angles += [0.0] * plain + canvas.compass(np.arctan2(ahead[1], ahead[0])) + [0.0]
        text += [_motion_words(motion, names[k], k)] * (plain + 1) + [""]
    marker = {"symbol": "arrow", "size": sizes, "angle": angles, "color": PURPLE}
    return {"x": x, "y": y, "marker": {**marker, "opacity": 1, "line": {"width": 0}}, "text": text}


def _arrow_paths(
    plan: Plan, motion: UnobservableMode, view: maps.MapView
) -> Iterator[tuple[int, Array, Array]]:
    """Yield each vehicle that moves, its arrow's line (p, 2) in m and the direction of its head."""
    radius = float(plan.orbits.radii.mean())
    length = max(_ARROW * radius, _LEAST_ARROW * float(np.max(view.high - view.low)))
    where = position(plan.orbits, 0.0)
    shifts = np.hypot(motion.motion[:, 0], motion.motion[:, 1])
    for k in motion.vehicles:
        if shifts[k] > 1e-3:
            ahead = motion.motion[k, :2]
            yield k, where[k] + length * np.array([[0.0, 0.0], ahead]), ahead
        else:
            path = _turning_arc(where[k], radius / 3.0, float(motion.motion[k, 2]))
            yield k, path, path[-1] - path[-2]


def _arrow_lines(plan: Plan, view: maps.MapView) -> Array:
    """Line segments (k, 2, 2) in m of all arrows that are drawn at first."""
    lines = [
        np.stack([path[:-1], path[1:]], axis=1)
        for motion in plan.unobservable[:MOTIONS_SHOWN]
        for _, path, _ in _arrow_paths(plan, motion, view)
    ]
    return np.concatenate([np.empty((0, 2, 2)), *lines])


def _motion_words(motion: UnobservableMode, name: str, k: int) -> str:
    east, north, turn = motion.motion[k]
    shift = np.hypot(motion.motion[:, 0], motion.motion[:, 1])[k]
    return (
        f"{name} may move unseen: {shift:.2f} toward ({east:.2f}, {north:.2f}), turning "
        f"{turn:.4f} rad<br>{canvas.label(motion.description)}"
    )


def _turning_arc(place: Array, radius: float, turn: float) -> Array:
    """Three quarters of a small circle about a place, in the sense of `turn`: (p, 2) m."""
    angles = np.linspace(0.0, 1.5 * np.pi, 13) * np.sign(turn or 1.0)
    return np.asarray(place + radius * unit(angles))


# --- one period ---------------------------------------------------------------------------------


FRAMES = (12, 60)
"""Fewest and most frames that show one period."""

FRAME_MS = 100

_HEAD_AT = 0.68
"""Position of the arrowhead on a sight line: past the middle, to keep both ways apart."""


def animation_spec(plan: Plan, style: FigureStyle) -> canvas.Spec:
    """Return the figure of one period in steps, with buttons and a slider.

    Large teams have fewer steps, and no arrowheads. A line joins a vehicle and each target in
    contact at that moment, in the style that the formation gives a link of that worth; its
    arrowhead points at the target.
    """
    view = maps.view_of(style, plan)
    names = body_names(plan)
    about = obstructions(plan, np.empty((0, 2), dtype=int))
    still = [
        *maps.area_traces(plan, view),
        *maps.circle_traces(plan, view, arrows=False),
        *landmark_trace(plan, view, names, about),
        name_trace(plan, view, names, about),
        *(
            []
            if view.many
            else [maps.pointer_entry("directions", "direction of sight", maps.HEAD_PX)]
        ),
        maps.pointer_entry("vehicles", "vehicle", maps.VEHICLE_PX),
    ]
    frames = int(np.clip(FRAMES[1] * maps.MANY_VEHICLES // plan.orbits.count, *FRAMES))
    times = np.arange(frames) * plan.orbits.period / frames
    kinds = _by_worth(plan)
    kind_of = np.full((len(names), len(names)), -1)
    for kind, (_, meetings) in enumerate(kinds):
        for item in meetings:
            kind_of[item.a, item.b] = kind_of[item.b, item.a] = kind
    moving = [_moving_traces(plan, kind_of, len(kinds), float(time), view) for time in times]
    looks = _looks([shown for shown, _ in kinds], names, view)
    first = [{**trace, **look} for trace, look in zip(moving[0], looks, strict=True)]
    index = [len(still) + k for k in range(len(first))]
    steps = [{"name": str(k), "data": traces, "traces": index} for k, traces in enumerate(moving)]
    title = f"{canvas.escaped(plan.scenario.name or 'Formation')}: one period"
    heads = "" if view.many else "; arrowheads point at what is seen"
    note = f"{plan.orbits.period:.4g} s in {frames} steps{heads}"
    drawn = canvas.layout(title, note=note, inner=view.height_px, **view.axes(), **_controls(times))
    return {"data": [*still, *first], "layout": drawn, "frames": steps}


def live(windows: Windows, period: float, time: float) -> tuple[Index, Index]:
    """Return (observers, targets) in contact at `time` s, edges of windows included."""
    pair = np.repeat(np.arange(len(windows.observers)), np.diff(windows.first))
    now = (time - windows.starts) % period <= windows.ends - windows.starts
    return windows.observers[pair[now]], windows.targets[pair[now]]


def _moving_traces(
    plan: Plan, kind_of: Index, kinds: int, time: float, view: maps.MapView
) -> list[canvas.Spec]:
    """Traces that change from frame to frame: sight lines of each kind, their heads, the vehicles.

    `kind_of` (b, b) is the kind of each pair of bodies, symmetric; -1 for pairs that never meet.
    """
    orbits, places = plan.orbits, view.places - 1
    bodies = np.concatenate([position(orbits, time), plan.landmarks.reshape(-1, 2)])
    observers, targets = live(plan.windows, orbits.period, time)
    headed = slice(0 if view.many else None)
    # one line for two that see each other
    pairs = np.unique(np.sort(np.column_stack([observers, targets]), axis=1), axis=0)
    worth = kind_of[pairs[:, 0], pairs[:, 1]]
    away = (bodies[targets] - bodies[observers])[headed]
    heads = bodies[observers[headed]] + _HEAD_AT * away
    return [
        *(_segments(bodies[pairs[worth == kind]], places) for kind in range(kinds)),
        {
            "x": canvas.numbers(heads[:, 0], places) or [None],
            "y": canvas.numbers(heads[:, 1], places) or [None],
            "marker": maps.pointer(
                view, maps.HEAD_PX, canvas.compass(np.arctan2(away[:, 1], away[:, 0])), INK
            ),
        },
        maps.vehicle_marks(plan, view, time, places),
    ]


def _segments(ends: Array, places: int) -> canvas.Spec:
    # the legend entry of an empty trace would come and go
    x, y = canvas.gapped(ends.reshape(-1, 2, 2), places)
    return {"x": x or [None], "y": y or [None]}


def _looks(kinds: list[Standing], names: list[str], view: maps.MapView) -> list[canvas.Spec]:
    """Style of the moving traces, whose coordinates come with each frame."""

    def marks(group: str, **more: Any) -> canvas.Spec:
        shared = {"uid": group, "legendgroup": group, "showlegend": False}
        return {"type": "scatter", "mode": "markers", **shared, **more}

    looks: list[canvas.Spec] = []
    for kind in kinds:
        line = {"color": kind.color, "dash": kind.dash, "width": view.link_px(kind.width)}
        shared = {"type": "scatter", "mode": "lines", "hoverinfo": "skip"}
        shown = {"uid": f"sight-{kind.key}", "name": f"in contact: {kind.text}", "line": line}
        looks.append({**shared, **shown})
    hovered = "%{text}<br>%{x} m, %{y} m<extra></extra>"
    heads = marks("directions", hoverinfo="skip")
    return [*looks, heads, marks("vehicles", text=names, hovertemplate=hovered)]


def _controls(times: Array) -> canvas.Spec:
    """Play, pause and a slider, below the map."""
    turn = {"frame": {"duration": FRAME_MS, "redraw": True}, "transition": {"duration": 0}}
    at_once = {"frame": {"duration": 0, "redraw": True}, "transition": {"duration": 0}}
    now = {"mode": "immediate"}
    play = [None, {**turn, "fromcurrent": True, **now}]
    buttons = [
        {"label": "Play", "method": "animate", "args": play},
        {"label": "Pause", "method": "animate", "args": [[None], {**at_once, **now}]},
    ]
    steps = [
        {"label": f"{time:.4g}", "method": "animate", "args": [[str(k)], {**at_once, **now}]}
        for k, time in enumerate(times)
    ]
    place = {"x": 0, "y": 0, "xanchor": "left", "yanchor": "top"}
    menu = {"type": "buttons", "direction": "left", "showactive": False, "pad": {"t": 66, "r": 10}}
    shown = {"pad": {"t": 56}, "currentvalue": {"prefix": "time ", "suffix": " s"}}
    return {
        "updatemenus": [{**place, **menu, "buttons": buttons}],
        "sliders": [{**place, "x": 0.2, "len": 0.8, **shown, "steps": steps}],
    }
