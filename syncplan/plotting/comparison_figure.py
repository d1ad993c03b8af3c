"""Figures that compare two plans of the same vehicles, or a plan before and after refinement."""

from collections.abc import Sequence

import numpy as np

from syncplan.errors import InputError
from syncplan.phrases import Places, listed, metres
from syncplan.planning.plans import Plan
from syncplan.plotting import canvas
from syncplan.plotting.accuracy_figures import bars
from syncplan.plotting.figure_style import BLUE, MUTED, ORANGE, FigureStyle
from syncplan.plotting.links import body_names
from syncplan.plotting.map_labels import Obstructions, landmark_trace, name_trace
from syncplan.plotting.maps import (
    MapView,
    area_traces,
    circle_points,
    sense_heads,
    view_of,
)
from syncplan.reports.refinement_report import FiguresOfMerit, RefinementResult
from syncplan.scenario.objectives import DISTANCES, OBJECTIVES, ROWS, FigureOfMerit

_BARS_PX = 170
_GAP_PX = 84
_NAMED = 6
"""Largest number of vehicles that a note names."""

_SIDES = (("before", ORANGE, "/"), ("after", BLUE, ""))
"""Names, colours and patterns of the bars."""

_CAPTION_LENGTH = 22

_ROW_PX = 44
_WITH_VALUE = 1.2
"""Axis that leaves room for the value at the longest bar, in lengths of that bar."""
_STANDING_GAP, _LYING_GAP = 0.1, 0.2
"""Height of a row of horizontal bars in px, and gaps between errors and distances."""


def refinement_spec(record: RefinementResult, name: str, style: FigureStyle) -> canvas.Spec:
    """Return the figure of a refinement: figures of merit in m before and after.

    Errors and distances have an axis each. In a narrow figure bars are horizontal, as captions do
    not fit side by side.
    """
    objective = OBJECTIVES.get(record.objective)
    aim = canvas.escaped(record.objective) if objective is None else objective.title
    title = f"{canvas.escaped(name or 'Plan')}: refinement for {aim}"
    known = [row for row in ROWS if row.unit == "m" and _merits(record, [row]) != [None] * 2]
    panels = {
        "error, m": [row for row in known if row not in DISTANCES],
        "distance, m": [row for row in known if row in DISTANCES],
    }
    panels = {unit: rows for unit, rows in panels.items() if rows}
    if not panels:
        return canvas.message(title, "no figure of merit in metres is known of either plan")
    note = f"{_summary(record.before)} before; {_summary(record.after)} after"
    if not record.improved:
        note = f"not refined: {canvas.escaped(record.reason)}"
    along, up = ("y", "x") if style.narrow else ("x", "y")
    gap = _LYING_GAP if style.narrow else _STANDING_GAP
    each = (1.0 - gap * (len(panels) - 1)) / len(known)
    traces: list[canvas.Spec] = []
    axes: canvas.Spec = {}
    begin = 0.0
    for number, (unit, rows) in enumerate(panels.items()):
        suffix = "2" if number else ""
        end = begin + each * len(rows)
        domain = [1.0 - end, 1.0 - begin] if style.narrow else [begin, end]
        captions: canvas.Spec = {"domain": canvas.numbers(domain, 6), "anchor": f"{up}{suffix}"}
        if style.narrow:
            captions["autorange"] = "reversed"
        values = [0.0, *(value for value in _merits(record, rows) if value)]
        ends = _WITH_VALUE * np.array([min(values), max(values) or 1.0])
        metres: canvas.Spec = {"range": canvas.numbers(ends, 6), "nticks": 6}
        axes[f"{along}axis{suffix}"] = canvas.axis(type="category", **captions)
        axes[f"{up}axis{suffix}"] = canvas.axis(unit, anchor=f"{along}{suffix}", **metres)
        traces += _merit_bars(record, rows, suffix, lying=style.narrow)
        begin = end + gap
    inner = style.px(_ROW_PX) * len(known) + style.px(_GAP_PX) if style.narrow else 310
    drawn = canvas.layout(title, note=note, inner=inner, barmode="group", **axes)
    return {"data": traces, "layout": drawn}


def _merits(record: RefinementResult, rows: Sequence[FigureOfMerit]) -> list[float | None]:
    """Values before, then after, of figures of merit; None where unknown."""
    return [getattr(figures, row.key) for figures in (record.before, record.after) for row in rows]


