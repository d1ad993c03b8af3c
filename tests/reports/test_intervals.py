"""95 % intervals of RMS errors, ratios and shares in reports, tables and figures."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import beta

import syncplan
from syncplan.arrays import Array
from syncplan.estimation.consistency import FEWEST_TRIALS, interval_of_mean
from syncplan.planning.plan_flights import Flight
from syncplan.planning.plans import Plan
from syncplan.planning.validation import Validation
from syncplan.plotting.accuracy_figures import accuracy_spec
from syncplan.plotting.figure_style import FigureStyle
from syncplan.reports.flight_report import FlightDocument, flight_document
from syncplan.reports.validation_report import (
    SweepReport,
    ValidationDocument,
    sweep_document,
    validation_document,
)
from tests.tools.on_paper import plan
from tests.tools.scenarios import changed
from tests.tools.stories import shown

TRIALS = 12


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(changed("paper-grid-same", duration_s=20.0, min_separation_m=27.0))


@pytest.fixture(scope="module")
def validation(grid: Plan) -> Validation:
    return syncplan.validate(grid, trials=TRIALS, filter="ekf")


@pytest.fixture(scope="module")
def flight(grid: Plan) -> Flight:
    return syncplan.fly(grid, trials=TRIALS, filter="ekf", lose=("v6@5",))


def ends(squares: Array, reference: float = 1.0) -> Any:
    """Approximate interval of the root of a mean over trials, over a reference."""
    return pytest.approx(tuple(np.sqrt(interval_of_mean(squares)) / reference))


def share_ends(count: int, trials: int) -> Any:
    """Approximate interval of Clopper and Pearson."""
    low = beta.ppf(0.025, count, trials - count + 1) if count else 0.0
    high = beta.ppf(0.975, count + 1, trials - count) if count < trials else 1.0
    return pytest.approx((low, high))


def test_a_validation_states_the_interval_of_each_error_and_of_its_ratio(
    validation: Validation,
) -> None:
    report = validation_document(validation)
    squares = validation.result.late_mean_squares[..., :2].sum(axis=2)
    assert validation.predicted is not None
    for k, vehicle in enumerate(report.vehicles):
        assert vehicle.rms_second_half_interval_m == ends(squares[:, k])
        predicted = float(validation.predicted[k])
        assert vehicle.rms_over_predicted_interval == ends(squares[:, k], predicted)
    overall, mean = report.overall, squares.mean(axis=1)
    assert overall.rms_second_half_interval_m == ends(mean)
    assert overall.predicted_rms_m is not None
    assert overall.rms_over_predicted_interval == ends(mean, overall.predicted_rms_m)


def test_a_validation_states_the_interval_of_each_share(validation: Validation) -> None:
    assert validation.predicted is not None
    squares = np.full_like(validation.result.late_mean_squares, 0.0)
    squares[:3, 0, 0] = (4.0 * validation.predicted[0]) ** 2
    squares[2:4, 1, 0] = (11.0 * validation.predicted[1]) ** 2
    far = replace(
        validation,
        result=replace(validation.result, late_mean_squares=squares),
    )
    report = validation_document(far)
    counts = [(3, 0), (2, 2), (0, 0), (0, 0), (0, 0), (0, 0), (4, 2)]
    for figures, (over_3, over_10) in zip([*report.vehicles, report.overall], counts, strict=True):
        assert figures.share_over_3_predicted == over_3 / TRIALS
        assert figures.share_over_3_predicted_interval == share_ends(over_3, TRIALS)
        assert figures.share_over_10_predicted == over_10 / TRIALS
        assert figures.share_over_10_predicted_interval == share_ends(over_10, TRIALS)


def test_a_flight_states_the_intervals_of_vehicles_that_are_there_to_the_end(
    flight: Flight,
) -> None:
    report = flight_document(flight)
    squares = flight.result.estimates.late_mean_squares[..., :2].sum(axis=2)
    *present, lost = report.vehicles
    assert lost.errors is None
    for k, vehicle in enumerate(present):
        errors = vehicle.errors
        assert errors is not None
        assert errors.predicted_rms_m is not None
        assert errors.rms_second_half_interval_m == ends(squares[:, k])
        assert errors.rms_over_bound_interval == ends(squares[:, k], errors.bound_rms_m)
        assert errors.rms_over_predicted_interval == ends(squares[:, k], errors.predicted_rms_m)
        assert errors.rms_over_predicted == errors.rms_second_half_m / errors.predicted_rms_m
        assert errors.rms_second_half_interval_m == flight.record.vehicles[k].rms_interval_m
    overall, mean = report.overall, squares[:, :-1].mean(axis=1)
    assert overall.rms_second_half_interval_m == ends(mean)
    assert overall.rms_over_bound_interval == ends(mean, overall.bound_rms_m)


def test_a_flight_states_the_interval_of_each_share(flight: Flight) -> None:
    report = flight_document(flight)
    assert report.filter_lost_interval == share_ends(int(flight.filter_lost.sum()), TRIALS)
    assert report.out_of_contact_interval == share_ends(int(flight.out_of_contact.sum()), TRIALS)
    nearest, close = report.least_separation_m, int(flight.too_close.sum())
    assert nearest is not None
    assert 0 < close < TRIALS
    assert nearest.below_asked_share == close / TRIALS
    assert nearest.below_asked_interval == share_ends(close, TRIALS)


def test_few_trials_have_shares_with_intervals_and_no_other(grid: Plan) -> None:
    few = FEWEST_TRIALS - 1
    errors = validation_document(syncplan.validate(grid, trials=few, filter="ekf")).overall
    assert errors.rms_over_predicted is not None
    assert errors.rms_second_half_interval_m is None
    assert errors.rms_over_predicted_interval is None
    assert errors.share_over_3_predicted_interval == share_ends(0, few)


def test_reports_without_intervals_are_read(validation: Validation, flight: Flight) -> None:
    def without_intervals(values: Any) -> Any:
        if isinstance(values, dict):
            return {
                key: without_intervals(value)
                for key, value in values.items()
                if not key.endswith(("_interval", "_interval_m")) and key != "rms_over_predicted"
            }
        return list(map(without_intervals, values)) if isinstance(values, list) else values

    flown = without_intervals(flight_document(flight).as_json())
    overall = FlightDocument.model_validate(flown).overall
    assert overall.rms_over_predicted is None
    assert overall.rms_over_bound_interval is None
    report = validation_document(validation).as_json()
    for errors in (report["overall"], *report["vehicles"]):
        for key in [key for key in errors if key.endswith(("_interval", "_interval_m"))]:
            del errors[key]
    assert ValidationDocument.model_validate(report).overall.rms_second_half_interval_m is None


# --- tables and figures ---------------------------------------------------------------------------


def test_tables_state_the_interval_over_all_vehicles_within_80_columns(
    validation: Validation, flight: Flight
) -> None:
    report = validation_document(validation)
    flown = flight_document(flight)
    for lines, errors, ratio, interval in (
        (
            shown(report).splitlines(),
            report.overall,
            report.overall.rms_over_predicted,
            report.overall.rms_over_predicted_interval,
        ),
        (
            shown(flown).splitlines(),
            flown.overall,
            flown.overall.rms_over_bound,
            flown.overall.rms_over_bound_interval,
        ),
    ):
        assert errors.rms_second_half_interval_m is not None
        assert interval is not None
        low, high = errors.rms_second_half_interval_m
        assert (
            f"all vehicles: {errors.rms_second_half_m:.3g} m (95 % interval {low:.3g} to "
            f"{high:.3g}), ratio {ratio:.3g} ({interval[0]:.3g} to {interval[1]:.3g})"
        ) in lines
    text = " ".join(shown(report).splitlines())
    assert "over 3 times the bound 0 % (0 % to 26.5 %), over 10 times 0 % (0 % to 26.5 %)" in (
        " ".join(text.split())
    )


def test_a_table_of_a_sweep_has_a_column_of_intervals(grid: Plan) -> None:
    rows = syncplan.sweep(grid.scenario, "range", [50.0], trials=TRIALS)
    document: SweepReport = sweep_document(rows)
    interval = document.rows[0].validation.overall.rms_second_half_interval_m
    assert interval is not None
    lines = shown(document).splitlines()
    (head,) = [line for line in lines if "2nd half" in line]
    assert "95 %" in head
    assert f"{interval[0]:.3g} to {interval[1]:.3g}" in lines[lines.index(head) + 2]


def test_bars_of_errors_reach_to_the_ends_of_their_intervals(validation: Validation) -> None:
    report = validation_document(validation)
    (late,) = [one for one in accuracy_spec(report, FigureStyle())["data"] if one["uid"] == "late"]
    bars = late["error_y"]
    for k, vehicle in enumerate(report.vehicles):
        low, high = late["y"][k] - bars["arrayminus"][k], late["y"][k] + bars["array"][k]
        assert (low, high) == pytest.approx(vehicle.rms_second_half_interval_m, rel=1e-4)
    vehicles = [
        vehicle.model_copy(update={"rms_second_half_interval_m": None})
        for vehicle in report.vehicles
    ]
    older = report.model_copy(update={"vehicles": vehicles})
    assert all("error_y" not in one for one in accuracy_spec(older, FigureStyle())["data"])
