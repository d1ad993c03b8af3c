"""Keys of the world: random walks, lasting errors, wind, further sensors, obstacles, the truth."""

from typing import Any

import numpy as np
import pytest

from syncplan.orbits.team import sensors_of, team_of
from syncplan.scenario.dotted_keys import numeric_keys, with_number
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.truths import changed_keys, with_truth
from tests.tools.on_paper import plan
from tests.tools.scenarios import document, planned, small

POLYGON = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]


def _keys(**sections: Any) -> dict[str, Any]:
    """The values of a small scenario with keys added to its sections."""
    base = document()
    return base | {
        name: {**base.get(name, {}), **keys} if isinstance(keys, dict) else keys
        for name, keys in sections.items()
    }


def test_a_random_walk_gives_readings_whose_integral_does_not_depend_on_the_sample_time() -> None:
    walks = {"position_random_walk_m_sqrt_s": 0.03, "angle_random_walk_rad_sqrt_s": 0.003}
    for sample_time in (0.1, 0.05):
        scenario = scenario_from(_keys(motion=walks, sensor={"sample_time_s": sample_time}))
        noise = plan(scenario, bound="never").team.noise
        assert noise.speed_sigma * sample_time * np.sqrt(1.0 / sample_time) == pytest.approx(0.03)
        assert noise.turn_rate_sigma * np.sqrt(sample_time) == pytest.approx(0.003)
        again = scenario_from(scenario.model_dump(mode="json", exclude_none=True))
        assert again == scenario


def test_a_walk_stands_in_place_of_the_default_of_the_sigma_alone() -> None:
    motion = small(motion={"position_random_walk_m_sqrt_s": 0.03}).motion
    assert motion.speed_sigma_mps is None
    assert motion.turn_rate_sigma_rad_s == 0.01


def test_the_filter_estimates_what_has_a_sigma_unless_options_say_otherwise() -> None:
    sections: dict[str, Any] = {
        "wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2},
        "motion": {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.0},
    }
    named = {
        "auto": ["wind", "speed_scale", "gusts"],
        "all": ["wind", "speed_scale", "gusts"],
        "none": [],
        ("gusts", "wind"): ["wind", "gusts"],
    }
    assert scenario_from(_keys(**sections)).estimated == named["auto"]
    for wanted, found in named.items():
        estimate = list(wanted) if isinstance(wanted, tuple) else wanted
        scenario = scenario_from(_keys(**sections, filter={"estimate": estimate}))
        assert scenario.estimated == found
    assert small().estimated == []


def test_a_scenario_without_the_keys_has_none_of_them_written() -> None:
    scenario = small().resolved()
    written = scenario.model_dump(mode="json", exclude_none=True)
    assert set(written["sensor"]) == {
        *("range_m", "fov_deg", "boresight_deg", "bearing_sigma_rad", "sample_time_s")
    }
    assert set(written["motion"]) == {"speed_sigma_mps", "turn_rate_sigma_rad_s"}
    assert not {"wind", "filter", "obstacles_m", "heading_sigma_rad", "heading_interval_s"} & set(
        written
    )


def test_the_arrays_hold_what_the_keys_say() -> None:
    scenario = scenario_from(
        _keys(
            sensor={
                "interval_s": 0.5,
                "detection_probability": 0.9,
                "range_sigma_m": 0.3,
                "bearing_bias_sigma_rad": 0.02,
            },
            heading_sigma_rad=[0.01, 0.02],
            wind={"sigma_mps": 1.0, "gust_sigma_mps": 0.2, "gust_time_s": 5.0},
            obstacles_m=[POLYGON],
        )
    )
    sensors = sensors_of(scenario)
    assert sensors.every.tolist() == [5] * 2
    assert sensors.detection.tolist() == [0.9] * 2
    assert sensors.range_sigmas.tolist() == [0.3] * 2
    assert sensors.bearing_bias_sigmas.tolist() == [0.02] * 2
    assert sensors.compass_sigmas.tolist() == [0.01, 0.02]
    team = team_of(scenario, planned().orbits)
    assert team.errors.sigmas == {"wind": 1.0, "gusts": 0.2}
    assert team.errors.gust_time == 5.0
    np.testing.assert_array_equal(team.obstacles[0], POLYGON)


# --- keys of the simulated world ------------------------------------------------------------------


def test_the_world_has_the_truths_keys_and_the_scenarios_others() -> None:
    scenario = small(
        wind={"sigma_mps": 1.0, "gust_sigma_mps": 0.2},
        truth={"wind": {"gust_sigma_mps": 0.6}, "sensor": {"range_m": 40.0}},
    )
    true = scenario.in_truth
    assert true.wind is not None
    assert scenario.wind is not None
    assert (true.wind.sigma_mps, true.wind.gust_sigma_mps) == (1.0, 0.6)
    assert [one.range_m for one in true.sensors] == [40.0, 40.0]
    assert (scenario.wind.gust_sigma_mps, scenario.sensors[0].range_m) == (0.2, 50.0)
    assert scenario.truth is not None
    changed = changed_keys(scenario, true, scenario.truth)
    assert [(one.key, one.assumed, one.true) for one in changed] == [
        ("sensor.range_m", 50.0, 40.0),
        ("wind.gust_sigma_mps", 0.2, 0.6),
    ]


def test_a_truth_stays_with_a_scenario_that_is_resolved_and_written() -> None:
    scenario = small(truth={"sensor": [{"bearing_sigma_rad": 0.2}, {"fov_deg": 90.0}]})
    assert scenario.resolved().truth == scenario.truth
    written = scenario.model_dump(mode="json", exclude_none=True)["truth"]
    assert written == {"sensor": [{"bearing_sigma_rad": 0.2}, {"fov_deg": 90.0}]}
    own, other = scenario.in_truth.sensors
    assert (own.bearing_sigma_rad, own.fov_deg) == (0.2, 360.0)
    assert (other.bearing_sigma_rad, other.fov_deg) == (0.1, 90.0)


def test_a_random_walk_takes_the_place_of_the_sigma_of_each_reading() -> None:
    true = small(truth={"motion": {"position_random_walk_m_sqrt_s": 0.5}}).in_truth
    assert true.motion.speed_sigma(0.25) == 1.0


def test_keys_of_the_world_are_numbers_of_the_scenario_too() -> None:
    key = "truth.wind.gust_sigma_mps"
    assert key in numeric_keys()
    assert with_number(document(), key, 0.6)["truth"] == {"wind": {"gust_sigma_mps": 0.6}}


def test_further_keys_go_over_those_of_the_truth() -> None:
    scenario = small(truth={"wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2}})
    true = with_truth(scenario, {"wind": {"gust_sigma_mps": 0.6}}).in_truth
    assert true.wind is not None
    assert (true.wind.sigma_mps, true.wind.gust_sigma_mps) == (1.0, 0.6)
