"""The compiled filter against its plain form, finite differences, and a linear Kalman filter."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import syncplan
from syncplan.arrays import Array
from syncplan.estimation import lane_filter
from syncplan.estimation.extended_filter import EXTENDED
from syncplan.estimation.filter_setup import FilterSetup, MotionModel, Readings
from syncplan.estimation.filter_statistics import (
    SAMPLE_EVERY,
    FilterStatistics,
    empty_series,
    empty_statistics,
)
from syncplan.estimation.lane_filter import KERNEL_FILES, WIDE_UP_TO
from syncplan.estimation.reference_filter import (
    displacement,
    displacement_jacobian,
    predict,
    predict_bearing,
    update,
)
from syncplan.orbits.circles import Orbits, heading, position, transition, unit, wrap

LANDMARKS = np.array([[60.0, -5.0], [-30.0, 70.0]])
ORBITS = Orbits(
    centers=np.array([[0.0, 0.0], [60.0, 5.0], [10.0, 55.0]]),
    radii=np.array([20.0, 15.0, 18.0]),
    senses=np.array([1.0, -1.0, 1.0]),
    phases=np.array([0.3, 2.0, -1.0]),
    rate=0.4,
)
PAIRS = [(0, 1), (1, 0), (2, 0), (0, 3), (1, 4), (2, 4)]
"""Observer and target; 3 and 4 are the landmarks."""

SIGMAS = np.array([0.02, 0.03, 0.05])


def motion_model(
    time: float, speed_sigma: float, turn_rate_sigma: float, substeps: int = 0
) -> MotionModel:
    return MotionModel(time, substeps, speed_sigma**2, turn_rate_sigma**2)


MOTION = motion_model(0.1, 0.3, 0.05)
INITIAL_SIGMAS = np.array([1.0, 1.0, 0.1])


class Scene(NamedTuple):
    """A set-up, and the readings without noise that belong to it."""

    setup: FilterSetup
    bearings: Array


def scene_of(steps: int, motion: MotionModel = MOTION, gate: float = np.inf) -> Scene:
    """Every third step is blind; at the others, all pairs see each other."""
    times = np.arange(steps + 1) * motion.time
    poses = np.concatenate([position(ORBITS, times), heading(ORBITS, times)[..., None]], axis=2)
    per_step = [PAIRS if k % 3 else [] for k in range(1, steps + 1)]
    seen = np.array([pair for pairs in per_step for pair in pairs], dtype=np.int64)
    step = np.repeat(np.arange(1, steps + 1), [len(pairs) for pairs in per_step])
    setup = FilterSetup(
        truth=poses,
        spans=np.full(steps, motion.time),
        compared=np.arange(steps + 1),
        landmarks=LANDMARKS,
        first=np.concatenate([[0, 0], np.cumsum([len(pairs) for pairs in per_step])]),
        observers=seen[:, 0].copy(),
        targets=seen[:, 1].copy(),
        kinds=np.zeros(len(seen), dtype=np.int64),
        variances=SIGMAS[seen[:, 0]] ** 2,
        initial_variances=np.tile(INITIAL_SIGMAS**2, (3, 1)),
        motion=motion,
        gate=gate,
        second_order=False,
        period=20.0,
        judged_from=0,
        lost_variances=np.ones((3, 3)),
        sample_every=SAMPLE_EVERY,
        noise_known=True,
    )
    bearings = [
        predict_bearing(poses[k], o, t, LANDMARKS)[0] for k, (o, t) in zip(step, seen, strict=True)
    ]
    return Scene(setup, np.array(bearings))


def readings_of(given: Scene, lanes: int, scale: float = 1.0) -> Readings:
    """Readings with noise of `scale` times the filter's sigmas."""
    setup = given.setup
    steps, motion, random = len(setup.truth) - 1, setup.motion, np.random.default_rng(7)
    pose, speed, turn, bearing = (
        random.standard_normal(shape)
        for shape in [(3, 3, lanes), (steps, 3, lanes), (steps, 3, lanes), (len(given[1]), lanes)]
    )
    sigmas = np.sqrt(setup.variances)
    return Readings(
        initial=setup.truth[0][..., None]
        + scale * np.sqrt(setup.initial_variances)[..., None] * pose,
        speeds=ORBITS.speeds[:, None] + scale * np.sqrt(motion.speed_variance) * speed,
        turn_rates=ORBITS.turn_rates[:, None] + scale * np.sqrt(motion.turn_rate_variance) * turn,
        sightings=given.bearings[:, None] + scale * sigmas[:, None] * bearing,
    )


