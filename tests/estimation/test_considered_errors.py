"""What is not estimated: against a dense recursion, and against trials."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas
from syncplan.orbits.sightings import steps_within
from syncplan.orbits.team import Team
from syncplan.planning.planner import Plan, plan
from tests.tools.dense_models import dense_true_covariances
from tests.tools.scenarios import EVERYTHING, changed

ALL = tuple(ERROR_STATES)


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(changed("paper-grid-same", heading_sigma_rad=0.1, **EVERYTHING), bound="never")


def _estimating(team: Team, names: tuple[str, ...]) -> Team:
    return replace(team, errors=replace(team.errors, estimated=names))


@pytest.mark.parametrize(
    "names", [(), ("wind",), ("speed_scale", "gusts"), ALL], ids=lambda names: "-".join(names)
)
def test_the_true_error_equals_that_of_the_filters_own_recursion(
    grid: Plan, names: tuple[str, ...]
) -> None:
    team, steps = _estimating(grid.team, names), 120
    found = expected_errors(team, grid.windows, steps * 0.1)
    own, whole, n = layout_of(team), layout_of(team, ALL), team.count
    covariances = dense_true_covariances(team, own, whole, steps)
    variances = np.array([np.diag(C) for C in covariances])
    poses = variances[:, : 3 * n].reshape(-1, n, 3)
    np.testing.assert_allclose(found.position_variance, poses[..., :2].sum(axis=-1), rtol=1e-9)
    np.testing.assert_allclose(found.heading_variance, poses[..., 2], rtol=1e-9)
    assert found.errors is not None
    np.testing.assert_allclose(found.errors, variances[:, 3 * n :], rtol=1e-8, atol=1e-15)
    assert neglected_errors(team) == tuple(name for name in whole.names if name not in names)


@pytest.mark.parametrize(
    "errors",
    [ErrorSigmas({"speed_scale": 0.02, "turn_rate_bias": 0.005}), ErrorSigmas({"wind": 0.05})],
    ids=["scale and bias", "wind"],
)
def test_trials_of_a_filter_that_neglects_errors_find_what_is_expected(errors: ErrorSigmas) -> None:
    sigma = {"position_m": 2.0, "heading_rad": 0.05}
    made = plan(changed("paper-grid-same", initial_sigma=sigma), bound="never")
    team = replace(made.team, errors=errors)
    expected = expected_errors(team, made.windows, 90.0).rms_second_half()
    bound = posterior_bound(team, made.windows, 90.0).rms_second_half()
    steps = steps_within(90.0, team.sensors.sample_time)
    seen = possible_sightings(team, made.windows, steps)
    squares = run_trials(team, seen, steps, FilterOptions(trials=40)).late_mean_squares
    found = np.sqrt(squares[..., :2].sum(axis=-1).mean(axis=0))
    assert np.all(found > 1.3 * bound)
    assert np.sqrt(np.mean(expected**2)) == pytest.approx(np.sqrt(np.mean(found**2)), rel=0.15)
    np.testing.assert_allclose(found, expected, rtol=0.3)
