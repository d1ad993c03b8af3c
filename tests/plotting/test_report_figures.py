"""Figures of validations and sweeps: what is drawn is what the report holds."""

import json
import re

import numpy as np
import pytest
from plotly.graph_objects import Figure

from syncplan import figures
from syncplan.errors import InputError
from syncplan.estimation.trials import series
from syncplan.planning.loss_study import what_if
from syncplan.planning.validation import Validation, validate
from syncplan.planning.variations import sweep
from syncplan.plotting.figures import specs_of
from syncplan.plotting.panels import MOST_POINTS
from syncplan.plotting.series_figures import MOST_VEHICLES
from syncplan.reports.flight_report import flight_document
from syncplan.reports.validation_report import (
    SweepReport,
    ValidationDocument,
    sweep_document,
)
from tests.tools.figure_parts import note_of, spec_of, trace_of
from tests.tools.flown import short_flight
from tests.tools.on_paper import plan
from tests.tools.scenarios import example, small


def test_bars_are_the_errors_found_and_predicted(report: ValidationDocument) -> None:
    spec = spec_of(report, "accuracy")
    for uid, key in (
        ("late", "rms_second_half_m"),
        ("whole", "rms_m"),
        ("predicted", "predicted_rms_m"),
        ("median", "median_rms_second_half_m"),
    ):
        expected = [getattr(vehicle, key) for vehicle in report.vehicles]
        np.testing.assert_allclose(trace_of(spec, uid)["y"], expected, atol=1e-6)
    bars = [trace["marker"] for trace in spec["data"] if trace["type"] == "bar"]
    patterns = [marker.get("pattern", {}).get("shape", "") for marker in bars]
    assert len(patterns) == 3
    assert len(set(patterns)) == len(patterns)


def test_a_report_without_a_prediction_has_no_bars_of_it(report: ValidationDocument) -> None:
    values = report.as_json()
    for figure in [*values["vehicles"], values["overall"]]:
        figure["predicted_rms_m"] = figure["rms_over_predicted"] = None
    spec = spec_of(ValidationDocument.model_validate(values), "accuracy")
    assert [trace["uid"] for trace in spec["data"]] == ["late", "whole", "median"]


