"""Before and after: two plans of the same vehicles, and the figures of merit of a refinement."""

import numpy as np

from syncplan.errors import InputError
from syncplan.planning.figures_of_merit import ROWS
from syncplan.planning.judged_plan import Plan
from syncplan.plotting.accuracy_figure import bars
from syncplan.plotting.canvas import (
    Spec,
    axis,
    decimals,
    escaped,
    gapped,
    layout,
    message,
    numbers,
    panel_title,
)
from syncplan.plotting.link_styles import body_names
from syncplan.plotting.map_layers import circle_points, landmark_traces, map_height, view_box
from syncplan.plotting.palette import BLUE, INK, MUTED, ORANGE
from syncplan.reports.refinement_schemas import FiguresOfMerit, RefinementResult
from syncplan.scenario.objectives import OBJECTIVES

__all__ = ["comparison_spec", "refinement_spec"]

_BARS_PX = 170
_GAP_PX = 100

_SIDES = (("before", ORANGE, "/"), ("after", BLUE, ""))
"""Names, colours and patterns of the bars."""

_METRES = [row for row in ROWS if row.unit == "m"]


def refinement_spec(record: RefinementResult, name: str = "") -> Spec:
    """Return the figure of a refinement: figures of merit in m before and after."""
    title = f"{escaped(name or 'Plan')}: refinement for {escaped(record.objective)}"
    labels = [row.caption.replace("\n", "<br>") for row in _METRES]
    traces = []
    both = (record.before, record.after)
    for (side, color, pattern), figures in zip(_SIDES, both, strict=True):
        values = [getattr(figures, row.key) for row in _METRES]
        trace = bars(side, side, labels, values, color, pattern)
        trace["text"] = ["none" if value is None else f"{value:.3g}" for value in values]
        trace["textposition"] = "outside"
        trace["cliponaxis"] = False
        traces.append(trace)
    if not any(value is not None for trace in traces for value in trace["y"]):
        return message(title, "no figure of merit in metres is known of either plan")
    note = f"{_summary(record.before)} before; {_summary(record.after)} after"
    if not record.improved:
        note = f"not refined: {escaped(record.reason)}"
    drawn = layout(
        title,
        note=note,
        height=460,
        barmode="group",
        xaxis=axis(type="category"),
        yaxis=axis("m", rangemode="tozero"),
    )
    drawn["margin"]["b"] = 110
    return {"data": traces, "layout": drawn}


def comparison_spec(before: Plan, after: Plan) -> Spec:
    """Return the figure of two plans of the same vehicles: circles, and each predicted error.

    Raises InputError where the plans are of different vehicles.
    """
    _refuse_other_vehicles(before, after)
    low, high = (
        corner(view_box(before)[k], view_box(after)[k])
        for k, corner in enumerate((np.minimum, np.maximum))
    )
    places = decimals(float(np.max(high - low)))
    traces = _circles(before, "before", ORANGE, "dash", places)
    traces += _circles(after, "after", BLUE, "solid", places)
    traces += landmark_traces(after, body_names(after), places)
    traces += _errors(before, after)
    map_px = max(map_height(before), map_height(after))
    inner = map_px + _GAP_PX + _BARS_PX
    share = _BARS_PX / inner
    drawn = layout(
        f"{escaped(after.scenario.name or 'Plan')}: before and after",
        note=f"{_verdict(before)} before; {_verdict(after)} after",
        height=inner + 196,
        barmode="group",
        xaxis=axis("x (east), m", range=numbers([low[0], high[0]], 6), constrain="domain"),
        yaxis=axis(
            "y (north), m",
            range=numbers([low[1], high[1]], 6),
            scaleanchor="x",
            scaleratio=1,
            constrain="domain",
            domain=[1.0 - map_px / inner, 1],
        ),
        xaxis2=axis("vehicle", type="category", anchor="y2"),
        yaxis2=axis("predicted RMS, m", rangemode="tozero", domain=[0, share], anchor="x2"),
        annotations=[panel_title("Predicted position error, second half of the run", 0, share)],
    )
    drawn["margin"]["b"] = 110
    return {"data": traces, "layout": drawn}


def _refuse_other_vehicles(before: Plan, after: Plan) -> None:
    names, others = before.scenario.vehicle_names, after.scenario.vehicle_names
    if names != others:
        raise InputError(
            f"its vehicles {', '.join(others[:6])} are not those of the plan before it, "
            f"{', '.join(names[:6])}; both must name the same, in the same order",
            key="compare",
        )


def _errors(before: Plan, after: Plan) -> list[Spec]:
    """Bars of every vehicle's predicted error, if both plans have them."""
    found = [plan.prediction.rms for plan in (before, after)]
    if any(rms is None for rms in found):
        return []
    shown = [escaped(name) for name in before.scenario.vehicle_names]
    traces = []
    for (side, color, pattern), rms in zip(_SIDES, found, strict=True):
        trace = bars(f"{side}-rms", f"error {side}", shown, np.asarray(rms), color, pattern)
        traces.append({**trace, "xaxis": "x2", "yaxis": "y2"})
    return traces


def _circles(plan: Plan, side: str, color: str, dash: str, places: int) -> list[Spec]:
    x, y = gapped(circle_points(plan), places)
    centers = plan.orbits.centers
    return [
        {
            "type": "scatter",
            "uid": f"circles-{side}",
            "name": f"circles {side}",
            "mode": "lines",
            "x": x,
            "y": y,
            "line": {"color": color, "dash": dash, "width": 2},
            "hoverinfo": "skip",
            "legendgroup": side,
        },
        {
            "type": "scatter",
            "uid": f"centers-{side}",
            "mode": "markers+text" if side == "after" else "markers",
            "x": numbers(centers[:, 0], places),
            "y": numbers(centers[:, 1], places),
            "text": body_names(plan)[: plan.orbits.count],
            "textposition": "top center",
            "marker": {"symbol": "circle" if side == "after" else "circle-open", "color": INK},
            "textfont": {"color": MUTED},
            "hovertemplate": f"%{{text}} {side}: %{{x}} m, %{{y}} m<extra></extra>",
            "legendgroup": side,
            "showlegend": False,
        },
    ]


def _summary(figures: FiguresOfMerit) -> str:
    """The rank, and the information if there is any."""
    logdet = figures.model_dump()[OBJECTIVES["logdet"].key]
    return f"rank {figures.rank}" + ("" if logdet is None else f", log det {logdet:.4g}")


def _verdict(plan: Plan) -> str:
    verdict = plan.observability
    return f"rank {verdict.rank} of {verdict.state_dim}"
