"""What is not estimated: against a dense recursion, and against trials of a plain filter."""

from dataclasses import replace

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.orbits.circles import position
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas
from syncplan.orbits.sightings import sample_sightings, steps_within
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
    team, steps = _estimating(grid.team, names), 300
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


def test_a_filter_that_neglects_nothing_meets_its_bound(grid: Plan) -> None:
    team = _estimating(grid.team, ALL)
    found = expected_errors(team, grid.windows, 40.0)
    bound = posterior_bound(team, grid.windows, 40.0)
    np.testing.assert_allclose(found.position_variance, bound.position_variance, rtol=1e-7)


def test_neglecting_costs_no_less_than_estimating(grid: Plan) -> None:
    bound = posterior_bound(_estimating(grid.team, ALL), grid.windows, 60.0)
    found = expected_errors(_estimating(grid.team, ()), grid.windows, 60.0)
    assert np.all(found.position_variance >= bound.position_variance * (1.0 - 1e-9))


def _trials(team: Team, made: Plan, duration: float, trials: int) -> Array:
    """(n,) m RMS over the second half of a plain EKF that knows of no errors, lanes in a batch.

    Vehicles keep their circles; what they read is wrong by scale and bias, and with wind they head
    into it.
    """
    generator = np.random.default_rng(15)
    orbits, noise, dt, n = team.orbits, team.noise, team.sensors.sample_time, team.count
    steps = steps_within(duration, dt)
    seen = sample_sightings(made.windows, orbits.period, team.sensors, 1, steps)
    first = seen.first_of_steps(steps)
    scale = team.errors.speed_scale * generator.standard_normal((trials, n))
    bias = team.errors.turn_rate_bias * generator.standard_normal((trials, n))
    wind = team.errors.wind * generator.standard_normal((trials, 1, 2))

    def flown(time: float) -> tuple[Array, Array, Array]:
        angle = orbits.phases + orbits.senses * orbits.rate * time
        ground = orbits.speeds[:, None] * orbits.senses[:, None]
        air = ground * np.column_stack([-np.sin(angle), np.cos(angle)]) - wind
        return (
            position(orbits, time),
            np.arctan2(air[..., 1], air[..., 0]),
            np.hypot(*np.moveaxis(air, -1, 0)),
        )

    place, ahead, _ = flown(0.0)
    spread = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    x = np.concatenate([np.broadcast_to(place, (trials, n, 2)), ahead[..., None]], axis=-1)
    x = x + spread * generator.standard_normal((trials, n, 3))
    P = np.broadcast_to(np.diag(np.tile(spread**2, n)), (trials, 3 * n, 3 * n)).copy()
    squares, kept = np.zeros(n), 0
    sigma = team.sensors.bearing_sigmas
    for k in range(1, steps + 1):
        place, after, _ = flown(k * dt)
        speed = flown((k - 0.5) * dt)[2]  # of the middle of the step
        rate = np.angle(np.exp(1j * (after - ahead))) / dt
        ahead = after
        v = speed / (1.0 + scale) + noise.speed_sigma * generator.standard_normal((trials, n))
        w = rate - bias + noise.turn_rate_sigma * generator.standard_normal((trials, n))
        _predict(x, P, (v, w), (noise.speed_sigma, noise.turn_rate_sigma), dt)
        for s in range(first[k], first[k + 1]):
            a, b = int(seen.observers[s]), int(seen.targets[s])
            target = place[b] if b < n else team.landmarks[b - n]
            q = target - place[a]
            z = np.arctan2(q[1], q[0]) - ahead[:, a] + sigma[a] * generator.standard_normal(trials)
            estimated = x[:, b, :2] if b < n else team.landmarks[b - n]
            _correct(x, P, (a, b), estimated - x[:, a, :2], z, sigma[a])
        if 2 * k > steps:
            squares += np.mean(np.sum((x[..., :2] - place) ** 2, axis=-1), axis=0)
            kept += 1
    return np.asarray(np.sqrt(squares / kept))


def _predict(
    x: Array, P: Array, readings: tuple[Array, Array], sigmas: tuple[float, float], dt: float
) -> None:
    (v, w), n = readings, x.shape[1]
    half, middle = 0.5 * w * dt, x[..., 2] + 0.5 * w * dt
    chord = v * dt * np.sinc(half / np.pi)
    along = np.stack([np.cos(middle), np.sin(middle)], axis=-1)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    F = np.zeros((len(x), n, 3, 3))
    F[..., :, :] = np.eye(3)
    F[..., :2, 2] = chord[..., None] * across
    G = np.zeros((len(x), n, 3, 2))
    G[..., :2, 0] = dt * np.sinc(half / np.pi)[..., None] * along
    G[..., :2, 1] = (0.5 * dt * chord)[..., None] * across
    G[..., 2, 1] = dt
    x[..., :2] += chord[..., None] * along
    x[..., 2] += w * dt
    blocks = P.reshape(len(x), n, 3, n, 3)
    P[:] = np.einsum("lnab,lnbmc->lnamc", F, blocks).reshape(P.shape)
    P[:] = np.einsum("lnamb,lmcb->lnamc", P.reshape(blocks.shape), F).reshape(P.shape)
    for i in range(n):
        own = slice(3 * i, 3 * i + 3)
        scaled = G[:, i] * np.array(sigmas)
        P[:, own, own] += scaled @ np.swapaxes(scaled, -1, -2)


def _correct(x: Array, P: Array, pair: tuple[int, int], q: Array, z: Array, sigma: float) -> None:
    (a, b), n = pair, x.shape[1]
    slope = np.column_stack([-q[:, 1], q[:, 0]]) / np.sum(q * q, axis=1)[:, None]
    h = np.zeros((len(x), 3 * n))
    h[:, 3 * a : 3 * a + 2], h[:, 3 * a + 2] = -slope, -1.0
    if b < n:
        h[:, 3 * b : 3 * b + 2] = slope
    u = np.einsum("lij,lj->li", P, h)
    variance = np.einsum("li,li->l", h, u) + sigma**2
    innovation = z - np.arctan2(q[:, 1], q[:, 0]) + x[:, a, 2]
    innovation = np.angle(np.exp(1j * innovation))
    x += (u * (innovation / variance)[:, None]).reshape(x.shape)
    P -= u[:, :, None] * (u / variance[:, None])[:, None]


@pytest.mark.parametrize(
    "errors",
    [ErrorSigmas(speed_scale=0.02, turn_rate_bias=0.005), ErrorSigmas(wind=0.05)],
    ids=["scale and bias", "wind"],
)
def test_trials_of_a_filter_that_neglects_errors_find_what_is_expected(
    errors: ErrorSigmas,
) -> None:
    sigma = {"position_m": 2.0, "heading_rad": 0.05}
    made = plan(changed("paper-grid-same", initial_sigma=sigma), bound="never")
    team = replace(made.team, errors=errors)
    expected = expected_errors(team, made.windows, 90.0).rms_second_half()
    bound = posterior_bound(team, made.windows, 90.0).rms_second_half()
    found = _trials(team, made, 90.0, trials=40)
    assert np.all(found > 1.3 * bound)
    assert np.sqrt(np.mean(expected**2)) == pytest.approx(np.sqrt(np.mean(found**2)), rel=0.15)
    np.testing.assert_allclose(found, expected, rtol=0.3)
