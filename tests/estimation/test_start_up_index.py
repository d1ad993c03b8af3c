"""The start-up index: against Monte Carlo of what a tangent leaves out, and plain recursions."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.estimation import covariances, foreseen_sightings
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.foreseen_sightings import Asked, Foreseen
from syncplan.estimation.reference_filter import predict_bearing
from syncplan.estimation.start_up_index import index_of_run, lines_of_sight, second_order_terms
from syncplan.orbits.circles import position
from syncplan.orbits.sighting_kinds import COMPASS, DISTANCE, place_of
from syncplan.orbits.sightings import Sightings, sample_sightings
from syncplan.orbits.team import Team
from syncplan.planning.planner import plan
from tests.tools.scenarios import example, small


def _seen(team: Team, observers: list[int], targets: list[int], step: int) -> Sightings:
    number = np.full(len(observers), step)
    return Sightings(number, np.array(observers), np.array(targets), np.zeros_like(number))


@pytest.mark.parametrize("seed", range(5))
def test_eta_is_the_deviation_of_what_a_tangent_leaves_out_of_a_bearing(seed: int) -> None:
    # errors small beside the distance: what is left out is its second-order term
    generator = np.random.default_rng(seed)
    team = plan(small(landmarks_m=[[30.0, 55.0]]), bound="never").team
    factor = generator.normal(size=(2, 2))
    spread = factor @ factor.T
    seen = _seen(team, [0], [2], step=7)
    sigma = float(team.sensors.bearing_sigmas[0])
    place = position(team.orbits, 0.7)[0]
    q = team.landmarks[0] - place
    distance = float(np.hypot(*q))
    axes = np.stack([q, [-q[1], q[0]]]) / distance
    pairs = (axes @ spread @ axes.T / distance**2)[..., None]
    found = index_of_run(team, seen, Foreseen(pairs, np.array([1.0 / sigma**2])))

    errors = generator.multivariate_normal(np.zeros(2), spread, 400_000)
    true = np.arctan2(q[1], q[0])
    away = q + errors
    bent = np.arctan2(away[:, 1], away[:, 0]) - true - errors @ axes[1] / distance
    assert found.value == pytest.approx(np.std(bent), rel=0.02)
    assert (found.observer, found.target) == (0, 2)
    assert found.time == pytest.approx(0.7)


@pytest.mark.parametrize("seed", range(5))
def test_eta_is_the_deviation_of_what_a_tangent_leaves_out_of_a_distance(seed: int) -> None:
    generator = np.random.default_rng(seed)
    sensor = {"range_m": 50.0, "bearing_sigma_rad": 0.1, "range_sigma_m": 0.4}
    team = plan(small(landmarks_m=[[30.0, 55.0]], sensor=sensor), bound="never").team
    factor = generator.normal(size=(2, 2))
    spread = factor @ factor.T
    kinds = np.array([place_of(DISTANCE)])
    seen = Sightings(np.array([7]), np.array([0]), np.array([2]), kinds)
    q = team.landmarks[0] - position(team.orbits, 0.7)[0]
    distance = float(np.hypot(*q))
    across = np.array([-q[1], q[0]]) / distance
    terms = second_order_terms(team, seen, 1.0)
    ways = terms.functions[:, 0, :2]
    pairs = (ways @ spread @ ways.T)[..., None]
    found = index_of_run(team, seen, Foreseen(pairs, np.array([1.0 / 0.4**2])))
    size = np.sqrt(pairs[0, 0] * pairs[1, 1] + pairs[0, 1] ** 2) * np.sqrt(terms.weights) * 0.4

    errors = generator.multivariate_normal(np.zeros(2), spread, 400_000)
    bent = np.hypot(*(q + errors).T) - distance - errors @ q / distance
    assert found.value == pytest.approx(np.std(bent), rel=0.03)
    assert size[0] == pytest.approx(found.value, rel=1e-12)
    assert found.value == pytest.approx(across @ spread @ across / distance / np.sqrt(2.0))


def test_a_compass_leaves_nothing_out() -> None:
    team = plan(small(heading_sigma_rad=0.1), bound="never").team
    seen = Sightings(*np.array([[3], [1], [1], [place_of(COMPASS)]]))
    terms = second_order_terms(team, seen, 20.0)
    np.testing.assert_array_equal(terms.functions, 0.0)
    np.testing.assert_array_equal(terms.weights, 0.0)
    foreseen = Foreseen(np.ones((2, 2, 1)), np.ones(1))
    assert index_of_run(team, seen, foreseen).value == 0.0


def test_along_and_across_add_up_to_the_way_between_the_two() -> None:
    grid = plan(example("paper-grid-same"), bound="never")
    team = grid.team
    seen = sample_sightings(grid.windows, grid.orbits.period, grid.sensors, 1, 200)
    along, across = lines_of_sight(team, seen, 20.0)
    generator = np.random.default_rng(1)
    start = generator.normal(size=(team.count, 3))
    step = 1e-6
    for s in generator.integers(0, len(seen.steps), 40):
        observer, target, time = seen.observers[s], seen.targets[s], 0.1 * seen.steps[s]
        was, is_now = position(team.orbits, 0.0), position(team.orbits, time)
        moved = is_now - was
        turned = np.column_stack([-moved[:, 1], moved[:, 0]])
        bodies = np.concatenate([is_now, team.landmarks])
        shift = np.zeros_like(bodies)
        shift[: team.count] = step * (20.0 * start[:, :2] + turned * start[:, 2:])
        q = bodies[target] - bodies[observer]
        nudged = q + shift[target] - shift[observer]
        states = np.concatenate([start[observer], start[target] if target < 6 else np.zeros(3)])
        stretch = np.hypot(*nudged) / np.hypot(*q) - 1.0
        turn = np.arctan2(nudged[1], nudged[0]) - np.arctan2(q[1], q[0])
        assert step * along[s] @ states == pytest.approx(stretch, abs=1e-10)
        assert step * across[s] @ states == pytest.approx(turn, abs=1e-10)


@pytest.mark.parametrize("vehicles", [0, 20])
def test_the_index_equals_that_of_the_filter_itself_along_the_plan(
    vehicles: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the covariance carried from sample to sample, with the filter's own rows and transitions
    monkeypatch.setattr(covariances, "GROUPED_VEHICLES", vehicles)
    scenario = small(
        landmarks_m=[[0.0, 45.0], [70.0, 50.0]],
        initial_sigma={"position_m": 6.0, "heading_rad": 0.2},
        duration_s=30.0,
    )
    made = plan(scenario, bound="never")
    team, steps = made.team, 300
    seen = sample_sightings(made.windows, made.orbits.period, made.sensors, 1, steps)
    found = posterior_bound(team, made.windows, 30.0, start_up=True).start_up
    assert found is not None
    best, who = 0.0, (0, 0, 0.0)
    P = np.diag(np.tile([36.0, 36.0, 0.04], 2))
    for k in range(1, steps + 1):
        P = _carried(team, P, k)
        bodies = np.concatenate([position(team.orbits, 0.1 * k), team.landmarks])
        for s in np.flatnonzero(seen.steps == k):
            o, t = int(seen.observers[s]), int(seen.targets[s])
            q = bodies[t] - bodies[o]
            distance = np.hypot(*q)
            between = np.zeros((2, 6))
            between[:, 3 * o : 3 * o + 2] -= np.eye(2)
            if t < 2:
                between[:, 3 * t : 3 * t + 2] += np.eye(2)
            axes = np.stack([q, [-q[1], q[0]]]) / distance
            (rr, rt), (_, tt) = axes @ between @ P @ between.T @ axes.T
            poses = np.column_stack([bodies[:2], np.zeros(2)])
            _, row = predict_bearing(poses, o, t, team.landmarks)
            u, sigma = P @ row, float(team.sensors.bearing_sigmas[o])
            variance = float(row @ u) + sigma**2
            value = np.sqrt(rr * tt + rt**2) / distance**2 / np.sqrt(variance)
            if value > best:
                best, who = value, (o, t, 0.1 * k)
            P = P - np.outer(u, u) / variance
    assert found.value == pytest.approx(best, rel=1e-9)
    assert (found.observer, found.target) == who[:2]
    assert found.time == pytest.approx(who[2])


def _carried(team: Team, P: np.ndarray, k: int) -> np.ndarray:
    from syncplan.estimation.referred_system import arc_noise_gain
    from syncplan.orbits.circles import heading

    moved = position(team.orbits, 0.1 * k) - position(team.orbits, 0.1 * (k - 1))
    ahead = heading(team.orbits, 0.1 * (k - 1))
    gains = arc_noise_gain(team.orbits, 0.1)
    F, Q = np.eye(6), np.zeros((6, 6))
    for i in range(2):
        F[3 * i : 3 * i + 2, 3 * i + 2] = -moved[i, 1], moved[i, 0]
        cos, sin = np.cos(ahead[i]), np.sin(ahead[i])
        frame = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        gain = frame @ gains[i] * [team.noise.speed_sigma, team.noise.turn_rate_sigma]
        Q[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = gain @ gain.T
    return np.asarray(F @ P @ F.T + Q)


def test_the_bound_is_the_same_with_and_without_its_index() -> None:
    grid = plan(example("paper-grid-same"), bound="never")
    plain = posterior_bound(grid.team, grid.windows, 60.0)
    indexed = posterior_bound(grid.team, grid.windows, 60.0, start_up=True)
    assert plain.start_up is None
    np.testing.assert_array_equal(plain.position_variance, indexed.position_variance)


@pytest.mark.parametrize("grouped", [True, False])
@pytest.mark.parametrize("name", ["paper-grid-same", "mixed-radii-camera", "four-ground-robots"])
def test_sightings_are_passed_over_only_where_none_of_them_has_the_index(
    name: str, grouped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not grouped:
        monkeypatch.setattr(covariances, "GROUPED_VEHICLES", 0)
    made = plan(example(name), bound="never")
    answered = []
    found = Asked._found

    def counted(asked: Asked, rows: Any, pairs: Any) -> None:
        answered.append(pairs.shape[-1])
        found(asked, rows, pairs)

    monkeypatch.setattr(Asked, "_found", counted)
    some = posterior_bound(made.team, made.windows, 120.0, start_up=True)
    few = sum(answered)
    answered.clear()
    monkeypatch.setattr(foreseen_sightings, "MARGIN", np.inf)
    every = posterior_bound(made.team, made.windows, 120.0, start_up=True)
    assert some.start_up == every.start_up
    assert few < 0.6 * sum(answered)


def test_the_index_vanishes_with_the_initial_sigmas_and_the_noise() -> None:
    grid = plan(example("paper-grid-same"), bound="never")
    noise = replace(
        grid.noise, speed_sigma=0.0, turn_rate_sigma=0.0, position_sigma=0.0, heading_sigma=0.0
    )
    exact = replace(grid.team, noise=noise)
    found = posterior_bound(exact, grid.windows, 20.0, start_up=True).start_up
    assert found is not None
    assert found.value == 0.0


def test_a_team_that_sees_nothing_has_index_zero() -> None:
    scenario = small(formation={"centers_m": [[0.0, 0.0], [500.0, 0.0]], "links": []})
    blind = plan(scenario, bound="never")
    found = posterior_bound(blind.team, blind.windows, 20.0, start_up=True).start_up
    assert found is not None
    assert found.value == 0.0


def test_a_landmark_on_the_path_leaves_the_index_finite() -> None:
    made = plan(small(landmarks_m=[[20.005, 0.0], [0.0, 45.0]]), bound="never")
    start = replace(made.orbits, phases=np.zeros(2))
    found = posterior_bound(made.team.on(start), made.windows, 40.0, start_up=True).start_up
    assert found is not None
    assert 0.0 < found.value < 1e9
    through = _seen(made.team.on(start), [0], [2], step=0)
    np.testing.assert_array_equal(lines_of_sight(made.team.on(start), through, 20.0), 0.0)
