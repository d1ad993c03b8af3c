"""Errors above their predictions: where they are findings, of flights and of validations."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.estimation.consistency import FEWEST_TRIALS, interval_of_mean, interval_of_rms
from syncplan.flight.flying import flight_run
from syncplan.planning.error_checks import ComparedError, errors_above
from syncplan.planning.judged_team import PlanFinding
from syncplan.planning.plan_files import in_world
from syncplan.planning.plan_records import FlownPlan
from syncplan.planning.plans import Plan
from syncplan.planning.validation import Validation, trial_run
from syncplan.planning.variations import stress_runs, stressed
from syncplan.reports.validation_report import stress_document, validation_document
from tests.tools.flown import WELL
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed, findings_of

HARD = Path(__file__).parents[1] / "data" / "hard"
CODE = "error-above-prediction"
GUSTS = {"sigma_mps": 0.3, "gust_sigma_mps": 0.05, "gust_time_s": 7.0}

LEVELS = {1.24: None, 1.26: "warning", 1.99: "warning", 2.01: "stop"}
"""Level by the ratio to the prediction."""

VEHICLE, ANEES = "v2", ""


def levels(findings: tuple[PlanFinding, ...]) -> list[str]:
    """The levels of the findings on errors."""
    return [finding.level for finding in findings if finding.code == CODE]


def expected(level: str | None) -> list[str]:
    """The levels where there is one, or none."""
    return [] if level is None else [level]


SHORT = WELL.model_copy(update={"duration_s": 40.0})
"""Record of flights of the grid's 40 s in which nothing went wrong."""


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(changed("paper-grid-same", duration_s=40.0))


@pytest.fixture(scope="module")
def validation(grid: Plan) -> Validation:
    return syncplan.validate(grid, trials=FEWEST_TRIALS, filter="ekf")


def test_an_interval_of_an_rms_is_that_of_its_mean_square() -> None:
    squares = np.random.default_rng(5).chisquare(3, size=40)
    low, high = interval_of_mean(squares)
    assert interval_of_rms(squares) == pytest.approx((low**0.5, high**0.5))
    assert interval_of_rms(squares[: FEWEST_TRIALS - 1]) is None
    assert interval_of_rms(np.append(squares, np.inf)) is None


def test_an_error_counts_where_its_whole_interval_is_well_above_the_prediction() -> None:
    uncertain = ComparedError(3.0, (1.09, 7.0), 1.0, "v1")
    certain = ComparedError(1.3, (1.11, 1.6), 1.0, "v2")
    larger = ComparedError(6.0, (5.0, 7.0), 4.0, "v3")
    assert errors_above([uncertain, certain, larger]) == [larger, certain]


# --- flights --------------------------------------------------------------------------------------


def flown(plan: Plan, whose: str, ratio: float, **changes: Any) -> FlownPlan:
    """Record of flights in which a vehicle, or ANEES, is this multiple of its prediction."""
    assert plan.prediction.rms is not None
    vehicles = [
        vehicle.model_copy(update={"rms_m": rms, "rms_interval_m": (0.9 * rms, 1.1 * rms)})
        for vehicle, rms in zip(
            WELL.vehicles,
            [
                float(rms) * (ratio if name == whose else 1.0)
                for name, rms in zip(plan.scenario.vehicle_names, plan.prediction.rms, strict=True)
            ],
            strict=True,
        )
    ]
    anees = ratio if whose == ANEES else 1.0
    keys = {"duration_s": plan.scenario.duration_s, "vehicles": vehicles, "anees": anees}
    return WELL.model_copy(update={**keys, "anees_interval": (0.9 * anees, 1.1 * anees), **changes})


@pytest.mark.parametrize("ratio", LEVELS)
@pytest.mark.parametrize("whose", [VEHICLE, ANEES])
def test_errors_in_flight_stop_from_twice_the_prediction(
    grid: Plan, whose: str, ratio: float
) -> None:
    judged = replace(grid, flight=flown(grid, whose, ratio))
    assert levels(judged.verdict.findings) == expected(LEVELS[ratio])
    for finding in findings_of(judged, CODE):
        assert "errors in 50 flights of 40 s (filter robust) are above" in finding.message
        assert finding.subjects == ((VEHICLE,) if whose == VEHICLE else ())


@pytest.mark.parametrize("changes", [{"duration_s": 41.0}, {"events": ["v3 is lost at 6 s"]}])
def test_flights_that_the_prediction_does_not_describe_are_not_compared(
    grid: Plan, changes: dict[str, Any]
) -> None:
    judged = replace(grid, flight=flown(grid, VEHICLE, 3.0, **changes))
    assert findings_of(judged, CODE) == []


# --- validations ----------------------------------------------------------------------------------


def scaled(validation: Validation, whose: str, ratio: float) -> Validation:
    """The validation with an RMS error, or ANEES, that is this multiple of its prediction."""
    assert validation.predicted is not None
    rms, anees = validation.predicted.copy(), validation.anees
    value = ratio if whose == ANEES else 1.0
    anees = replace(anees, value=value, band=(0.9 * value, 1.1 * value))
    if whose == VEHICLE:
        rms[validation.plan.scenario.vehicle_names.index(VEHICLE)] *= ratio
    spread = np.linspace(0.9, 1.1, validation.result.trials)[:, None]
    squares = np.stack([spread * rms**2, 0.0 * spread * rms, 0.0 * spread * rms], axis=2)
    return replace(
        validation,
        result=replace(validation.result, late_mean_squares=squares),
        accuracy=replace(validation.accuracy, late_position=rms),
        anees=anees,
    )


