"""How near two vehicles of a flight come: the least separation over trials."""

import numpy as np

from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.palette import BLUE, INK, VERMILLION
from syncplan.reports.flight_schemas import FlightDocument, FlownSeparation

_AIR = 1.06


def flight_separation_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of trials in which two vehicles come nearer than a distance.

    Lines mark the separation that is asked for, and the plan's own.
    """
    title = f"{escaped(report.name or 'Plan')}: least separation"
    found = report.least_separation_m
    if found is None:
        return message(title, "a single vehicle keeps away from all others")
    shares = np.linspace(0.0, 100.0, len(found.quantiles))
    curve = {
        "type": "scatter",
        "mode": "lines",
        "uid": "trials",
        "name": "trials in which two come nearer",
        "x": numbers(found.quantiles, 4),
        "y": numbers(shares, 3),
        "line": {"color": BLUE, "width": 2.5},
        "hovertemplate": "nearer than %{x:.3g} m in %{y:.3g} % of the trials<extra></extra>",
    }
    planned = _level("planned", "the plan's own", found.planned, {"color": INK, "dash": "dash"})
    traces = [curve, planned]
    if found.asked is not None:
        line = {"color": VERMILLION, "dash": "dot"}
        traces.append(_level("asked", "asked for: min_separation_m", found.asked, line))
    drawn = layout(
        title,
        note=_note(report, found),
        inner=300,
        xaxis=axis("least separation, m", range=[0.0, _AIR * _most(found)]),
        yaxis=axis("share of trials, %", range=[0, 102]),
    )
    return {"data": traces, "layout": drawn}


def _most(found: FlownSeparation) -> float:
    return max(found.planned, found.asked or 0.0, *found.quantiles)


def _level(uid: str, name: str, value: float, line: Spec) -> Spec:
    return {
        "type": "scatter",
        "mode": "lines",
        "uid": uid,
        "name": name,
        "x": numbers([value, value], 4),
        "y": [0, 102],
        "line": {**line, "width": 2},
        "hovertemplate": f"{name}: %{{x:.3g}} m<extra></extra>",
    }


def _note(report: FlightDocument, found: FlownSeparation) -> str:
    pair = escaped("-".join(found.between))
    note = (
        f"{report.run}; {found.median:.3g} m in the median trial, {found.worst:.3g} m in the worst "
        f"({pair} at {found.time_s:.4g} s)"
    )
    if found.below_asked_share is not None:
        note += f"; nearer than asked in {100.0 * found.below_asked_share:.3g} % of the trials"
    return note
