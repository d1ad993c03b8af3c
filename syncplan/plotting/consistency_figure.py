"""Consistency: ANEES and NIS with their bands, and the share of errors within three sigma."""

import numpy as np

from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers, panel_title
from syncplan.plotting.palette import BLUE, INK, MUTED, SKY, VERMILLION
from syncplan.reports.run_schemas import ReplayDocument, Spread, ValidationDocument

__all__ = ["consistency_spec"]

IDEAL_COVERAGE = 0.9973
"""Probability that a normal error lies within three sigma."""

_SYMBOLS = {"consistent": "circle", "optimistic": "triangle-right", "conservative": "triangle-left"}


def consistency_spec(report: ValidationDocument | ReplayDocument) -> Spec:
    """Return the figure of ANEES and NIS in their 95 % bands, and of each vehicle's coverage."""
    figures = [("ANEES", report.anees), ("NIS", report.nis)]
    traces = []
    axes: Spec = {}
    for number, (name, figure) in enumerate(figures):
        suffix = "" if number == 0 else "2"
        traces += _spread_traces(name, figure, suffix)
        left = 0.52 * number
        values = [1.0] if figure.value is None else [1.0, figure.value, *(figure.band or ())]
        axes[f"xaxis{suffix}"] = axis(
            f"{name}: 1 is honest",
            domain=[left, left + 0.48],
            anchor=f"y{suffix}",
            nticks=6,
            range=_room(values),
        )
        axes[f"yaxis{suffix}"] = axis(
            domain=[0.76, 0.96], range=[-1, 1], visible=False, anchor=f"x{suffix}"
        )
    names = [escaped(vehicle.name) for vehicle in report.vehicles]
    covered = [vehicle.coverage_3sigma for vehicle in report.vehicles]
    traces += _coverage_traces(names, covered)
    axes["xaxis3"] = axis("vehicle", type="category", domain=[0, 1], anchor="y3")
    lowest = min(*covered, IDEAL_COVERAGE, 0.98)
    axes["yaxis3"] = axis(
        "share within 3 sigma",
        domain=[0, 0.5],
        anchor="x3",
        range=[lowest - 0.05 * (1.0 - lowest), 1.002],
        tickformat=".1%",
    )
    titles = [
        panel_title(_verdict(name, figure), 0.52 * number, 0.97)
        for number, (name, figure) in enumerate(figures)
    ]
    titles.append(panel_title("Coordinates within the filter's own 3 sigma", 0, 0.51))
    title = f"{escaped(report.name or 'Plan')}: is the filter honest?"
    drawn = layout(title, note=report.run, height=590, annotations=titles, **axes)
    drawn["margin"]["t"] += 34
    drawn["margin"]["b"] = 104
    return {"data": traces, "layout": drawn}


def _verdict(name: str, figure: Spread) -> str:
    if figure.value is None or figure.band is None:
        return f"{name}: nothing to judge"
    low, high = figure.band
    band = f"95 % band {low:.4g} to {high:.4g}"
    return f"{name} {figure.value:.4g}: {figure.verdict}<br>{band}"


def _room(values: list[float]) -> list[float | None]:
    low, high = min(values), max(values)
    room = 0.15 * max(high - low, 1e-3)
    return numbers([low - room, high + room], 6)


def _spread_traces(name: str, figure: Spread, suffix: str) -> list[Spec]:
    """The band as a thick line, the value as a mark on it: a circle if within, else a triangle."""
    shared = {"type": "scatter", "xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}

    def trace(part: str, words: str, mode: str) -> Spec:
        about = {"uid": f"{name}-{part}", "name": words, "legendgroup": part}
        return {**shared, **about, "showlegend": not suffix, "mode": mode}

    ideal = {
        **trace("ideal", "1: errors as large as the filter says", "lines"),
        "x": [1, 1],
        "y": [-0.8, 0.8],
        "line": {"color": MUTED, "width": 1.5, "dash": "dash"},
        "hoverinfo": "skip",
    }
    if figure.value is None or figure.band is None:
        return [ideal]
    band = {
        **trace("band", "95 % band", "lines"),
        "x": numbers(figure.band),
        "y": [0, 0],
        "line": {"color": SKY, "width": 16},
        "hovertemplate": "%{x}<extra>edge of the band</extra>",
    }
    value = {
        **trace("value", "found", "markers"),
        "legendgroup": "found",
        "x": [figure.value],
        "y": [0],
        "marker": {
            "symbol": _SYMBOLS.get(figure.verdict, "circle"),
            "size": 14,
            "color": BLUE if figure.verdict == "consistent" else VERMILLION,
            "line": {"color": INK, "width": 1},
        },
        "hovertemplate": f"{name} %{{x}}, {figure.verdict}<extra></extra>",
    }
    return [band, ideal, value]


def _coverage_traces(names: list[str], covered: list[float]) -> list[Spec]:
    shared = {"type": "scatter", "xaxis": "x3", "yaxis": "y3"}
    return [
        {
            **shared,
            "uid": "coverage",
            "name": "share within 3 sigma",
            "mode": "markers",
            "x": names,
            "y": numbers(covered, 6),
            "marker": {"symbol": "diamond", "size": 11, "color": BLUE},
            "hovertemplate": "%{x}: %{y:.2%}<extra></extra>",
        },
        {
            **shared,
            "uid": "coverage-ideal",
            "name": "99.73 %, normal errors",
            "mode": "lines",
            "x": names,
            "y": numbers(np.full(len(names), IDEAL_COVERAGE)),
            "line": {"color": MUTED, "width": 1.5, "dash": "dot"},
            "hoverinfo": "skip",
        },
    ]
