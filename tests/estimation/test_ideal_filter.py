"""The ideal filter against the bound, and the extended Kalman filter against it."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trials import MonteCarloResult
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.team import Team
from tests.estimation.test_disturbed_trials import run_of
from tests.estimation.test_montecarlo import paper_grid
from tests.tools.filter_scenes import ALL, a_team


def test_errors_are_those_of_the_bound_and_the_covariance_holds_from_any_start() -> None:
    team, sightings, steps = paper_grid(500, noise=Noise(0.1, 0.01, 50.0, 1.0))
    trials = 1600
    result = run_trials(team, sightings, steps, FilterOptions(trials=trials, filter="ideal"))
    bound = posterior_bound(team, find_windows(team), 50.0).rms_second_half()
    squares = result.late_mean_squares[..., :2].sum(axis=2) / bound**2
    # a last column for all vehicles, whose errors are much alike
    squares = np.column_stack([squares, squares.mean(axis=1)])
    spread = squares.std(axis=0) / np.sqrt(trials)
    assert spread[-1] < 0.03
    assert np.all(np.abs(squares.mean(axis=0) - 1.0) < 3.0 * spread)
    assert_consistent(result, 18)


def assert_consistent(result: MonteCarloResult, dimension: int) -> None:
    """NEES and NIS are 1 within three standard errors, which are below 2 %."""
    nees = result.nees / dimension
    spread = nees.std() / np.sqrt(len(nees))
    assert spread < 0.02
    assert abs(nees.mean() - 1.0) < 3.0 * spread
    assert result.nis_sums.sum() / result.accepted.sum() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("errors", "wide"),
    [
        (ErrorSigmas(), 50.0),
        (ErrorSigmas({"wind": 0.8}), 1.0),
        (ErrorSigmas({"wind": 0.8, "gusts": 0.3}, gust_time=4.0), 50.0),
        (ErrorSigmas({"speed_scale": 0.05, "turn_rate_bias": 0.02}), 1.0),
    ],
)
def test_with_every_error_as_a_state_the_covariance_holds(errors: ErrorSigmas, wide: float) -> None:
    team = a_team(ALL)
    noise = replace(team.noise, position_sigma=wide, heading_sigma=min(0.1 * wide, 1.0))
    team = replace(team, noise=noise, errors=replace(errors, estimated=ALL))
    assert_consistent(run_of(team, 300, 320, filter="ideal"), 9)


def test_for_small_noise_the_extended_filter_becomes_this_one_at_second_order() -> None:
    off = []
    for scale in (1e-3, 1e-4):
        team = a_team(())
        sensors = replace(
            team.sensors,
            bearing_sigmas=scale * team.sensors.bearing_sigmas,
            range_sigmas=scale * team.sensors.range_sigmas,
            compass_sigmas=scale * team.sensors.compass_sigmas,
            bearing_bias_sigmas=scale * team.sensors.bearing_bias_sigmas,
        )
        noise = Noise(scale * 0.3, scale * 0.05, scale, scale * 0.1)
        errors = ErrorSigmas(
            {"wind": scale * 0.8, "speed_scale": scale * 0.05, "turn_rate_bias": scale * 0.02},
            estimated=ALL,
        )
        small = Team(team.orbits, team.landmarks, sensors, noise, errors)
        ideal, extended = (run_of(small, 100, 2, filter=name) for name in ("ideal", "ekf"))
        assert np.abs(ideal.final_errors).max() > 0.1 * scale
        off.append(np.abs(ideal.final_errors - extended.final_errors).max())
    assert off[0] / off[1] == pytest.approx(100.0, rel=0.1)
