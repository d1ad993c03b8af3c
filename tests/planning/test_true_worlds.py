"""Validations and flights in a world that differs from the scenario."""

from typing import Any

import numpy as np
import pytest

from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.considered_errors import expected_errors
from syncplan.flight.flying import fly
from syncplan.orbits.team import true_team_of
from syncplan.planning.plan_files import in_world
from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from syncplan.planning.variations import (
    ALL_SIGMAS,
    FALSE_BEARINGS,
    MISSES,
    doubled_sigmas,
    stress_worlds,
    stressed,
)
from syncplan.plotting.study_figures import stress_spec
from syncplan.reports.flight_report import flight_document
from syncplan.reports.validation_report import stress_document, validation_document
from tests.tools.on_paper import plan
from tests.tools.scenarios import EVERYTHING, changed, small

SMALL: dict[str, Any] = {
    "motion": {"speed_scale_sigma": 0.01, "turn_rate_bias_sigma_rad_s": 0.002},
    "wind": {"sigma_mps": 0.3, "gust_sigma_mps": 0.05, "gust_time_s": 7.0},
    "sensor": {"bearing_bias_sigma_rad": 0.01, "range_sigma_m": 0.3, "interval_s": 0.2},
    "initial_sigma": {"position_m": 1.0, "heading_rad": 0.03},
    "duration_s": 60.0,
}


@pytest.fixture(scope="module")
def made() -> Plan:
    return plan(changed("paper-grid-same", **SMALL), bound="always", pilot=False)


def test_what_is_expected_is_the_bound_where_the_world_is_as_it_is_taken(made: Plan) -> None:
    bound = posterior_bound(made.team, made.windows, 60.0)
    found = expected_errors(made.team, made.windows, 60.0, true=made.team)
    np.testing.assert_allclose(found.position_variance, bound.position_variance, rtol=1e-7)


def test_gusts_that_are_followed_as_estimates_give_what_errors_of_gusts_give(made: Plan) -> None:
    truth = {"wind": {"gust_time_s": 7.0 * (1.0 + 1e-12)}}
    true = in_world(made, truth).true_team
    assert true.errors.gust_time != made.team.errors.gust_time
    bound = posterior_bound(made.team, made.windows, 60.0)
    found = expected_errors(made.team, made.windows, 60.0, true=true)
    np.testing.assert_allclose(found.position_variance, bound.position_variance, rtol=1e-6)


@pytest.mark.parametrize(
    "truth",
    [
        {"wind": {"gust_sigma_mps": 0.1}},
        {"wind": {"gust_sigma_mps": 0.0}},
        {"sensor": {"bearing_sigma_rad": 0.2, "range_sigma_m": 0.6}},
        {"false_bearings": 0.01},
    ],
    ids=lambda truth: "-".join(truth),
)
def test_trials_in_a_world_find_what_is_expected_and_not_what_is_predicted(
    made: Plan, truth: dict[str, Any]
) -> None:
    result = validate(made, trials=60, seed=3, filter="ekf", truth=truth)
    assert result.expected is not None
    assert result.predicted is not None
    found, expected, predicted = (
        float(np.sqrt(np.mean(one**2)))
        for one in (result.accuracy.late_position, result.expected, result.predicted)
    )
    assert found == pytest.approx(expected, rel=0.06)
    assert abs(np.log(expected / predicted)) > 0.1
    report = validation_document(result).as_json()
    assert report["truth"]
    assert report["expected_rms_m"]["overall"] == pytest.approx(expected)


def test_a_truth_of_the_scenarios_own_values_changes_nothing(made: Plan) -> None:
    own = validate(made, trials=4, seed=3, filter="ekf")
    same = validate(made, trials=4, seed=3, filter="ekf", truth={"wind": {"sigma_mps": 0.3}})
    np.testing.assert_array_equal(same.accuracy.late_position, own.accuracy.late_position)
    assert "truth" not in validation_document(own).as_json()
    assert validation_document(same).truth == []


