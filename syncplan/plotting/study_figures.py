"""Figures of errors after losses, in worse worlds, over swept values and over teams."""

from collections.abc import Callable, Sequence
from math import nan

from syncplan.orbits.lost_parts import phrase_of
from syncplan.planning.loss_study import RemainingTeam, WhatIfDocument
from syncplan.plotting import canvas
from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import BLUE, GREEN, INK, ORANGE, PURPLE, SKY, VERMILLION
from syncplan.reports.design_report import DesignDocument
from syncplan.reports.validation_report import SweepReport, SweepRow, ValidationDocument
from syncplan.scenario.dotted_keys import swept_key

MOST_BARS = 30
"""Largest number of losses that stay readable; the most harmful are shown."""

FEW_TRIALS = 100

_EDGE = 1.08
"""End of a bar without end, in units of the largest error that stays."""

_LEVEL: Spec = {"color": INK, "width": 2, "dash": "dash"}


# --- losses -------------------------------------------------------------------------------------


def losses_spec(report: WhatIfDocument) -> Spec:
    """Return the figure of the worst predicted error after each loss, the most harmful on top.

    Losses that end observability are hatched to the edge, with an arrowhead: their error grows for
    as long as the team flies. A line marks the plan with nothing lost.
    """
    title = f"{canvas.escaped(report.name or 'Plan')}: predicted error after each loss"
    shown = report.losses[:MOST_BARS]
    if not shown or all(one.worst_predicted_rms_m is None for one in shown):
        note = report.baseline.predicted_rms_m.note
        return canvas.message(title, note or "no loss was judged")
    rows = [_lost(one) for one in shown]
    ends = [one for one in shown if not one.observable]
    stays = [one for one in shown if one.observable]
    baseline = report.baseline.worst_predicted_rms_m if report.baseline.observable else None
    kept = [one.worst_predicted_rms_m for one in (*stays, report.baseline) if one.observable]
    largest = max((error for error in kept if error), default=0.0)
    edge = _EDGE * (largest or 1.0)
    traces = [
        *_growing(ends, edge),
        _loss_bars(
            "stays",
            "observable",
            stays,
            [one.worst_predicted_rms_m for one in stays],
            canvas.bar_marker(BLUE),
        ),
        canvas.line_trace(
            "baseline",
            "nothing lost",
            [] if baseline is None else [baseline] * len(rows),
            rows,
            _LEVEL,
            hovertemplate="nothing lost: %{x:.3g} m<extra></extra>",
        ),
    ]
    across = canvas.axis(
        "worst predicted RMS error, m",
        range=[0.0, round(1.02 * edge, 6)],
        showticklabels=largest > 0.0,
    )
    return canvas.rows_spec(title, _loss_note(report, len(shown)), rows, across, traces)


def _growing(losses: list[RemainingTeam], edge: float) -> list[Spec]:
    """Hatched bars up to the edge, and their arrowheads, of losses that end observability."""
    name = "not observable: the error grows with time"
    ends, marker = [edge] * len(losses), canvas.bar_marker(VERMILLION, "/")
    bars = {**_loss_bars("ends", name, losses, ends, marker), "legendgroup": "ends"}
    head = {"symbol": "triangle-right", "size": 15, "color": VERMILLION}
    head["line"] = {"color": INK, "width": 0.8}
    shown: Spec = {"legendgroup": "ends", "showlegend": False, "cliponaxis": False}
    return [bars, canvas.mark_trace("growing", name, bars["x"], bars["y"], head, **shown)]


def _loss_bars(
    uid: str, name: str, losses: list[RemainingTeam], ends: Sequence[float | None], marker: Spec
) -> Spec:
    """Bars up to `ends`; their hover texts give the errors and the ranks."""
    errors = [one.worst_predicted_rms_m for one in losses]
    return canvas.row_bars(
        uid,
        name,
        [_lost(one) for one in losses],
        canvas.numbers([end or 0.0 for end in ends], 6),
        marker,
        text=[
            f"{error or 0.0:.3g} m in the run's second half, rank {one.rank} of {one.state_dim}"
            for one, error in zip(losses, errors, strict=True)
        ],
        textposition="none",
        hovertemplate="%{y}: %{text}<extra></extra>",
    )


