"""Compiled filters against plain ones, and the plain ones against finite differences."""

import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.correction_kernels import second_order_variance
from syncplan.estimation.filter_options import lane_filter_of
from syncplan.estimation.filter_setup import (
    BEARING_KIND,
    COMPASS_KIND,
    DELAY,
    DISTANCE_KIND,
    SQUARE,
    VARIANCE,
    FilterRun,
    FilterSetup,
    FilterStatistics,
    Readings,
    Truth,
    empty_statistics,
    start_of,
)
from syncplan.estimation.kernels import WIDE_UP_TO, has_compiled, kernel, lanes_for
from syncplan.estimation.lane_filter import EXTENDED, IDEAL, LaneFilter, specimen
from syncplan.estimation.trial_readings import TrialReadings
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.noise import Noise
from syncplan.runtime.machine import usable_cores
from syncplan.scenario.filters import FILTERS
from tests.tools.filter_scenes import (
    ALL,
    CHOICES,
    Scene,
    a_team,
    derivative,
    quiet,
    scene_of,
    true_state,
)
from tests.tools.inner_kernels import called_alone
from tests.tools.plain_filters import Plain, extended_steps, ideal_steps
from tests.tools.reference_filter import (
    displacement,
    displacement_jacobian,
    moved_state,
    predict_state,
    sighted,
    transition_of,
)

STEPS = 42
BOTH = pytest.mark.parametrize("lane_filter", [EXTENDED, IDEAL])

# --- the plain filter by itself -----------------------------------------------------------------


def some_state(given: Scene) -> Array:
    x, random = true_state(given.truth, 7, 0), np.random.default_rng(1)
    x[: 3 * given.setup.vehicles] += random.normal(size=3 * given.setup.vehicles)
    return x


@pytest.mark.parametrize("model", ["ekf", "paper"])
@pytest.mark.parametrize("estimated", CHOICES)
def test_prediction_carries_the_covariance_by_the_derivatives_of_the_motion(
    estimated: tuple[str, ...], model: str
) -> None:
    given = scene_of(a_team(estimated), 10, 1, filter=model, substeps=3)
    setup = given.setup._replace(motion=given.setup.motion._replace(time=0.8))
    state, read = some_state(given), np.array([4.0, 5.0, 6.0, 0.4, -1.0, 0.0])
    root = np.random.default_rng(2).normal(size=(len(state), len(state)))
    F = derivative(lambda one: moved_state(one, read[:3], read[3:], setup), state)
    G = derivative(lambda one: moved_state(state, one[:3], one[3:], setup), read)
    np.testing.assert_allclose(transition_of(state, read[:3], read[3:], setup), F, atol=1e-7)
    Q = np.repeat([setup.motion.speed_variance, setup.motion.turn_rate_variance], 3)
    gained = np.zeros(len(state))
    gained[9:] = setup.states.variances * (1.0 - setup.states.decays**2)
    carried = predict_state(state, root @ root.T, read[:3], read[3:], setup)[1]
    expected = F @ root @ root.T @ F.T + (G * Q) @ G.T + np.diag(gained)
    np.testing.assert_allclose(carried, expected, atol=2e-5)
    if "gusts" in estimated:
        assert setup.states.decays.min() <= np.exp(-0.1 / 4.0) in setup.states.decays


@pytest.mark.parametrize(
    ("kind", "observer", "target"),
    [
        (BEARING_KIND, 0, 1),
        (BEARING_KIND, 2, 4),
        (DISTANCE_KIND, 2, 0),
        (DISTANCE_KIND, 0, 3),
        (COMPASS_KIND, 1, 1),
    ],
)
def test_a_row_is_the_derivative_of_the_sighting(kind: int, observer: int, target: int) -> None:
    given = scene_of(a_team(ALL), 10, 1)
    setup, state = given.setup, some_state(given)
    read = np.array([8.0, 6.0, 7.0]), np.array([0.4, -0.4, 0.4])
    # the product of an offset and other errors is left out
    clocks = setup.states.columns[setup.states.acts == DELAY]
    state[clocks] = 0.0

    def value(one: Array) -> float:
        return sighted(one, kind, observer, target, setup, read)[0]

    row = sighted(state, kind, observer, target, setup, read)[1]
    np.testing.assert_allclose(row, derivative(value, state)[0], atol=1e-8)
    shifts = {BEARING_KIND: (1, 1, 2), DISTANCE_KIND: (0, 0, 0), COMPASS_KIND: (0, 0, 0)}
    assert np.delete(row[9:], clocks - 9).sum() == shifts[kind][observer]
    assert row[clocks[observer]] != 0.0 == row[np.delete(clocks, observer)].sum()


