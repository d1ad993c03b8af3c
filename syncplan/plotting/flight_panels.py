"""Figures of flights over time, a panel a vehicle: which vehicles, logarithmic axes, curves."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.plotting.canvas import Spec, escaped, layout, numbers
from syncplan.plotting.event_marks import event_entries, event_shapes, event_words
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.panels_over_time import every_so_many, panels
from syncplan.reports.flight_schemas import FlightDocument
from syncplan.reports.flight_series_schemas import FlightOverTime, VehicleOverTime

MOST_VEHICLES = 12
"""Vehicles drawn: of larger teams, the worst."""

_DECADES = 2.5
"""What an axis holds at most below its largest value."""

_AIR = 1.15
_DIGITS = 5


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve of each panel.

    Attributes
    ----------
    key, name : in the figure, and in the legend
    line : Plotly's
    values : over time or, as a level, a single one; None where it is not known
    """

    key: str
    name: str
    line: Spec
    values: Sequence[float | None]


def series_in(report: FlightDocument) -> FlightOverTime:
    """Return a report's figures over time; raises InputError where it has none."""
    if report.series is None:
        raise InputError("the report has no figures over time; --series keeps them", key="series")
    return report.series


def flight_panels_spec(
    report: FlightDocument,
    style: FigureStyle,
    curves: Mapping[str, Sequence[Curve]],
    worst: Mapping[str, float],
    words: tuple[str, str, str],
) -> Spec:
    """Return a figure of curves by vehicle; `words` are what it shows, its unit, and a note.

    Of a large team those vehicles are drawn that are `worst`.
    """
    series, (what, unit, note) = series_in(report), words
    kept = set(sorted(worst, key=lambda name: -worst[name])[:MOST_VEHICLES])
    drawn = [one for one in series.vehicles if one.name in kept]
    axes, titles, inner = panels(
        [f"{one.name}, {unit}" for one in drawn], [None] * len(drawn), style
    )
    low, high = _range([one for vehicle in drawn for one in curves[vehicle.name]])
    for name in axes:
        if name.startswith("yaxis"):
            axes[name] |= _logarithmic(low, high)
    traces = [
        trace
        for number, vehicle in enumerate(drawn)
        for trace in _panel(vehicle, curves[vehicle.name], series.time_s, number)
    ]
    if len(drawn) < len(series.vehicles):
        note += f"; the {len(drawn)} worst of {len(series.vehicles)} vehicles"
    said = event_words(report)
    shown = layout(
        f"{escaped(report.name or 'Plan')}: {what}",
        note=f"{note}; {said}" if said else note,
        inner=inner,
        above=24,
        annotations=titles,
        shapes=event_shapes(report.events, len(drawn)),
        **axes,
    )
    return {"data": traces + event_entries(report.events), "layout": shown}


def _panel(
    vehicle: VehicleOverTime, curves: Sequence[Curve], times: Sequence[float], number: int
) -> list[Spec]:
    every = every_so_many(len(times))
    suffix = str(number + 1) if number else ""
    traces = []
    for one in curves:
        level = len(one.values) == 1
        at = [times[0], times[-1]] if level else times[::every]
        values = [*one.values, *one.values] if level else one.values[::every]
        traces.append(
            {
                "type": "scatter",
                "mode": "lines",
                "uid": f"{one.key}-{vehicle.name}",
                "name": one.name,
                "legendgroup": one.key,
                "showlegend": number == 0,
                "xaxis": f"x{suffix}",
                "yaxis": f"y{suffix}",
                "x": numbers(at, 6),
                "y": numbers(_positive(values), _DIGITS),
                "line": one.line,
                "hovertemplate": f"{escaped(vehicle.name)} at %{{x}} s: %{{y:.3g}}"
                f"<extra>{one.name}</extra>",
            }
        )
    return traces


def _positive(values: Sequence[float | None]) -> Array:
    found = np.array(values, dtype=float)
    return np.where(found > 0.0, found, np.nan)


def _range(curves: Sequence[Curve]) -> tuple[float, float]:
    """What an axis holds of curves: all, but no more than _DECADES below the largest."""
    known = [_positive(one.values) for one in curves]
    every = np.concatenate([np.ones(0), *known])
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.1, 1.0
    high = float(every.max()) * _AIR
    return max(float(every.min()) / _AIR, high * 10.0**-_DECADES), high


def _logarithmic(low: float, high: float) -> Spec:
    """A logarithmic axis, marked at 1, 2, 5, 10, ... or, where these are many, at fewer."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    wide = math.log10(high / low) > 1.7
    digits = (1.0, 3.0) if wide else (1.0, 2.0, 5.0)
    marks = [round(d * 10.0**k, 12) for k in range(first, last + 1) for d in digits]
    marks = [one for one in marks if low <= one <= high]
    return {
        "type": "log",
        "range": numbers([math.log10(low), math.log10(high)], 4),
        "tickvals": marks,
        "ticktext": [f"{one:g}" for one in marks],
    }