def test_bands_are_three_sigma(run_with_series: Validation, report: ValidationDocument) -> None:
    kept = series(run_with_series.result)
    spec = spec_of(report, "errors")
    # small multiples have half as many points
    every = -(-2 * len(kept.position_rms) // MOST_POINTS)
    for k, vehicle in enumerate(report.vehicles):
        for column in range(3):
            sigma = kept.heading_sigma[:, k] if column == 2 else kept.axis_sigma[:, k, column]
            band = np.array(trace_of(spec, f"band-{vehicle.name}-{column}")["y"])
            count = len(band) // 2
            np.testing.assert_allclose(band[:count], 3.0 * sigma[::every], atol=1e-5)
            np.testing.assert_allclose(band[count:][::-1], -3.0 * sigma[::every], atol=1e-5)
            mean = trace_of(spec, f"mean-{vehicle.name}-{column}")
            np.testing.assert_allclose(mean["y"], kept.mean_errors[::every, k, column], atol=1e-5)
            np.testing.assert_allclose(mean["x"], every * 0.1 * np.arange(count), atol=1e-6)
    assert "mean error of 20 trials" in note_of(spec)


def test_axes_of_the_series_make_up_the_position(run_with_series: Validation) -> None:
    kept = series(run_with_series.result)
    whole = np.hypot(kept.axis_rms[..., 0], kept.axis_rms[..., 1])
    np.testing.assert_allclose(whole, kept.position_rms, rtol=1e-12)
    whole = np.hypot(kept.axis_sigma[..., 0], kept.axis_sigma[..., 1])
    np.testing.assert_allclose(whole, kept.position_sigma, rtol=1e-12)
    # at time 0 each axis has the initial sigma
    np.testing.assert_allclose(
        kept.axis_sigma[0], run_with_series.plan.noise.position_sigma, rtol=1e-12
    )
    # over the run, axis by axis, they come to the totals of the trials
    totals = np.sqrt(np.mean(kept.axis_rms[1:] ** 2, axis=0))
    np.testing.assert_allclose(totals[:, 0], run_with_series.accuracy.x, rtol=1e-9)
    np.testing.assert_allclose(totals[:, 1], run_with_series.accuracy.y, rtol=1e-9)


def test_of_a_large_team_the_worst_are_drawn_or_those_named() -> None:
    shape = {"shape": "grid", "count": 20, "columns": 5, "spacing_m": 70.0}
    run = validate(small(formation=shape), trials=4, duration=2.0, with_series=True)
    spec = spec_of(run, "errors")
    drawn = {trace["uid"].split("-")[1] for trace in spec["data"]}
    order = np.argsort(-run.accuracy.position, kind="stable")[:MOST_VEHICLES]
    assert drawn == {f"v{k + 1}" for k in order}
    assert "16 of 20" in note_of(spec)
    named = figures.error_bands(run, ["v3"]).to_plotly_json()
    assert {trace["uid"].split("-")[1] for trace in named["data"]} == {"v3"}
    with pytest.raises(InputError, match="'v21' is not in the report"):
        figures.error_bands(run, ["v21"])


def test_a_report_without_series_says_how_to_get_one(report: ValidationDocument) -> None:
    without = report.model_copy(update={"series": None})
    assert "errors" not in specs_of(without)
    with pytest.raises(InputError, match="--series"):
        figures.error_bands(without)


def test_consistency_shows_value_band_and_verdict(report: ValidationDocument) -> None:
    spec = spec_of(report, "consistency")
    for name, figure in (("ANEES", report.anees), ("NIS", report.nis)):
        assert figure.band is not None
        np.testing.assert_allclose(trace_of(spec, f"{name}-band")["x"], figure.band)
        assert trace_of(spec, f"{name}-value")["x"] == [figure.value]
        texts = [note["text"] for note in spec["layout"]["annotations"]]
        assert any(text.startswith(name) and figure.verdict in text for text in texts)
        assert any("95 % interval" in text and "over 20 trials" in text for text in texts)
        tolerated = trace_of(spec, f"{name}-tolerated")
        assert (min(tolerated["x"]), max(tolerated["x"])) == (0.9, 1.1)
    covered = [vehicle.coverage_3sigma for vehicle in report.vehicles]
    np.testing.assert_allclose(trace_of(spec, "coverage")["y"], covered, atol=1e-6)


def test_a_dishonest_filter_is_reported_by_symbol_and_words(report: ValidationDocument) -> None:
    wrong = report.anees.model_copy(update={"value": 3.0, "verdict": "optimistic"})
    bad = report.model_copy(update={"anees": wrong})
    spec = spec_of(bad, "consistency")
    assert trace_of(spec, "ANEES-value")["marker"]["symbol"] == "triangle-right"
    low, high = spec["layout"]["xaxis"]["range"]
    assert low < 1.0
    assert high > 3.0


def test_a_single_trial_shows_its_error_and_a_value_without_spread_or_interval() -> None:
    one = validate(small(landmarks_m=[[35, 9]]), trials=1, duration=5.0, with_series=True)
    specs = specs_of(one)
    spec = specs["errors"]
    assert {trace["uid"].split("-")[0] for trace in spec["data"]} == {"band", "mean"}
    assert trace_of(spec, "mean-v1-0")["name"] == "error"
    drawn = [trace_of(spec, f"mean-v1-{column}")["y"][-1] for column in range(3)]
    np.testing.assert_allclose(drawn, one.result.final_errors[0, 0], atol=1e-5)
    spec = specs["consistency"]
    assert "ANEES-band" not in {trace["uid"] for trace in spec["data"]}
    assert trace_of(spec, "ANEES-value")["x"] == [one.anees.value]
    texts = [note["text"] for note in spec["layout"]["annotations"]]
    assert any("1 trial: not judged<br>at least 10 trials are needed" in text for text in texts)


def test_a_report_of_an_earlier_version_keeps_its_band(report: ValidationDocument) -> None:
    values = report.as_json()
    for name in ("anees", "nis"):
        del values[name]["basis"]
    for figure in [*values["vehicles"], values["overall"]]:
        for key in ("median_rms_second_half_m", "share_over_3_predicted"):
            del figure[key]
    old = ValidationDocument.model_validate(values)
    spec = spec_of(old, "consistency")
    assert trace_of(spec, "ANEES-band")["name"] == "95 % band"
    accuracy = spec_of(old, "accuracy")
    assert "median" not in {trace["uid"] for trace in accuracy["data"]}


def test_a_run_without_bearings_has_nothing_to_judge() -> None:
    lonely = small(formation={"centers_m": [[0.0, 0.0], [500.0, 0.0]]})
    alone = spec_of(validate(lonely, trials=2, duration=2.0), "consistency")
    assert any("nothing to judge" in note["text"] for note in alone["layout"]["annotations"])
    assert Figure(alone).to_json()


@pytest.fixture(scope="module")
def swept() -> SweepReport:
    rows = sweep(
        example("paper-grid-same"),
        "angular_rate",
        [0.4, 0.2],
        trials=4,
        duration=20.0,
        connected=True,
    )
    document = sweep_document(rows)
    assert SweepReport.model_validate_json(json.dumps(document.as_json())) == document
    return document


def test_sweep_curves_run_over_the_values_in_order(swept: SweepReport) -> None:
    spec = spec_of(swept, "sweep")
    by_value = {row.value: row for row in swept.rows[:2]}
    curve = trace_of(spec, "x")
    assert curve["x"] == [0.2, 0.4]
    np.testing.assert_allclose(
        curve["y"], [by_value[0.2].mean_rms_x_m, by_value[0.4].mean_rms_x_m], atol=1e-6
    )
    beside = trace_of(spec, "y-connected")
    assert beside["x"] == [0.4]
    np.testing.assert_allclose(beside["y"], [swept.rows[2].mean_rms_y_m], atol=1e-6)
    assert beside["marker"]["symbol"].endswith("-open")
    assert Figure(spec).to_json()
    assert figures.sweep_curves(swept).layout.xaxis.title.text == "angular rate, rad/s"


def test_a_row_that_is_not_observable_is_crossed_out(swept: SweepReport) -> None:
    lost = swept.rows[0].model_copy(update={"rank": 5})
    spec = spec_of(SweepReport(swept=swept.swept, rows=[lost, *swept.rows[1:]]), "sweep")
    assert trace_of(spec, "unobservable")["x"] == [0.4]
    assert all(trace["uid"] != "unobservable" for trace in spec_of(swept, "sweep")["data"])


def test_texts_hold_no_markup_but_breaks(report: ValidationDocument, swept: SweepReport) -> None:
    """Plotly gives such markup a style of its own, which the policy of the web page forbids."""
    flown = flight_document(short_flight()).model_copy(update={"name": "<b>&"})
    for subject in (plan(example("paper-grid-alternate")), report, swept, flown):
        tags = re.findall(r"</?\w[^<>]*>", json.dumps(specs_of(subject)))
        assert set(tags) <= {"<br>", "<extra>", "</extra>"}


def test_a_report_is_not_compared_with_a_plan(run_with_series: Validation) -> None:
    with pytest.raises(InputError, match="only a plan"):
        specs_of(run_with_series, after=run_with_series.plan)


def test_losses_are_bars_and_those_that_end_observability_grow_beyond_the_axis() -> None:
    document = what_if(example("paper-grid-same"))
    spec = spec_of(document, "losses")
    ends, stays = trace_of(spec, "ends"), trace_of(spec, "stays")
    assert set(ends["y"]) == {"v3", "v4", "sensor of v3", "sensor of v4", "L1", "L2"}
    assert ends["marker"]["pattern"]["shape"]
    assert spec["layout"]["yaxis"]["categoryarray"] == ends["y"] + stays["y"]
    worst = [one.worst_predicted_rms_m for one in document.losses if one.observable]
    np.testing.assert_allclose(stays["x"], np.array(worst, dtype=float), atol=1e-6)
    # to the edge, one as long as the other, whatever the error at the end of the run
    heads = trace_of(spec, "growing")
    assert (heads["x"], heads["y"]) == (ends["x"], ends["y"])
    (edge,) = set(ends["x"])
    assert max(stays["x"]) < edge > 0.95 * spec["layout"]["xaxis"]["range"][1]
    assert ends["name"] == "not observable: the error grows with time"
    first = document.losses[0]
    assert ends["text"][0].startswith(f"{first.worst_predicted_rms_m:.3g} m in the run's second")
    assert set(trace_of(spec, "baseline")["x"]) == {document.baseline.worst_predicted_rms_m}
    assert Figure(spec).to_json()
    assert figures.figures_of(document)["losses"].layout.xaxis.title.text.endswith("error, m")


def test_the_errors_of_a_plan_that_is_not_observable_grow_with_nothing_lost() -> None:
    spec = spec_of(what_if(example("paper-grid-alternate")), "losses")
    assert {trace["uid"] for trace in spec["data"]} == {"ends", "growing"}
    assert spec["layout"]["xaxis"]["showticklabels"] is False


def test_without_predicted_errors_the_figure_of_losses_says_why() -> None:
    spec = spec_of(what_if(small(), bound="never"), "losses")
    assert spec["data"] == []
    assert "not asked for" in spec["layout"]["annotations"][0]["text"]


def test_of_many_losses_the_most_harmful_are_drawn() -> None:
    row = {"shape": "line", "count": 4, "spacing_m": 70.0}
    team = small(formation=row, landmarks_m=[[30.0, 20.0], [40.0, -20.0]])
    spec = spec_of(what_if(team, losses=2), "losses")
    assert len(spec["layout"]["yaxis"]["categoryarray"]) == 30
    assert len(trace_of(spec, "baseline")["y"]) == 30
    assert "the 30 most harmful are shown" in note_of(spec)