@pytest.mark.parametrize("turn", [0.0, 1e-5, 1e-3, 0.4, -3.0])
def test_euler_tends_to_the_arc_at_first_order(turn: float) -> None:
    psi, v, w = np.array([0.3]), np.array([4.0]), np.array([turn])
    for function in (displacement, displacement_jacobian):
        arc = function(psi, v, w, 0.5)
        coarse, fine = (np.abs(function(psi, v, w, 0.5, N) - arc).max() for N in (500, 1000))
        assert fine <= 1e-2 * (0.1 + abs(turn))
        assert coarse == pytest.approx(2.0 * fine, rel=0.01, abs=1e-13)


@pytest.mark.parametrize("kind", [BEARING_KIND, DISTANCE_KIND])
def test_second_order_noise_is_the_variance_of_the_second_order_term(kind: int) -> None:
    """Isserlis: e' H e / 2 has the variance tr(H P H P) / 2 where e is normal."""
    random, variance = np.random.default_rng(2), called_alone(second_order_variance)
    for _ in range(20):
        q, root = random.uniform(-20.0, 20.0, 2), random.normal(size=(2, 2))

        def seen(place: Array) -> float:
            if kind == DISTANCE_KIND:
                return float(np.hypot(*place))
            # about the line of sight, where no branch is cut
            return float(np.arctan2(q[0] * place[1] - q[1] * place[0], q @ place))  # noqa: B023

        H = derivative(lambda place: derivative(seen, place, 1e-3)[0], q, 1e-3)
        P = root @ root.T
        noise = variance(kind, q[0], q[1], P[0, 0], P[0, 1], P[1, 1])
        np.testing.assert_allclose(noise, 0.5 * np.trace(H @ P @ H @ P), rtol=1e-4)
    assert np.isfinite(variance(kind, 0.0, 0.0, 1.0, 0.2, 2.0))


# --- compiled filters ---------------------------------------------------------------------------


def statistics_of(given: Scene, *, with_series: bool = False) -> FilterStatistics:
    setup, readings, _ = given
    lanes, states = readings.initial.shape[-1], len(setup.initial_variances)
    samples = setup.samples if with_series else None
    return empty_statistics(lanes, states, samples, len(readings.sightings))


def filtered(
    given: Scene, lane_filter: Any = EXTENDED, *, with_series: bool = False
) -> tuple[Array, Array, FilterStatistics]:
    """Final state (3n + e, lanes), full covariance and statistics of all lanes."""
    statistics = statistics_of(given, with_series=with_series)
    x, P = lane_filter.run(FilterRun(*given, statistics))
    lower = np.tril(np.ones(P.shape[:2], dtype=bool))[..., None]
    return x, np.where(lower, P, P.transpose(1, 0, 2)), statistics


def of_lanes(given: Scene, lanes: slice) -> Scene:
    """The same of some lanes; in moving air, the truth is theirs, too."""

    def part(one: Array) -> Array:
        return np.ascontiguousarray(one[..., lanes]) if one.shape[-1] > 1 else one

    readings, truth = Readings(*map(part, given.readings)), Truth(*map(part, given.truth))
    return Scene(given.setup, readings, truth)


