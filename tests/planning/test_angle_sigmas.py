"""Standard deviations of angles: too large for radians, and what they would be in degrees."""

from math import radians
from pathlib import Path
from typing import Any

import pytest

import syncplan
from syncplan.planning.scenario_checks import LARGEST_ANGLE_SIGMA, USUAL_ANGLE_SIGMA
from syncplan.scenario.angle_sigmas import angle_sigmas
from syncplan.scenario.dotted_keys import numeric_keys, with_number
from syncplan.scenario.loading import load_scenario, scenario_from
from tests.tools.scenarios import document, findings_of, planned

DEGREES = Path(__file__).parents[1] / "data" / "hard" / "degrees.yaml"
CODE = "angle-sigma-large"
KEYS = [
    "sensor.bearing_sigma_rad",
    "sensor.bearing_bias_sigma_rad",
    "sensor.bearing_walk.sigma_rad",
    "heading_sigma_rad",
    "initial_sigma.heading_rad",
]
NEEDED = {"heading_sigma_rad": 0.1, "sensor": {**document()["sensor"], "bearing_walk": {}}}
"""Keys that a scenario needs before others of the list may be set, in its truth too."""


def test_a_bearing_sigma_of_two_radians_is_a_stop_that_names_its_value_in_degrees() -> None:
    verdict = syncplan.plan(DEGREES, bound="never").verdict
    (finding,) = (finding for finding in verdict.findings if finding.code == CODE)
    assert not verdict.go
    assert finding.level == "stop"
    assert "sensor.bearing_sigma_rad is 2 in radians; were degrees meant?" in finding.message
    assert finding.cure is not None
    assert dict(finding.cure.change) == {"sensor.bearing_sigma_rad": 0.0349}


def test_the_cure_in_degrees_makes_the_plan_go() -> None:
    scenario = load_scenario(DEGREES)
    (finding,) = findings_of(syncplan.plan(scenario, bound="never"), CODE)
    assert finding.cure is not None
    ((key, value),) = finding.cure.change.items()
    cured = scenario_from(with_number(scenario.model_dump(exclude_none=True), key, float(value)))
    verdict = syncplan.plan(cured, bound="never").verdict
    assert verdict.go
    assert CODE not in {finding.code for finding in verdict.findings}


def test_the_keys_are_those_in_radians_that_state_a_sigma() -> None:
    listed = [key.key for key in numeric_keys().values() if key.unit == "rad"]
    assert [key for key in listed if "sigma" in key] == [*KEYS, *(f"truth.{key}" for key in KEYS)]
    every: dict[str, Any] = document(**NEEDED)
    for key in listed:
        every = with_number(every, key, 0.3)
    stated = [sigma.key for sigma in angle_sigmas(scenario_from(every))]
    # in the order of the models, where the truth is a section like any other
    assert sorted(stated) == sorted(key for key in listed if "sigma" in key)


@pytest.mark.parametrize("prefix", ["", "truth."])
@pytest.mark.parametrize("key", KEYS)
def test_every_sigma_of_an_angle_warns_above_half_a_radian_and_stops_above_one(
    key: str, prefix: str
) -> None:
    for value, level in (
        (USUAL_ANGLE_SIGMA, None),
        (USUAL_ANGLE_SIGMA + 0.01, "warning"),
        (LARGEST_ANGLE_SIGMA, "warning"),
        (LARGEST_ANGLE_SIGMA + 0.01, "warning" if key.startswith("initial_sigma") else "stop"),
    ):
        findings = findings_of(
            planned(**with_number(document(**NEEDED), prefix + key, value)), CODE
        )
        assert [finding.level for finding in findings] == ([] if level is None else [level])
        for finding in findings:
            assert f"{prefix}{key} is {value:g} in radians" in finding.message
            assert finding.cure is not None
            change = {prefix + key: pytest.approx(radians(value), rel=5e-3)}
            assert dict(finding.cure.change) == change


def test_vehicles_with_own_values_are_named_and_the_gravest_decides_the_level() -> None:
    base = document()["sensor"]
    sensors = [{**base, "bearing_sigma_rad": value} for value in (0.6, 2.0)]
    (finding,) = findings_of(planned(sensor=sensors, heading_sigma_rad=[None, 0.1]), CODE)
    assert (finding.level, finding.subjects) == ("stop", ("v1", "v2"))
    assert "sensor.bearing_sigma_rad is 0.6 for v1, 2 for v2 in radians" in finding.message
    assert finding.cure is not None
    assert finding.cure.change == {}
    (finding,) = findings_of(planned(heading_sigma_rad=[None, 0.8]), CODE)
    assert (finding.level, finding.subjects) == ("warning", ("v2",))
    assert "heading_sigma_rad is 0.8 for v2 in radians" in finding.message


def test_rates_and_angles_without_a_sigma_are_left_alone() -> None:
    judged = planned(
        orbit={**document()["orbit"], "first_phase_rad": 3.0, "desync_rad": 2.0},
        motion={"turn_rate_sigma_rad_s": 2.0, "turn_rate_bias_sigma_rad_s": 2.0},
    )
    assert findings_of(judged, CODE) == []
    assert findings_of(planned(motion={"angle_random_walk_rad_sqrt_s": 2.0}), CODE) == []
