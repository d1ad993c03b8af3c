"""Bounds with further states, estimated or not, against dense recursions in their own states."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation import covariances
from syncplan.estimation.bounds import (
    LossBounds,
    position_covariances,
    posterior_bound,
    steady_bound,
)
from syncplan.estimation.considered_errors import expected_errors, neglected_errors
from syncplan.estimation.covariances import Foreseen, variances_along
from syncplan.estimation.referred_system import ReferredSystem
from syncplan.estimation.start_up_index import index_of_run, lines_of_sight, second_order_terms
from syncplan.orbits.circles import position
from syncplan.orbits.error_states import ERROR_STATES, layout_of
from syncplan.orbits.sighting_kinds import COMPASS, SIGHTING_KINDS, place_of
from syncplan.orbits.sightings import Loss, Sightings, remainder_of
from syncplan.orbits.team import Team
from syncplan.planning.plans import Plan
from tests.tools.dense_models import dense_covariances, dense_run, dense_true_covariances, start_of
from tests.tools.on_paper import plan
from tests.tools.scenarios import EVERYTHING, changed, circling, example, small

SCALES_AND_BIASES = {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.005}
ALL = tuple(ERROR_STATES)
STATES = [(), *((name,) for name in ERROR_STATES), ALL]


def plan_of_changed(name: str, **keys: Any) -> Plan:
    return plan(changed(name, **keys), bound="never")


@pytest.fixture(scope="module")
def grid() -> Plan:
    compasses = [0.05, 0.1, 0.05, 0.2, 0.3, 0.05]
    return plan_of_changed("paper-grid-same", heading_sigma_rad=compasses, **EVERYTHING)


def _estimating(team: Team, names: tuple[str, ...]) -> Team:
    return replace(team, errors=replace(team.errors, estimated=names))


def _assert_close(found: Array, expected: Array) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("names", STATES, ids=lambda names: "-".join(names) or "poses")
def test_the_posterior_bound_equals_the_recursion_of_the_filters_model(
    grid: Plan, names: tuple[str, ...]
) -> None:
    _assert_bound_of_the_model(_estimating(grid.team, names), grid, 160)


@pytest.mark.parametrize("name", ["mixed-radii-camera", "landmark-bridge", "nothing seen at first"])
@pytest.mark.parametrize("at_once", [4, 64])
def test_it_does_so_where_vehicles_differ_or_are_not_observable(
    name: str, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = {"first_phase_rad": -1.5, "direction": "ccw"}
    alone = {"formation": {"centers_m": [[0.0, 0.0]]}, "landmarks_m": [[0.0, 45.0]]}
    given = example(name) if "-" in name else small(orbit=circling(**late), **alone)
    made = plan(given, bound="never")
    monkeypatch.setattr(covariances, "ROWS_AT_ONCE", at_once)
    _assert_bound_of_the_model(made.team, made, 160)


def _assert_bound_of_the_model(team: Team, made: Plan, steps: int) -> None:
    found = posterior_bound(team, made.windows, steps * team.sensors.sample_time)
    layout, n = layout_of(team), team.count
    variances = np.array([np.diag(P) for P in dense_covariances(team, layout, steps)])
    poses = variances[:, : 3 * n].reshape(-1, n, 3)
    _assert_close(found.position_variance, poses[..., :2].sum(axis=-1))
    _assert_close(found.heading_variance, poses[..., 2])
    assert sorted(layout.names) == sorted(team.errors.estimated)
    if layout.names:
        assert found.errors is not None
        _assert_close(found.errors, variances[:, 3 * n :])
    else:
        assert found.errors is None


@pytest.mark.parametrize("names", [(), ALL], ids=["poses", "every error"])
def test_covariances_of_positions_equal_the_recursion_of_the_filters_model(
    grid: Plan, names: tuple[str, ...]
) -> None:
    team, steps = _estimating(grid.team, names), 280
    found = position_covariances(team, grid.windows, steps * team.sensors.sample_time, 7)
    dense = np.array(list(dense_covariances(team, layout_of(team), steps)))
    chosen = np.rint(found.times / team.sensors.sample_time).astype(int)
    assert len(chosen) == 7
    assert chosen[-1] == steps
    for vehicle in range(team.count):
        own = slice(3 * vehicle, 3 * vehicle + 2)
        _assert_close(found.values[:, vehicle], dense[chosen, own, own])


def test_the_covariance_at_the_start_of_a_run_is_left_as_it_is(grid: Plan) -> None:
    team = _estimating(grid.team, ())
    system = ReferredSystem.along(team, grid.windows, 20, layout_of(team))
    start = system.start.copy()
    system.bound(start)
    np.testing.assert_array_equal(start, system.start)


def test_many_samples_are_as_good_as_few_at_once(
    grid: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    team = _estimating(grid.team, ALL)
    whole = posterior_bound(team, grid.windows, 15.0, start_up=True)
    monkeypatch.setattr(covariances, "_ELEMENTS_AT_ONCE", 900.0)
    parts = posterior_bound(team, grid.windows, 15.0, start_up=True)
    np.testing.assert_allclose(parts.position_variance, whole.position_variance, rtol=1e-12)
    assert parts.start_up == whole.start_up


@pytest.mark.parametrize(("keys", "names"), [({}, ()), (EVERYTHING, ()), (EVERYTHING, ALL)])
def test_the_start_up_index_is_that_of_the_filters_model(
    keys: dict[str, Any], names: tuple[str, ...]
) -> None:
    made = plan_of_changed(
        "mixed-radii-camera",
        heading_sigma_rad=0.2,
        initial_sigma={"position_m": 8.0, "heading_rad": 0.2},
        **keys,
    )
    team, steps = _estimating(made.team, names), 60
    layout = layout_of(team)
    found = posterior_bound(team, made.windows, steps * team.sensors.sample_time, start_up=True)
    best, where = 0.0, (0, 0, 0.0)
    P = start_of(team, layout)
    for k, (F, Q, H, seen) in enumerate(dense_run(team, layout, steps), 1):
        P = F @ P @ F.T + Q
        time = k * team.sensors.sample_time
        bodies = np.concatenate([position(team.orbits, time), team.landmarks])
        for h, (a, b, kind) in zip(H, seen.tolist(), strict=True):
            u = P @ h
            between = np.zeros((2, layout.size))
            between[:, 3 * a : 3 * a + 2] -= np.eye(2)
            if b < team.count:
                between[:, 3 * b : 3 * b + 2] += np.eye(2)
            q = bodies[b] - bodies[a]
            rho, name = np.hypot(*q), list(SIGHTING_KINDS)[kind]
            if name != "compass":
                axes = np.stack([q, [-q[1], q[0]]]) / rho
                (rr, rt), (_, tt) = axes @ between @ P @ between.T @ axes.T
                eta = np.sqrt(rr * tt + rt**2) / rho**2
                if name == "distance":
                    eta = tt / (np.sqrt(2.0) * rho)
                sigma = SIGHTING_KINDS[name].sigmas(team.sensors)[a]
                value = eta / sigma / np.sqrt(h @ u + 1.0)
                if value > best:
                    best, where = value, (a, b, time)
            P = P - np.outer(u, u) / (h @ u + 1.0)
    # with its index, the bound is the same
    np.testing.assert_allclose(found.heading_variance[-1], np.diag(P)[2 : 3 * team.count : 3])
    assert found.start_up is not None
    assert found.start_up.value == pytest.approx(best, rel=1e-8)
    assert (found.start_up.observer, found.start_up.target) == where[:2]
    assert found.start_up.time == pytest.approx(where[2])


def test_a_long_run_settles_at_the_steady_bound_with_sightings_now_and_then() -> None:
    made = plan_of_changed("paper-grid-same", sensor={"range_sigma_m": 1.0})
    # twice 30 samples, and no fewer, are a whole number of all intervals
    every = np.array([20, 12, 20, 4, 1, 20])
    rare = replace(made.sensors, sample_time=made.orbits.period / 30, every=every)
    team = replace(made.team, sensors=rare)
    run = posterior_bound(team, made.windows, 120 * made.orbits.period)
    settled = np.sqrt(run.position_variance[-60:].mean(axis=0))
    np.testing.assert_allclose(settled, steady_bound(team, made.windows), rtol=1e-4)


@pytest.mark.parametrize("names", [(), ALL])
@pytest.mark.parametrize("loss", [Loss(vehicles=(1,)), Loss(sensors=(2,)), Loss(landmarks=(0,))])
def test_bounds_after_losses_are_those_of_the_team_that_is_left(
    grid: Plan, loss: Loss, names: tuple[str, ...]
) -> None:
    plain = replace(grid.team.sensors, compass_sigmas=np.full(6, np.inf))
    team = replace(_estimating(grid.team, names), sensors=plain)
    left = remainder_of(team, loss)
    found = LossBounds.along(team, grid.windows, 40.0).after(left)
    expected = posterior_bound(left.team, left.windows(grid.windows), 40.0)
    np.testing.assert_allclose(found.position_variance, expected.position_variance, rtol=1e-9)
    if names:
        assert found.errors is not None
        assert found.errors.shape[1] == len(layout_of(left.team).sigmas)


def test_scales_and_biases_as_states_raise_the_bound_of_the_grid_as_found_before() -> None:
    # design.md, 6.2: 1.40 to 1.88 m in an independent prototype
    made = plan_of_changed("paper-grid-same", motion=SCALES_AND_BIASES, duration_s=200.0)
    errors = posterior_bound(made.team, made.windows, 200.0).rms_second_half()
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(1.88, abs=0.005)


@pytest.mark.parametrize("names", [("bearing_bias",), ALL])
def test_vehicles_without_an_error_have_no_state_of_it(grid: Plan, names: tuple[str, ...]) -> None:
    biases = np.array([0.0, 0.02, 0.0, 0.0, 0.05, 0.0])
    sensors = replace(grid.team.sensors, bearing_bias_sigmas=biases)
    team = replace(_estimating(grid.team, names), sensors=sensors)
    assert list(layout_of(team).columns["bearing_bias"][:, 0] >= 0) == list(biases > 0.0)
    _assert_bound_of_the_model(team, grid, 100)


@pytest.mark.parametrize("sigmas", [{}, SCALES_AND_BIASES])
def test_a_team_that_sees_nothing_has_a_bound_and_an_index(sigmas: dict[str, float]) -> None:
    formation = {"centers_m": [[0.0, 0.0], [500.0, 0.0]], "links": []}
    blind = plan(small(formation=formation, motion=sigmas), bound="never")
    found = posterior_bound(blind.team, blind.windows, 20.0, start_up=True)
    assert found.start_up is not None
    assert found.start_up.value == 0.0
    assert np.all(found.position_variance[1:] > 50.0)
    if sigmas:
        np.testing.assert_allclose(found.errors_second_half(), [0.02, 0.02, 0.005, 0.005])


@pytest.fixture(scope="module")
def coarse() -> Plan:
    sensor = {"sample_time_s": 0.5, "bearing_bias_sigma_rad": 0.02}
    return plan_of_changed(
        "paper-grid-same", sensor=sensor, motion=EVERYTHING["motion"], wind=EVERYTHING["wind"]
    )


@pytest.mark.parametrize("name", ["wind", "turn_rate_bias", "bearing_bias"])
def test_what_sightings_determine_does_not_count_in_the_steady_bound(
    coarse: Plan, name: str
) -> None:
    known = steady_bound(_estimating(coarse.team, ()), coarse.windows)
    found = steady_bound(_estimating(coarse.team, (name,)), coarse.windows)
    np.testing.assert_allclose(found, known, rtol=1e-5)


@pytest.mark.parametrize(
    "names", [("speed_scale",), ("gusts",), ("speed_scale", "wind", "turn_rate_bias")]
)
def test_what_they_do_not_determine_stays_in_the_steady_bound_for_ever(
    coarse: Plan, names: tuple[str, ...]
) -> None:
    periods, samples, period = 300, 32, coarse.orbits.period
    even = replace(coarse.sensors, sample_time=period / samples)
    team = replace(_estimating(coarse.team, names), sensors=even)
    run = posterior_bound(team, coarse.windows, 2 * periods * period)

    def mean_until(end: int) -> Array:
        last = end * samples
        return np.asarray(run.position_variance[last - samples + 1 : last + 1].mean(axis=0))

    # what is determined becomes known as 1 / t
    settled = np.sqrt(2.0 * mean_until(2 * periods) - mean_until(periods))
    found = steady_bound(team, coarse.windows)
    np.testing.assert_allclose(settled, found, rtol=4e-3)
    assert np.all(found > 1.05 * steady_bound(_estimating(team, ()), coarse.windows))


def test_poses_that_are_not_determined_have_no_steady_bound_with_errors_either() -> None:
    made = plan_of_changed("landmark-bridge", wind={"sigma_mps": 1.0})
    assert np.isinf(steady_bound(made.team, made.windows)[-1])


def test_a_run_goes_on_from_its_end_with_time_0_moved_there(coarse: Plan) -> None:
    samples, period = 32, coarse.orbits.period
    even = replace(coarse.sensors, sample_time=period / samples)
    team = replace(_estimating(coarse.team, ALL), sensors=even)
    layout = layout_of(team)
    twice = posterior_bound(team, coarse.windows, 2.0 * period)
    system = ReferredSystem.along(team, coarse.windows, samples, layout)
    last = variances_along(system.run, system.start, system._columns, system._moves).covariance
    moved = system.moved_on()
    second = system.bound(moved @ last @ moved.T)
    _assert_close(second.position_variance, twice.position_variance[samples:])
    _assert_close(second.heading_variance, twice.heading_variance[samples:])


# --- the start-up index ---------------------------------------------------------------------------


def _seen(team: Team, observers: list[int], targets: list[int], step: int) -> Sightings:
    number = np.full(len(observers), step)
    return Sightings(number, np.array(observers), np.array(targets), np.zeros_like(number))


def test_a_compass_leaves_nothing_out() -> None:
    team = plan(small(heading_sigma_rad=0.1), bound="never").team
    seen = Sightings(*np.array([[3], [1], [1], [place_of(COMPASS)]]))
    functions, sizes = second_order_terms(team, seen, 20.0)
    np.testing.assert_array_equal(functions, 0.0)
    foreseen = Foreseen(np.ones((3, 1)), np.ones(1))
    assert index_of_run(team, seen, sizes, foreseen).value == 0.0


def test_a_landmark_on_the_path_leaves_the_index_finite() -> None:
    made = plan(small(landmarks_m=[[20.005, 0.0], [0.0, 45.0]]), bound="never")
    start = replace(made.orbits, phases=np.zeros(2))
    found = posterior_bound(made.team.on(start), made.windows, 40.0, start_up=True).start_up
    assert found is not None
    assert 0.0 < found.value < 1e9
    through = _seen(made.team.on(start), [0], [2], step=0)
    np.testing.assert_array_equal(lines_of_sight(made.team.on(start), through, 20.0)[0], 0.0)


# --- errors that are not estimated ----------------------------------------------------------------


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
