"""Consistency: ANEES and NIS with their intervals, and the share of errors within 3 sigma."""

import numpy as np

from syncplan.estimation.consistency import TOLERANCE
from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers, panel_title
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.palette import BLUE, INK, MUTED, SKY, VERMILLION, translucent
from syncplan.reports.consistency_words import interval_words, verdict_words
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.reports.run_schemas import Spread, ValidationDocument

IDEAL_COVERAGE = 0.9973
"""Probability that a normal error lies within three sigma."""

_TOLERATED = [1.0 - TOLERANCE, 1.0 + TOLERANCE]

_BAND_PX = 78
_WORDS_PX = 96
_COVERAGE_PX = 190
"""Heights: of a panel with a band, of what stands between panels, of the panel of vehicles."""

_SYMBOLS = {"consistent": "circle", "optimistic": "triangle-right", "conservative": "triangle-left"}
_COLOURS = {"consistent": BLUE, "unknown": MUTED}


def consistency_spec(report: ValidationDocument | ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of ANEES and NIS with 95 % intervals, and of each vehicle's coverage.

    Of a recording without truth: of NIS alone.
    """
    figures = [("NIS", report.nis)]
    if report.anees is not None:
        figures.insert(0, ("ANEES", report.anees))
    traces = []
    axes: Spec = {}
    inner, places, split = _panels(style, len(figures), _COVERAGE_PX if report.has_errors else 0)
    for number, (name, figure) in enumerate(figures):
        suffix = "" if number == 0 else "2"
        traces += _spread_traces(name, figure, suffix)
        left, right, low, high = places[number]
        values = [*_TOLERATED, *([] if figure.value is None else [figure.value])]
        values += figure.band or ()
        axes[f"xaxis{suffix}"] = axis(
            f"{name}: 1 is honest",
            domain=[left, right],
            anchor=f"y{suffix}",
            nticks=5,
            range=_room(values),
        )
        axes[f"yaxis{suffix}"] = axis(
            domain=[low, high], range=[-1, 1], visible=False, anchor=f"x{suffix}"
        )
    titles = [
        panel_title(_verdict(name, figure), places[number][0], places[number][3])
        for number, (name, figure) in enumerate(figures)
    ]
    note = report.run
    if report.has_errors:
        covered = [vehicle.coverage_3sigma or 0.0 for vehicle in report.vehicles]
        traces += _coverage_traces([escaped(vehicle.name) for vehicle in report.vehicles], covered)
        axes |= _coverage_axes(covered, split)
        titles.append(panel_title("Coordinates within the filter's own 3 sigma", 0, split))
    else:
        note += " without truth: innovations alone are judged"
    title = f"{escaped(report.name or 'Plan')}: is the filter honest?"
    drawn = layout(title, note=note, inner=inner, above=40, annotations=titles, **axes)
    return {"data": traces, "layout": drawn}


def _panels(
    style: FigureStyle, count: int, lowest_px: int
) -> tuple[int, list[tuple[float, float, float, float]], float]:
    """Height in px, (left, right, low, high) of the bands' panels, and the top of the lowest one.

    The bands stand side by side, or under each other where that leaves no room for their words.
    """
    below = style.narrow or count == 1
    rows, words_px = count if below else 1, style.px(_WORDS_PX)
    inner = rows * (_BAND_PX + words_px) + lowest_px
    places = []
    for number in range(count):
        row, column = (number, 0) if below else (0, number)
        high = 1.0 - row * (_BAND_PX + words_px) / inner
        left, right = (0.0, 1.0) if below else (0.52 * column, 0.52 * column + 0.48)
        places.append((left, right, high - _BAND_PX / inner, high))
    return inner, places, lowest_px / inner


def _verdict(name: str, figure: Spread) -> str:
    if figure.value is None:
        return f"{name}: nothing to judge"
    value, _, interval = interval_words(figure).partition(", ")
    verdict, _, reason = verdict_words(figure).partition(", ")
    return f"{name} {value}: {verdict}<br>{interval or reason}"


def _room(values: list[float]) -> list[float | None]:
    low, high = min(values), max(values)
    room = 0.15 * max(high - low, 1e-3)
    return numbers([low - room, high + room], 6)


def _spread_traces(name: str, figure: Spread, suffix: str) -> list[Spec]:
    """The interval as a thick line, the value as a mark on it, beside the tolerated range."""
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
    tolerated = {
        **trace("tolerated", f"within {TOLERANCE:.0%} of 1: consistent", "lines"),
        "x": [*_TOLERATED, *_TOLERATED[::-1], _TOLERATED[0]],
        "y": [-0.8, -0.8, 0.8, 0.8, -0.8],
        "fill": "toself",
        "fillcolor": translucent(MUTED, 0.15),
        "line": {"width": 0},
        "hoverinfo": "skip",
    }
    if figure.value is None:
        return [tolerated, ideal]
    band = {
        **trace("band", _band_name(figure), "lines"),
        "x": numbers(figure.band or ()),
        "y": [0, 0],
        "line": {"color": SKY, "width": 16},
        "hovertemplate": "%{x}<extra>end of the interval</extra>",
    }
    value = {
        **trace("value", "found", "markers"),
        "legendgroup": "found",
        "x": [figure.value],
        "y": [0],
        "marker": {
            "symbol": _SYMBOLS.get(figure.verdict, "circle"),
            "size": 14,
            "color": _COLOURS.get(figure.verdict, VERMILLION),
            "line": {"color": INK, "width": 1},
        },
        "hovertemplate": f"{name} %{{x}}, {figure.verdict}<extra></extra>",
    }
    return [tolerated, *([band] if figure.band else []), ideal, value]


def _band_name(figure: Spread) -> str:
    return "95 % band" if figure.basis is None else "95 % interval"


def _coverage_axes(covered: list[float], split: float) -> Spec:
    lowest = min(*covered, IDEAL_COVERAGE, 0.98)
    return {
        "xaxis3": axis("vehicle", type="category", domain=[0, 1], anchor="y3"),
        "yaxis3": axis(
            "share within 3 sigma",
            domain=[0, split],
            anchor="x3",
            range=[lowest - 0.05 * (1.0 - lowest), 1.002],
            tickformat=".1%",
        ),
    }


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
