"""Sight among obstacles: closed forms, symmetries, and sampling with bisection by Shapely."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import shapely
from numpy.typing import ArrayLike

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, unit
from syncplan.orbits.contacts import Windows, find_windows
from syncplan.orbits.sight_lines import crosses_interior, hidden_landmarks, obstructible
from syncplan.orbits.team import Team
from tests.tools.draws import NOISE
from tests.tools.obstructed import compare, draw_obstructed
from tests.tools.phase_teams import cameras

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
HORSESHOE = np.array(
    [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]]
)


def _team(orbits: Orbits, *obstacles: Array, landmarks: Array | None = None) -> Team:
    sensors = cameras(orbits.count, 100.0, 7.0, 0.0)
    places = np.zeros((0, 2)) if landmarks is None else landmarks
    return Team(orbits, places, sensors, NOISE, obstacles=obstacles)


CIRCLE = Orbits(np.zeros((1, 2)), np.array([10.0]), np.ones(1), np.zeros(1), 1.0)


def _sees(landmark: ArrayLike, obstacle: Array) -> Array:
    """Windows in which the vehicle on the circle sees a landmark."""
    return find_windows(_team(CIRCLE, obstacle, landmarks=np.array([landmark], dtype=float))).of(0)


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
    comparison = compare(draw_obstructed(np.random.default_rng(seed)))
    assert not comparison.mismatches
    assert comparison.largest < 1e-9


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
        around, *ends = (part @ axes + shift for part in (polygon, start, end))
        for outline, (a, b) in product((around, around[::-1]), (ends, ends[::-1])):
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


def test_a_wall_hides_a_landmark_for_the_angle_it_spans() -> None:
    # seen from the landmark in the middle of a circle, a wall spans the angle of its near side
    wall = np.array([[4.0, -3.0], [5.0, -3.0], [5.0, 3.0], [4.0, 3.0]])
    half = np.arctan2(3.0, 4.0)
    np.testing.assert_allclose(_sees([0.0, 0.0], wall), [[half, 2.0 * np.pi - half]], atol=1e-12)


def test_a_vehicle_is_hidden_while_it_is_within_an_obstacle() -> None:
    # it enters and leaves where its circle crosses the wall x = 6; no corner is ever passed
    block = np.array([[6.0, -50.0], [60.0, -50.0], [60.0, 50.0], [6.0, 50.0]])
    enters = np.arccos(0.6)
    seen = _sees([-20.0, 0.0], block)
    np.testing.assert_allclose(seen, [[enters, 2.0 * np.pi - enters]], atol=1e-12)


def test_a_disc_of_many_corners_hides_what_is_beyond_its_tangents() -> None:
    disc = 6.0 * unit(np.linspace(0.0, 2.0 * np.pi, 2001)[:-1])
    half = np.arccos(6.0 / 10.0) + np.arccos(6.0 / 15.0)
    seen = _sees([15.0, 0.0], disc)
    np.testing.assert_allclose(seen, [[2.0 * np.pi - half, 2.0 * np.pi + half]], atol=1e-6)
