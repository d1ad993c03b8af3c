"""The ideal filter against its plain form, the bound, and the extended Kalman filter."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedStatistics,
    empty_augmented_statistics,
)
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_statistics import empty_series
from syncplan.estimation.ideal_filter import IDEAL
from syncplan.estimation.lane_filter import start_of
from syncplan.estimation.montecarlo import run_trials
from syncplan.estimation.reference_states import (
    covariance_at_start,
    moved_state,
    predict_state,
    sighted,
    transition_of,
)
from syncplan.estimation.trial_readings import possible_sightings
from syncplan.estimation.trials import MonteCarloResult, merge
from syncplan.orbits.circles import unit, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.team import Team
from tests.estimation.test_further_states import CHOICES, Scene, a_team, derivative, scene_of
from tests.estimation.test_montecarlo import bytes_of, paper_grid

STEPS = 45


def true_state(given: Scene, k: int, lane: int) -> Array:
    """The true state (3n + e,) at sample k."""
    setup, readings = given
    poses = setup.poses.truth[k].copy()
    poses[:, 2] = readings.headings[k, :, lane]
    return np.concatenate(
        [poses.ravel(), readings.constants[:, lane], readings.changing[k, :, lane]]
    )


def true_readings(given: Scene, k: int, lane: int) -> tuple[Array, Array]:
    """Speeds and turn rates (n,) that lead along arcs through the air to the truth at sample k."""
    setup, readings = given
    before, time = true_state(given, k - 1, lane), setup.poses.motion.time
    own = np.where(setup.columns >= 0, before[setup.columns], 0.0)
    way = np.diff(setup.poses.truth[k - 1 : k + 1, :, :2], axis=0)[0]
    way = way - time * (own[:, :2] + own[:, 5:7])
    ahead = readings.headings[k - 1, :, lane]
    turn = wrap(readings.headings[k, :, lane] - ahead)
    along = np.sum(way * unit(ahead + 0.5 * turn), axis=1) / np.sinc(turn / (2.0 * np.pi))
    return along / (time * (1.0 + own[:, 2])), turn / time - own[:, 3]


def plain_steps(given: Scene, lane: int) -> Iterator[tuple[int, Array, Array, Array]]:
    """Each sample by a linear filter along the truth: what it is off, covariance, innovations."""
    setup, readings = given
    poses, n = setup.poses, len(setup.columns)
    off, P = -true_state(given, 0, lane), covariance_at_start(setup)
    off[: 3 * n] += readings.initial[..., lane].ravel()
    for k in range(1, len(poses.truth)):
        before, after = true_state(given, k - 1, lane), true_state(given, k, lane)
        true = np.concatenate(true_readings(given, k, lane))
        read = np.concatenate(
            [readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]]
        )
        G = derivative(lambda one: moved_state(before, one[:n], one[n:], setup), true, 1e-5)  # noqa: B023
        moved, P = predict_state(before, P, true[:n], true[n:], setup)
        missed = moved - after
        missed[2 : 3 * n : 3] = wrap(missed[2 : 3 * n : 3])
        off = transition_of(before, true[:n], true[n:], setup) @ off + G @ (read - true) + missed
        made = []
        for s in range(poses.first[k], poses.first[k + 1]):
            o, t, kind = (int(one[s]) for one in (poses.observers, poses.targets, poses.kinds))
            expected, h = sighted(after, kind, o, t, setup, (read[:n], read[n:]))
            u, nu = P @ h, float(readings.sightings[s, lane]) - expected
            S = float(h @ u) + float(poses.variances[s])
            nu = (nu if kind == 1 else float(wrap(nu))) - float(h @ off)
            if nu**2 <= poses.gate * S:
                off, P = off + u * nu / S, P - np.outer(u, u) / S
            made.append((nu, S))
        yield k, off, P, np.reshape(made, (-1, 2))


def filtered(
    given: Scene, *, with_series: bool = False
) -> tuple[Array, Array, AugmentedStatistics]:
    """Final state (3n + e, lanes), full covariance and statistics of all lanes."""
    setup, readings = given
    n, _, lanes = readings.initial.shape
    steps, e = len(readings.speeds), len(setup.variances)
    rows = steps + 1 if with_series else 0
    series = empty_series(n, steps, wanted=with_series), np.zeros((rows, e, 3))
    statistics = empty_augmented_statistics(n, e, lanes, series, len(readings.sightings))
    x, errors, P = IDEAL.run(setup, readings, statistics)
    lower = np.tril(np.ones(P.shape[:2], dtype=bool))[..., None]
    state = np.concatenate([x.reshape(3 * n, lanes), errors])
    return state, np.where(lower, P, P.transpose(1, 0, 2)), statistics


@pytest.mark.parametrize("with_series", [False, True])
@pytest.mark.parametrize(
    ("estimated", "changes"),
    [*((one, {}) for one in CHOICES), (tuple(ERROR_STATES), {"gate_probability": 0.9})],
)
def test_compiled_trials_are_those_of_a_linear_filter_along_the_truth(
    estimated: tuple[str, ...], changes: dict[str, object], with_series: bool
) -> None:
    given = scene_of(a_team(estimated), STEPS, 3, filter="ideal", **changes)
    setup, readings = given
    state, P, statistics = filtered(given, with_series=with_series)
    lane, nis, made, nees = 2, 0.0, 0, 0.0
    squares, late = np.zeros(len(state)), np.zeros(len(state))
    covered = np.zeros(len(setup.variances))
    for k, off, C, sightings in plain_steps(given, lane):
        nu, S = sightings.T
        accepted = nu**2 <= setup.poses.gate * S
        nis, made = nis + np.sum(nu[accepted] ** 2 / S[accepted]), made + accepted.sum()
        squares, late = squares + off**2, late + off**2 * (2 * k > STEPS)
        if k % 10 == 0 or k == STEPS:
            covered += off[9:] ** 2 <= 9.0 * np.diag(C)[9:]
            nees += float(off[:9] @ np.linalg.solve(C[:9, :9], off[:9]))
    true = true_state(given, STEPS, lane)
    np.testing.assert_allclose(state[:, lane] - true, off, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(P[..., lane], C, rtol=1e-7, atol=1e-10)
    poses, errors = statistics.poses, statistics.errors
    np.testing.assert_allclose(poses.final[..., lane].ravel(), off[:9], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(poses.squares[..., lane].ravel(), squares[:9], rtol=1e-6)
    np.testing.assert_allclose(poses.late_squares[..., lane].ravel(), late[:9], rtol=1e-6)
    np.testing.assert_allclose(errors.squares[:, lane], squares[9:], rtol=1e-6)
    np.testing.assert_array_equal(errors.covered[:, lane], covered)
    assert poses.nees[lane] == pytest.approx(nees, rel=1e-6)
    assert poses.nis[lane] == pytest.approx(nis, rel=1e-6)
    assert poses.accepted[lane] == made
    missed = int(np.isnan(readings.sightings[:, lane]).sum())
    assert missed > 0
    assert poses.gated[lane] == len(readings.sightings) - missed - made
    assert (poses.gated[lane] > 0) == bool(changes)
    kept, weights = poses.innovations[..., lane].T
    assert np.sum(kept**2 * weights) == pytest.approx(nis, rel=1e-6)


@pytest.mark.parametrize("sigmas", [(5.0, 0.1), (50.0, 1.0)])
def test_errors_are_those_of_the_bound_and_the_covariance_holds_from_any_start(
    sigmas: tuple[float, float],
) -> None:
    team, sightings, steps = paper_grid(800, noise=Noise(0.1, 0.01, *sigmas))
    trials = 1600
    result = run_trials(team, sightings, steps, FilterOptions(trials=trials, filter="ideal"))
    bound = posterior_bound(team, find_windows(team), 80.0).rms_second_half()
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


@pytest.mark.parametrize("wide", [1.0, 50.0])
@pytest.mark.parametrize(
    "errors",
    [
        ErrorSigmas(),
        ErrorSigmas(wind=0.8),
        ErrorSigmas(wind=0.8, gust=0.3, gust_time=4.0),
        ErrorSigmas(speed_scale=0.05, turn_rate_bias=0.02),
    ],
)
def test_with_every_error_as_a_state_the_covariance_holds(errors: ErrorSigmas, wide: float) -> None:
    team = a_team(tuple(ERROR_STATES))
    noise = replace(team.noise, position_sigma=wide, heading_sigma=min(0.1 * wide, 1.0))
    team = replace(team, noise=noise, errors=replace(errors, estimated=tuple(ERROR_STATES)))
    assert_consistent(run_of(team, 300, 320), 9)


def run_of(team: Team, steps: int, trials: int, **options: object) -> MonteCarloResult:
    seen = possible_sightings(team, find_windows(team), steps)
    wanted = {"filter": "ideal", "trials": trials, **options}
    return run_trials(team, seen, steps, FilterOptions(**wanted))  # type: ignore[arg-type]


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
            wind=scale * 0.8,
            speed_scale=scale * 0.05,
            turn_rate_bias=scale * 0.02,
            estimated=tuple(ERROR_STATES),
        )
        small = Team(team.orbits, team.landmarks, sensors, noise, errors)
        ideal, extended = (run_of(small, 100, 2, filter=name) for name in ("ideal", "ekf"))
        assert np.abs(ideal.final_errors).max() > 0.1 * scale
        off.append(np.abs(ideal.final_errors - extended.final_errors).max())
    assert off[0] / off[1] == pytest.approx(100.0, rel=0.1)


def test_any_number_of_threads_and_parts_give_the_same_bytes() -> None:
    team = a_team(tuple(ERROR_STATES), fov=4.0)
    seen = possible_sightings(team, find_windows(team), 60)

    def run(begin: int, end: int, threads: int) -> MonteCarloResult:
        options = FilterOptions(trials=end - begin, with_series=True, filter="ideal")
        return run_trials(team, seen, 60, options, first_trial=begin, threads=threads)

    whole = run(0, 70, 1)
    assert bytes_of(run(0, 70, 3)) == bytes_of(whole)
    assert bytes_of(merge([run(0, 16, 2), run(16, 48, 1), run(48, 70, 2)])) == bytes_of(whole)


def test_a_trial_has_the_same_bytes_whatever_lanes_lie_beside_it() -> None:
    given = scene_of(a_team(tuple(ERROR_STATES)), 20, 19)
    state, P, statistics = filtered(given)
    for lanes in (slice(0, 1), slice(3, 7), slice(2, 18)):
        part = AugmentedReadings(*(np.ascontiguousarray(one[..., lanes]) for one in given.readings))
        found = filtered(Scene(given.setup, part))
        assert found[0].tobytes() == state[:, lanes].tobytes()
        assert found[1].tobytes() == P[..., lanes].tobytes()
        assert found[2].errors.squares.tobytes() == statistics.errors.squares[:, lanes].tobytes()


def test_a_run_may_stop_on_its_way() -> None:
    given = scene_of(a_team(tuple(ERROR_STATES)), STEPS, 2)
    setup, readings = given
    state, P, statistics = filtered(given)
    none = empty_series(3, STEPS, wanted=False), np.zeros((0, len(setup.variances), 3))
    again = empty_augmented_statistics(3, len(setup.variances), 2, none)
    reached = start_of(setup, readings)
    for begin, end in ((0, 13), (13, STEPS)):
        IDEAL.advance(setup, readings, again, reached, begin, end)
    np.testing.assert_allclose(reached[0].reshape(9, 2), state[:9], rtol=1e-9)
    np.testing.assert_allclose(reached[1], state[9:], rtol=1e-7, atol=1e-10)
    lower = np.tril_indices(len(P))
    np.testing.assert_allclose(reached[2][lower], P[lower], rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(again.poses.squares, statistics.poses.squares, rtol=1e-8)