def _lost(one: RemainingTeam) -> str:
    return canvas.escaped(" and ".join(phrase_of(name).removeprefix("the ") for name in one.lost))


def _loss_note(report: WhatIfDocument, shown: int) -> str:
    critical, judged = len(report.critical), len(report.losses)
    found = f"{critical} of {judged} losses end observability"
    if not report.baseline.observable:
        found = f"{judged} losses of a plan that is NOT observable itself"
    rest = f"; the {shown} most harmful are shown" if judged > shown else ""
    return f"{found}{rest}; orbits unchanged, errors from initial_sigma on"


# --- worse worlds -------------------------------------------------------------------------------


def stress_spec(report: ValidationDocument) -> Spec:
    """Return the figure of the error in each worse world, the most harmful on top.

    Diamonds mark the expected errors, a line the error in the world as stated.
    """
    worlds = report.stress or []
    rows = [canvas.escaped(one.world) for one in worlds]
    expected = [one for one in worlds if one.expected_rms_m is not None]
    traces = [
        canvas.row_bars(
            "found",
            "found",
            rows,
            canvas.numbers([one.rms_second_half_m for one in worlds], 6),
            canvas.bar_marker(BLUE),
            text=[f"{one.harm:.2f} times" for one in worlds],
            textposition="none",
            hovertemplate="%{y}: %{x:.3g} m, %{text}<extra></extra>",
        ),
        canvas.mark_trace(
            "expected",
            "expected",
            canvas.numbers([one.expected_rms_m or 0.0 for one in expected], 6),
            [canvas.escaped(one.world) for one in expected],
            {"color": INK, "symbol": "diamond", "size": 8},
            "%{y}: %{x:.3g} m expected<extra></extra>",
        ),
        canvas.line_trace(
            "stated",
            "as stated",
            [report.overall.rms_second_half_m] * len(rows),
            rows,
            _LEVEL,
            hovertemplate="as stated: %{x:.3g} m<extra></extra>",
        ),
    ]
    title = f"{canvas.escaped(report.name or 'Plan')}: error in worse worlds"
    note = f"{report.run}; the plan and its filter are the same in all worlds"
    across = canvas.axis("RMS position error, second half, m", rangemode="tozero")
    return canvas.rows_spec(title, note, rows, across, traces)


# --- sweeps -------------------------------------------------------------------------------------

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
    """Return the figure of errors over the swept value, as in the paper's Tables 1 and 2.

    A row for a team connected at every instant has hollow marks beside the curves; rows whose plan
    is not observable are crossed out.
    """
    key = swept_key(report.swept)
    connected = [row for row in report.rows if row.label.startswith("connected")]
    swept = sorted((row for row in report.rows if row not in connected), key=lambda row: row.value)
    traces = []
    for uid, name, of, color, dash, symbol in _CURVES:
        points = [(row.value, value) for row in swept if (value := of(row)) is not None]
        traces.append(
            canvas.line_trace(
                uid,
                name,
                canvas.numbers([value for value, _ in points]),
                canvas.numbers([figure for _, figure in points], 6),
                {"color": color, "dash": dash, "width": 2},
                mode="lines+markers",
                marker={"symbol": symbol, "size": 9, "line": {"width": 2, "color": color}},
                hovertemplate=f"%{{x}}: {name} %{{y:.3g}} m<extra></extra>",
            )
        )
    for uid, name, of, color, _, symbol in _CURVES:
        marker = {"symbol": f"{symbol}-open", "size": 13, "color": color, "line": {"width": 2.5}}
        traces += [_beside(uid, name, of(row), marker, row) for row in connected]
    lost = [row for row in report.rows if row.rank < row.state_dim]
    if lost:
        traces.append(
            canvas.mark_trace(
                "unobservable",
                "NOT observable",
                canvas.numbers([row.value for row in lost]),
                canvas.numbers([row.validation.overall.rms_second_half_m for row in lost], 6),
                {"symbol": "x-thin", "size": 16, "line": {"width": 3, "color": VERMILLION}},
                "%{text}<extra></extra>",
                text=[f"rank {row.rank} of {row.state_dim}" for row in lost],
            )
        )
    first = report.rows[0].validation
    drawn = canvas.layout(
        f"{canvas.escaped(first.name or 'Scenario')}: sweep of {canvas.escaped(report.swept)}",
        note=f"{first.trials} trials of {first.duration_s:g} s at each value, seed {first.seed}"
        + ("; so few leave much to chance" if first.trials < FEW_TRIALS else ""),
        inner=340,
        xaxis=canvas.axis(", ".join(filter(None, [key.one, key.unit]))),
        yaxis=canvas.axis("RMS error over all vehicles, m", rangemode="tozero"),
    )
    return {"data": [trace for trace in traces if trace["y"]], "layout": drawn}


