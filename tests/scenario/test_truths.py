"""The truth: keys of the simulated world in place of the scenario's own."""

from syncplan.scenario.dotted_keys import numeric_keys, with_number
from syncplan.scenario.truths import changed_keys, with_truth
from tests.tools.scenarios import document, small


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
