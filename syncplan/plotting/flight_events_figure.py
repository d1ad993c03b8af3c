"""What was lost or held in a flight, and when: a row for each, over the time of the run."""

from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.palette import GREEN, INK, ORANGE, VERMILLION
from syncplan.reports.flight_schemas import FlightDocument, FlightEvent

_ROW_PX = 26
_LEAST_PX = 90

_STYLES = (
    ("loss", "lost", VERMILLION, "x"),
    ("hold", "held where it is", ORANGE, "/"),
)


def flight_events_spec(report: FlightDocument) -> Spec:
    """Return the figure of events: bars from a loss to the end, and over the time of a hold.

    After a hold, a thin bar shows how long the median trial takes to have its phase again.
    """
    title = f"{escaped(report.name or 'Plan')}: what was lost, and when"
    if not report.events:
        return message(title, "nothing was lost, and no vehicle held")
    rows = list(dict.fromkeys(escaped(one.subject) for one in report.events))
    traces = [
        _bars(kind, name, [one for one in report.events if one.kind == kind], look, report)
        for kind, name, *look in _STYLES
    ]
    traces.append(_settling(report))
    drawn = layout(
        title,
        note=f"the same in each of {report.run}",
        inner=max(_ROW_PX * len(rows), _LEAST_PX),
        barmode="overlay",
        bargap=0.35,
        xaxis=axis("time, s", range=numbers([0.0, report.duration_s], 4)),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=rows,
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _bars(
    uid: str, name: str, events: list[FlightEvent], look: list[str], report: FlightDocument
) -> Spec:
    color, shape = look
    ends = [report.duration_s if one.end_s is None else one.end_s for one in events]
    return {
        "type": "bar",
        "orientation": "h",
        "uid": uid,
        "name": name,
        "y": [escaped(one.subject) for one in events],
        "base": numbers([one.begin_s for one in events], 4),
        "x": numbers([end - one.begin_s for end, one in zip(ends, events, strict=True)], 4),
        "marker": {
            "color": color,
            "line": {"color": INK, "width": 0.8},
            "pattern": {"shape": shape, "fillmode": "replace", "size": 7},
        },
        "text": [escaped(one.what) for one in events],
        "textposition": "none",
        "hovertemplate": "%{text}<extra></extra>",
    }


def _settling(report: FlightDocument) -> Spec:
    found = [one for one in report.events if one.settled_s and one.end_s is not None]
    return {
        "type": "bar",
        "orientation": "h",
        "uid": "settling",
        "name": "until its phase is kept again, median trial",
        "y": [escaped(one.subject) for one in found],
        "base": numbers([one.end_s or 0.0 for one in found], 4),
        "x": numbers([one.settled_s or 0.0 for one in found], 4),
        "width": 0.3,
        "marker": {"color": GREEN, "line": {"color": INK, "width": 0.8}},
        "hovertemplate": "in phase again after %{x:.3g} s<extra></extra>",
    }
