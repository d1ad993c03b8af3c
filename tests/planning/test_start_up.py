"""The finding on the start: index, pilot, cure, refinements that make it worse, filter."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.planning import start_up
from syncplan.planning.judged_team import PlanFinding
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.planner import Plan, plan
from syncplan.planning.start_up import CLEARING_INDEX, SAFE_RATIO, InputStart, StartTrials, StartUp
from syncplan.planning.validation import choose_filter, validate
from syncplan.planning.variations import sweep
from syncplan.refinement.refiner import refine
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import validation_document
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.scenarios import changed, example, small


def grid(
    position: float = 15.0,
    heading: float = 0.3,
    name: str = "paper-grid-same",
    filter_: str = "ekf",
) -> Scenario:
    """A scenario from an uncertain start, for a filter that it is too much for."""
    start = {"position_m": position, "heading_rad": heading}
    return changed(name, initial_sigma=start, filter={"kind": filter_})


@cache
def uncertain_for(filter_: str) -> Plan:
    """The plan of the uncertain start for a filter."""
    return plan(grid(filter_=filter_))


@pytest.fixture(scope="module")
def uncertain() -> Plan:
    return uncertain_for("ekf")


def found(judged: Plan, code: str = "start-up") -> list[PlanFinding]:
    return [one for one in judged.verdict.findings if one.code == code]


def start_of(judged: Plan) -> StartUp:
    assert judged.start_up is not None
    return judged.start_up


def trials_of(judged: Plan) -> StartTrials:
    trials = start_of(judged).trials
    assert trials is not None
    return trials


def test_an_uncertain_start_is_warned_of_with_error_and_prediction(uncertain: Plan) -> None:
    (reported,) = found(uncertain)
    trials = trials_of(uncertain)
    assert reported.level == "warning"
    assert uncertain.verdict.go
    worst = int(np.argmax(trials.ratios))
    name = uncertain.scenario.vehicle_names[worst]
    predicted = trials.predicted[worst]
    assert trials.found[worst] > SAFE_RATIO * predicted
    words = f"{name} off by {trials.found[worst]:.3g} m ({predicted:.3g} m predicted)"
    assert words in reported.message
    assert "from initial_sigma 15 m and 0.3 rad the filter (ekf) may not settle" in reported.message
    assert reported.subjects == tuple(uncertain.scenario.vehicle_names)


def test_the_cure_of_an_uncertain_start_clears_it(uncertain: Plan) -> None:
    (reported,) = found(uncertain)
    assert reported.cure is not None
    assert set(reported.cure.change) == {"initial_sigma.position_m", "initial_sigma.heading_rad"}
    assert reported.cure.text.startswith("the robust filter, or a start known to ")
    values = uncertain.scenario.model_dump(mode="json", exclude_none=True)
    for key, value in reported.cure.change.items():
        section, name = key.split(".")
        values[section][name] = value
    cured = plan(scenario_from(values))
    assert found(cured) == []
    assert start_of(cured).cleared


@pytest.mark.parametrize("asked", ["auto", "robust"])
def test_the_robust_filter_is_not_warned_of_where_the_extended_one_is(asked: str) -> None:
    made = uncertain_for(asked)
    start = start_of(made)
    assert start.filter == "robust"
    assert trials_of(made).pilot
    assert start.worst_ratio < 1.3
    assert found(made) == []
    assert plan_document(made).as_json()["start_up"]["pilot"]["filter"] == "robust"


def test_the_pilot_is_of_the_filter_that_is_asked_for() -> None:
    names = ("ekf", "second-order", "robust")
    worst = {name: start_of(uncertain_for(name)) for name in names}
    assert [start.filter for start in worst.values()] == list(worst)
    assert worst["ekf"].worst_ratio > 2.0 * worst["second-order"].worst_ratio
    assert worst["second-order"].worst_ratio > 1.2 * worst["robust"].worst_ratio


def test_a_robust_filter_that_misses_its_bound_is_warned_of_by_name(uncertain: Plan) -> None:
    start = replace(ratios(uncertain, 3.0), filter="robust")
    (reported,) = found(replace(uncertain, start_up=start))
    assert reported.level == "warning"
    assert "the filter (robust) may not settle: a pilot of 16 trials" in reported.message
    assert reported.cure is not None
    assert reported.cure.text.startswith("a start known to ")


def test_a_known_start_needs_no_pilot() -> None:
    made = plan(example("paper-grid-same"))
    assert start_of(made).index.value <= CLEARING_INDEX
    assert start_of(made).trials is None
    assert start_of(made).filter == "ekf"
    assert found(made) == []


def test_trials_that_find_no_harm_are_silent(
    uncertain: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    # as if the index cleared nothing
    monkeypatch.setattr(start_up, "CLEARING_INDEX", 0.0)
    made = plan(grid(1.0, 0.02))
    assert trials_of(made).pilot
    assert start_of(made).worst_ratio <= SAFE_RATIO
    assert found(made) == []


def test_a_pilot_that_left_errors_out_does_not_clear_a_plan_with_errors_as_states(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # as if the index cleared nothing
    monkeypatch.setattr(start_up, "CLEARING_INDEX", 0.0)
    lasting = {"motion": {"speed_scale_sigma": 0.02}, "landmarks_m": [[0.0, 45.0], [70.0, 50.0]]}
    made = plan(small(**lasting, duration_s=60.0))
    assert start_of(made).worst_ratio <= SAFE_RATIO
    (reported,) = found(made)
    assert reported.level == "note"
    assert "left these errors out" in reported.message
    own = trials_of(made)
    with_all = replace(start_of(made), trials=replace(own, pilot=False))
    assert found(replace(made, start_up=with_all)) == []
    assert found(plan(small(**lasting, duration_s=60.0, filter={"estimate": "none"}))) == []


def test_what_was_not_tried_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    (reported,) = found(plan(grid(), pilot=False))
    assert reported.level == "note"
    assert "the filter (ekf) reaches the bound was not tried" in reported.message
    assert "trials were left out" in reported.message
    monkeypatch.setattr(start_up, "PILOT_WORK_LIMIT", 1.0)
    (reported,) = found(plan(grid()))
    assert reported.level == "note"
    assert "takes over a second" in reported.message


@pytest.mark.parametrize("bound", ["never", "auto"])
def test_a_plan_that_predicts_nothing_says_nothing_of_its_start(bound: Any) -> None:
    name = "paper-grid-same" if bound == "never" else "paper-grid-alternate"
    made = plan(grid(name=name), bound=bound)
    assert made.start_up is None
    assert found(made) == []


def test_a_validation_speaks_of_its_own_trials(uncertain: Plan) -> None:
    flown = validate(plan(grid(), pilot=False), trials=32, seed=5, threads=1, filter="ekf")
    findings = validation_document(flown).verdict
    assert findings is not None
    (reported,) = [one for one in findings.findings if one.code == "start-up"]
    assert reported.level == "warning"
    assert ": 32 trials over 200 s found" in reported.message
    assert flown.predicted is not None
    worst = int(np.argmax(flown.accuracy.late_position / flown.predicted))
    assert f"off by {flown.accuracy.late_position[worst]:.3g} m" in reported.message


def test_a_long_run_is_piloted_over_its_first_periods(uncertain: Plan) -> None:
    long = plan(grid().model_copy(update={"duration_s": 500.0}))
    trials = trials_of(long)
    assert trials.duration == pytest.approx(5.0 * long.orbits.period)
    short = plan(grid().model_copy(update={"duration_s": trials.duration}))
    assert short.prediction.rms is not None
    np.testing.assert_allclose(trials.predicted, short.prediction.rms, rtol=1e-9)
    alone = trials_of(short)
    np.testing.assert_allclose(trials.found, alone.found, rtol=1e-9)


def test_the_document_holds_the_figures(uncertain: Plan) -> None:
    values = plan_document(uncertain).as_json()["start_up"]
    start, trials = start_of(uncertain), trials_of(uncertain)
    assert values["index"] == start.index.value
    assert values["observer"] == uncertain.scenario.vehicle_names[start.index.observer]
    ratios = values["pilot"]["rms_over_predicted"]
    assert list(ratios) == uncertain.scenario.vehicle_names
    assert list(ratios.values()) == trials.ratios.tolist()
    lost = replace(trials, found=np.full(6, np.inf))
    gone = replace(uncertain, start_up=replace(start, trials=lost))
    assert plan_document(gone).as_json()["start_up"]["pilot"]["rms_over_predicted"]["v1"] is None
    assert "v1 lost" in found(gone)[0].message


def ratios(judged: Plan, ratio: float) -> StartUp:
    """A start like the plan's whose worst vehicle is that many times off."""
    start = start_of(judged)
    predicted = np.ones(judged.team.count)
    trials = StartTrials(16, 0, 100.0, pilot=True, found=ratio * predicted, predicted=predicted)
    return replace(start, trials=trials)


