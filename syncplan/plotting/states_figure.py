"""Errors over time of the filter's states that are no poses: wind, scales, biases, gusts."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import chain

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, escaped, layout, numbers
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.palette import INK, SKY, VERMILLION
from syncplan.plotting.panels_over_time import every_so_many, panels
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.reports.run_schemas import ValidationDocument
from syncplan.reports.state_error_schemas import StateErrorSeries

MOST_STATES = 24
"""States drawn: where there are more, the least known of each kind."""

_DIGITS = 4


def states_spec(report: ValidationDocument | ReplayDocument, style: FigureStyle) -> Spec:
    """Return the figure of further states over time: a panel for each, in its own unit.

    The thin line is the RMS error over the trials (of a single trial: the size of its error), the
    broad one the filter's own sigma, the dotted one the bound. Raises InputError for a report
    without such a series.
    """
    if report.series is None or report.series.errors is None:
        raise InputError(
            "the report has no errors of further states over time; --series keeps them",
            key="series",
        )
    held = report.series.errors
    drawn = _least_known(held)
    every = every_so_many(len(report.series.time_s))
    at = numbers(report.series.time_s[::every], 6)
    single = report.trials == 1
    traces = chain.from_iterable(
        _panel(state, at, every, number, single) for number, state in enumerate(drawn)
    )
    axes, titles, inner = panels([_title(one) for one in drawn], [None] * len(drawn), style)
    for name, axis in axes.items():
        if name.startswith("yaxis"):
            axis["rangemode"] = "tozero"
    found = "size of the error" if single else "RMS error"
    note = f"{found} of {report.run}, the filter's own sigma and the predicted error"
    if len(drawn) < len(held):
        note += f"; {len(drawn)} of {len(held)} states, the least known of each kind"
    title = f"{escaped(report.name or 'Plan')}: further states over time"
    shown = layout(title, note=note, inner=inner, above=24, annotations=titles, **axes)
    return {"data": list(traces), "layout": shown}


def _least_known(states: Sequence[StateErrorSeries]) -> list[StateErrorSeries]:
    """At most MOST_STATES, as many of each kind as there is room for, in the order given."""
    if len(states) <= MOST_STATES:
        return list(states)
    kinds: dict[str, list[int]] = defaultdict(list)
    for k, one in enumerate(states):
        kinds[one.state.split(" of ")[0]].append(k)
    places = {
        k: place
        for of_kind in kinds.values()
        for place, k in enumerate(sorted(of_kind, key=lambda k: -_left(states[k])))
    }
    kept = sorted(places, key=lambda k: (places[k], k))[:MOST_STATES]
    return [states[k] for k in sorted(kept)]


def _left(state: StateErrorSeries) -> float:
    """How much of the error is left in the second half, as a share of the sigma at the start."""
    late = np.array(state.rms[len(state.rms) // 2 :])
    return float(np.sqrt(np.mean(late**2))) / (state.sigma[0] or 1.0)


def _title(state: StateErrorSeries) -> str:
    return state.state if state.unit == "1" else f"{state.state}, {state.unit}"


def _panel(
    state: StateErrorSeries, at: list[float | None], every: int, number: int, single: bool
) -> list[Spec]:
    """The curves of one state."""
    curves: list[tuple[str, str, Sequence[float] | None, Spec]] = [
        ("sigma", "filter's own sigma", state.sigma, {"color": SKY, "width": 4}),
        (
            "predicted",
            "predicted error",
            state.predicted,
            {"color": VERMILLION, "width": 2, "dash": "dot"},
        ),
        (
            "rms",
            "size of the error" if single else "RMS error over the trials",
            state.rms,
            {"color": INK, "width": 1.3},
        ),
    ]
    suffix = str(number + 1) if number else ""
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "uid": f"{key}-{state.state}",
            "name": name,
            "legendgroup": key,
            "showlegend": number == 0,
            "xaxis": f"x{suffix}",
            "yaxis": f"y{suffix}",
            "x": at,
            "y": numbers(_significant(np.array(values)[::every])),
            "line": line,
            "hovertemplate": f"{escaped(state.state)} at %{{x}} s: %{{y}}<extra>{name}</extra>",
        }
        for key, name, values, line in curves
        if values is not None
    ]


def _significant(values: Array) -> Array:
    """Values to _DIGITS digits of the largest: units differ by orders of magnitude."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if not 0.0 < largest < np.inf:
        return values
    return np.round(values, _DIGITS - int(np.floor(np.log10(largest))))
