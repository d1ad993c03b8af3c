"""Refinement keeps clear of landmarks, keep-outs and obstacles."""

from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.arrays import Array
from syncplan.orbits.circles import position
from syncplan.orbits.contacts import landmark_gaps
from syncplan.planning.judged_team import PlanFinding, landmark_limit
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.plans import Plan
from syncplan.refinement.constraints import (
    area_clearances,
    kept_landmarks,
    landmark_clearances,
    side_count,
    sides_of,
)
from syncplan.refinement.problem import Freedom, RefineProblem, circles_of
from syncplan.reports.plan_report import plan_document
from syncplan.scenario.areas import Area
from tests.tools.on_paper import refine
from tests.tools.scenarios import planned
from tests.tools.smooth_problems import posed, record_of

pytestmark = pytest.mark.usefixtures("short_exact_search")

INSTANTS = 20_000
SENSED = [[0.0, 45.0], [70.0, -40.0]]
SQUARE = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
STRIP = [[-22.0, -22.0], [95.0, -22.0], [95.0, 22.0], [-22.0, 22.0]]
RADII = {"vary": ["phases", "centers", "radii"], "radius_m": [15.0, 25.0]}
LENGTHS = st.integers(-40_000, 40_000).map(lambda mm: mm / 1000.0)


def made(**changes: Any) -> Plan:
    return planned(**{"landmarks_m": SENSED, "duration_s": 60.0, **changes})


def nearest(judged: Plan) -> float:
    """The least distance of any vehicle from any landmark, at many instants."""
    where = position(judged.orbits, np.linspace(0.0, judged.orbits.period, INSTANTS))
    return float(np.hypot(*(where[:, :, None] - judged.landmarks).T).min())


def asked(judged: Plan) -> float:
    return landmark_limit(judged.scenario).least(judged.orbits.radii)


def findings(judged: Plan) -> dict[str, PlanFinding]:
    return {one.code: one for one in judged.verdict.findings}


def reread(made_plan: Plan) -> Plan:
    """The plan judged again from its document."""
    return plan_of(loaded_from(plan_document(made_plan).as_json()))


@pytest.mark.parametrize(
    ("off", "clearance", "options"),
    [(-1.0, None, {}), (0.0, 3.0, {}), (0.4, None, RADII), (-0.2, 3.0, RADII)],
)
def test_a_plan_that_passes_a_landmark_too_near_is_cleared(
    off: float, clearance: float | None, options: Any
) -> None:
    near = made(
        landmarks_m=[*SENSED, [0.0, -20.0 - off]],
        landmark_clearance_m=clearance,
        min_separation_m=5.0,
    )
    assert "landmark-too-close" in findings(near)
    refined = refine(near, starts=1, workers=1, objective="logdet", **options)
    assert record_of(refined).improved
    assert record_of(refined).cleared
    assert "landmark-too-close" not in findings(refined)
    assert "cleared" in findings(refined)
    assert nearest(refined) >= asked(refined) * (1.0 - 1e-6)
    assert findings(reread(refined)) == findings(refined)


def test_phases_alone_move_no_path_and_the_finding_says_so() -> None:
    near = made(landmarks_m=[*SENSED, [0.0, -20.5]])
    refined = refine(near, starts=1, workers=1, objective="logdet", vary=["phases"])
    assert record_of(refined).improved
    assert not record_of(refined).cleared
    cure = findings(refined)["landmark-too-close"].cure
    assert cure is not None
    assert "phases alone, which moves no path" in cure.text
    assert findings(reread(refined)) == findings(refined)
    np.testing.assert_array_equal(refined.orbits.centers, near.orbits.centers)


def test_a_landmark_that_bounds_leave_no_way_to_clear_is_not_come_nearer_to() -> None:
    near = made(landmarks_m=[*SENSED, [0.0, -20.5]], landmark_clearance_m=4.0)
    refined = refine(near, starts=1, workers=1, objective="logdet", center_box_m=1.0)
    cure = findings(refined)["landmark-too-close"].cure
    assert cure is not None
    assert "refinement could not clear it" in cure.text
    assert nearest(near) < nearest(refined) < 4.0


@pytest.mark.parametrize("area", [None, STRIP], ids=["without an area", "no room for discs"])
def test_a_plan_that_orbits_an_obstacle_is_refined_and_still_does(area: Any) -> None:
    orbiting = made(keep_out_m=[SQUARE], area_m=area, min_separation_m=5.0)
    assert "in-keep-out" not in findings(orbiting)
    refined = refine(orbiting, starts=1, workers=1, objective="logdet")
    assert record_of(refined).improved
    assert "in-keep-out" not in findings(refined)
    obstacle = Area(None, (np.array(SQUARE),))
    round_it = obstacle.goes_round(0, refined.orbits.centers, refined.orbits.radii)
    assert round_it.tolist() == [True, False]


