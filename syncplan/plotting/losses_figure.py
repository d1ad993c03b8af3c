"""What losses do to a plan: the worst predicted error after each, and which end observability."""

from syncplan.planning.lost_parts import phrase_of
from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.palette import BLUE, INK, VERMILLION
from syncplan.reports.loss_schemas import RemainingTeam, WhatIfDocument

MOST_BARS = 30
"""Losses shown, the most harmful: more would be too many to read."""

_ROW_PX = 21


def losses_spec(report: WhatIfDocument) -> Spec:
    """Return the figure of the worst predicted error after each loss, the most harmful on top.

    Losses that end observability are hatched; a line marks the plan with nothing lost.
    """
    title = f"{escaped(report.name or 'Plan')}: predicted error after each loss"
    shown = report.losses[:MOST_BARS]
    if not shown or all(one.worst_predicted_rms_m is None for one in shown):
        note = report.baseline.predicted_rms_m.note
        return message(title, note or "no loss was judged")
    ends = [one for one in shown if not one.observable]
    stays = [one for one in shown if one.observable]
    traces = [
        _bars("ends", "not observable", ends, VERMILLION, "/"),
        _bars("stays", "observable", stays, BLUE, ""),
        _baseline(report, shown),
    ]
    drawn = layout(
        title,
        note=_note(report, len(shown)),
        inner=max(_ROW_PX * len(shown), 90),
        barmode="overlay",
        bargap=0.25,
        xaxis=axis("worst predicted RMS error, m", rangemode="tozero"),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=[_label(one) for one in shown],
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _bars(uid: str, name: str, losses: list[RemainingTeam], color: str, pattern: str) -> Spec:
    marker: Spec = {"color": color, "line": {"color": INK, "width": 0.8}}
    if pattern:
        marker["pattern"] = {"shape": pattern, "fillmode": "replace", "size": 6}
    return {
        "type": "bar",
        "orientation": "h",
        "uid": uid,
        "name": name,
        "y": [_label(one) for one in losses],
        "x": numbers([one.worst_predicted_rms_m or 0.0 for one in losses], 6),
        "text": [f"rank {one.rank} of {one.state_dim}" for one in losses],
        "textposition": "none",
        "marker": marker,
        "hovertemplate": "%{y}: %{x:.3g} m, %{text}<extra></extra>",
    }


def _label(one: RemainingTeam) -> str:
    return escaped(" and ".join(phrase_of(name).removeprefix("the ") for name in one.lost))


def _note(report: WhatIfDocument, shown: int) -> str:
    critical, judged = len(report.critical), len(report.losses)
    found = f"{critical} of {judged} losses end observability"
    if not report.baseline.observable:
        found = f"{judged} losses of a plan that is NOT observable itself"
    rest = f"; the {shown} most harmful are shown" if judged > shown else ""
    return f"{found}{rest}; orbits unchanged, errors from initial_sigma on"


def _baseline(report: WhatIfDocument, shown: list[RemainingTeam]) -> Spec:
    value = report.baseline.worst_predicted_rms_m
    return {
        "type": "scatter",
        "uid": "baseline",
        "name": "nothing lost",
        "mode": "lines",
        "x": [] if value is None else [value] * len(shown),
        "y": [_label(one) for one in shown],
        "line": {"color": INK, "width": 2, "dash": "dash"},
        "hovertemplate": "nothing lost: %{x:.3g} m<extra></extra>",
    }
