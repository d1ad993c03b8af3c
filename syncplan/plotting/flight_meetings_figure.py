"""Which meetings of the plan a flight kept: a bar a link."""

from syncplan.plotting.canvas import Spec, axis, escaped, layout, message, numbers
from syncplan.plotting.palette import BLUE, INK, VERMILLION
from syncplan.reports.flight_schemas import FlightDocument, FlownLink

MOST_BARS = 40
"""Links shown, those that missed most: more would be too many to read."""

_ROW_PX = 21
_LEAST_PX = 90


def flight_meetings_spec(report: FlightDocument) -> Spec:
    """Return the figure of the share of meetings kept, a bar a link, the worst on top.

    Links that missed a meeting in any trial are hatched.
    """
    title = f"{escaped(report.name or 'Plan')}: meetings kept"
    if not report.links:
        return message(title, "the plan has no meeting that the flight is long enough for")
    shown = sorted(report.links, key=lambda one: one.kept_share)[:MOST_BARS]
    traces = [
        _bars("missed", "some were missed", [o for o in shown if o.kept_share < 1.0], VERMILLION),
        _bars("kept", "all were kept", [o for o in shown if o.kept_share >= 1.0], BLUE),
    ]
    missed = sum(one.kept_share < 1.0 for one in report.links)
    note = (
        f"planned meetings with a sighting in {report.run}; {missed} of {len(report.links)} links "
        "missed some"
    )
    if len(shown) < len(report.links):
        note += f"; the {len(shown)} worst are shown"
    drawn = layout(
        title,
        note=note,
        inner=max(_ROW_PX * len(shown), _LEAST_PX),
        barmode="overlay",
        bargap=0.25,
        xaxis=axis("meetings kept, %", range=[0, 104]),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=[_label(one) for one in shown],
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _bars(uid: str, name: str, links: list[FlownLink], color: str) -> Spec:
    marker: Spec = {"color": color, "line": {"color": INK, "width": 0.8}}
    if uid == "missed":
        marker["pattern"] = {"shape": "/", "fillmode": "replace", "size": 6}
    return {
        "type": "bar",
        "orientation": "h",
        "uid": uid,
        "name": name,
        "x": numbers([100.0 * one.kept_share for one in links], 4),
        "y": [_label(one) for one in links],
        "text": [f"{one.meetings} in a trial" for one in links],
        "textposition": "none",
        "marker": marker,
        "hovertemplate": "%{y}: %{x:.4g} % of %{text}<extra></extra>",
    }


def _label(one: FlownLink) -> str:
    return escaped("-".join(one.between))