@pytest.fixture(scope="module")
def refined() -> Plan:
    return refine(plan(grid(5.0, 0.1)), vary=["phases"], starts=1, workers=1, time_limit_s=0.01)


@pytest.mark.parametrize(
    ("before", "after", "level"),
    [(1.1, 1.15, None), (1.1, 1.4, "note"), (1.1, 4.0, "warning"), (4.0, 3.0, None)],
)
def test_a_refinement_that_starts_worse_says_so(
    refined: Plan, before: float, after: float, level: str | None
) -> None:
    assert refined.refinement is not None
    assert refined.refinement.start_before is not None
    given = InputStart(index=1.0, worst_rms_over_predicted=before)
    record = replace(refined.refinement, improved=True, start_before=given)
    reported = found(
        replace(refined, refinement=record, start_up=ratios(refined, after)), "start-up-worse"
    )
    assert [one.level for one in reported] == ([] if level is None else [level])
    for one in reported:
        assert f"{after:.3g} times its prediction; it was {before:.3g} before" in one.message
    cleared = replace(record, start_before=InputStart(index=0.2, worst_rms_over_predicted=1.0))
    reported = found(
        replace(refined, refinement=cleared, start_up=ratios(refined, after)), "start-up-worse"
    )
    assert len(reported) == (after > 1.1 * 1.0)
    assert all("the index cleared it, at 0.2, before" in one.message for one in reported)


