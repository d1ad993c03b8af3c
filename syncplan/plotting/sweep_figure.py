"""Sweeps: errors over the value that was varied, as the paper's Tables 1 and 2."""

from collections.abc import Callable

import numpy as np

from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers
from syncplan.plotting.palette import BLUE, GREEN, INK, ORANGE, VERMILLION
from syncplan.reports.run_schemas import SweepReport, SweepRow
from syncplan.scenario.dotted_keys import swept_key

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
