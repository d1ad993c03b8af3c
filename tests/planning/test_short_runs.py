"""Runs shorter than the window: the judge takes sightings of the run alone."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.observability.rank import assess_team
from syncplan.planning.loss_study import what_if
from syncplan.planning.plans import Plan
from syncplan.refinement.problem_setup import problem_of
from syncplan.reports.plan_report import plan_document
from syncplan.scenario.dotted_keys import with_number
from syncplan.scenario.loading import load_scenario, scenario_from
from syncplan.scenario.models import RefineOptions
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, example, findings_of

SHORT = Path(__file__).parents[1] / "data" / "hard" / "short-run.yaml"
PERIOD = 10.0 * np.pi


@pytest.fixture(scope="module")
def short() -> Plan:
    return syncplan.plan(SHORT, bound="never")


def lasting(duration: float, **keys: Any) -> Plan:
    """The plan of the same team with another run."""
    scenario = load_scenario(SHORT).model_copy(update={"duration_s": duration, **keys})
    return plan(scenario, bound="never")


def test_a_run_of_ten_seconds_where_eighteen_are_needed_is_no_go(short: Plan) -> None:
    findings = findings_of(short, "unobservable")
    assert not short.verdict.go
    assert findings
    for finding in findings:
        assert finding.level == "stop"
        assert "over the run of 10 s, shorter than the window of 31.42 s" in finding.message
        assert finding.cure is not None
        assert "17.9 s" in finding.cure.text
        assert dict(finding.cure.change) == {"duration_s": 17.9}


def test_the_run_that_the_cure_states_makes_the_team_observable(short: Plan) -> None:
    (finding, *_) = findings_of(short, "unobservable")
    assert finding.cure is not None
    keys: dict[str, Any] = short.scenario.model_dump(exclude_none=True)
    for key, value in finding.cure.change.items():
        keys = with_number(keys, key, float(value))
    cured = plan(scenario_from(keys), bound="never")
    assert cured.observable
    assert cured.connectivity_period == 17.9
    assert findings_of(cured, "unobservable") == []


def test_no_connectivity_period_is_longer_than_the_run(short: Plan) -> None:
    assert short.connectivity_period is None
    period = lasting(200.0).connectivity_period
    assert period == 17.9
    assert lasting(period).connectivity_period == pytest.approx(period, abs=0.2)
    assert lasting(period - 0.5).connectivity_period is None


def test_the_judge_takes_the_sightings_of_the_run(short: Plan) -> None:
    of_run = assess_team(short.team, 10.0)
    assert short.observability.rank == of_run.observability.rank
    assert short.observability.rank < assess_team(short.team, PERIOD).observability.rank
    assert short.certificate == of_run.certificate
    assert what_if(short, lose=["v6"]).baseline.rank == short.observability.rank


@pytest.mark.parametrize(
    ("duration", "window", "judged"),
    [
        (200.0, None, PERIOD),
        (200.0, 60.0, 60.0),
        (10.0, None, 10.0),
        (10.0, 60.0, 10.0),
        (10.0, 5.0, 5.0),
    ],
)
def test_the_window_is_as_stated_or_a_period_and_no_longer_than_the_run(
    duration: float, window: float | None, judged: float
) -> None:
    scenario = load_scenario(SHORT).model_copy(update={"duration_s": duration, "window_s": window})
    assert scenario.window == pytest.approx(judged)
    assert scenario.stated_window == pytest.approx(PERIOD if window is None else window)
    # documents keep the window as stated
    assert scenario.resolved().window_s == scenario.stated_window
    assert scenario.resolved().window == scenario.window


def test_links_that_meet_after_the_run_say_so(short: Plan) -> None:
    reasons = {(link.a, link.b): link.reason for link in (*short.links, *short.landmark_links)}
    # v2 and v3 meet from 11.8 s on, v6 and L2 from 8.9 s on
    assert reasons[1, 2] == "no contact within the window of 10 s"
    assert reasons[5, 7] == ""
    meeting = [link for link in short.links if link.rank == 0]
    assert meeting
    assert all(link.windows[:, 0].min() > 10.0 for link in meeting)


def test_a_run_without_any_contact_determines_nothing_and_states_the_run_needed() -> None:
    judged = lasting(2.0, landmarks_m=[[190.0, 70.0]])
    assert not any(link.rank for link in judged.landmark_links)
    assert not judged.observable
    alone = lasting(0.1)
    assert alone.observability.rank < alone.observability.state_dim
    assert alone.sufficient_run == 17.9


def test_refinement_and_reports_use_the_window_of_the_judge(short: Plan) -> None:
    assert problem_of(short, RefineOptions()).window == 10.0
    document = plan_document(short)
    assert document.observability.window_s == 10.0
    assert document.scenario.window_s == pytest.approx(PERIOD)
    assert document.connectivity_period_s is None


def test_a_team_that_a_longer_run_does_not_cure_keeps_its_own_cures() -> None:
    judged = plan(changed("paper-grid-alternate", duration_s=10.0), bound="never")
    findings = findings_of(judged, "unobservable")
    assert judged.sufficient_run is None
    assert findings
    for finding in findings:
        assert finding.cure is not None
        assert finding.cure.text.startswith("a run of the whole window, 31.42 s (duration_s)")
        assert finding.cure.change == {}


def test_a_run_as_long_as_its_window_is_judged_as_before() -> None:
    scenario: Scenario = example("paper-grid-alternate")
    whole = plan(scenario, bound="never")
    exact = plan(scenario.model_copy(update={"duration_s": scenario.period}), bound="never")
    assert exact.observability.singular_values.tolist() == (
        whole.observability.singular_values.tolist()
    )
    messages = [finding.message for finding in findings_of(whole, "unobservable")]
    assert [finding.message for finding in findings_of(exact, "unobservable")] == messages
    assert all(message.endswith("rank 16 of 18 over 31.42 s") for message in messages)
