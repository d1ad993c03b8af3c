"""Sight past obstacles as the solver sees it, against Shapely and the exact code."""

from typing import Any

import casadi as ca
import numpy as np
import pytest
import shapely

from syncplan.arrays import Array
from syncplan.planning.plans import Plan
from syncplan.refinement.ipopt import StagedSolver
from syncplan.refinement.measures import measure
from syncplan.refinement.problem import circles_of, orbits_of
from syncplan.refinement.smooth_sightings import ConvexPiece, convex_pieces, sight_gap
from tests.tools.on_paper import plan, refine
from tests.tools.phase_teams import meet_when_shifted
from tests.tools.scenarios import small
from tests.tools.smooth_problems import posed

pytestmark = pytest.mark.usefixtures("short_exact_search")

TRIANGLE = np.array([[1.0, 0.0], [4.0, 1.0], [2.0, 3.0]])
DENTED = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [3.0, 1.5], [0.0, 5.0]])


def _gaps(pieces: tuple[ConvexPiece, ...], start: Array, end: Array, **options: Any) -> Array:
    ends = [ca.MX.sym(name, 1, len(start)) for name in ("ax", "ay", "bx", "by")]
    gap = sight_gap(pieces, tuple(ends), **options)  # type: ignore[arg-type]
    function = ca.Function("gap", ends, [gap])
    return np.array(function(*start.T[:, None], *end.T[:, None])).ravel()


@pytest.mark.parametrize("corners", [TRIANGLE, TRIANGLE[::-1], DENTED], ids=["ccw", "cw", "dented"])
def test_a_sight_line_has_a_gap_where_it_misses_the_polygon(corners: Array) -> None:
    generator = np.random.default_rng(0)
    start, end = generator.uniform(-3.0, 9.0, (2, 4000, 2))
    gaps = _gaps(convex_pieces((corners,), 1.0), start, end)
    polygon = shapely.Polygon(corners)
    lines = shapely.linestrings(np.stack([start, end], axis=1))
    blocked = shapely.intersects(lines, polygon)
    assert blocked.any()
    assert not blocked.all()
    np.testing.assert_array_equal(gaps <= 0.0, blocked)
    # never more than the true distance, which it is where the nearest point is on an edge
    assert np.all(gaps[~blocked] <= shapely.distance(lines[~blocked], polygon) + 1e-9)


def test_the_depth_is_how_far_a_sight_line_has_to_move() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 1.0], [0.0, 1.0]])
    start, end = np.array([[-5.0, 0.7], [4.0, -5.0]]), np.array([[15.0, 0.7], [4.0, 5.0]])
    np.testing.assert_allclose(_gaps(convex_pieces((square,), 1.0), start, end), [-0.3, -4.0])


def test_a_wall_does_not_hide_the_landmark_that_hangs_on_it() -> None:
    wall = convex_pieces((np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 1.0], [0.0, 1.0]]),), 1.0)
    start, end = np.array([[3.0, -2.0], [3.0, 4.0]]), np.array([[5.0, 0.0], [5.0, 0.0]])
    gaps = _gaps(wall, start, end, to_landmark=True)
    np.testing.assert_allclose(gaps[0], 2.0)
    assert gaps[1] < -0.5


CORRIDOR: dict[str, Any] = {
    "orbit": {"radius_m": 2.0, "speed_mps": 0.8, "direction": "ccw"},
    "formation": {"centers_m": [[0.0, 0.0], [7.0, 0.0]]},
    "landmarks_m": [[-3.5, -3.5], [-3.5, 3.5]],
    "sensor": {"range_m": 5.0, "bearing_sigma_rad": 0.02, "sample_time_s": 0.1},
    "initial_sigma": {"position_m": 0.5, "heading_rad": 0.1},
    "min_separation_m": 0.6,
    "duration_s": 120.0,
}
BETWEEN = [[3.2, -2.5], [3.8, -2.5], [3.8, 2.5], [3.2, 2.5]]
"""A shelf across the way between the two, as long as their circles are wide."""


def _walled(**refine_keys: Any) -> Plan:
    """The plan of two rovers of which v2 sees no landmark, their only meeting behind a shelf."""
    walled = {"obstacles_m": [BETWEEN], "keep_out_m": [BETWEEN]}
    return plan(small(**CORRIDOR, **walled, refine={"center_box_m": 4.0, **refine_keys}))


def test_the_solver_sees_the_way_round_a_shelf() -> None:
    # where the shelf stands, without the search by the exact measure, and without drawn starts
    before = _walled()
    problem = posed(before)
    run = StagedSolver(problem).solve(circles_of(before.orbits))
    found = measure(problem, orbits_of(run.candidates[-1], before.orbits))
    assert found.figures.rank == 6
    assert found.shortfall == 0.0


def test_a_shelf_in_the_way_is_planned_round() -> None:
    before = _walled(starts=2, time_limit_s=3600.0)
    assert plan(small(**CORRIDOR)).observable
    assert not before.observable
    assert not meet_when_shifted(before, 0.0)
    after = refine(before, workers=1)
    assert after.observable
    assert not after.dropped_links
    assert meet_when_shifted(after, 0.0)
    assert measure(posed(before), after.orbits).shortfall == 0.0