def filtered(setup: FilterSetup, readings: Readings) -> tuple[Array, Array, FilterStatistics]:
    """Final state, full covariance and statistics of all lanes."""
    lanes, steps = readings.initial.shape[-1], len(setup.truth) - 1
    statistics = empty_statistics(3, lanes, empty_series(3, steps, wanted=True))
    x, P = EXTENDED.run(setup, readings, statistics)
    lower = np.tril(np.ones(P.shape[:2], dtype=bool))[..., None]
    return x, np.where(lower, P, P.transpose(1, 0, 2)), statistics


class Plain(NamedTuple):
    """What the plain filter says of one trial."""

    x: Array
    P: Array
    errors: Array
    nees: float
    nis: float
    gated: int


def plainly_filtered(given: Scene, readings: Readings, lane: int, motion: MotionModel) -> Plain:
    """The same trial by `reference_filter.predict` and `reference_filter.update`."""
    setup = given.setup
    x, P = readings.initial[..., lane], np.diag(setup.initial_variances.ravel())
    errors, nees, nis, gated = [], 0.0, 0.0, 0
    steps = len(setup.truth) - 1
    for k in range(1, steps + 1):
        x, P = predict(
            x, P, readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane], motion
        )
        for s in range(setup.first[k], setup.first[k + 1]):
            o, t = int(setup.observers[s]), int(setup.targets[s])
            z, gate = readings.sightings[s, lane], setup.gate
            x, P, nu, S = update(x, P, o, t, z, SIGMAS[o], LANDMARKS, gate)
            accepted = nu**2 <= gate * S
            nis += nu**2 / S if accepted else 0.0
            gated += not accepted
        e = x - setup.truth[k]
        e[:, 2] = wrap(e[:, 2])
        errors.append(e)
        if k % 10 == 0 or k == steps:
            nees += float(e.ravel() @ np.linalg.solve(P, e.ravel()))
    return Plain(x, P, np.array(errors), nees, nis, gated)


def derivative(function: object, x: Array, step: float = 1e-6) -> Array:
    """Central differences of a vector function, (outputs, inputs)."""
    assert callable(function)
    columns = []
    for direction in np.eye(len(x)):
        difference = function(x + step * direction) - function(x - step * direction)
        columns.append(np.asarray(difference / (2.0 * step)).ravel())
    return np.array(columns).T


@pytest.mark.parametrize("substeps", [0, 1, 4])
def test_prediction_carries_the_covariance_by_the_derivatives_of_its_own_state(
    substeps: int,
) -> None:
    motion = motion_model(0.7, 0.3, 0.2, substeps)
    random = np.random.default_rng(1)
    x, speeds, turns = random.normal(size=(3, 3)), np.array([4.0, 5.0, 6.0]), np.array([0.4, -1, 0])
    root = random.normal(size=(9, 9))
    P = root @ root.T

    def moved(state: Array, readings: Array) -> Array:
        return predict(state.reshape(3, 3), P, readings[:3], readings[3:], motion)[0]

    readings = np.concatenate([speeds, turns])
    F = derivative(lambda state: moved(state, readings), x.ravel())
    G = derivative(lambda given: moved(x, given), readings)
    Q = np.diag([0.3**2] * 3 + [0.2**2] * 3)
    carried = predict(x, P, speeds, turns, motion)[1]
    np.testing.assert_allclose(carried, F @ P @ F.T + G @ Q @ G.T, atol=1e-6)


@pytest.mark.parametrize(("observer", "target"), PAIRS)
def test_a_bearing_row_is_the_derivative_of_the_bearing(observer: int, target: int) -> None:
    x = np.array([[0.0, 1.0, 0.3], [20.0, -7.0, 2.0], [-9.0, 30.0, 4.0]])

    def bearing(state: Array) -> Array:
        return np.array([predict_bearing(state.reshape(3, 3), observer, target, LANDMARKS)[0]])

    row = predict_bearing(x, observer, target, LANDMARKS)[1]
    np.testing.assert_allclose(row, derivative(bearing, x.ravel())[0], atol=1e-9)
    assert np.count_nonzero(row) == (5 if target < 3 else 3)


