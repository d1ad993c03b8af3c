"""The filter with further states against its plain form, and the plain form against differences."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.augmented_filter import AUGMENTED
from syncplan.estimation.augmented_frame import BIAS, CLOCK, WALK
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
    augmented_setup_of,
    empty_augmented_statistics,
)
from syncplan.estimation.extended_filter import EXTENDED
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import Readings
from syncplan.estimation.filter_statistics import empty_series, empty_statistics
from syncplan.estimation.lane_filter import augmented_specimen
from syncplan.estimation.montecarlo import _setup
from syncplan.estimation.reference_states import (
    covariance_at_start,
    moved_state,
    predict_state,
    sighted,
    transition_of,
    update_state,
)
from syncplan.estimation.trial_readings import TrialReadings, possible_sightings
from syncplan.orbits.circles import Orbits, wrap
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.noise import ErrorSigmas, Noise
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.team import Team

ALL = ErrorSigmas(
    wind=0.8,
    gust=0.3,
    gust_time=4.0,
    speed_scale=0.05,
    turn_rate_bias=0.02,
    clock_offset=0.05,
    estimated=(),
)
CHOICES = [
    (),
    ("wind",),
    ("gusts",),
    ("bearing_bias",),
    ("bearing_walk",),
    ("clock_offset",),
    ("speed_scale", "turn_rate_bias"),
    tuple(ERROR_STATES),
]


class Scene(NamedTuple):
    """A set-up with further states, and readings of some lanes."""

    setup: AugmentedSetup
    readings: AugmentedReadings


def a_team(estimated: tuple[str, ...], fov: float = 2.0 * np.pi, detection: float = 0.7) -> Team:
    """Three vehicles with every kind of sensor, the second without bearing bias or distances.

    The first has no bearing walk.
    """
    return Team(
        Orbits(
            centers=np.array([[0.0, 0.0], [60.0, 5.0], [10.0, 55.0]]),
            radii=np.array([20.0, 15.0, 18.0]),
            senses=np.array([1.0, -1.0, 1.0]),
            phases=np.array([0.3, 2.0, -1.0]),
            rate=0.4,
        ),
        np.array([[60.0, -5.0], [-30.0, 70.0]]),
        Sensors(
            ranges=np.full(3, 60.0),
            fields_of_view=np.full(3, fov),
            boresights=np.array([0.0, 1.0, -1.0]),
            bearing_sigmas=np.array([0.02, 0.03, 0.05]),
            sample_time=0.1,
            range_sigmas=np.array([0.5, np.inf, 0.3]),
            compass_sigmas=np.array([np.inf, 0.05, 0.1]),
            every=np.array([1, 3, 2]),
            detection=np.array([1.0, detection, detection]),
            bearing_bias_sigmas=np.array([0.03, 0.0, 0.02]),
            bearing_walk_sigmas=np.array([0.0, 0.04, 0.03]),
            bearing_walk_times=np.array([np.inf, 2.0, 0.5]),
        ),
        Noise(speed_sigma=0.3, turn_rate_sigma=0.05, position_sigma=1.0, heading_sigma=0.1),
        replace(ALL, estimated=estimated),
    )


def scene_of(team: Team, steps: int, lanes: int, **changes: object) -> Scene:
    """The first trials of a team."""
    options = FilterOptions(**changes)  # type: ignore[arg-type]
    seen = possible_sightings(team, find_windows(team), steps)
    poses, layout = _setup(team, seen, steps, options), layout_of(team)
    readings = TrialReadings.of(team, poses, layout, 3).disturbed(range(lanes))
    return Scene(augmented_setup_of(poses, layout), readings)


def filtered(
    given: Scene, *, with_series: bool = False
) -> tuple[Array, Array, AugmentedStatistics]:
    """Final state (3n + e, lanes), full covariance and statistics of all lanes."""
    setup, readings = given
    n, _, lanes = readings.initial.shape
    steps, e = len(readings.speeds), len(setup.variances)
    rows = steps + 1 if with_series else 0
    series = empty_series(n, steps, wanted=with_series), np.zeros((rows, e, 3))
    statistics = empty_augmented_statistics(n, e, lanes, series)
    x, errors, P = AUGMENTED.run(setup, readings, statistics)
    lower = np.tril(np.ones(P.shape[:2], dtype=bool))[..., None]
    state = np.concatenate([x.reshape(3 * n, lanes), errors])
    return state, np.where(lower, P, P.transpose(1, 0, 2)), statistics


def plain_steps(given: Scene, lane: int) -> Iterator[tuple[int, Array, Array, Array]]:
    """Each sample by the plain filter: state, covariance, innovations with their variances."""
    setup, readings = given
    errors = np.zeros(len(setup.variances))
    x = np.concatenate([readings.initial[..., lane].ravel(), errors])
    C = covariance_at_start(setup)
    for k in range(1, len(setup.poses.truth)):
        speeds, turns = readings.speeds[k - 1, :, lane], readings.turn_rates[k - 1, :, lane]
        x, C = predict_state(x, C, speeds, turns, setup)
        made = []
        for s in range(setup.poses.first[k], setup.poses.first[k + 1]):
            z = float(readings.sightings[s, lane])
            x, C, nu, S = update_state(x, C, s, z, setup, (speeds, turns))
            made.append((nu, S))
        yield k, x, C, np.reshape(made, (-1, 2))


def derivative(function: object, x: Array, step: float = 1e-6) -> Array:
    """Central differences of a vector function, (outputs, inputs)."""
    assert callable(function)
    columns = [
        np.atleast_1d(function(x + step * one) - function(x - step * one)) / (2.0 * step)
        for one in np.eye(len(x))
    ]
    return np.array(columns).T


def some_state(setup: AugmentedSetup) -> Array:
    random = np.random.default_rng(1)
    poses = setup.poses.truth[7].ravel() + random.normal(size=9)
    return np.concatenate(
        [poses, np.sqrt(setup.variances) * random.normal(size=len(setup.variances))]
    )


@pytest.mark.parametrize("lanes", [1, 3])
@pytest.mark.parametrize("estimated", CHOICES)
def test_kernels_are_not_compiled_anew_for_some_number_of_trials(
    estimated: tuple[str, ...], lanes: int
) -> None:
    given = scene_of(a_team(estimated), 5, lanes)
    setup, readings, *_ = augmented_specimen(3)
    typeof: Any = numba.typeof
    assert [typeof(one) for one in given] == [typeof(setup), typeof(readings)]


@pytest.mark.parametrize("model", ["ekf", "paper"])
@pytest.mark.parametrize("estimated", CHOICES)
def test_the_transition_is_the_derivative_of_the_motion(
    estimated: tuple[str, ...], model: str
) -> None:
    setup = scene_of(a_team(estimated), 10, 1, filter=model, substeps=3).setup
    setup = setup._replace(poses=setup.poses._replace(motion=setup.poses.motion._replace(time=0.8)))
    speeds, turns = np.array([4.0, 5.0, 6.0]), np.array([0.4, -1.0, 0.0])
    state = some_state(setup)
    F = transition_of(state, speeds, turns, setup)
    found = derivative(lambda one: moved_state(one, speeds, turns, setup), state)
    np.testing.assert_allclose(F, found, atol=1e-7)
    if "gusts" in estimated:
        gust = setup.columns[0, 5]
        assert F[gust, gust] == np.exp(-0.1 / 4.0)


def test_the_row_of_every_kind_is_the_derivative_of_the_sighting() -> None:
    setup = scene_of(a_team(tuple(ERROR_STATES)), 10, 1).setup
    state, read = some_state(setup), (np.array([8.0, 6.0, 7.0]), np.array([0.4, -0.4, 0.4]))
    # what an offset does times what other errors do is left out
    clocks = setup.columns[:, CLOCK]
    state[clocks] = 0.0
    for kind, (observer, target) in [
        (0, (0, 1)),
        (0, (2, 4)),
        (1, (2, 0)),
        (1, (0, 3)),
        (2, (1, 1)),
    ]:
        row = sighted(state, kind, observer, target, setup, read)[1]
        found = derivative(
            lambda one: sighted(one, kind, observer, target, setup, read)[0],  # noqa: B023
            state,
        )[0]
        np.testing.assert_allclose(row, found, atol=1e-8)
        own = setup.columns[observer, [BIAS, WALK]]
        assert np.delete(row[9:], clocks - 9).sum() == (kind == 0) * np.sum(own >= 0)
        assert row[clocks[observer]] != 0.0 == row[np.delete(clocks, observer)].sum()


def test_innovations_of_sightings_that_are_made_are_kept() -> None:
    setup, readings = scene_of(a_team(tuple(ERROR_STATES)), 45, 2, gate_probability=0.9)
    n, e = 3, len(setup.variances)
    none = empty_series(n, 45, wanted=False), np.zeros((0, e, 3))
    statistics = empty_augmented_statistics(n, e, 2, none, len(readings.sightings))
    AUGMENTED.run(setup, readings, statistics)
    innovations, weights = statistics.poses.innovations.swapaxes(0, 1)
    np.testing.assert_allclose((innovations**2 * weights).sum(axis=0), statistics.poses.nis)
    np.testing.assert_array_equal((weights > 0.0).sum(axis=0), statistics.poses.accepted)
    rejected = ((weights == 0.0) & ~np.isnan(readings.sightings)).sum(axis=0)
    np.testing.assert_array_equal(rejected, statistics.poses.gated)
    assert 0 < np.isnan(readings.sightings).sum() == (innovations == 0.0).sum()


def test_steps_of_unequal_length_are_those_of_the_plain_filter() -> None:
    team = a_team(tuple(ERROR_STATES))
    setup, readings = scene_of(team, 45, 2)
    spans, steps = np.random.default_rng(5).uniform(0.02, 0.4, 45), np.arange(46)
    poses = setup.poses._replace(
        truth=setup.poses.truth[:16],
        spans=spans,
        compared=np.where(steps % 3 == 0, steps // 3, -1),
    )
    readings = readings._replace(headings=readings.headings[:16], changing=readings.changing[:16])
    state, P, statistics = filtered(Scene(setup._replace(poses=poses), readings))
    x = np.concatenate([readings.initial[..., 1].ravel(), np.zeros(len(setup.variances))])
    C, squares = covariance_at_start(setup), 0.0
    for k, span in enumerate(spans.tolist(), 1):
        motion, share = poses.motion, poses.motion.time / span
        held = poses.motion._replace(
            time=span,
            speed_variance=motion.speed_variance * share,
            turn_rate_variance=motion.turn_rate_variance * share,
        )
        there = augmented_setup_of(poses._replace(motion=held), layout_of(team))
        speeds, turns = readings.speeds[k - 1, :, 1], readings.turn_rates[k - 1, :, 1]
        x, C = predict_state(x, C, speeds, turns, there)
        for s in range(poses.first[k], poses.first[k + 1]):
            z = float(readings.sightings[s, 1])
            x, C, *_ = update_state(x, C, s, z, there, (speeds, turns))
        if k % 3 == 0:
            squares += (x[0] - poses.truth[k // 3, 0, 0]) ** 2
    np.testing.assert_allclose(state[:, 1], x, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(P[..., 1], C, rtol=1e-6, atol=1e-8)
    assert statistics.poses.squares[0, 0, 1] == pytest.approx(squares)


@pytest.mark.parametrize("with_series", [False, True])
@pytest.mark.parametrize(
    ("estimated", "changes"),
    [
        *((one, {}) for one in CHOICES),
        (tuple(ERROR_STATES), {"filter": "paper", "substeps": 3, "gate_probability": 0.9}),
    ],
)
def test_compiled_trials_are_those_of_the_plain_filter(
    estimated: tuple[str, ...], changes: dict[str, object], with_series: bool
) -> None:
    given = scene_of(a_team(estimated), 45, 3, **changes)
    setup, readings = given
    # with a series, the covariance is brought to the present at every sample
    state, P, statistics = filtered(given, with_series=with_series)
    lane, e = 2, len(setup.variances)
    constants, squares, late, nis, made = len(readings.constants), 0.0, 0.0, 0.0, 0
    covered, nees, series = 0.0, 0.0, []
    for k, x, C, sightings in plain_steps(given, lane):
        nu, S = sightings.T
        accepted = nu**2 <= setup.poses.gate * S
        nis, made = nis + np.sum(nu[accepted] ** 2 / S[accepted]), made + accepted.sum()
        true = np.concatenate([readings.constants[:, lane], readings.changing[k, :, lane]])
        off = x[:9].reshape(3, 3) - setup.poses.truth[k]
        off[:, 2] = wrap(x[2:9:3] - readings.headings[k, :, lane])
        error = x[9:] - true
        squares, late = squares + error**2, late + error**2 * (2 * k > 45)
        series.append(off)
        if k % 10 == 0 or k == 45:
            covered = covered + (error**2 <= 9.0 * np.diag(C)[9:])
            nees += float(off.ravel() @ np.linalg.solve(C[:9, :9], off.ravel()))
    np.testing.assert_allclose(state[:, lane], x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(P[..., lane], C, rtol=1e-7, atol=1e-10)
    errors, poses = statistics.errors, statistics.poses
    np.testing.assert_allclose(errors.squares[:, lane], squares, rtol=1e-7)
    np.testing.assert_allclose(errors.late_squares[:, lane], late, rtol=1e-7)
    np.testing.assert_array_equal(errors.covered[:, lane], covered)
    assert poses.nees[lane] == pytest.approx(nees, rel=1e-6)
    assert poses.nis[lane] == pytest.approx(nis, rel=1e-7)
    assert poses.accepted[lane] == made
    missed = int(np.isnan(readings.sightings[:, lane]).sum())
    assert missed > 0
    assert poses.gated[lane] == len(readings.sightings) - missed - made
    np.testing.assert_allclose(
        poses.squares[..., lane], np.sum(np.square(series), axis=0), rtol=1e-7
    )
    assert constants + readings.changing.shape[1] == e


@pytest.mark.parametrize("gust_time", [1e-3, 0.05, 0.2])
def test_gusts_that_pass_within_a_sample_or_two_are_filtered_alike(gust_time: float) -> None:
    team = a_team(("wind", "gusts"))
    given = scene_of(replace(team, errors=replace(team.errors, gust_time=gust_time)), 25, 2)
    state, P, _ = filtered(given)
    *_, (_, x, C, _) = plain_steps(given, 1)
    np.testing.assert_allclose(state[:, 1], x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(P[..., 1], C, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("walk_time", [1e-3, 0.05, 0.2])
def test_walks_that_pass_within_a_sample_or_two_are_filtered_alike(walk_time: float) -> None:
    team = a_team(("gusts", "bearing_walk"))
    times = np.array([np.inf, walk_time, 3.0])
    given = scene_of(replace(team, sensors=replace(team.sensors, bearing_walk_times=times)), 25, 2)
    state, P, _ = filtered(given)
    *_, (_, x, C, _) = plain_steps(given, 1)
    np.testing.assert_allclose(state[:, 1], x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(P[..., 1], C, rtol=1e-7, atol=1e-10)


def test_without_further_states_it_is_the_filter_of_poses() -> None:
    team = replace(a_team((), detection=1.0), errors=ErrorSigmas())
    none = np.zeros(3)
    sensors = replace(team.sensors, bearing_bias_sigmas=none, bearing_walk_sigmas=none)
    team = replace(team, sensors=sensors)
    given = scene_of(team, 60, 5)
    state, P, statistics = filtered(given)
    plain = empty_statistics(3, 5, empty_series(3, 60, wanted=False))
    x, C = EXTENDED.run(given.setup.poses, Readings(*given.readings[:4]), plain)
    np.testing.assert_allclose(state, x.reshape(9, 5), rtol=0, atol=1e-9)
    lower = np.tril_indices(9)
    np.testing.assert_allclose(P[lower], C[lower], rtol=1e-7, atol=1e-11)
    for found, expected in zip(statistics.poses, plain, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-10)


def test_a_missed_sighting_leaves_its_lane_as_if_there_were_none() -> None:
    given = scene_of(a_team(("wind", "bearing_bias"), detection=1.0), 20, 4)
    spoilt = given.readings.sightings.copy()
    s = len(spoilt) // 2
    spoilt[s, 1] = np.nan
    state, P, statistics = filtered(Scene(given.setup, given.readings._replace(sightings=spoilt)))
    whole = filtered(given)
    poses = given.setup.poses
    first = poses.first.copy()
    first[np.searchsorted(first, s, side="right") :] -= 1
    cut = poses._replace(
        first=first,
        observers=np.delete(poses.observers, s),
        targets=np.delete(poses.targets, s),
        kinds=np.delete(poses.kinds, s),
        variances=np.delete(poses.variances, s),
    )
    shorter = Scene(
        given.setup._replace(poses=cut),
        given.readings._replace(sightings=np.delete(given.readings.sightings, s, axis=0)),
    )
    without = filtered(shorter)
    # sightings are taken off the covariance in other groups
    np.testing.assert_allclose(state[:, 1], without[0][:, 1], rtol=1e-10)
    np.testing.assert_allclose(P[..., 1], without[1][..., 1], rtol=1e-7, atol=1e-12)
    assert statistics.poses.accepted[1] == without[2].poses.accepted[1] == len(spoilt) - 1
    assert statistics.poses.nis[1] == pytest.approx(without[2].poses.nis[1], rel=1e-9)
    assert statistics.poses.gated[1] == 0.0
    for lane in (0, 2, 3):
        assert state[:, lane].tobytes() == whole[0][:, lane].tobytes()


def test_a_trial_has_the_same_bytes_whatever_lanes_lie_beside_it() -> None:
    given = scene_of(a_team(tuple(ERROR_STATES)), 20, 19)
    state, P, statistics = filtered(given)
    for lanes in (slice(0, 1), slice(3, 7), slice(2, 18)):
        part = AugmentedReadings(*(np.ascontiguousarray(one[..., lanes]) for one in given.readings))
        found = filtered(Scene(given.setup, part))
        assert found[0].tobytes() == state[:, lanes].tobytes()
        assert found[1].tobytes() == P[..., lanes].tobytes()
        assert found[2].errors.squares.tobytes() == statistics.errors.squares[:, lanes].tobytes()