def test_vehicles_fly_in_the_true_world_by_a_filter_that_knows_the_other(made: Plan) -> None:
    plain = fly(made, trials=2, seed=1, filter="ekf")
    true = fly(made, trials=2, seed=1, filter="ekf", truth={"sensor": {"bearing_sigma_rad": 0.3}})
    assert true.run.team.team is made.team
    assert true.run.team.setup.eyes.sigmas[0, 0] == 0.3
    assert true.run.team.setup.eyes.taken[0, 0] == made.sensors.bearing_sigmas[0]
    assert true.anees.value > 1.3 * plain.anees.value
    assert flight_document(true).truth is not None
    assert flight_document(true).expected_rms_m is not None
    assert flight_document(plain).truth is None


# --- worlds that are worse than stated ------------------------------------------------------------


def test_each_stated_sigma_is_doubled_for_each_vehicle_that_has_one() -> None:
    sensors = [
        {"range_m": 50.0, "bearing_sigma_rad": 0.1},
        {"range_m": 50.0, "bearing_sigma_rad": 0.2, "range_sigma_m": 0.1},
    ]
    scenario = small(heading_sigma_rad=[0.1, None], sensor=sensors)
    worlds = doubled_sigmas(scenario)
    assert worlds["heading_sigma_rad"] == {"heading_sigma_rad": [0.2, None]}
    assert worlds["sensor.range_sigma_m"] == {"sensor": [{}, {"range_sigma_m": 0.2}]}
    assert worlds["sensor.bearing_sigma_rad"] == {
        "sensor": [{"bearing_sigma_rad": 0.2}, {"bearing_sigma_rad": 0.4}]
    }
    assert "wind.gust_sigma_mps" not in worlds
    for truth in stress_worlds(scenario).values():
        small(heading_sigma_rad=[0.1, None], sensor=sensors, truth=truth)


def test_all_sigmas_doubled_are_expected_to_double_the_error() -> None:
    keys = {**EVERYTHING, "heading_sigma_rad": 0.1, "duration_s": 100.0}
    made = plan(changed("triangle-alternate", **keys), bound="always", pilot=False)
    true = in_world(made, stress_worlds(made.scenario)[ALL_SIGMAS]).true_team
    found = expected_errors(made.team, made.windows, made.scenario.duration_s, true=true)
    assert made.prediction.rms is not None
    np.testing.assert_allclose(found.rms_second_half(), 2.0 * made.prediction.rms, rtol=1e-5)


def test_more_sightings_missed_than_stated_are_known_to_the_filter() -> None:
    made = plan(changed("paper-grid-same", sensor={"detection_probability": 0.5}), bound="never")
    truth = stress_worlds(made.scenario)[MISSES]
    assert truth["sensor"]["detection_probability"] == pytest.approx(0.4)
    scenario = in_world(made, truth).scenario
    assert true_team_of(scenario, made.team).sensors.detection[0] == pytest.approx(0.4)


@pytest.mark.parametrize("sensor", [{}, {"bearing_sigma_rad": 0.02}])
def test_the_report_has_the_most_harmful_world_first(sensor: dict[str, float]) -> None:
    keys = {"duration_s": 40.0, "sensor": sensor}
    made = plan(changed("triangle-alternate", **keys), bound="always", pilot=False)
    test = stressed(made, trials=8, seed=2, filter="ekf")
    report = stress_document(test)
    assert report.stress is not None
    harms = [one.harm for one in report.stress]
    assert harms == sorted(harms, reverse=True)
    assert {one.world for one in report.stress} >= {ALL_SIGMAS, MISSES, FALSE_BEARINGS}
    for one in report.stress:
        assert one.harm == one.rms_second_half_m / report.overall.rms_second_half_m
        assert one.truth
    assert report.verdict is not None
    warned = any(one.code == "not-robust" for one in report.verdict.findings)
    assert warned == (harms[0] > 2.2) == bool(sensor)
    assert stress_spec(report)["data"][0]["y"][0] == report.stress[0].world
