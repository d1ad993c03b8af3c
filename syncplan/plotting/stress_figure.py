"""What worlds that are worse than stated do to the error of a plan's filter."""

from syncplan.plotting.canvas import Spec, axis, escaped, layout, numbers
from syncplan.plotting.palette import BLUE, INK
from syncplan.reports.run_schemas import ValidationDocument

_ROW_PX = 21


def stress_spec(report: ValidationDocument) -> Spec:
    """Return the figure of the error in each worse world, the most harmful on top.

    Diamonds mark what was to be expected, a line the error in the world as stated.
    """
    traces = _traces(report)
    labels = [escaped(one.world) for one in report.stress or []]
    drawn = layout(
        f"{escaped(report.name or 'Plan')}: error in worse worlds",
        note=f"{report.run}; the plan and its filter are the same in all worlds",
        inner=max(_ROW_PX * len(labels), 90),
        barmode="overlay",
        bargap=0.25,
        xaxis=axis("RMS position error, second half, m", rangemode="tozero"),
        yaxis=axis(
            type="category",
            autorange="reversed",
            categoryorder="array",
            categoryarray=labels,
            showgrid=False,
        ),
    )
    return {"data": [trace for trace in traces if trace["x"]], "layout": drawn}


def _traces(report: ValidationDocument) -> list[Spec]:
    worlds = report.stress or []
    labels = [escaped(one.world) for one in worlds]
    expected = [one for one in worlds if one.expected_rms_m is not None]
    stated = report.overall.rms_second_half_m
    return [
        {
            "type": "bar",
            "orientation": "h",
            "uid": "found",
            "name": "found",
            "y": labels,
            "x": numbers([one.rms_second_half_m for one in worlds], 6),
            "text": [f"{one.harm:.2f} times" for one in worlds],
            "textposition": "none",
            "marker": {"color": BLUE, "line": {"color": INK, "width": 0.8}},
            "hovertemplate": "%{y}: %{x:.3g} m, %{text}<extra></extra>",
        },
        {
            "type": "scatter",
            "uid": "expected",
            "name": "expected",
            "mode": "markers",
            "y": [escaped(one.world) for one in expected],
            "x": numbers([one.expected_rms_m or 0.0 for one in expected], 6),
            "marker": {"color": INK, "symbol": "diamond", "size": 8},
            "hovertemplate": "%{y}: %{x:.3g} m expected<extra></extra>",
        },
        {
            "type": "scatter",
            "uid": "stated",
            "name": "as stated",
            "mode": "lines",
            "x": [stated] * len(labels),
            "y": labels,
            "line": {"color": INK, "width": 2, "dash": "dash"},
            "hovertemplate": "as stated: %{x:.3g} m<extra></extra>",
        },
    ]