@pytest.mark.parametrize("turn", [0.0, 1e-5, 1e-3, 0.4, -3.0])
def test_euler_tends_to_the_arc_at_first_order(turn: float) -> None:
    psi, v, w = np.array([0.3]), np.array([4.0]), np.array([turn])
    for function in (displacement, displacement_jacobian):
        arc = function(psi, v, w, 0.5)
        coarse, fine = (np.abs(function(psi, v, w, 0.5, N) - arc).max() for N in (500, 1000))
        assert fine <= 1e-2 * (0.1 + abs(turn))
        assert coarse == pytest.approx(2.0 * fine, rel=0.01, abs=1e-13)


@pytest.mark.parametrize("substeps", [0, 1, 5])
@pytest.mark.parametrize("gate", [np.inf, 2.0])
def test_the_compiled_filter_equals_the_plain_one_to_round_off(substeps: int, gate: float) -> None:
    motion = motion_model(0.1, 0.3, 0.05, substeps)
    given = scene_of(36, motion, gate)
    readings = readings_of(given, lanes=3)
    x, P, statistics = filtered(given.setup, readings)
    for lane in range(3):
        plain = plainly_filtered(given, readings, lane, motion)
        np.testing.assert_allclose(x[..., lane], plain.x, rtol=0, atol=1e-11)
        np.testing.assert_allclose(P[..., lane], plain.P, rtol=0, atol=1e-11)
        np.testing.assert_allclose(statistics.final[..., lane], plain.errors[-1], atol=1e-11)
        squares = (plain.errors**2).sum(axis=0)
        np.testing.assert_allclose(statistics.squares[..., lane], squares, atol=1e-10)
        late = (plain.errors[18:] ** 2).sum(axis=0)
        np.testing.assert_allclose(statistics.late_squares[..., lane], late, atol=1e-10)
        assert statistics.nees[lane] == pytest.approx(plain.nees, rel=1e-9)
        assert statistics.nees_samples[lane] == 4
        assert statistics.nis[lane] == pytest.approx(plain.nis, rel=1e-9)
        assert statistics.gated[lane] == plain.gated
    assert (statistics.gated.sum() > 0) == np.isfinite(gate)


