"""The contact timeline: a bar for each directed sighting, and what their union joins below."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.observability.certificate import DISTINCT_LANDMARKS
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.graphs import disjoint_sets
from syncplan.planning.judged_plan import Plan
from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers, panel_title
from syncplan.plotting.link_styles import Standing, body_names, grouped, hover
from syncplan.plotting.palette import BLUE, INK, PURPLE

__all__ = ["Row", "rows_of", "timeline_spec", "union_growth", "within_period"]


@dataclass(frozen=True, slots=True)
class Row:
    """One directed sighting: who sees whom, when in s (k, 2), as part of which meeting."""

    observer: int
    target: int
    windows: Array
    meeting: LinkVerdict
    shown: Standing


ROW_PX = 19
NARROW_ROW_PX = 11
MANY_ROWS = 60
UNION_PX = 170


def timeline_spec(plan: Plan) -> Spec:
    """Return the figure of all sightings over [0, T), with the growth of their union below.

    A window that passes T goes on from 0.
    """
    names = body_names(plan)
    rows = rows_of(plan)
    row_px = ROW_PX if len(rows) <= MANY_ROWS else NARROW_ROW_PX
    bars_px = max(row_px * len(rows), 60)
    gap_px = 90
    inner = bars_px + gap_px + UNION_PX
    kinds = len({row.shown for row in rows}) + 3
    bottom = 70 + 13 * kinds
    split = UNION_PX / inner
    period = plan.orbits.period
    longest = max(period, plan.connectivity_period or 0.0)
    title = f"{escaped(plan.scenario.name or 'Plan')}: who sees whom, when"
    drawn = layout(
        title,
        note=_note(plan),
        height=90 + inner + bottom,
        barmode="overlay",
        xaxis=axis("time within a period, s", range=[0, period], domain=[0, 1], anchor="y"),
        yaxis=axis(
            domain=[1.0 - bars_px / inner, 1],
            range=[len(rows) - 0.5, -0.5],
            tickmode="array",
            tickvals=list(range(len(rows))),
            ticktext=[f"{names[row.observer]} → {names[row.target]}" for row in rows],
            tickfont={"size": 12 if row_px == ROW_PX else 8},
            ticks="",
        ),
        xaxis2=axis("watched from time 0 for, s", range=[0, longest], anchor="y2"),
        yaxis2=axis("number", domain=[0, split], rangemode="tozero", anchor="x2"),
        annotations=[panel_title("What the union of the sightings joins", 0, split)],
    )
    drawn["margin"]["t"] += 14
    drawn["margin"]["b"] = bottom
    return {"data": [*_bars(plan, rows, names), *_union_traces(plan)], "layout": drawn}


def rows_of(plan: Plan) -> list[Row]:
    """Return the directed sightings: links, incidental links, landmarks, each both ways."""
    return [
        Row(observer, target, windows, meeting, shown)
        for shown, meetings in grouped(plan).items()
        for meeting in meetings
        for observer, target, windows in (
            (meeting.a, meeting.b, meeting.forward),
            (meeting.b, meeting.a, meeting.backward),
        )
        if len(windows)
    ]


def within_period(windows: Array, period: float) -> list[tuple[float, float]]:
    """Return (k, 2) windows in s cut at the period, so that each lies in [0, period]."""
    cut = []
    for start, end in windows.tolist():
        cut.append((start, min(end, period)))
        if end > period:
            cut.append((0.0, min(end - period, start)))
    return cut


def union_growth(plan: Plan) -> tuple[Array, Array, Array]:
    """Return (times, groups, held) of the union of sightings from time 0 on, a step at each time.

    `groups` counts the components of vehicles joined so far, `held` the vehicles in components
    that have seen two distinct landmarks. Sightings count as they begin, whatever their rank.
    """
    count = plan.orbits.count
    merged = disjoint_sets(count)
    seen: dict[int, set[int]] = {k: set() for k in range(count)}
    size = dict.fromkeys(range(count), 1)
    steps: list[tuple[float, int, int]] = [(0.0, count, 0)]
    groups, held = count, 0
    for time, a, b in _beginnings(plan):
        parts = {merged[a]} if b >= count else {merged[a], merged[b]}
        if b < count and len(parts) == 1:
            continue
        before = sum(size[part] for part in parts if _distinct(plan, seen[part]))
        known = set().union(*(seen[part] for part in parts))
        whole = sum(size[part] for part in parts)
        if b >= count:
            known.add(b - count)
        else:
            merged.union(a, b)
            groups -= 1
        seen[merged[a]], size[merged[a]] = known, whole
        held += (whole if _distinct(plan, known) else 0) - before
        if (groups, held) != steps[-1][1:]:
            steps = steps[:-1] if steps[-1][0] == time else steps
            steps.append((time, groups, held))
    times, left, found = np.array(steps).T
    return times, left, found


def _beginnings(plan: Plan) -> Iterable[tuple[float, int, int]]:
    """(time, observer, target) at which each pair is first in contact, in order of time."""
    windows, period = plan.windows, plan.orbits.period
    first = []
    for k in np.flatnonzero(np.diff(windows.first)):
        of = windows.of(int(k))
        begin = 0.0 if (of[:, 1] >= period).any() else float(of[:, 0].min())
        first.append((begin, int(windows.observers[k]), int(windows.targets[k])))
    return sorted(first)


def _distinct(plan: Plan, landmarks: set[int]) -> bool:
    places = plan.landmarks[sorted(landmarks)]
    apart = places[:, None] - places[None]
    limit = DISTINCT_LANDMARKS * float(plan.orbits.radii.mean())
    return bool((np.hypot(apart[..., 0], apart[..., 1]) > limit).any())


def _note(plan: Plan) -> str:
    length = plan.connectivity_period
    if length is None:
        return f"period {plan.orbits.period:.4g} s; no window of two periods certifies the team"
    return (
        f"period {plan.orbits.period:.4g} s; any {length:.4g} s of sightings certify the team "
        "(connectivity period)"
    )


def _bars(plan: Plan, rows: list[Row], names: list[str]) -> list[Spec]:
    """One trace for each kind of link, so that the legend distinguishes them."""
    traces = []
    for shown in dict.fromkeys(row.shown for row in rows):
        base, length, at, text = [], [], [], []
        for number, row in enumerate(rows):
            if row.shown != shown:
                continue
            words = hover(row.meeting, names, shown)
            for start, end in within_period(row.windows, plan.orbits.period):
                base.append(start)
                length.append(end - start)
                at.append(number)
                text.append(f"{start:.4g} to {end:.4g} s<br>{words}")
        marker = {"color": shown.color, "line": {"color": INK, "width": 0.6}}
        if shown.pattern:
            marker["pattern"] = {"shape": shown.pattern, "fillmode": "replace", "size": 6}
        traces.append(
            {
                "type": "bar",
                "uid": f"bars-{shown.key}",
                "name": shown.text,
                "orientation": "h",
                "base": numbers(base, 6),
                "x": numbers(length, 6),
                "y": at,
                "width": 0.66,
                "marker": marker,
                "hovertext": text,
                "hoverinfo": "text",
                "textposition": "none",
            }
        )
    return traces


def _union_traces(plan: Plan) -> list[Spec]:
    times, groups, held = union_growth(plan)
    longest = max(plan.orbits.period, plan.connectivity_period or 0.0)
    at = numbers(np.append(times, longest), 6)
    shared = {"type": "scatter", "mode": "lines", "xaxis": "x2", "yaxis": "y2"}
    traces: list[Spec] = [
        {
            **shared,
            "uid": "groups",
            "name": "groups of vehicles not yet joined to each other",
            "x": at,
            "y": numbers(np.append(groups, groups[-1])),
            "line": {"shape": "hv", "color": BLUE, "width": 2.5},
        },
        {
            **shared,
            "uid": "held",
            "name": "vehicles in groups that have seen two landmarks",
            "x": at,
            "y": numbers(np.append(held, held[-1])),
            "line": {"shape": "hv", "color": PURPLE, "width": 2.5, "dash": "dash"},
        },
    ]
    if plan.connectivity_period is not None:
        end = plan.connectivity_period
        traces.append(
            {
                **shared,
                "uid": "connectivity-period",
                "name": f"connectivity period, {end:.4g} s",
                "x": [end, end],
                "y": [0, plan.orbits.count],
                "line": {"color": INK, "width": 1.5, "dash": "dot"},
            }
        )
    return traces
