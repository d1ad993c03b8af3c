"""Contact windows, in an open field and among obstacles: closed forms, symmetries, and samples."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, unit
from syncplan.orbits.contacts import (
    Windows,
    close_pairs,
    find_windows,
    merge_windows,
    outer_gaps,
    reachable_pairs,
    smallest_outer_gap,
)
from syncplan.orbits.sight_lines import crosses_interior, hidden_landmarks, obstructible
from syncplan.orbits.sightings import sample_sightings
from syncplan.orbits.team import Team
from syncplan.planning.planner import plan
from tests.tools.draws import NOISE
from tests.tools.obstructed import compare, covered, draw_obstructed
from tests.tools.phase_teams import cameras
from tests.tools.scenarios import example


def _pair(
    distance: float,
    senses: tuple[float, float] = (1.0, 1.0),
    phases: tuple[float, float] = (0.3, 0.3 + np.pi),
    reach: float = 50.0,
    view: float = 2.0 * np.pi,
) -> Team:
    centers = np.array([[0.0, 0.0], [distance, 0.0]])
    orbits = Orbits(centers, np.full(2, 20.0), np.array(senses), np.array(phases), rate=1.0)
    return Team(orbits, np.array([[3.0, 4.0]]), cameras(2, reach, view, 0.0), NOISE)


@pytest.mark.parametrize("senses", [(1.0, -1.0), (-1.0, -1.0)])
@pytest.mark.parametrize("reach", [29.9, 30.1, 60.0, 109.9, 110.1, 500.0])
@pytest.mark.parametrize("view", [2.0 * np.pi, 0.2, np.pi, 5.5])
def test_near_tangent_permanent_and_absent_contact(
    senses: tuple[float, float], reach: float, view: float
) -> None:
    team = _pair(70.0, senses=senses, phases=(0.3, np.pi - 0.3), reach=reach, view=view)
    assert compare(team).mismatches == ()


def test_contact_exactly_at_the_range_limit_all_the_time_counts() -> None:
    # same circle radius and phase: the distance is constant and equal to the range
    team = _pair(50.0, phases=(0.7, 0.7), reach=50.0)
    np.testing.assert_allclose(find_windows(team).of(0), [[0.0, team.orbits.period]])


def test_a_tangent_of_the_range_opens_no_more_than_an_instant() -> None:
    vehicle = find_windows(_pair(70.0, phases=(0.0, np.pi), reach=30.0)).of(0)
    assert np.sum(vehicle[:, 1] - vehicle[:, 0]) < 1e-5


def test_the_spatial_index_finds_the_same_pairs_as_all_pairs() -> None:
    generator = np.random.default_rng(5)
    count = 700
    places, radii = generator.uniform(0.0, 900.0, (count, 2)), generator.uniform(1.0, 30.0, count)
    orbits = Orbits(places, radii, np.ones(count), np.zeros(count), 1.0)
    landmarks = generator.uniform(0.0, 900.0, (20, 2))
    reach = generator.uniform(5.0, 60.0, count)
    a, b = reachable_pairs(orbits, reach, landmarks)
    centers, all_radii = np.concatenate([places, landmarks]), np.append(radii, np.zeros(20))
    distance = np.hypot(*(centers[None] - places[:, None]).transpose(2, 0, 1))
    own = radii[:, None]
    gap = np.maximum(distance - own - all_radii, abs(own - all_radii) - distance)
    gap[np.arange(count), np.arange(count)] = np.inf
    expected = np.argwhere(gap <= reach[:, None])
    np.testing.assert_array_equal(np.column_stack([a, b]), expected)


def test_the_nearest_circles_are_the_same_with_the_spatial_index(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    generator = np.random.default_rng(6)
    radii = np.append(generator.uniform(1.0, 30.0, 299), 200.0)
    for side in (600.0, 9000.0):
        centers = generator.uniform(0.0, side, (300, 2))
        every = close_pairs(centers, radii, 0.0)
        gaps = outer_gaps(centers, radii, every)
        smallest = smallest_outer_gap(centers, radii)
        assert smallest == gaps.min()
        with monkeypatch.context() as patched:
            patched.setattr("syncplan.orbits.contacts.DENSE_LIMIT", 2)
            for gap in (-50.0, 5.0, 20.0):
                near = close_pairs(centers, radii, gap)
                kept = near[outer_gaps(centers, radii, near) <= gap]
                np.testing.assert_array_equal(kept, every[gaps <= gap])
                assert len(near) < len(every)
            assert smallest_outer_gap(centers, radii) == smallest
    assert smallest_outer_gap(centers[:1], radii[:1]) == np.inf


def test_merged_windows_cover_what_their_parts_cover() -> None:
    merged = merge_windows(np.array([[9.0, 11.0], [0.5, 2.0], [1.0, 3.0]]), 10.0)
    np.testing.assert_allclose(merged, [[9.0, 13.0]])
    np.testing.assert_allclose(merge_windows(np.array([[0.0, 6.0], [5.0, 10.5]]), 10.0), [[0, 10]])
    assert merge_windows(np.zeros((0, 2)), 10.0).shape == (0, 2)


@given(st.integers(0, 2**32 - 1))
def test_sightings_are_the_samples_inside_windows(seed: int) -> None:
    team = draw_obstructed(np.random.default_rng(seed))
    windows, period, steps = find_windows(team), team.orbits.period, 400
    sightings = sample_sightings(windows, period, team.sensors, 1, steps)
    time = np.arange(1, steps + 1) * team.sensors.sample_time
    for pair, (a, b) in enumerate(zip(windows.observers, windows.targets, strict=True)):
        inside = covered(windows.of(pair), time % period, period)
        since = (time[:, None] - windows.of(pair).ravel() + 1e-9) % period
        clear = since.min(axis=1, initial=np.inf) >= 2e-9
        taken = sightings.steps[(sightings.observers == a) & (sightings.targets == b)]
        times_taken = np.bincount(taken, minlength=steps + 1)[1:]
        np.testing.assert_array_equal(times_taken[clear], inside[clear])


def test_a_pair_exactly_at_reach_is_found_in_large_teams_too() -> None:
    def pairs(count: int) -> set[tuple[int, int]]:
        centers = np.column_stack([9.03 * np.arange(count), np.zeros(count)])
        orbits = Orbits(centers, np.full(count, 2.01), np.ones(count), np.zeros(count), 1.0)
        a, b = reachable_pairs(orbits, np.full(count, 5.01))
        return set(zip(a.tolist(), b.tolist(), strict=True))

    assert {pair for pair in pairs(600) if max(pair) < 400} == pairs(400)


@pytest.mark.parametrize("rate", [0.2, 2.0 * np.pi / 30.0, 1.0, 0.37])
def test_a_sample_on_a_windows_edge_counts_in_every_turn(rate: float) -> None:
    orbits = Orbits(np.zeros((1, 2)), np.array([20.0]), np.ones(1), np.zeros(1), rate)
    sample_time = orbits.period / 12.0
    reach = np.sqrt(2000.0 - 1600.0 * np.cos(np.pi / 6.0))
    sensors = replace(cameras(1, reach, 2.0 * np.pi, 0.0), sample_time=sample_time)
    windows = find_windows(Team(orbits, np.array([[40.0, 0.0]]), sensors, NOISE))
    turns = 20
    sightings = sample_sightings(windows, orbits.period, sensors, 1, 12 * turns)
    assert set((sightings.steps % 12).tolist()) == {0, 1, 11}
    assert len(sightings.steps) == 3 * turns


def test_the_union_of_both_ways_holds_what_either_sees() -> None:
    made = plan(example("mixed-radii-camera"))
    period = made.orbits.period
    t = np.linspace(0.0, period, 5000, endpoint=False)
    one_sided = 0
    for link in made.links:
        forward, backward = (covered(w, t, period) for w in (link.forward, link.backward))
        np.testing.assert_array_equal(covered(link.windows, t, period), forward | backward)
        one_sided += int(np.any(forward & ~backward)) + int(np.any(backward & ~forward))
    assert one_sided >= 2


# --- among obstacles ------------------------------------------------------------------------------


SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
HORSESHOE = np.array(
    [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]]
)


def _team(orbits: Orbits, *obstacles: Array, landmarks: Array | None = None) -> Team:
    sensors = cameras(orbits.count, 100.0, 7.0, 0.0)
    places = np.zeros((0, 2)) if landmarks is None else landmarks
    return Team(orbits, places, sensors, NOISE, obstacles=obstacles)


CIRCLE = Orbits(np.zeros((1, 2)), np.array([10.0]), np.ones(1), np.zeros(1), 1.0)


def _contact(windows: Windows) -> dict[tuple[int, int], float]:
    """Time in s that each pair is in contact."""
    return {
        (int(a), int(b)): float(np.sum(np.diff(windows.of(k), axis=1)))
        for k, (a, b) in enumerate(zip(windows.observers, windows.targets, strict=True))
    }


# the last two touch a wall from within, midway between two crossings: no root is found there
TOUCHING = [[20261122, 667], [20261122, 3409]]


@pytest.mark.parametrize("seed", [*([20, k] for k in (*range(12), 17, 19, 25, 28)), *TOUCHING])
def test_windows_among_obstacles_equal_dense_sampling_with_bisection(seed: list[int]) -> None:
    found = compare(draw_obstructed(np.random.default_rng(seed)))
    assert not found.mismatches
    assert found.largest < 1e-9


@pytest.mark.parametrize("corners", [SQUARE, HORSESHOE], ids=["square", "horseshoe"])
def test_a_segment_is_blocked_where_it_meets_the_interior(corners: Array) -> None:
    # between all places of a lattice: through corners, along walls, from within, of no length
    places = np.array(list(product(range(-2, 10), repeat=2)), dtype=float)
    first, second = np.triu_indices(len(places), 1)
    start, end = (np.concatenate([places, places[k]]) for k in (first, second))
    lines = shapely.linestrings(np.stack([places[first], places[second]], axis=1))
    segments = np.concatenate([shapely.points(places), lines])
    blocked = shapely.relate_pattern(shapely.Polygon(corners), segments, "T********")
    # one corner stands twice, and the last stands on an edge
    repeated = np.concatenate([corners[:1], corners, [0.5 * (corners[-1] + corners[0])]])
    for polygon, turn, shift in product((corners, repeated), (0.0, 0.7, 2.0), (0.0, 700.0)):
        axes = np.array([unit(turn), unit(turn + 0.5 * np.pi)])
        around, one, other = (part @ axes + shift for part in (polygon, start, end))
        for outline, (a, b) in product((around, around[::-1]), ((one, other), (other, one))):
            np.testing.assert_array_equal(crosses_interior(outline, a, b), blocked)


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0])
def test_a_sight_line_that_turns_about_a_corner_is_blocked_while_it_is_in_the_angle(
    turn: float,
) -> None:
    # opposite each other on a circle about a corner: that corner is on their line for ever
    corner = np.array([3.0, -2.0])
    orbits = Orbits(
        np.array([corner, corner]), np.full(2, 10.0), np.ones(2), np.array([0.4, 0.4 + np.pi]), 1.0
    )
    sides = unit(turn + np.array([0.0, 1.0])) * 50.0
    team = _team(orbits, corner + np.array([[0.0, 0.0], *sides]))
    windows = find_windows(team)
    # the line is in the angle of 1 rad twice in a turn
    for pair in range(2):
        begins = np.sort((turn + 1.0 - 0.4 + np.pi * np.arange(2)) % (2.0 * np.pi))
        np.testing.assert_allclose(windows.of(pair)[:, 0], begins, atol=1e-9)
        np.testing.assert_allclose(np.diff(windows.of(pair), axis=1), np.pi - 1.0, atol=1e-9)


def test_a_landmark_on_a_wall_is_seen_from_before_it_alone() -> None:
    for turn in np.linspace(0.0, 6.0, 13):
        axes = np.array([unit(turn), unit(turn + 0.5 * np.pi)])
        wall = np.array([[0.0, -40.0], [1.0, -40.0], [1.0, 40.0], [0.0, 40.0]]) @ axes
        seen = find_windows(_team(CIRCLE, wall, landmarks=np.array([[0.0, 0.3]]) @ axes)).of(0)
        begin = (turn + 0.5 * np.pi) % (2.0 * np.pi)
        np.testing.assert_allclose(seen, [[begin, begin + np.pi]], atol=1e-9)


@pytest.mark.parametrize("draw", range(12))
def test_windows_turn_and_shift_with_everything(draw: int) -> None:
    team = draw_obstructed(np.random.default_rng([22, draw]))
    turn, shift = 0.9, np.array([3.0e4, -1.0e4])
    axes = np.array([unit(turn), unit(turn + 0.5 * np.pi)])
    orbits = replace(
        team.orbits, centers=team.orbits.centers @ axes + shift, phases=team.orbits.phases + turn
    )
    moved = replace(
        team,
        orbits=orbits,
        landmarks=team.landmarks @ axes + shift,
        obstacles=tuple(corners @ axes + shift for corners in team.obstacles),
    )
    before, after = _contact(find_windows(team)), _contact(find_windows(moved))
    assert before.keys() == after.keys()
    np.testing.assert_allclose(list(after.values()), list(before.values()), atol=1e-5)


def test_landmarks_in_an_obstacle_are_hidden_and_those_on_its_wall_are_not() -> None:
    landmarks = np.array([[2.0, 2.0], [0.0, 2.0], [4.0, 4.0], [9.0, 9.0], [3.0, 1.0]])
    team = _team(CIRCLE, SQUARE + 100.0, SQUARE, landmarks=landmarks)
    assert hidden_landmarks(team) == {0: 1, 4: 1}
    windows = find_windows(team)
    seen = set(windows.targets[np.diff(windows.first) > 0].tolist())
    assert seen == {2, 3, 4}


def test_only_obstacles_by_the_hull_of_two_circles_may_come_between() -> None:
    orbits = Orbits(
        np.array([[0.0, 0.0], [20.0, 20.0]]), np.array([3.0, 5.0]), np.ones(2), np.zeros(2), 1.0
    )
    pair = (np.array([0]), np.array([1]))
    between, beside = SQUARE + 8.0, SQUARE + np.array([14.0, -3.0])
    assert not obstructible(_team(orbits), *pair)[0]
    assert obstructible(_team(orbits, beside, between), *pair)[0]
    assert not obstructible(_team(orbits, beside), *pair)[0]