def test_a_path_through_a_keep_out_is_moved_off_it() -> None:
    crossing = made(keep_out_m=[[[15.0, -5.0], [22.0, -5.0], [22.0, 5.0], [15.0, 5.0]]])
    assert "in-keep-out" in findings(crossing)
    refined = refine(crossing, starts=1, workers=1, objective="logdet", center_box_m=8.0)
    assert "in-keep-out" not in findings(refined)
    assert "cleared" in findings(refined)


# --- the solver's copy ----------------------------------------------------------------------------


@cache
def obstructed() -> tuple[RefineProblem, ca.Function]:
    """A problem with obstacles, and clearances from landmarks and areas as the solver sees them."""
    corner = [[12.0, 15.0], [30.0, 12.0], [24.0, 31.0]]
    problem = posed(
        made(
            keep_out_m=[SQUARE, corner],
            landmarks_m=[*SENSED, [0.0, -23.0]],
            landmark_clearance_m=4.0,
        ),
        center_box_m=100.0,
        vary=["phases", "centers", "radii"],
        radius_m=[5.0, 60.0],
    )
    symbols = [ca.MX.sym("X", 4, problem.orbits.count), ca.MX.sym("s", side_count(problem))]
    rows = [of(problem, *symbols).values for of in (landmark_clearances, area_clearances)]
    return problem, ca.Function("c", symbols, rows)


def seen(circles: Array) -> tuple[Array, Array]:
    """Values of landmarks kept, then least value of each vehicle over the edges of areas."""
    problem, clearances = obstructed()
    scaled = circles.copy()
    scaled[:3] /= problem.scale
    landmarks, edges = map(np.array, clearances(scaled, sides_of(problem, circles)))
    return landmarks.ravel(), edges.reshape(-1, problem.orbits.count).min(axis=0) * problem.scale


@given(st.lists(LENGTHS, min_size=6, max_size=6))
def test_the_solver_sees_the_clearances_that_the_exact_code_finds(shifts: list[float]) -> None:
    problem, _ = obstructed()
    circles = circles_of(problem.orbits)
    circles[:2] += np.reshape(shifts[:4], (2, 2))
    circles[2] += np.abs(shifts[4:]) / 2.0
    landmarks, edges = seen(circles)
    exact = landmark_gaps(circles[:2].T, circles[2], problem.landmarks)
    # the solver keeps a ten-thousandth more than is asked
    wanted = exact[tuple(kept_landmarks(problem).T)] / (4.0 * (1.0 + 1e-4))
    np.testing.assert_allclose(landmarks, wanted, atol=1e-6)
    clear = problem.area.path_clearances(circles[:2].T, circles[2]).min(axis=0)
    for value, path in zip(edges, clear, strict=True):
        # through a polygon, only the sign is the same
        assert value == pytest.approx(path, abs=1e-4) if path > 0.0 else value <= 1e-4


def test_a_side_that_bounds_leave_no_room_on_is_exchanged() -> None:
    # the start lies just outside, but its centre can only move inwards
    near = made(
        area_m=[[-20.5, -60.0], [120.0, -60.0], [120.0, 60.0], [-20.5, 60.0]],
        landmarks_m=[*SENSED, [0.0, -20.5]],
    )
    problem = posed(near, vary=["centers"])
    first = kept_landmarks(problem).tolist().index([0, 2])
    assert sides_of(problem, circles_of(problem.orbits))[first] > 0.0
    unasked = replace(problem.landmark_limit, stated=0.0)
    assert not len(kept_landmarks(replace(problem, landmark_limit=unasked)))
    lower, upper = problem.freedom.lower.copy(), problem.freedom.upper.copy()
    lower[:2, 0], upper[:2, 0] = [-0.1, -4.0], [0.1, 0.2]
    moved = replace(problem, freedom=Freedom(lower, upper))
    first = kept_landmarks(moved).tolist().index([0, 2])
    assert sides_of(moved, circles_of(moved.orbits))[first] == pytest.approx(-1.0 / 2.0002)


@pytest.mark.long
def test_a_clear_plan_stays_clear_though_sightings_are_best_from_near() -> None:
    given_plan = made(landmarks_m=[*SENSED, [0.0, -24.0], [83.0, 20.0]], min_separation_m=5.0)
    refined = refine(given_plan, starts=1, workers=1, objective="logdet")
    assert record_of(refined).improved
    assert not record_of(refined).cleared
    assert nearest(refined) >= asked(refined) * (1.0 - 1e-6)
    # where landmarks are no obstacles, it comes nearer
    scenario = given_plan.scenario.model_copy(update={"landmark_clearance_m": 0.0})
    free = refine(scenario, starts=1, workers=1, objective="logdet")
    assert nearest(free) < 0.8 * asked(refined)