@pytest.mark.parametrize("ratio", LEVELS)
@pytest.mark.parametrize("whose", [VEHICLE, ANEES])
def test_errors_in_a_validation_stop_a_plan_that_was_not_flown_well(
    validation: Validation, whose: str, ratio: float
) -> None:
    result = scaled(validation, whose, ratio)
    verdict = result.verdict
    assert levels(verdict.findings) == expected(LEVELS[ratio])
    assert verdict.go == (LEVELS[ratio] != "stop")
    assert verdict.findings[: len(result.plan.verdict.findings)] == result.plan.verdict.findings
    assert validation_document(result).verdict == verdict


@pytest.mark.parametrize("ratio", LEVELS)
def test_errors_in_a_validation_warn_where_the_plan_flew_well(
    validation: Validation, ratio: float
) -> None:
    for lost, stopped in ((0.0, False), (0.5, True)):
        flight = SHORT.model_copy(update={"filter_lost_share": lost})
        result = scaled(validation, VEHICLE, ratio)
        result = replace(result, plan=replace(result.plan, flight=flight))
        level = LEVELS[ratio]
        assert levels(result.findings) == expected(level if stopped or level is None else "warning")
        assert result.verdict.flown
        for finding in result.findings:
            assert ("exact circles are the harder case" in finding.message) != stopped
            assert "errors in 10 trials of 40 s (filter ekf) are above" in finding.message
            assert finding.subjects == (VEHICLE,)


def test_a_run_without_intervals_or_predictions_finds_nothing(validation: Validation) -> None:
    far = scaled(validation, VEHICLE, 3.0)
    few = replace(far.result, late_mean_squares=far.result.late_mean_squares[: FEWEST_TRIALS - 1])
    assert levels(far.findings) == ["stop"]
    assert replace(far, result=few).findings == ()
    assert replace(far, predicted=None).findings == ()


def test_a_validation_that_misses_its_prediction_on_weak_links_is_no_go() -> None:
    weak = plan(HARD / "weak-desync.yaml")
    assert weak.verdict.go
    result = syncplan.validate(weak, trials=20)
    assert not result.verdict.go
    (finding,) = result.findings
    assert (finding.code, finding.level) == (CODE, "stop")
    assert {"v1", "v4"} <= set(finding.subjects)
    assert finding.cure is not None
    assert "flights, in which guidance keeps estimates on the plan" in finding.cure.text


def test_errors_that_the_filter_leaves_out_are_what_cures(validation: Validation) -> None:
    keys: dict[str, Any] = {"wind": GUSTS, "filter": {"estimate": []}, "duration_s": 40.0}
    neglecting = plan(changed("paper-grid-same", **keys))
    (finding,) = scaled(replace(validation, plan=neglecting), VEHICLE, 3.0).findings
    assert finding.cure is not None
    assert finding.cure.change == {"filter.estimate": "auto"}


# --- other worlds ---------------------------------------------------------------------------------


def test_the_message_says_that_the_world_differs(grid: Plan) -> None:
    truths = {"differs": 0.3, "": 0.1}
    for words, sigma in truths.items():
        truth = {"sensor": {"bearing_sigma_rad": sigma}}
        result = syncplan.validate(grid, trials=FEWEST_TRIALS, filter="ekf", truth=truth)
        (finding,) = scaled(result, VEHICLE, 3.0).findings
        assert ("in a world that differs from the scenario" in finding.message) == bool(words)


def test_flights_do_not_count_in_another_world_and_their_filter_still_runs(grid: Plan) -> None:
    truth = {"sensor": {"bearing_sigma_rad": 0.3}}
    plan = replace(grid, flight=SHORT.model_copy(update={"filter": "second-order"}))
    there = in_world(plan, truth)
    assert in_world(plan, None).flight is plan.flight
    assert there.flight is None
    assert there.verdict.headline == "GO on paper: not flown"
    (note,) = findings_of(there, "flights-dropped")
    assert "they were in another world" in note.message
    flown = flight_run(plan, trials=2, truth=truth)
    assert (flown.plan.flight, flown.options.filter) == (None, "second-order")
    stressed_runs = stress_runs(plan, trials=2, truth=truth).values()
    for run in [trial_run(plan, trials=2, truth=truth), *stressed_runs]:
        assert (run.plan.flight, run.options.filter) == (None, "second-order")


def test_a_stress_test_keeps_the_basis_and_the_findings_of_the_world_as_stated(
    grid: Plan,
) -> None:
    test = stressed(replace(grid, flight=SHORT), trials=2)
    test = replace(test, nominal=scaled(test.nominal, ANEES, 3.0))
    verdict = stress_document(test).verdict
    assert verdict is not None
    assert verdict.flown
    assert levels(verdict.findings) == ["warning"]


def test_worlds_of_a_stress_test_are_worse_than_the_truth_that_is_asked_for() -> None:
    made = plan(changed("paper-grid-same", wind=GUSTS, duration_s=40.0))
    runs = stress_runs(made, trials=2, truth={"wind": {"gust_sigma_mps": 0.1}})
    gusts = {}
    for world in ("", "wind.gust_sigma_mps doubled", "wind.sigma_mps doubled"):
        truth = runs[world].plan.scenario.truth
        assert truth is not None
        assert truth.wind is not None
        gusts[world] = truth.wind.gust_sigma_mps
    assert list(gusts.values()) == [0.1, 0.2, 0.1]
