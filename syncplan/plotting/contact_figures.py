"""Figures of contacts over a period, and of the observability matrix's singular values.

The timeline has a bar for each contact window; a panel below shows what the union of the sightings
joins. A row is a directed sighting (v1 sees v2). For teams with more than MANY_SIGHTINGS of these,
a row is a vehicle, and simultaneous sightings stand in lanes of its row. At most MOST_ROWS vehicles
have a row: those with the least contact.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.observability.rank import DISTINCT_LANDMARKS
from syncplan.observability.sliding_windows import SEARCHED_PERIODS
from syncplan.observability.spectrum import RANK_TOLERANCE
from syncplan.orbits.graphs import DisjointSets
from syncplan.planning.plans import Plan
from syncplan.plotting import canvas
from syncplan.plotting.figure_style import BLUE, INK, MUTED, PURPLE, VERMILLION, FigureStyle
from syncplan.plotting.formation_figures import verdict_words
from syncplan.plotting.links import Standing, body_names, grouped, hover


@dataclass(frozen=True, slots=True)
class Row:
    """A directed sighting, its windows (k, 2) in s, and the meeting that it is part of."""

    observer: int
    target: int
    windows: Array
    meeting: LinkVerdict
    shown: Standing


MANY_SIGHTINGS = 60
"""Largest number of directed sightings for which each has a row of its own."""

MOST_ROWS = 200
"""Most vehicles that have a row."""

ROW_PX = 19
VEHICLE_ROW_PX = 14
BARS_PX = (60, 1600)
"""Heights of a row, and least and largest height of all rows together."""

_LABEL_PX = 12
_LABEL_FONT_PX = 11
_UNION_PX = 170
_GAP_PX = 84
_BAR = 0.72
"""Share of a row that its bars fill."""


@dataclass(frozen=True, slots=True)
class Lane:
    """A window as drawn: row, middle and width in rows, start and end in s, and its sighting."""

    row: int
    at: float
    width: float
    start: float
    end: float
    sighting: Row


def timeline_spec(plan: Plan, style: FigureStyle) -> canvas.Spec:
    """Return the figure of all sightings over [0, T), with the growth of their union below.

    A window that passes T continues from 0.
    """
    names = body_names(plan)
    lanes, labels = lanes_of(plan, names)
    row_px = style.px(ROW_PX if len(rows_of(plan)) <= MANY_SIGHTINGS else VEHICLE_ROW_PX)
    bars_px = min(max(row_px * len(labels), BARS_PX[0]), BARS_PX[1])
    inner = bars_px + style.px(_GAP_PX) + _UNION_PX
    # label each row or, where labels have no room, every k-th
    every = max(1, -(-style.px(_LABEL_PX) * len(labels) // bars_px))
    split = _UNION_PX / inner
    period = plan.orbits.period
    longest = max(period, plan.connectivity_period or 0.0)
    title = f"{canvas.escaped(plan.scenario.name or 'Plan')}: who sees whom, when"
    drawn = canvas.layout(
        title,
        note=_note(plan, labels),
        inner=inner,
        above=12,
        barmode="overlay",
        xaxis=canvas.axis("time within a period, s", range=[0, period], domain=[0, 1], anchor="y"),
        yaxis=canvas.axis(
            domain=[1.0 - bars_px / inner, 1],
            range=[len(labels) - 0.5, -0.5],
            tickmode="array",
            tickvals=list(range(0, len(labels), every)),
            ticktext=labels[::every],
            tickfont={"size": _LABEL_FONT_PX},
            ticks="",
        ),
        xaxis2=canvas.axis("watched from time 0 for, s", range=[0, longest], anchor="y2"),
        yaxis2=canvas.axis("number", domain=[0, split], rangemode="tozero", anchor="x2"),
        annotations=[canvas.panel_title("What the union of the sightings joins", 0, split)],
    )
    return {"data": [*_bars(lanes, names), *_union_traces(plan)], "layout": drawn}


def lanes_of(plan: Plan, names: list[str]) -> tuple[list[Lane], list[str]]:
    """Return all windows with their places in rows, and the rows' labels; `names` are escaped.

    Windows of one row that overlap in time stand in separate lanes. Of more than MOST_ROWS
    vehicles, those with the least contact have rows.
    """
    sightings, period = rows_of(plan), plan.orbits.period
    if len(sightings) <= MANY_SIGHTINGS:
        row_of = {id(one): k for k, one in enumerate(sightings)}
        labels = [f"{names[one.observer]} sees {names[one.target]}" for one in sightings]
    else:
        contact: dict[int, float] = {}
        for one in sightings:
            length = float(np.diff(one.windows).sum())
            contact[one.observer] = contact.get(one.observer, 0.0) + length
        observers = sorted(sorted(contact, key=lambda k: (contact[k], k))[:MOST_ROWS])
        row_at = {observer: row for row, observer in enumerate(observers)}
        sightings = [one for one in sightings if one.observer in row_at]
        row_of = {id(one): row_at[one.observer] for one in sightings}
        labels = [names[k] for k in observers]
    of_row: dict[int, list[tuple[float, float, Row]]] = {}
    for one in sightings:
        windows = within_period(one.windows, period)
        of_row.setdefault(row_of[id(one)], []).extend((*window, one) for window in windows)
    return [lane for row, drawn in of_row.items() for lane in _laid_out(row, drawn)], labels


def _laid_out(row: int, windows: list[tuple[float, float, Row]]) -> list[Lane]:
    """Place each window of a row in the first lane that is free when it begins."""
    busy: list[float] = []
    lanes = []
    ordered = sorted(windows, key=lambda window: window[:2])
    for start, end, _ in ordered:
        lane = next((k for k, until in enumerate(busy) if until <= start), len(busy))
        busy[lane : lane + 1] = [end]
        lanes.append(lane)
    width = _BAR / max(len(busy), 1)
    return [
        Lane(row, row + (lane + 0.5) * width - 0.5 * _BAR, width, start, end, sighting)
        for lane, (start, end, sighting) in zip(lanes, ordered, strict=True)
    ]


def rows_of(plan: Plan) -> list[Row]:
    """Return the directed sightings of links, incidental links and landmark links, both ways."""
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
    """Return (times, groups, held): the growth of the union of sightings from time 0, in steps.

    `groups` counts the components that vehicles form so far, `held` the vehicles in components
    that have seen two distinct landmarks. A sighting counts once it begins, whatever its rank.
    """
    count = plan.orbits.count
    merged = DisjointSets(count)
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
    """Time of first contact, observer and target of each pair, in order of time."""
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


def _note(plan: Plan, rows: list[str]) -> str:
    length, windows = plan.connectivity_period, plan.windows
    seeing = len(np.unique(windows.observers[np.diff(windows.first) > 0]))
    note = f"period {plan.orbits.period:.4g} s; "
    if length is None:
        short = plan.scenario.duration_s < SEARCHED_PERIODS * plan.orbits.period
        note += (
            "windows within the run do not all certify the team"
            if short
            else "no window of two periods certifies the team"
        )
    else:
        note += f"any {length:.4g} s of sightings certify the team (connectivity period)"
    if len(rows) == MOST_ROWS and seeing > MOST_ROWS:
        note += f"; rows are the {MOST_ROWS} of {seeing} vehicles with the least contact"
    return note


def _bars(lanes: list[Lane], names: list[str]) -> list[canvas.Spec]:
    """One trace of bars for each kind of link, so that the legend distinguishes them."""
    traces = []
    for shown in dict.fromkeys(lane.sighting.shown for lane in lanes):
        drawn = [lane for lane in lanes if lane.sighting.shown == shown]
        traces.append(
            canvas.row_bars(
                f"bars-{shown.key}",
                shown.text,
                canvas.numbers([lane.at for lane in drawn], 4),
                canvas.numbers([lane.end - lane.start for lane in drawn], 6),
                canvas.bar_marker(shown.color, shown.pattern, edge_px=0.6),
                base=canvas.numbers([lane.start for lane in drawn], 6),
                width=canvas.numbers([lane.width for lane in drawn], 4),
                hovertext=[_window_words(lane, names) for lane in drawn],
                hoverinfo="text",
                textposition="none",
            )
        )
    return traces


def _window_words(lane: Lane, names: list[str]) -> str:
    one = lane.sighting
    who = f"{names[one.observer]} sees {names[one.target]}"
    words = hover(one.meeting, names, one.shown)
    return f"{who}, {lane.start:.4g} to {lane.end:.4g} s<br>{words}"


def _union_traces(plan: Plan) -> list[canvas.Spec]:
    times, groups, held = union_growth(plan)
    longest = max(plan.orbits.period, plan.connectivity_period or 0.0)
    at = canvas.numbers(np.append(times, longest), 6)

    def line(uid: str, name: str, x: list[Any], y: list[Any], look: canvas.Spec) -> canvas.Spec:
        shared = {"type": "scatter", "mode": "lines", "xaxis": "x2", "yaxis": "y2"}
        return {**shared, "uid": uid, "name": name, "x": x, "y": y, "line": look}

    joined, seen = (canvas.numbers(np.append(values, values[-1])) for values in (groups, held))
    name = "groups of vehicles not yet joined to each other"
    look: canvas.Spec = {"shape": "hv", "color": BLUE, "width": 2.5}
    traces = [line("groups", name, at, joined, look)]
    name = "vehicles in groups that have seen two landmarks"
    look = {"shape": "hv", "color": PURPLE, "width": 2.5, "dash": "dash"}
    traces.append(line("held", name, at, seen, look))
    end = plan.connectivity_period
    if end is not None:
        name, look = (
            f"connectivity period, {end:.4g} s",
            {"color": INK, "width": 1.5, "dash": "dot"},
        )
        traces.append(line("connectivity-period", name, [end, end], [0, plan.orbits.count], look))
    return traces


# --- singular values ----------------------------------------------------------------------------


_FLOOR = 1e-18
"""Smallest value drawn, as a share of the largest singular value."""


def spectrum_spec(plan: Plan) -> canvas.Spec:
    """Return the figure of the singular values in descending order, on a logarithmic axis."""
    verdict = plan.observability
    values, rank = verdict.singular_values, verdict.rank
    largest = float(values[0]) or 1.0
    # of large teams, values between the extremes are unknown
    order = 1 + np.flatnonzero(np.isfinite(values))
    values, rank = values[order - 1], int(np.sum(order <= rank))
    drawn = np.maximum(values, _FLOOR * largest)
    limit = RANK_TOLERANCE * largest
    width = [0.5, verdict.state_dim + 0.5]
    traces = [
        _points(order[:rank], drawn[:rank], values[:rank], "counts for the rank", "circle", BLUE),
        canvas.line_trace(
            "tolerance",
            "tolerance, 1e-8 of the largest",
            width,
            [limit, limit],
            {"color": MUTED, "dash": "dash", "width": 1.5},
        ),
    ]
    if rank < len(values):
        rest = slice(rank, None)
        name = "does not count: unobservable"
        traces.insert(1, _points(order[rest], drawn[rest], values[rest], name, "x", VERMILLION))
    title = f"{canvas.escaped(plan.scenario.name or 'Plan')}: singular values"
    low = min(float(drawn[-1]), limit) / 3.0
    shown = canvas.layout(
        title,
        note=f"{verdict_words(plan)}; positions in mean radii",
        inner=320,
        xaxis=canvas.axis("number, largest first", range=width),
        yaxis=canvas.axis(
            "singular value",
            type="log",
            exponentformat="e",
            range=canvas.numbers(np.log10([low, 3.0 * largest]), 4),
        ),
        annotations=[_gap(order, rank, drawn, verdict.gap, limit)],
    )
    return {"data": traces, "layout": shown}


def _points(
    order: np.ndarray, drawn: np.ndarray, values: np.ndarray, name: str, symbol: str, color: str
) -> canvas.Spec:
    marker = {"symbol": symbol, "size": 9, "color": color, "line": {"color": INK, "width": 0}}
    said, x, y = "%{x}: %{text}<extra></extra>", order.tolist(), canvas.numbers(drawn)
    text = [f"{value:.3e}" for value in values]
    return canvas.mark_trace(f"values-{symbol}", name, x, y, marker, said, text=text)


def _gap(order: Index, rank: int, drawn: np.ndarray, gap: float, limit: float) -> canvas.Spec:
    """Annotation in the gap between the last value that counts and the first that does not.

    It stands in the larger part of the gap, away from the line of the tolerance. At full rank, it
    compares the smallest value with the tolerance.
    """
    high = float(drawn[max(rank, 1) - 1])
    if rank < len(drawn):
        size = f"a factor of {gap:.1e}" if np.isfinite(gap) else "all: the rest is zero"
        text, low, at = f"gap: {size}", float(drawn[rank]), float(order[rank]) - 0.5
        edges = np.log10([low, min(max(limit, low), high), high])
        parts = [edges[:2], edges[1:]]
        middle = float(np.mean(max(parts, key=lambda part: float(part[1] - part[0]))))
    else:
        last = float(drawn[-1])
        text, at = f"smallest is {last / limit:.1e}<br>times the tolerance", int(order[-1])
        middle = float(np.log10(np.sqrt(limit * high)))
    return {
        "text": text,
        "x": at,
        "y": round(middle, 4),
        "xanchor": "right",
        "showarrow": False,
        "font": {"size": 13},
    }
