"""Work expected from circles and ranges alone, beside what a plan then holds."""

import numpy as np
import pytest

from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.planning.expected_work import ExpectedWork, work_of
from syncplan.planning.validation import trial_run
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario
from tests.tools.on_paper import plan
from tests.tools.scenarios import EVERYTHING, changed, example, shared_circles, small

NAMES = ("boats", "camera-pair", "five-ring", "four-ground-robots", "mixed-radii-camera", "shelves")


def expected(scenario: Scenario, duration: float | None = None) -> ExpectedWork:
    """The work of a team whose centres are given."""
    work = work_of(scenario, duration)
    assert work is not None
    return work


@pytest.mark.parametrize("name", NAMES)
def test_sightings_expected_are_about_those_of_the_plan(name: str) -> None:
    scenario = example(name)
    work = expected(scenario)
    # obstacles are left out of the count
    made = plan(changed(name, obstacles_m=[]), bound="never", pilot=False)
    run = trial_run(made, trials=1)
    assert 0.7 < work.sightings / len(run.sightings.observers) < 1.5
    size = layout_of(made.team, tuple(ERROR_STATES)).size
    assert size >= 3 * scenario.size
    assert work.pass_work == pytest.approx(work.sightings * size**2)
    assert work.bounded


def test_vehicles_that_share_circles_see_each_other_at_every_sample() -> None:
    scenario = scenario_from(shared_circles(2))
    work = expected(scenario)
    run = trial_run(plan(scenario, bound="never", pilot=False), trials=1)
    assert 1.0 <= work.sightings / len(run.sightings.observers) < 1.5


def test_a_landmark_is_in_range_for_the_share_that_geometry_says() -> None:
    # D = 40, R = 20, r = 30: in range while cos tau >= (1600 + 400 - 900) / 1600
    scenario = small(
        formation={"centers_m": [[0.0, 0.0], [1000.0, 0.0]]},
        landmarks_m=[[40.0, 0.0]],
        sensor={"range_m": 30.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    )
    work = expected(scenario, 100.0)
    assert work.sightings == pytest.approx(1000 * np.arccos(1100 / 1600) / np.pi)


@pytest.mark.parametrize(
    ("landmark", "boresight", "fov", "share"),
    [
        # the centre stays a quarter turn to the left; the horizon turns by
        ((0.0, 0.0), 90.0, 20.0, 1.0),
        ((0.0, 0.0), -90.0, 170.0, 0.0),
        ((0.0, 0.0), 0.0, 200.0, 1.0),
        ((3e6, 4e6), 30.0, 75.0, 75.0 / 360.0),
    ],
)
def test_a_landmark_is_in_a_narrow_view_for_the_share_that_geometry_says(
    landmark: tuple[float, float], boresight: float, fov: float, share: float
) -> None:
    sensor = {"range_m": 1e7, "fov_deg": fov, "boresight_deg": boresight}
    scenario = small(
        formation={"centers_m": [[0.0, 0.0]]},
        landmarks_m=[landmark],
        sensor={**sensor, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    )
    work = expected(scenario, 100.0)
    assert work.sightings == pytest.approx(1000.0 * share)


def test_nothing_is_expected_where_centres_are_yet_to_be_found() -> None:
    scenario = small(formation={"count": 3, "links": [["v1", "v2"]]})
    assert work_of(scenario) is None


def test_further_kinds_count_and_intervals_are_left_out_of_the_count() -> None:
    plain, kinds = example("paper-grid-same"), {"range_sigma_m": 1.0, "interval_s": 0.5}
    before, after = expected(plain), expected(changed(plain.name, sensor=kinds))
    assert after.sightings == pytest.approx(before.sightings * 2.0 / 5.0)
    heading = expected(changed(plain.name, heading_sigma_rad=0.1))
    samples = plain.duration_s / plain.sample_time
    assert heading.sightings == pytest.approx(before.sightings + 6.0 * samples)


def test_errors_widen_the_state_whether_estimated_or_not() -> None:
    before = expected(example("paper-grid-same"))
    for estimate in ("all", "none"):
        made = changed(
            "paper-grid-same",
            motion=EVERYTHING["motion"],
            wind=EVERYTHING["wind"],
            filter={"estimate": estimate},
        )
        work = expected(made)
        # poses, wind, scales, biases, clocks and gusts
        size = 18 + 2 + 6 + 6 + 6 + 12
        assert work.pass_work == pytest.approx(before.pass_work * (size / 18.0) ** 2)