def _merit_bars(
    record: RefinementResult, rows: Sequence[FigureOfMerit], suffix: str, *, lying: bool
) -> list[canvas.Spec]:
    """Bars of figures of merit before and after, on the axes of a suffix."""
    labels = [canvas.label(row.caption.replace("\n", " "), _CAPTION_LENGTH) for row in rows]
    values = _merits(record, rows)
    traces = []
    for number, (side, color, pattern) in enumerate(_SIDES):
        own = values[number * len(rows) :][: len(rows)]
        trace = bars(f"{side}{suffix}", side, labels, own, color, pattern)
        trace["text"] = ["none" if value is None else metres(value, 3) for value in own]
        trace |= {"textposition": "outside", "cliponaxis": False, "legendgroup": side}
        trace |= {"showlegend": not suffix, "xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}
        if lying:
            turned = {"x": trace["y"], "y": trace["x"], "orientation": "h"}
            trace.update(turned, hovertemplate="%{y}: %{x:.3g} m<extra></extra>")
        traces.append(trace)
    return traces


def comparison_spec(before: Plan, after: Plan, style: FigureStyle) -> canvas.Spec:
    """Return the figure of two plans of the same vehicles: circles and predicted errors.

    Arrowheads on the circles show the senses; a thin line joins a vehicle's two centres. Raises
    InputError if the plans' vehicles differ.
    """
    _refuse_other_vehicles(before, after)
    view, names = view_of(style, before, after), body_names(after)
    moves = np.stack([before.orbits.centers, after.orbits.centers], axis=1)
    x, y = canvas.gapped(moves, view.places)
    line = {"color": MUTED, "width": 1.0, "dash": "dot"}
    traces = [
        *area_traces(after, view),
        canvas.line_trace("moves", "move of the centre", x, y, line),
    ]
    traces += _circles(before, "before", ORANGE, "dash", view)
    traces += _circles(after, "after", BLUE, "solid", view)
    both = (before.orbits, after.orbits)
    centers = np.concatenate([orbits.centers for orbits in both])
    about = Obstructions(moves, centers, np.concatenate([orbits.radii for orbits in both]))
    traces += landmark_trace(after, view, names, about)
    traces.append({**name_trace(after, view, names, about), "legendgroup": "after"})
    traces += _errors(before, after)
    inner = view.height_px + style.px(_GAP_PX) + _BARS_PX
    share = _BARS_PX / inner
    axes = view.axes()
    axes["yaxis"]["domain"] = [1.0 - view.height_px / inner, 1]
    drawn = canvas.layout(
        f"{canvas.escaped(after.scenario.name or 'Plan')}: before and after",
        note=f"{_verdict(before)} before; {_verdict(after)} after; {_turned(before, after)}",
        inner=inner,
        barmode="group",
        **axes,
        xaxis2=canvas.axis("vehicle", type="category", anchor="y2"),
        yaxis2=canvas.axis("predicted RMS, m", rangemode="tozero", domain=[0, share], anchor="x2"),
        annotations=[
            canvas.panel_title("Predicted position error, second half of the run", 0, share)
        ],
    )
    return {"data": traces, "layout": drawn}


def _turned(before: Plan, after: Plan) -> str:
    """Phrase that names the vehicles that change direction."""
    other = np.flatnonzero(before.orbits.senses != after.orbits.senses)
    names = [canvas.escaped(after.scenario.vehicle_names[k]) for k in other]
    if not names:
        return "all keep their direction"
    verb = "changes" if len(names) == 1 else "change"
    return f"{listed(names, _NAMED)} {verb} direction"


def _refuse_other_vehicles(before: Plan, after: Plan) -> None:
    names, others = before.scenario.vehicle_names, after.scenario.vehicle_names
    if names != others:
        raise InputError(
            f"its vehicles {', '.join(others[:6])} are not those of the plan before it, "
            f"{', '.join(names[:6])}; both must name the same, in the same order",
            key="compare",
        )


def _errors(before: Plan, after: Plan) -> list[canvas.Spec]:
    """Bars of each vehicle's predicted error, if both plans have one."""
    found = [plan.prediction.rms for plan in (before, after)]
    if any(rms is None for rms in found):
        return []
    shown = [canvas.escaped(name) for name in before.scenario.vehicle_names]
    traces = []
    for (side, color, pattern), rms in zip(_SIDES, found, strict=True):
        trace = bars(f"{side}-rms", f"error {side}", shown, np.asarray(rms), color, pattern)
        traces.append({**trace, "xaxis": "x2", "yaxis": "y2"})
    return traces


def _circles(plan: Plan, side: str, color: str, dash: str, view: MapView) -> list[canvas.Spec]:
    """Circles, each with an arrowhead that shows its sense, and their centres."""
    x, y = canvas.gapped(circle_points(plan), view.places)
    centers = plan.orbits.centers
    line = {"color": color, "dash": dash, "width": view.line_px(2.0), "simplify": False}
    everyone = np.ones(plan.orbits.count, dtype=bool)
    turns = ["counter-clockwise" if sense > 0.0 else "clockwise" for sense in plan.orbits.senses]
    names = [canvas.escaped(name) for name in plan.scenario.vehicle_names]
    words = map(Places(centers, plan.orbits.radii).words, centers)
    texts = [
        f"{name} {side}, {turn}: {place} m"
        for name, turn, place in zip(names, turns, words, strict=True)
    ]
    symbol = "circle" if side == "after" else "circle-open"
    shown = {"type": "scatter", "uid": f"centers-{side}", "mode": "markers"}
    return [
        canvas.line_trace(f"circles-{side}", f"circles {side}", x, y, line, legendgroup=side),
        {**sense_heads(plan, view, color, everyone), "uid": f"heads-{side}", "legendgroup": side},
        {
            **shown,
            "x": canvas.numbers(centers[:, 0], view.places),
            "y": canvas.numbers(centers[:, 1], view.places),
            "text": texts,
            "marker": {"symbol": symbol, "size": view.mark_px(5.0), "color": color},
            "hovertemplate": "%{text}<extra></extra>",
            "legendgroup": side,
            "showlegend": False,
        },
    ]


def _summary(figures: FiguresOfMerit) -> str:
    """Rank and, if known, log determinant, in words."""
    logdet = figures.model_dump()[OBJECTIVES["logdet"].key]
    return f"rank {figures.rank}" + ("" if logdet is None else f", log det {logdet:.4g}")


def _verdict(plan: Plan) -> str:
    verdict = plan.observability
    return f"rank {verdict.rank} of {verdict.state_dim}"
