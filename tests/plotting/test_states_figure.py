"""The figure of further states over time: what is drawn is what the report holds."""

from typing import Any

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.planning.validation import validate
from syncplan.plotting.figure_style import FigureStyle
from syncplan.plotting.figures import specs_of
from syncplan.plotting.series_figures import MOST_STATES
from syncplan.reports.run_figures import StateErrorSeries
from syncplan.reports.validation_report import ValidationDocument, validation_document
from tests.tools.figure_parts import spec_of, trace_of
from tests.tools.scenarios import small


@pytest.fixture(scope="module")
def report() -> ValidationDocument:
    given = small(wind={"sigma_mps": 0.5}, motion={"speed_scale_sigma": 0.02})
    return validation_document(validate(given, trials=4, duration=20.0, with_series=True))


def _of(report: ValidationDocument, **changes: object) -> ValidationDocument:
    assert report.series is not None
    series = report.series.model_copy(update=changes)
    return report.model_copy(update={"series": series})


def states_of(report: ValidationDocument) -> list[StateErrorSeries]:
    """The further states of a report."""
    assert report.series is not None
    assert report.series.errors is not None
    return report.series.errors


def _drawn(report: ValidationDocument, **style: Any) -> dict[str, Any]:
    return spec_of(report, "states", style=FigureStyle(**style))


def test_each_state_has_a_panel_of_found_and_predicted(report: ValidationDocument) -> None:
    assert report.series is not None
    assert list(specs_of(report)) == ["accuracy", "errors", "states", "consistency"]
    curves = {one["uid"]: one for one in _drawn(report)["data"]}
    lines = [uid for uid, one in curves.items() if one["mode"] == "lines"]
    assert len(lines) == 3 * len(states_of(report))
    for state in states_of(report):
        assert state.predicted is not None
        for key, values in (("rms", state.rms), ("sigma", state.sigma)):
            assert curves[f"{key}-{state.state}"]["y"] == pytest.approx(values, rel=1e-3)
        dotted = curves[f"predicted-{state.state}"]
        assert dotted["y"] == pytest.approx(state.predicted, rel=1e-3)
        assert dotted["x"] == pytest.approx(report.series.time_s)
    titles = [one["text"] for one in _drawn(report)["layout"]["annotations"]]
    assert titles[:3] == ["wind x, m/s", "wind y, m/s", "speed scale of v1"]


def test_curves_that_coincide_have_marks_apart(report: ValidationDocument) -> None:
    same = [
        one.model_copy(update={"predicted": one.sigma, "rms": one.sigma})
        for one in states_of(report)
    ]
    shown = _drawn(_of(report, errors=same))
    first = same[0].state
    marks = {k: trace_of(shown, f"marks-{k}-{first}") for k in ("sigma", "rms", "predicted")}
    times = [time for one in marks.values() for time in one["x"]]
    assert len(set(times)) == len(times) == 3 * 4
    # in turns over the whole run
    assert [k for _, k in sorted((t, k) for k, one in marks.items() for t in one["x"])] == [
        "sigma",
        "rms",
        "predicted",
    ] * 4
    for key, one in marks.items():
        line = trace_of(shown, f"{key}-{first}")
        assert set(zip(one["x"], one["y"], strict=True)) <= set(
            zip(line["x"], line["y"], strict=True)
        )
        entry = trace_of(shown, f"entry-{key}")
        assert (entry["marker"], entry["line"]) == (one["marker"], line["line"])
        assert entry["legendgroup"] == one["legendgroup"] == line["legendgroup"]
    assert len({one["marker"]["symbol"] for one in marks.values()}) == 3
    assert shown["layout"]["xaxis"]["range"] == [0.0, 20.0]


def test_the_lowest_panel_of_each_column_has_the_times(report: ValidationDocument) -> None:
    def timed(**style: Any) -> list[bool]:
        shown = _drawn(report, **style)["layout"]
        return [shown[name]["showticklabels"] for name in shown if name.startswith("xaxis")]

    assert timed(width=1000) == [False, True, True, True]
    assert timed(width=400) == [False, False, False, True]


def test_of_many_states_the_least_known_of_each_kind_are_drawn(report: ValidationDocument) -> None:
    wind, _, scale, _ = states_of(report)
    many = [
        scale.model_copy(
            update={"state": f"speed scale of v{k}", "rms": (0.01 * k * np.ones(5)).tolist()}
        )
        for k in range(40)
    ]
    shown = _drawn(_of(report, errors=[*many, wind]))
    titles = [one["text"] for one in shown["layout"]["annotations"]]
    assert titles[-1] == "wind x, m/s"
    assert titles[:-1] == [f"speed scale of v{k}" for k in range(40 - MOST_STATES + 1, 40)]
    assert f"{MOST_STATES} of 41 states" in str(shown["layout"]["title"])


def test_without_a_bound_none_is_drawn(report: ValidationDocument) -> None:
    unknown = [one.model_copy(update={"predicted": None}) for one in states_of(report)]
    curves = _drawn(_of(report, errors=unknown))["data"]
    assert {one["uid"].split("-")[0] for one in curves if "xaxis" in one} == {
        "sigma",
        "rms",
        "marks",
    }


def test_a_report_of_poses_alone_has_no_such_figure(report: ValidationDocument) -> None:
    for without in (_of(report, errors=None), report.model_copy(update={"series": None})):
        assert "states" not in specs_of(without)
        with pytest.raises(InputError, match="--series"):
            specs_of(without, ["states"])
