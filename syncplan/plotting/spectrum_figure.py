"""Singular values of the windowed matrix, with the gap that the rank rests on."""

import numpy as np

from syncplan.observability.rank import RANK_TOLERANCE
from syncplan.planning.planner import Plan
from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers
from syncplan.plotting.formation_figure import verdict_words
from syncplan.plotting.palette import BLUE, INK, MUTED, VERMILLION

_FLOOR = 1e-18
"""Share of the largest singular value below which one is drawn at the floor."""


def spectrum_spec(plan: Plan) -> Spec:
    """Return the figure of the singular values in descending order, on a logarithmic axis."""
    verdict = plan.observability
    values, rank = verdict.singular_values, verdict.rank
    largest = float(values[0]) or 1.0
    drawn = np.maximum(values, _FLOOR * largest)
    order = np.arange(1, len(values) + 1)
    limit = RANK_TOLERANCE * largest
    width = [0.5, len(values) + 0.5]
    traces = [
        _points(order[:rank], drawn[:rank], values[:rank], "counts for the rank", "circle", BLUE),
        {
            "type": "scatter",
            "uid": "tolerance",
            "mode": "lines",
            "name": "tolerance, 1e-8 of the largest",
            "x": width,
            "y": [limit, limit],
            "line": {"color": MUTED, "dash": "dash", "width": 1.5},
            "hoverinfo": "skip",
        },
    ]
    if rank < len(values):
        rest = slice(rank, None)
        name = "does not count: unobservable"
        traces.insert(1, _points(order[rest], drawn[rest], values[rest], name, "x", VERMILLION))
    title = f"{escaped(plan.scenario.name or 'Plan')}: singular values"
    low = min(float(drawn[-1]), limit) / 3.0
    shown = layout(
        title,
        note=f"{verdict_words(plan)}; positions in mean radii",
        inner=320,
        xaxis=axis("number, largest first", range=width),
        yaxis=axis(
            "singular value",
            type="log",
            exponentformat="e",
            range=numbers(np.log10([low, 3.0 * largest]), 4),
        ),
        annotations=[_gap(rank, drawn, verdict.gap, limit)],
    )
    return {"data": traces, "layout": shown}


def _points(
    order: np.ndarray, drawn: np.ndarray, values: np.ndarray, name: str, symbol: str, color: str
) -> Spec:
    return {
        "type": "scatter",
        "uid": f"values-{symbol}",
        "mode": "markers",
        "name": name,
        "x": order.tolist(),
        "y": numbers(drawn),
        "text": [f"{value:.3e}" for value in values],
        "marker": {"symbol": symbol, "size": 9, "color": color, "line": {"color": INK, "width": 0}},
        "hovertemplate": "%{x}: %{text}<extra></extra>",
    }


def _gap(rank: int, drawn: np.ndarray, gap: float, limit: float) -> Spec:
    """What separates the last value that counts from the first that does not, or the tolerance.

    The words stand in the larger part of the gap, away from the line of the tolerance.
    """
    high = float(drawn[max(rank, 1) - 1])
    if rank < len(drawn):
        size = f"a factor of {gap:.1e}" if np.isfinite(gap) else "all: the rest is zero"
        text, low, at = f"gap: {size}", float(drawn[rank]), rank + 0.5
        edges = np.log10([low, min(max(limit, low), high), high])
        parts = [edges[:2], edges[1:]]
        middle = float(np.mean(max(parts, key=lambda part: float(part[1] - part[0]))))
    else:
        last = float(drawn[-1])
        text, at = f"smallest is {last / limit:.1e}<br>times the tolerance", rank
        middle = float(np.log10(np.sqrt(limit * high)))
    return {
        "text": text,
        "x": at,
        "y": round(middle, 4),
        "xanchor": "right",
        "showarrow": False,
        "font": {"size": 13},
    }
