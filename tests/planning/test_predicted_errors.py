"""What plans predict: at any sample time the same, of states that are no poses, and of neglect."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import plan, refine
from tests.tools.scenarios import example, planned, small
from tests.tools.stories import shown

ERRORS: dict[str, Any] = {
    "motion": {"speed_scale_sigma": 0.02},
    "wind": {"sigma_mps": 0.3},
    "landmarks_m": [[0.0, 45.0], [70.0, 50.0]],
    "duration_s": 60.0,
}


def _at_density(scenario: Scenario, share: float) -> Scenario:
    """The scenario with its noise as random walks, and so much of its sample time."""
    document = scenario.model_dump(exclude_none=True)
    sample_time, motion = scenario.sample_time, scenario.motion
    lasting = {"speed_scale_sigma", "turn_rate_bias_sigma_rad_s"}
    document["motion"] = {
        **{key: value for key, value in document["motion"].items() if key in lasting},
        "position_random_walk_m_sqrt_s": motion.speed_sigma(sample_time) * sample_time**0.5,
        "angle_random_walk_rad_sqrt_s": motion.turn_rate_sigma(sample_time) * sample_time**0.5,
    }
    document["sensor"] = {
        "interval_s": sample_time,
        **document["sensor"],
        "sample_time_s": share * sample_time,
    }
    if scenario.heading_sigma_rad is not None:
        document["heading_interval_s"] = sample_time
    return scenario_from(document)


@pytest.mark.parametrize(
    "name", ["biased-grid", "boats", "camera-pair", "mixed-radii-camera", "windy-grid"]
)
def test_half_the_sample_time_with_densities_given_predicts_the_same(name: str) -> None:
    scenario = example(name)
    rms = []
    for given in (scenario, _at_density(scenario, 1.0), _at_density(scenario, 0.5)):
        found = plan(given, pilot=False, single_points=False).prediction.rms
        assert found is not None
        rms.append(found)
    np.testing.assert_allclose(rms[1], rms[0], rtol=1e-9)
    np.testing.assert_allclose(rms[2], rms[1], rtol=0.002)


def _with(estimate: Any) -> Plan:
    return plan(small(**ERRORS, filter={"estimate": estimate}))


def test_states_that_are_no_poses_are_predicted_by_name() -> None:
    made = _with("auto")
    states = made.prediction.states
    assert [one.label for one in states] == [
        "wind x",
        "wind y",
        "speed scale of v1",
        "speed scale of v2",
    ]
    assert [one.unit for one in states] == ["m/s", "m/s", "1", "1"]
    assert [one.sigma for one in states] == [0.3, 0.3, 0.02, 0.02]
    assert all(0.0 < one.rms < one.sigma for one in states)
    document = plan_document(made)
    assert document.predicted_errors is not None
    assert document.predicted_errors[2].predicted_rms == states[2].rms
    assert "expected_rms_m" not in document.as_json()
    assert PlanDocument.model_validate(document.as_json()) == document


@pytest.mark.parametrize(("estimate", "said"), [("auto", True), (["speed_scale"], False)])
def test_the_table_says_that_predictions_of_wind_suppose_still_air(
    estimate: str | list[str], said: bool
) -> None:
    text = shown(plan_document(_with(estimate)))
    assert "errors that the filter estimates" in text
    assert ("suppose still air" in text) == said
    assert ("wind x" in text) == said
    assert re.search(r"speed scale of v1 .*0\.02", text)


def test_a_plan_without_such_errors_says_nothing_of_them() -> None:
    document = plan_document(plan(small()))
    assert not {"expected_rms_m", "predicted_errors"} & set(document.as_json())
    assert "errors that the filter estimates" not in shown(document)
    assert all(one.code != "not-estimated" for one in plan(small()).verdict.findings)


def test_what_is_not_estimated_is_found_with_its_cost_and_its_cure() -> None:
    made = _with("none")
    rms, neglect = made.prediction.rms, made.prediction.neglect
    assert rms is not None
    assert neglect is not None
    assert neglect.names == ("wind", "speed_scale")
    assert neglect.expected is not None
    assert np.all(neglect.expected > 2.0 * rms)
    [finding] = [one for one in made.verdict.findings if one.code == "not-estimated"]
    assert finding.level == "warning"
    assert "wind, speed scale" in finding.message
    assert f"v1 by {neglect.expected[0]:.3g} m, not {rms[0]:.3g} m" in finding.message
    assert finding.subjects == ("v1", "v2")
    assert finding.cure is not None
    assert finding.cure.change == {"filter.estimate": "auto"}
    document = plan_document(made)
    assert document.expected_rms_m is not None
    assert document.expected_rms_m.vehicles["v2"] == neglect.expected[1]
    assert document.verdict is not None
    assert PlanDocument.model_validate(document.as_json()) == document
    cured = _with(finding.cure.change["filter.estimate"])
    assert all(one.code != "not-estimated" for one in cured.verdict.findings)


def test_neglect_that_costs_next_to_nothing_is_but_a_note() -> None:
    tiny = {**ERRORS, "motion": {"speed_scale_sigma": 1e-5}, "wind": {"sigma_mps": 1e-5}}
    made = plan(small(**tiny, filter={"estimate": "none"}))
    [finding] = [one for one in made.verdict.findings if one.code == "not-estimated"]
    assert finding.level == "note"
    assert finding.cure is None


@pytest.fixture(scope="module")
def refined() -> Plan:
    return refine(_with("none"), objective="logdet", starts=1, workers=1, time_limit_s=0.01)


@pytest.mark.parametrize(("share", "worse"), [(0.9, True), (1.0, False), (1.1, False)])
def test_a_refinement_that_makes_worse_what_is_to_be_expected_says_so(
    refined: Plan, share: float, worse: bool
) -> None:
    neglect, record = refined.prediction.neglect, refined.refinement
    assert neglect is not None
    assert record is not None
    after = neglect.expected_of_all
    assert after is not None
    record = replace(record, improved=True, expected_before=share * after)
    changed = replace(refined, refinement=record)
    reported = [one for one in changed.verdict.findings if one.code == "expected-worse"]
    assert len(reported) == worse
    for one in reported:
        assert f"rose from {share * after:.3g} m to {after:.3g} m" in one.message
    # and a plan that is read back says the same
    values = plan_document(changed).as_json()
    assert values["refinement"]["expected_rms_before_m"] == share * after
    again = plan_of(loaded_from(values))
    assert again.verdict.findings == changed.verdict.findings


def test_the_record_holds_what_was_to_be_expected_of_the_input(refined: Plan) -> None:
    neglect, record = _with("none").prediction.neglect, refined.refinement
    assert record is not None
    assert neglect is not None
    assert neglect.expected is not None
    assert record.expected_before == pytest.approx(np.sqrt(np.mean(neglect.expected**2)))
    known = replace(record, expected_before=None)
    document = plan_document(replace(_with("all"), refinement=known))
    assert "expected_rms_before_m" not in document.as_json()["refinement"]
    assert "as if all else were known" in shown(document)
    assert "as if all else were known" not in shown(plan_document(refined))


def test_without_a_bound_nothing_is_said_of_neglect() -> None:
    made = planned(**ERRORS, filter={"estimate": "none"})
    assert made.prediction.neglect is None
    assert all(one.code != "not-estimated" for one in made.verdict.findings)
