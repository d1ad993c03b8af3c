"""Worlds that are worse than stated."""

import numpy as np
import pytest

from syncplan.estimation.considered_errors import expected_errors
from syncplan.orbits.team import true_team_of
from syncplan.planning.plan_files import in_world
from syncplan.planning.planner import plan
from syncplan.planning.variations import (
    ALL_SIGMAS,
    FALSE_BEARINGS,
    MISSES,
    doubled_sigmas,
    stress_worlds,
    stressed,
)
from syncplan.plotting.study_figures import stress_spec
from syncplan.reports.validation_report import stress_document
from tests.tools.scenarios import EVERYTHING, changed, small


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


def test_the_report_has_the_most_harmful_world_first() -> None:
    made = plan(changed("triangle-alternate", duration_s=40.0), bound="always", pilot=False)
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
    assert warned == (harms[0] > 2.2)
    assert stress_spec(report)["data"][0]["y"][0] == report.stress[0].world