def unequal(given: Scene) -> Scene:
    """The same in steps of unequal length, compared after every third with the first samples."""
    spans, steps = np.random.default_rng(5).uniform(0.02, 0.4, STEPS), np.arange(STEPS + 1)
    compared = np.where(steps % 3 == 0, steps // 3, -1)
    setup = given.setup._replace(spans=spans, compared=compared, samples=STEPS // 3)
    return given._replace(setup=setup)


CASES: list[tuple[str, tuple[str, ...], dict[str, object]]] = [
    *(("ekf", estimated, {}) for estimated in CHOICES),
    *(("ideal", estimated, {}) for estimated in ((), ("gusts",), ALL)),
    *(("second-order", estimated, {}) for estimated in ((), ("wind",), ALL)),
    ("paper", ALL, {"substeps": 3, "gate_probability": 0.9}),
    ("ideal", ALL, {"gate_probability": 0.9}),
    ("ekf", ALL, {"unequal": True}),
]


@pytest.mark.parametrize(("name", "estimated", "changes"), CASES)
def test_compiled_trials_are_those_of_the_plain_filter(
    name: str, estimated: tuple[str, ...], changes: dict[str, object]
) -> None:
    team, options = a_team(estimated), dict[str, Any](changes)
    cut = options.pop("unequal", False)
    if name == "second-order":
        noise = replace(team.noise, position_sigma=8.0, heading_sigma=0.3)
        team = replace(team, noise=noise)
    given = scene_of(team, STEPS, 3, filter=name, **options)
    given = unequal(given) if cut else given
    plain = list((ideal_steps if name == "ideal" else extended_steps)(given, 2))
    # with a series, the covariance is brought to the present at every sample
    for with_series in (False, True):
        run = filtered(given, lane_filter_of(FILTERS[name]), with_series=with_series)
        _assert_lane_is(plain, 2, given.setup, *run)


def _assert_lane_is(
    plain: list[Plain], lane: int, setup: FilterSetup, x: Array, P: Array, found: FilterStatistics
) -> None:
    end, last = plain[-1], setup.samples
    np.testing.assert_allclose(x[:, lane], end.x, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(P[..., lane], end.P, rtol=1e-6, atol=1e-8)
    compared = [one for one in plain if one.sample >= 0]
    squares = np.array([one.error**2 for one in compared])
    late = np.array([2 * one.sample > last for one in compared])
    np.testing.assert_allclose(found.final[:, lane], end.error, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.squares[:, lane], squares.sum(axis=0), rtol=1e-6)
    np.testing.assert_allclose(found.late_squares[:, lane], late @ squares, rtol=1e-6)
    sampled = [one for one in compared if one.sample % 10 == 0 or one.sample == last]
    covered = sum(one.error**2 <= 9.0 * np.diag(one.P) for one in sampled)
    nees = [one.error[:9] @ np.linalg.solve(one.P[:9, :9], one.error[:9]) for one in sampled]
    np.testing.assert_array_equal(found.covered[:, lane], covered)
    assert found.nees_samples[lane] == len(sampled)
    assert found.nees[lane] == pytest.approx(sum(nees), rel=1e-6)
    nu, S = np.concatenate([one.made for one in plain]).T
    accepted, missed = nu**2 <= setup.gate * S, np.isnan(nu)
    assert missed.any()
    assert np.any(~accepted & ~missed) == np.isfinite(setup.gate)
    np.testing.assert_allclose(found.innovations[:, 1, lane], accepted / S, rtol=1e-6)
    kept = found.innovations[~missed, 0, lane]
    np.testing.assert_allclose(kept, nu[~missed], rtol=1e-5, atol=1e-8)
    assert found.nis[lane] == pytest.approx(np.sum(nu[accepted] ** 2 / S[accepted]), rel=1e-6)
    assert found.accepted[lane] == accepted.sum()
    assert found.gated[lane] == np.sum(~accepted & ~missed)
    if len(found.series):
        np.testing.assert_allclose(
            found.series[1:, :, SQUARE].sum(axis=0), found.squares.sum(axis=1)
        )
        variances = np.einsum("kkl->k", P)
        np.testing.assert_allclose(found.series[last, :, VARIANCE], variances)


@pytest.mark.parametrize("time", [1e-3, 0.05, 0.2])
def test_states_that_pass_within_a_sample_or_two_are_filtered_alike(time: float) -> None:
    team = a_team(("wind", "gusts", "bearing_walk"))
    times = np.array([np.inf, time, 3.0])
    sensors = replace(team.sensors, bearing_walk_times=times)
    team = replace(team, sensors=sensors, errors=replace(team.errors, gust_time=time))
    given = scene_of(team, 25, 2)
    x, P, _ = filtered(given)
    *_, end = extended_steps(given, 1)
    np.testing.assert_allclose(x[:, 1], end.x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(P[..., 1], end.P, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("model", ["ekf", "paper"])
@pytest.mark.parametrize("turn", [0.0, 1e-9, 3.9e-3, 4.1e-3, 0.59, 0.61])
def test_closed_forms_hold_where_vehicles_hardly_turn(turn: float, model: str) -> None:
    given = scene_of(a_team(()), 6, 2, filter=model, substeps=3)
    turn_rates = np.full_like(given.readings.turn_rates, turn)
    given = given._replace(readings=given.readings._replace(turn_rates=turn_rates))
    x, P, _ = filtered(given)
    *_, end = extended_steps(given, 1)
    np.testing.assert_allclose(x[:, 1], end.x, rtol=0, atol=1e-11)
    np.testing.assert_allclose(P[..., 1], end.P, rtol=0, atol=1e-11)


@BOTH
def test_without_noise_the_error_stays_at_round_off(lane_filter: LaneFilter) -> None:
    team, steps = quiet(a_team(())), 1000
    setup, drawn, truth = scene_of(team, steps, 1)
    exact = TrialReadings.of(team, truth.poses[..., 0], setup, layout_of(team), 0).sightings
    readings = drawn._replace(
        initial=truth.poses[0].copy(),
        speeds=np.tile(team.orbits.speeds[:, None], (steps, 1, 1)),
        turn_rates=np.tile(team.orbits.turn_rates[:, None], (steps, 1, 1)),
        sightings=exact[:, None],
    )
    _, _, statistics = filtered(Scene(setup, readings, truth), lane_filter)
    assert np.sqrt(statistics.squares.max() / 1000) < 1e-11


def test_whole_turns_of_heading_and_bearing_change_nothing() -> None:
    given = scene_of(a_team(ALL), 30, 2)
    setup, readings, _ = given
    angles = (setup.kinds != DISTANCE_KIND) * (np.arange(len(setup.kinds)) % 3)
    turned = readings._replace(
        sightings=readings.sightings + 2.0 * np.pi * angles[:, None],
        initial=readings.initial - 4.0 * np.pi * np.array([0.0, 0.0, 1.0])[:, None],
    )
    expected, found = filtered(given), filtered(given._replace(readings=turned))
    np.testing.assert_allclose(found[2].final, expected[2].final, atol=1e-9)
    np.testing.assert_allclose(found[2].squares, expected[2].squares, atol=1e-9)


@pytest.mark.parametrize("value", [np.nan, 1.0])
def test_a_missed_or_rejected_sighting_leaves_its_lane_as_if_there_were_none(value: float) -> None:
    team = a_team(("wind", "bearing_bias"), detection=1.0)
    given = scene_of(team, 20, 4, gate_probability=1.0 - 1e-9)
    setup, spoilt, whole = given.setup, given.readings.sightings.copy(), filtered(given)
    s = int(np.flatnonzero(setup.kinds == BEARING_KIND)[60])
    spoilt[s, 1] += value
    x, P, statistics = filtered(given._replace(readings=given.readings._replace(sightings=spoilt)))
    first = setup.first.copy()
    first[np.searchsorted(first, s, side="right") :] -= 1
    names = ("observers", "targets", "kinds", "variances")
    others: dict[str, Any] = {name: np.delete(getattr(setup, name), s) for name in names}
    rest = given.readings._replace(sightings=np.delete(spoilt, s, axis=0))
    without = filtered(Scene(setup._replace(first=first, **others), rest, given.truth))
    # sightings are taken off the covariance in other groups
    np.testing.assert_allclose(x[:, 1], without[0][:, 1], rtol=1e-10)
    np.testing.assert_allclose(P[..., 1], without[1][..., 1], rtol=1e-7, atol=1e-12)
    assert statistics.accepted[1] == without[2].accepted[1] == len(spoilt) - 1
    assert statistics.nis[1] == pytest.approx(without[2].nis[1], rel=1e-9)
    assert statistics.gated[1] == (not np.isnan(value))
    for lane in (0, 2, 3):
        assert x[:, lane].tobytes() == whole[0][:, lane].tobytes()


@BOTH
def test_a_trial_has_the_same_bytes_whatever_lanes_lie_beside_it(lane_filter: LaneFilter) -> None:
    given = scene_of(a_team(ALL), 20, 19)
    x, P, statistics = filtered(given, lane_filter)
    for lanes in (slice(0, 1), slice(3, 7), slice(2, 18)):
        found = filtered(of_lanes(given, lanes), lane_filter)
        assert found[0].tobytes() == x[:, lanes].tobytes()
        assert found[1].tobytes() == P[..., lanes].tobytes()
        for whole, part in zip(statistics[:-1], found[2][:-1], strict=True):
            assert part.tobytes() == whole[..., lanes].tobytes()


@BOTH
def test_a_run_may_stop_on_its_way(lane_filter: LaneFilter) -> None:
    given = scene_of(a_team(ALL), STEPS, 2)
    x, P, statistics = filtered(given, lane_filter, with_series=True)
    again, reached = statistics_of(given), start_of(given.setup, given.readings)
    for begin, end in ((0, 1), (1, 13), (13, STEPS)):
        lane_filter.advance(FilterRun(*given, again), reached, begin, end)
        present = np.einsum("kkl->k", reached[1])
        np.testing.assert_allclose(statistics.series[end, :, VARIANCE], present, rtol=1e-7)
    np.testing.assert_allclose(reached[0], x, rtol=1e-7, atol=1e-10)
    lower = np.tril_indices(len(P))
    np.testing.assert_allclose(reached[1][lower], P[lower], rtol=1e-6, atol=1e-10)
    np.testing.assert_allclose(again.squares, statistics.squares, rtol=1e-8)


@pytest.mark.long
def test_a_large_team_in_one_lane_has_the_bytes_of_many_lanes() -> None:
    n, steps, random = WIDE_UP_TO + 1, 12, np.random.default_rng(3)
    seen = 3 * steps + 3
    setup = specimen(n)[0].setup._replace(
        spans=np.full(steps, 0.1),
        compared=np.arange(steps + 1),
        samples=steps,
        landmarks=np.array([[60.0, -5.0], [-30.0, 70.0]]),
        first=np.arange(steps + 2) * 3,
        observers=random.integers(0, n, seen),
        targets=random.integers(n, n + 2, seen),
        kinds=np.zeros(seen, dtype=np.int64),
        variances=np.full(seen, 0.01),
    )
    shapes = [(n, 3), (steps, n), (steps, n), (seen,)]
    readings = Readings(*(random.uniform(0.1, 1.0, (*shape, 4)) for shape in shapes))
    poses = random.uniform(0.0, 500.0, (steps + 1, n, 3, 1))
    truth = Truth(poses, np.zeros((0, 4)), np.zeros((steps + 1, 0, 4)))
    given = Scene(setup, readings, truth)
    assert lanes_for(n) == 1
    one = of_lanes(given, slice(2, 3))
    for many, alone in zip(filtered(given)[:2], filtered(one)[:2], strict=True):
        assert alone.tobytes() == many[..., 2:3].tobytes()


def test_estimates_at_one_place_give_no_nan() -> None:
    given = scene_of(quiet(a_team(())), 2, 1, filter="second-order")
    readings = given.readings
    readings.initial[1] = readings.initial[0]
    readings.speeds[:], readings.turn_rates[:] = 1.0, 0.0
    x, P, _ = filtered(given)
    assert np.isfinite(x).all()
    assert np.isfinite(P).all()


def test_a_singular_covariance_counts_no_nees_sample() -> None:
    team = replace(quiet(a_team(())), noise=Noise(0.0, 0.0, 0.0, 0.0))
    _, P, statistics = filtered(scene_of(team, 12, 1))
    assert np.all(P == 0.0)
    assert statistics.nees_samples[0] == 0
    assert statistics.nees[0] == 0.0


@pytest.mark.parametrize("lanes", [1, 3])
@pytest.mark.parametrize("estimated", CHOICES)
def test_kernels_are_not_compiled_anew_for_some_number_of_trials(
    estimated: tuple[str, ...], lanes: int
) -> None:
    typeof: Any = numba.typeof
    given = scene_of(a_team(estimated), 5, lanes)
    assert [typeof(one) for one in given] == [typeof(one) for one in specimen(3)[0][:3]]


@BOTH
def test_kernels_count_as_compiled_once_they_are(lane_filter: LaneFilter) -> None:
    lane_filter.compile(3)
    assert lane_filter.is_compiled(3)
    assert lane_filter.is_compiled(WIDE_UP_TO)
    # as another process finds it, from the disk cache
    again = kernel(lane_filter.kernel.py_func)
    assert not again.overloads
    assert has_compiled(again, specimen(3))


FIRST_USE = """
from syncplan.estimation.correction_kernels import correct
from syncplan.estimation.lane_filter import EXTENDED
from syncplan.estimation.motion_kernels import predict
EXTENDED.compile(6)
print(*(sum(kernel.stats.cache_hits.values()) for kernel in (correct, predict)))
"""


@pytest.mark.long
def test_two_processes_share_what_a_first_use_compiles(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", FIRST_USE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    # predictions come from the other process, by the disk; corrections are compiled here
    assert done.stdout.split() == ["0", "1" if usable_cores() > 1 else "0"]
    kept = Counter(path.name.split("-")[0] for path in tmp_path.rglob("*.nbc"))
    assert {"lane_filter._filter", "motion_kernels.predict"} < set(kept)
    assert set(kept.values()) == {1}


def test_without_numba_nothing_is_to_be_compiled() -> None:
    code = "from syncplan.estimation.lane_filter import EXTENDED as one; one.compile(3)"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", code], env=environment, check=True)