def _beside(uid: str, name: str, value: float | None, marker: Spec, row: SweepRow) -> Spec:
    return canvas.mark_trace(
        f"{uid}-connected",
        f"{name}; {canvas.escaped(row.label)}",
        [row.value],
        [] if value is None else canvas.numbers([value], 6),
        marker,
        f"{canvas.escaped(row.label)}: %{{y:.3g}} m<extra></extra>",
        showlegend=uid == "x",
    )


# --- designs --------------------------------------------------------------------------------------

_LINES = tuple(
    zip(
        (BLUE, ORANGE, GREEN, PURPLE, SKY),
        ("solid", "dash", "dot", "dashdot", "longdash"),
        ("circle", "square", "diamond", "triangle-up", "cross"),
        strict=True,
    )
)
"""Colour, dash and symbol of each number of landmarks."""


def front_spec(report: DesignDocument) -> Spec:
    """Return the figure of the worst error found over the number of vehicles.

    There is a line for each number of landmarks and one for the need; a star marks the winner, or
    the best formation, by the exact code.
    """
    need, best = report.brief.need, report.best
    title = f"{canvas.escaped(report.name or 'Design')}: {report.status.replace('_', ' ')}"
    if not report.front:
        return canvas.message(title, report.proof.reason if report.proof else report.binding)
    traces = []
    for k, landmarks in enumerate(sorted({one.landmarks for one in report.front})):
        color, dash, symbol = _LINES[k % len(_LINES)]
        cells = [one for one in report.front if one.landmarks == landmarks]
        traces.append(
            canvas.line_trace(
                f"landmarks-{landmarks}",
                f"{landmarks} landmarks",
                [one.vehicles for one in cells],
                canvas.numbers([nan if (e := one.worst_rms_m) is None else e for one in cells], 6),
                {"color": color, "dash": dash, "width": 2},
                mode="lines+markers",
                marker={"symbol": symbol, "size": 9},
                hovertemplate=f"%{{x}} vehicles, {landmarks} landmarks: %{{y:.3g}} m"
                "<extra></extra>",
            )
        )
    ends = [min(one.vehicles for one in report.front), max(one.vehicles for one in report.front)]
    hover = "need: %{y:.3g} m<extra></extra>"
    level = [need.worst_rms_m] * 2
    traces.append(canvas.line_trace("need", "need", ends, level, _LEVEL, hovertemplate=hover))
    if best is not None and best.predicted_worst_rms_m is not None:
        name = "winner" if report.status == "met" else "best found"
        star = {"symbol": "star", "size": 17, "color": VERMILLION, "line": {"width": 1}}
        point = [best.vehicles], canvas.numbers([best.predicted_worst_rms_m], 6)
        hover = f"{name}: %{{y:.3g}} m with {best.landmarks} landmarks<extra></extra>"
        traces.append(canvas.mark_trace("winner", f"{name}, refined", *point, star, hover))
    drawn = canvas.layout(
        title,
        note=f"{report.evaluations} formations looked at; lines on a coarse sample grid, before "
        "refinement; teams without a point: none found that fits",
        inner=340,
        xaxis=canvas.axis("vehicles", dtick=1),
        yaxis=canvas.axis("predicted RMS error of the worst vehicle, m", type="log"),
    )
    return {"data": traces, "layout": drawn}
