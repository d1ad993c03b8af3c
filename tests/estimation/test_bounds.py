"""The bounds against independent recursions in other coordinates."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation.bounds import posterior_bound, steady_bound, window_bound
from syncplan.estimation.referred_system import PosteriorBound, arc_noise_gain
from syncplan.observability.rank import assess, link_information
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.circles import Orbits
from syncplan.orbits.noise import Noise
from syncplan.orbits.sightings import sample_sightings, steps_within
from syncplan.planning.planner import Plan, plan
from syncplan.scenario.loading import scenario_from
from tests.tools.scenarios import example

NOISE = Noise(speed_sigma=0.1, turn_rate_sigma=0.01, position_sigma=5.0, heading_sigma=0.1)


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(example("paper-grid-same"))


def test_the_steady_bound_of_the_grid_is_that_found_before(grid: Plan) -> None:
    # design.md, section 3: the period averages fall to 1.07 m
    assert abs(steady_bound(grid.team, grid.windows).max() - 1.07) < 0.01


def test_without_motion_noise_the_posterior_tends_to_the_window_bound(grid: Plan) -> None:
    still = Noise(0.0, 0.0, position_sigma=1e5, heading_sigma=1e3)
    steps = steps_within(grid.orbits.period, grid.sensors.sample_time)
    sightings = sample_sightings(grid.windows, grid.orbits.period, grid.sensors, 1, steps)
    links = link_information(grid.team, sightings)
    window = window_bound(assess(grid.team, links))
    rows = sighting_rows(grid.team, sightings)
    dense = np.zeros((len(rows), 18))
    for s, (a, b) in enumerate(zip(sightings.observers, sightings.targets, strict=True)):
        dense[s, 3 * a : 3 * a + 3] += rows[s, :3]
        if b < 6:
            dense[s, 3 * b : 3 * b + 3] += rows[s, 3:]
    variance = np.diag(np.linalg.inv(dense.T @ dense)).reshape(6, 3)[:, :2].sum(axis=1)
    np.testing.assert_allclose(window, 20.0 * np.sqrt(variance), rtol=1e-8)
    run = posterior_bound(
        replace(grid.team, noise=still),
        grid.windows,
        steps * grid.sensors.sample_time,
    )
    # the last sample is a hundredth of a second short of a whole period, back at the start
    np.testing.assert_allclose(np.sqrt(run.position_variance[-1]), window, rtol=1e-3)


def test_the_window_bound_is_missing_where_the_position_is_not_determined() -> None:
    made = plan(example("landmark-bridge"))
    assert np.isfinite(made.prediction.window[0])
    assert np.isnan(made.prediction.window[1])


def test_the_second_half_is_the_samples_with_twice_their_number_past_the_end() -> None:
    for steps in (5, 6):
        variance = np.arange(steps + 1, dtype=float)[:, None]
        kept = [k for k in range(steps + 1) if 2 * k > steps]
        rms = PosteriorBound(variance, variance).rms_second_half()
        assert rms[0] == pytest.approx(np.sqrt(np.mean(kept)))


def test_the_noise_gain_is_smooth_at_small_turns() -> None:
    def gain(half: float) -> np.ndarray:
        orbits = Orbits(np.zeros((1, 2)), np.ones(1), np.ones(1), np.zeros(1), 2.0 * half)
        return np.asarray(arc_noise_gain(orbits, 1.0)[0] / [1.0, 2.0 * half])

    np.testing.assert_allclose(gain(0.99e-4), gain(1.01e-4), rtol=0.03)


def test_exact_bearings_from_a_still_platform_have_a_steady_bound() -> None:
    made = plan(
        scenario_from(
            {
                "orbit": {"radius_m": 2.0, "angular_rate_rad_s": 2.0 * np.pi / 30.0},
                "formation": {"centers_m": [[-1.587, -1.081]]},
                "landmarks_m": [[3, 3], [-1, 2], [-2, -1]],
                "sensor": {"range_m": 10, "bearing_sigma_rad": 0.001, "sample_time_s": 15.0},
                "motion": {"speed_sigma_mps": 0.0},
                "window_s": 90.0,
            }
        ),
        steady=True,
    )
    assert made.prediction.steady is not None
    assert made.prediction.steady[0] < 0.02


def test_a_short_window_does_not_hide_the_steady_bound() -> None:
    document = example("paper-grid-same").model_dump(exclude_none=True)
    document["window_s"] = 0.5
    short = plan(scenario_from(document), steady=True).prediction.steady
    whole = plan(example("paper-grid-same"), steady=True).prediction.steady
    assert short is not None
    assert whole is not None
    np.testing.assert_allclose(short, whole)


def test_unobservable_teams_have_no_steady_bound() -> None:
    for name in ("landmark-bridge", "triangle-alternate"):
        steady = plan(example(name), steady=True).prediction.steady
        assert steady is not None
        assert np.isinf(steady[-1])