def test_a_plan_read_back_says_the_same_of_its_start_word_for_word(
    uncertain: Plan, refined: Plan
) -> None:
    values = plan_document(uncertain).as_json()
    again = plan_of(loaded_from(values))
    assert again.verdict == uncertain.verdict
    assert plan_document(again).as_json()["start_up"] == values["start_up"]
    assert refined.refinement is not None
    record = replace(
        refined.refinement,
        improved=True,
        start_before=InputStart(index=0.3, worst_rms_over_predicted=1.0),
    )
    worse = replace(refined, refinement=record, start_up=ratios(refined, 3.0))
    (reported,) = found(worse, "start-up-worse")
    kept = plan_of(loaded_from(plan_document(worse).as_json()))
    assert kept.refinement is not None
    assert kept.refinement.start_before == record.start_before
    assert found(replace(kept, start_up=worse.start_up), "start-up-worse") == [reported]


# --- which filter runs ----------------------------------------------------------------------------


def test_a_known_start_is_left_to_the_extended_filter() -> None:
    choice = choose_filter(syncplan.plan(example("paper-grid-same")), FilterOptions())
    assert choice.name == "ekf"
    assert choice.reason.startswith("start-up index 0.")


def test_a_start_that_the_index_does_not_clear_calls_for_the_robust_filter() -> None:
    lost = changed("paper-grid-same", initial_sigma={"position_m": 15.0, "heading_rad": 0.3})
    done = syncplan.validate(lost, trials=16, duration=70.0)
    assert done.filter == "robust"
    assert "over the 0.45" in done.chosen_because
    assert done.judged_from == pytest.approx(31.5)


def test_the_scenario_and_then_the_option_decide() -> None:
    asked = changed("paper-grid-same", filter={"kind": "second-order"})
    plan = syncplan.plan(asked)
    assert choose_filter(plan, FilterOptions()).name == "second-order"
    assert choose_filter(plan, FilterOptions(filter="paper")).name == "paper"


def test_rows_of_a_sweep_have_one_filter() -> None:
    lost = changed("paper-grid-same", initial_sigma={"position_m": 15.0, "heading_rad": 0.3})
    rows = sweep(lost, "range", [50.0, 60.0], trials=1, duration=2.0)
    assert {row.validation.filter for row in rows} == {"ekf"}


@pytest.mark.parametrize(("former", "now"), [("arc", "ekf"), ("euler", "paper")])
def test_former_names_are_understood(former: str, now: str) -> None:
    assert FilterOptions(model=former).filter == now
    assert FilterOptions.of_request({"model": former}).filter == now
    with pytest.raises(InputError, match="leave model out"):
        FilterOptions(model=former, filter="robust")
