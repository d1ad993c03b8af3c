"""What happens in a flight, on axes of time: a band while a vehicle is held, a line at a loss."""

from collections.abc import Sequence

from syncplan.plotting.canvas import Spec, escaped
from syncplan.plotting.palette import INK, MUTED, translucent
from syncplan.reports.flight_schemas import FlightDocument, FlightEvent

MOST_NAMED = 4
"""Events that a note names."""

_BAND = translucent(MUTED, 0.25)
_LINE: Spec = {"color": INK, "width": 1.5, "dash": "dashdot"}


def event_shapes(events: Sequence[FlightEvent], panels: int) -> list[Spec]:
    """Return the marks of events in each of so many panels, of axes x, x2, ..."""
    return [
        _mark(one, str(number + 1) if number else "") for number in range(panels) for one in events
    ]


def event_entries(events: Sequence[FlightEvent]) -> list[Spec]:
    """Return the legend's entries of what `event_shapes` draws."""
    kinds = {one.kind for one in events}
    entries: list[Spec] = []
    nowhere: Spec = {"type": "scatter", "x": [None], "y": [None], "hoverinfo": "skip"}
    if "loss" in kinds:
        entry = {"mode": "lines", "uid": "losses", "name": "something is lost", "line": _LINE}
        entries.append({**nowhere, **entry})
    if "hold" in kinds:
        marker = {"symbol": "square", "size": 12, "color": _BAND}
        entry = {"mode": "markers", "uid": "holds", "name": "a vehicle is held", "marker": marker}
        entries.append({**nowhere, **entry})
    return entries


def event_words(report: FlightDocument) -> str:
    """Return what happens, in words that a note can have; empty if nothing does."""
    said = [escaped(one.what) for one in report.events[:MOST_NAMED]]
    more = len(report.events) - len(said)
    return ", ".join(said) + (f" and {more} more" if more else "")


def _mark(one: FlightEvent, suffix: str) -> Spec:
    axes = {"xref": f"x{suffix}", "yref": f"y{suffix} domain", "y0": 0, "y1": 1}
    if one.end_s is None:
        return {"type": "line", **axes, "x0": one.begin_s, "x1": one.begin_s, "line": _LINE}
    return {
        "type": "rect",
        **axes,
        "x0": one.begin_s,
        "x1": one.end_s,
        "fillcolor": _BAND,
        "line": {"width": 0},
        "layer": "below",
    }