def test_steps_of_unequal_length_have_the_noise_of_a_random_walk() -> None:
    motion = motion_model(0.1, 0.3, 0.05)
    given = scene_of(36, motion)
    spans = np.random.default_rng(3).uniform(0.01, 0.3, 36)
    # errors are compared after every fourth step alone
    compared = np.where(np.arange(37) % 4 == 0, np.arange(37) // 4, -1)
    setup = given.setup._replace(truth=given.setup.truth[:10], spans=spans, compared=compared)
    readings, series = readings_of(given, lanes=2), empty_series(3, 9, wanted=True)
    statistics = empty_statistics(3, 2, series)
    x, P = EXTENDED.run(setup, readings, statistics)
    plain, C = readings.initial[..., 1], np.diag(setup.initial_variances.ravel())
    squares = np.zeros((3, 3))
    for k in range(1, 37):
        share = 0.1 / spans[k - 1]
        held = MotionModel(spans[k - 1], 0, 0.3**2 * share, 0.05**2 * share)
        speeds, turns = readings.speeds[k - 1, :, 1], readings.turn_rates[k - 1, :, 1]
        plain, C = predict(plain, C, speeds, turns, held)
        for s in range(setup.first[k], setup.first[k + 1]):
            o, t = int(setup.observers[s]), int(setup.targets[s])
            plain, C, *_ = update(
                plain, C, o, t, readings.sightings[s, 1], SIGMAS[o], LANDMARKS, setup.gate
            )
        if k % 4 == 0:
            error = plain - setup.truth[k // 4]
            error[:, 2] = wrap(error[:, 2])
            squares += error**2
    np.testing.assert_allclose(x[..., 1], plain, rtol=0, atol=1e-10)
    np.testing.assert_allclose(np.tril(P[..., 1]), np.tril(C), rtol=0, atol=1e-10)
    np.testing.assert_allclose(statistics.squares[..., 1], squares, atol=1e-9)
    np.testing.assert_allclose(series[9, :, 9].sum(), P[[0, 3, 6], [0, 3, 6]].sum(), rtol=1e-12)


def test_innovations_are_kept_where_they_are_wanted() -> None:
    given = scene_of(12, gate=2.0)
    readings = readings_of(given, lanes=2)
    series = empty_series(3, 12, wanted=False)
    statistics = empty_statistics(3, 2, series, len(readings.sightings))
    EXTENDED.run(given.setup, readings, statistics)
    innovations, weights = statistics.innovations[:, 0], statistics.innovations[:, 1]
    squares = innovations**2 * weights
    np.testing.assert_allclose(squares.sum(axis=0), statistics.nis, rtol=1e-12)
    np.testing.assert_array_equal((weights > 0.0).sum(axis=0), statistics.accepted)
    assert statistics.gated.sum() > 0
    assert squares.max() <= 2.0
    start = np.diag(given.setup.initial_variances.ravel())
    read = readings.speeds[0, :, 1], readings.turn_rates[0, :, 1]
    x, _ = predict(readings.initial[..., 1], start, *read, given.setup.motion)
    o, t = int(given.setup.observers[0]), int(given.setup.targets[0])
    off = readings.sightings[0, 1] - predict_bearing(x, o, t, LANDMARKS)[0]
    assert innovations[0, 1] == pytest.approx(float(wrap(off)), abs=1e-12)


def test_a_straight_way_in_parts_is_as_uncertain_as_at_once() -> None:
    motion = motion_model(0.1, 0.3, 0.0)
    given = scene_of(1, motion)
    readings = readings_of(given, lanes=1)
    straight = readings._replace(turn_rates=np.zeros_like(readings.turn_rates))
    blind = given.setup._replace(first=np.zeros(3, dtype=np.int64), spans=np.array([2.0]))
    parts = blind._replace(
        first=np.zeros(5, dtype=np.int64),
        spans=np.array([0.5, 0.1, 1.4]),
        compared=np.array([0, -1, -1, 1]),
    )
    several = straight._replace(
        speeds=np.repeat(straight.speeds, 3, axis=0), turn_rates=np.zeros((3, 3, 1))
    )
    x, P, _ = filtered(blind, straight)
    x_parts, P_parts, _ = filtered(parts, several)
    np.testing.assert_allclose(x_parts, x, rtol=1e-12)
    np.testing.assert_allclose(P_parts, P, rtol=1e-12, atol=1e-14)


def test_the_closed_form_holds_where_vehicles_hardly_turn() -> None:
    given = scene_of(6)
    readings = readings_of(given, lanes=2)
    for turn in (0.0, 1e-9, 3.9e-3, 4.1e-3):
        for substeps in (0, 3):
            motion = motion_model(0.1, 0.3, 0.05, substeps)
            setup = scene_of(6, motion).setup
            slow = readings._replace(turn_rates=np.full_like(readings.turn_rates, turn))
            x, P, _ = filtered(setup, slow)
            plain = plainly_filtered(Scene(setup, given.bearings), slow, 1, motion)
            np.testing.assert_allclose(x[..., 1], plain.x, rtol=0, atol=1e-11)
            np.testing.assert_allclose(P[..., 1], plain.P, rtol=0, atol=1e-11)


def test_without_noise_the_error_stays_at_round_off() -> None:
    given = scene_of(1000)
    _, _, statistics = filtered(given.setup, readings_of(given, lanes=2, scale=0.0))
    assert np.sqrt(statistics.squares.max() / 1000) < 1e-11
    assert np.abs(statistics.final).max() < 1e-11


def test_whole_turns_of_heading_and_bearing_change_nothing() -> None:
    given = scene_of(30)
    readings = readings_of(given, lanes=2)
    turned = readings._replace(
        sightings=readings.sightings + 2.0 * np.pi * (np.arange(len(given.bearings)) % 3)[:, None],
        initial=readings.initial - 4.0 * np.pi * np.array([0.0, 0.0, 1.0])[None, :, None],
    )
    expected, found = filtered(given.setup, readings), filtered(given.setup, turned)
    np.testing.assert_allclose(found[2].final, expected[2].final, atol=1e-11)
    np.testing.assert_allclose(found[2].squares, expected[2].squares, atol=1e-11)


def linear_filter(given: Scene, readings: Readings, lane: int) -> tuple[Array, Array]:
    """Error and covariance of a linear Kalman filter along the nominal path, joint updates.

    Written down anew: F from the orbits' transition, G by quadrature along the arc.
    """
    setup, motion = given.setup, given.setup.motion
    m = (readings.initial[..., lane] - setup.truth[0]).ravel()
    P = np.diag(setup.initial_variances.ravel())
    nodes, weights = np.polynomial.legendre.leggauss(8)
    s, ds = 0.5 * motion.time * (nodes + 1.0), 0.5 * motion.time * weights
    for k in range(1, len(setup.truth)):
        F, G = np.zeros((9, 9)), np.zeros((9, 6))
        turn = transition(ORBITS, k * motion.time, (k - 1) * motion.time)
        for i in range(3):
            ahead = setup.truth[k - 1, i, 2] + ORBITS.turn_rates[i] * s
            F[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turn[i]
            G[3 * i : 3 * i + 2, i] = ds @ unit(ahead)
            G[3 * i : 3 * i + 2, 3 + i] = ORBITS.speeds[i] * (ds * s) @ unit(ahead + np.pi / 2.0)
            G[3 * i + 2, 3 + i] = motion.time
        slips = np.concatenate(
            [
                readings.speeds[k - 1, :, lane] - ORBITS.speeds,
                readings.turn_rates[k - 1, :, lane] - ORBITS.turn_rates,
            ]
        )
        Q = np.diag([motion.speed_variance] * 3 + [motion.turn_rate_variance] * 3)
        m, P = F @ m + G @ slips, F @ P @ F.T + G @ Q @ G.T
        seen = slice(setup.first[k], setup.first[k + 1])
        if seen.start == seen.stop:
            continue
        pairs = list(zip(setup.observers[seen], setup.targets[seen], strict=True))
        H = np.array([predict_bearing(setup.truth[k], o, t, LANDMARKS)[1] for o, t in pairs])
        R = np.diag(setup.variances[seen])
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        m = m + K @ (readings.sightings[seen, lane] - given.bearings[seen] - H @ m)
        P = (np.eye(9) - K @ H) @ P
    return m.reshape(3, 3), P


def test_for_small_noise_the_filter_becomes_the_linear_one_at_second_order() -> None:
    differences = []
    for scale in (1e-3, 1e-4):
        motion = motion_model(0.1, scale * 0.3, scale * 0.05)
        given = scene_of(60, motion)
        small = given.setup._replace(
            initial_variances=scale**2 * given.setup.initial_variances,
            variances=scale**2 * given.setup.variances,
        )
        given = Scene(small, given.bearings)
        readings = readings_of(given, lanes=2)
        _, P, statistics = filtered(small, readings)
        expected, expected_P = linear_filter(given, readings, 1)
        assert np.abs(expected).max() > 0.05 * scale
        differences.append(np.abs(statistics.final[..., 1] - expected).max())
        np.testing.assert_allclose(P[..., 1] / scale**2, expected_P / scale**2, atol=3.0 * scale)
    assert differences[0] / differences[1] == pytest.approx(100.0, rel=0.1)


def test_a_trial_has_the_same_bytes_whatever_lanes_lie_beside_it() -> None:
    given = scene_of(40)
    readings = readings_of(given, lanes=19)
    x, P, statistics = filtered(given.setup, readings)
    for lanes in (slice(0, 1), slice(3, 7), slice(2, 18), slice(18, 19)):
        part = Readings(*(np.ascontiguousarray(field[..., lanes]) for field in readings))
        x_part, P_part, tally_part = filtered(given.setup, part)
        assert x_part.tobytes() == x[..., lanes].tobytes()
        assert P_part.tobytes() == P[..., lanes].tobytes()
        for whole, piece in zip(statistics[:-1], tally_part[:-1], strict=True):
            assert piece.tobytes() == whole[..., lanes].tobytes()


def test_a_large_team_in_one_lane_has_the_bytes_of_many_lanes() -> None:
    n, steps, random = WIDE_UP_TO + 1, 12, np.random.default_rng(3)
    poses = np.concatenate(
        [random.uniform(0, 500, (steps + 1, n, 2)), np.ones((steps + 1, n, 1))], 2
    )
    setup = scene_of(1).setup._replace(
        truth=poses,
        spans=np.full(steps, 0.1),
        compared=np.arange(steps + 1),
        first=np.arange(steps + 2) * 3,
        observers=random.integers(0, n, 3 * steps + 3),
        targets=random.integers(n, n + 2, 3 * steps + 3),
        initial_variances=np.ones((n, 3)),
        kinds=np.zeros(3 * steps + 3, dtype=np.int64),
        variances=np.full(3 * steps + 3, 0.01),
    )
    readings = Readings(
        *(random.uniform(0.1, 1, (*shape, 4)) for shape in [(n, 3), (steps, n), (steps, n), (39,)])
    )
    assert EXTENDED.lanes_for(n) == 1
    x, P = EXTENDED.run(
        setup,
        readings,
        empty_statistics(n, 4, empty_series(n, steps, wanted=False)),
    )
    one = Readings(*(np.ascontiguousarray(field[..., 2:3]) for field in readings))
    statistics = empty_statistics(n, 1, empty_series(n, steps, wanted=False))
    x_one, P_one = EXTENDED.run(setup, one, statistics)
    assert x_one.tobytes() == x[..., 2:3].tobytes()
    assert P_one.tobytes() == P[..., 2:3].tobytes()


def test_the_gate_leaves_an_outlier_out_as_if_it_had_not_been_measured() -> None:
    given = scene_of(20, gate=30.0)
    readings = readings_of(given, lanes=1)
    spoilt = readings.sightings.copy()
    spoilt[50] += 1.0
    x, P, statistics = filtered(given.setup, readings._replace(sightings=spoilt))
    first = given.setup.first.copy()
    first[np.searchsorted(first, 50, side="right") :] -= 1
    without = given.setup._replace(
        first=first,
        observers=np.delete(given.setup.observers, 50),
        targets=np.delete(given.setup.targets, 50),
        kinds=np.delete(given.setup.kinds, 50),
        variances=np.delete(given.setup.variances, 50),
    )
    rest = readings._replace(sightings=np.delete(readings.sightings, 50, axis=0))
    expected = filtered(without, rest)
    assert statistics.gated[0] == 1
    assert statistics.accepted[0] == len(spoilt) - 1
    assert x.tobytes() == expected[0].tobytes()
    assert P.tobytes() == expected[1].tobytes()


def test_estimates_at_one_place_give_no_nan() -> None:
    given = scene_of(2)
    readings = readings_of(given, lanes=1, scale=0.0)
    readings.initial[1] = readings.initial[0]
    alike = readings._replace(
        speeds=np.ones_like(readings.speeds), turn_rates=np.zeros_like(readings.turn_rates)
    )
    x, P, _ = filtered(given.setup, alike)
    assert np.isfinite(x).all()
    assert np.isfinite(P).all()


def test_a_singular_covariance_counts_no_nees_sample() -> None:
    given = scene_of(12, motion_model(0.1, 0.0, 0.0))
    certain = given.setup._replace(initial_variances=np.zeros((3, 3)))
    _, P, statistics = filtered(certain, readings_of(given, lanes=1, scale=0.0))
    assert np.all(P == 0.0)
    assert statistics.nees_samples[0] == 0
    assert statistics.nees[0] == 0.0


def test_kernels_count_as_compiled_once_they_are() -> None:
    EXTENDED.compile(3)
    assert EXTENDED.is_compiled(3)
    assert EXTENDED.is_compiled(WIDE_UP_TO)


def test_the_cache_of_kernels_notices_changes_of_every_file_they_are_built_on(
    tmp_path: Path,
) -> None:
    """Field order of records and kernels of other files are compiled in."""
    estimation = tmp_path / "syncplan" / "estimation"
    shutil.copytree(Path(syncplan.__file__).parent, estimation.parent)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}

    def stamps() -> str:
        return subprocess.run(
            [sys.executable, "-c", STAMPS],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout

    seen = {stamps()}
    for name in KERNEL_FILES:
        file = estimation / name
        file.write_text(file.read_text() + "\n# changed\n")
        seen.add(stamps())
    assert len(seen) == 1 + len(KERNEL_FILES)


def test_a_cache_that_names_a_record_of_another_version_is_none() -> None:
    def gone() -> Any:
        raise AttributeError("module has no attribute 'Former'")

    def known() -> Any:
        return {"key": "file"}

    assert lane_filter._none_if_renamed(known)() == {"key": "file"}
    assert lane_filter._none_if_renamed(gone)() == {}


STAMPS = """
from syncplan.estimation.extended_filter import EXTENDED
print(EXTENDED.kernel._cache._cache_file._source_stamp)
"""
