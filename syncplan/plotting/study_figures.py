"""Figures of studies of a plan: what losses, worse worlds and swept values do to its error."""

from collections.abc import Callable

import numpy as np

from syncplan.planning.lost_parts import phrase_of
from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.figure_style import BLUE, GREEN, INK, ORANGE, VERMILLION
from syncplan.reports.loss_report import RemainingTeam, WhatIfDocument
from syncplan.reports.validation_report import SweepReport, SweepRow, ValidationDocument
from syncplan.scenario.dotted_keys import swept_key

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
        _loss_bars("ends", "not observable", ends, VERMILLION, "/"),
        _loss_bars("stays", "observable", stays, BLUE, ""),
        _baseline(report, shown),
    ]
    drawn = layout(
        title,
        note=_loss_note(report, len(shown)),
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


def _loss_bars(uid: str, name: str, losses: list[RemainingTeam], color: str, pattern: str) -> Spec:
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


def _loss_note(report: WhatIfDocument, shown: int) -> str:
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


def stress_spec(report: ValidationDocument) -> Spec:
    """Return the figure of the error in each worse world, the most harmful on top.

    Diamonds mark what was to be expected, a line the error in the world as stated.
    """
    traces = _stress_traces(report)
    labels = [escaped(one.world) for one in report.stress or []]
    drawn = layout(
        f"{escaped(report.name or 'Plan')}: error in worse worlds",
        note=f"{report.run}; the plan and its filter are the same in all worlds",
        inner=max(_ROW_PX * len(labels), 90),
        barmode="overlay",
        bargap=0.25,
        xaxis=axis("RMS position error, second half, m", rangemode="tozero"),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=labels,
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _stress_traces(report: ValidationDocument) -> list[Spec]:
    worlds = report.stress or []
    labels = [escaped(one.world) for one in worlds]
    expected = [one for one in worlds if one.expected_rms_m is not None]
    stated = report.overall.rms_second_half_m
    return [
        {
            "type": "bar",
            "orientation": "h",
            "uid": "found",
            "name": "found",
            "y": labels,
            "x": numbers([one.rms_second_half_m for one in worlds], 6),
            "text": [f"{one.harm:.2f} times" for one in worlds],
            "textposition": "none",
            "marker": {"color": BLUE, "line": {"color": INK, "width": 0.8}},
            "hovertemplate": "%{y}: %{x:.3g} m, %{text}<extra></extra>",
        },
        {
            "type": "scatter",
            "uid": "expected",
            "name": "expected",
            "mode": "markers",
            "y": [escaped(one.world) for one in expected],
            "x": numbers([one.expected_rms_m or 0.0 for one in expected], 6),
            "marker": {"color": INK, "symbol": "diamond", "size": 8},
            "hovertemplate": "%{y}: %{x:.3g} m expected<extra></extra>",
        },
        {
            "type": "scatter",
            "uid": "stated",
            "name": "as stated",
            "mode": "lines",
            "x": [stated] * len(labels),
            "y": labels,
            "line": {"color": INK, "width": 2, "dash": "dash"},
            "hovertemplate": "as stated: %{x:.3g} m<extra></extra>",
        },
    ]


FEW_TRIALS = 100

_Figure = Callable[[SweepRow], float | None]

_CURVES: tuple[tuple[str, str, _Figure, str, str, str], ...] = (
    ("x", "mean RMS in x, whole run", lambda r: r.mean_rms_x_m, BLUE, "solid", "circle"),
    ("y", "mean RMS in y, whole run", lambda r: r.mean_rms_y_m, ORANGE, "dash", "square"),
    (
        "late",
        "RMS position, second half",
        lambda r: r.validation.overall.rms_second_half_m,
        GREEN,
        "dot",
        "diamond",
    ),
    (
        "predicted",
        "predicted: posterior bound, second half",
        lambda r: r.validation.overall.predicted_rms_m,
        INK,
        "dashdot",
        "triangle-up",
    ),
)


def sweep_spec(report: SweepReport) -> Spec:
    """Return the figure of errors over the swept value.

    A row for a team connected at every instant stands beside the curves, with hollow marks; rows
    whose plan is not observable are crossed out.
    """
    key = swept_key(report.swept)
    connected = [row for row in report.rows if row.label.startswith("connected")]
    swept = sorted((row for row in report.rows if row not in connected), key=lambda row: row.value)
    traces = [
        _curve(uid, name, of, color, dash, symbol, swept)
        for uid, name, of, color, dash, symbol in _CURVES
    ]
    for uid, name, of, color, _, symbol in _CURVES:
        traces += [_beside(uid, name, of, color, symbol, row) for row in connected]
    lost = [row for row in report.rows if row.rank < row.state_dim]
    if lost:
        traces.append(_crosses(lost))
    first = report.rows[0].validation
    drawn = layout(
        f"{escaped(first.name or 'Scenario')}: sweep of {escaped(report.swept)}",
        note=f"{first.trials} trials of {first.duration_s:g} s at each value, seed {first.seed}"
        + ("; so few leave much to chance" if first.trials < FEW_TRIALS else ""),
        inner=340,
        xaxis=axis(", ".join(filter(None, [key.one, key.unit]))),
        yaxis=axis("RMS error over all vehicles, m", rangemode="tozero"),
    )
    return {"data": [trace for trace in traces if trace["y"]], "layout": drawn}


def _curve(
    uid: str, name: str, of: _Figure, color: str, dash: str, symbol: str, rows: list[SweepRow]
) -> Spec:
    points = [(row.value, value) for row in rows if (value := of(row)) is not None]
    return {
        "type": "scatter",
        "uid": uid,
        "name": name,
        "mode": "lines+markers",
        "x": numbers([value for value, _ in points]),
        "y": numbers([figure for _, figure in points], 6),
        "line": {"color": color, "dash": dash, "width": 2},
        "marker": {"symbol": symbol, "size": 9, "line": {"width": 2, "color": color}},
        "hovertemplate": f"%{{x}}: {name} %{{y:.3g}} m<extra></extra>",
    }


def _beside(uid: str, name: str, of: _Figure, color: str, symbol: str, row: SweepRow) -> Spec:
    value = of(row)
    return {
        "type": "scatter",
        "uid": f"{uid}-connected",
        "name": f"{name}; {escaped(row.label)}",
        "mode": "markers",
        "x": [row.value],
        "y": [] if value is None else numbers([value], 6),
        "marker": {"symbol": f"{symbol}-open", "size": 13, "color": color, "line": {"width": 2.5}},
        "hovertemplate": f"{escaped(row.label)}: %{{y:.3g}} m<extra></extra>",
        "showlegend": uid == "x",
    }


def _crosses(rows: list[SweepRow]) -> Spec:
    return {
        "type": "scatter",
        "uid": "unobservable",
        "name": "NOT observable",
        "mode": "markers",
        "x": numbers([row.value for row in rows]),
        "y": numbers(np.array([row.validation.overall.rms_second_half_m for row in rows]), 6),
        "marker": {"symbol": "x-thin", "size": 16, "line": {"width": 3, "color": VERMILLION}},
        "text": [f"rank {row.rank} of {row.state_dim}" for row in rows],
        "hovertemplate": "%{text}<extra></extra>",
    }
