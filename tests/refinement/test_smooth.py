"""The smooth functions that the solver sees, against the exact code and finite differences."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.orbits.circles import relative_motion
from syncplan.orbits.contacts import least_distances
from syncplan.planning.planner import judge
from syncplan.refinement.constraints import separations
from syncplan.refinement.nlp import nlp_of
from syncplan.refinement.problem import RefineProblem, circles_of, orbits_of
from syncplan.scenario.objectives import OBJECTIVES
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, example, planned, small
from tests.tools.smooth_problems import (
    MIXED,
    STAGE,
    assert_slopes,
    exact_information,
    exact_rms,
    information_errors,
    point_near,
    posed,
    scaled_circles,
    smooth_information,
    smooth_rms_of,
)

PERIOD_S = 2.0 * np.pi / 0.2
UNEQUAL = [
    {"range_m": reach, "bearing_sigma_rad": sigma, "sample_time_s": 0.2}
    for reach, sigma in ((50.0, 0.1), (42.0, 0.05), (55.0, 0.2))
]
VIEWS = [
    dict(sensor, fov_deg=view, boresight_deg=side)
    for sensor, view, side in zip(UNEQUAL, (200.0, 300.0, 360.0), (-60.0, 20.0, 0.0), strict=True)
]
# distances, or none; missed now and then; not ready at every sample
FURTHER = [
    {**VIEWS[0], "range_sigma_m": 0.5, "interval_s": 0.4},
    {**VIEWS[1], "detection_probability": 0.7},
    {**VIEWS[2], "range_sigma_m": 2.0, "detection_probability": 0.9, "interval_s": 0.6},
]


def _problem(objective: str = "logdet", refine: Any = None, **changes: Any) -> RefineProblem:
    return posed(planned(**{**MIXED, **changes}), objective=objective, **(refine or {}))


AMONG_OBSTACLES: dict[str, Any] = {
    "orbit": {**MIXED["orbit"], "first_phase_rad": 0.0},
    "formation": {"centers_m": [[0.0, 0.0], [50.0, 5.0], [10.0, 56.0]]},
    "obstacles_m": [
        [[23.0, -9.0], [26.0, -9.0], [25.0, 4.0], [23.0, 2.0]],
        [[-4.0, 22.0], [4.0, 22.0], [4.0, 30.0], [0.0, 25.0], [-4.0, 30.0]],
    ],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.2},
    "min_separation_m": 1.0,
}

SIGHTED: dict[str, dict[str, Any]] = {
    "alike": {},
    "unequal ranges": {"sensor": UNEQUAL},
    "views": {"sensor": VIEWS},
    "part of a turn": {"window_s": 0.55 * PERIOD_S, "sensor": VIEWS},
    "several turns": {"window_s": 2.3 * PERIOD_S, "sensor": UNEQUAL},
    "one sense": {"orbit": {**MIXED["orbit"], "direction": "cw"}, "sensor": VIEWS},
    "distances and compasses": {"sensor": FURTHER, "heading_sigma_rad": [0.05, 0.2, 0.1]},
    "distances in part of a turn": {"sensor": FURTHER, "window_s": 0.55 * PERIOD_S},
    "among obstacles": AMONG_OBSTACLES,
}


@pytest.mark.parametrize("changes", SIGHTED.values(), ids=SIGHTED)
def test_the_information_approaches_the_exact_one_as_the_step_narrows(
    changes: dict[str, Any],
) -> None:
    problem = _problem(**changes)
    _, off = information_errors(problem)
    assert off[1] < 0.5 * off[0]
    assert off[2] < 0.03
    assert off[3] < 1e-5


def test_samples_counted_together_show_nearly_as_much_as_one_by_one() -> None:
    problem = _problem(sensor=UNEQUAL)
    each, together = (smooth_information(problem, 0.03, most) for most in (10_000, 64))
    assert np.abs(together - each).max() < 3e-4 * np.abs(each).max()


RADII: dict[str, Any] = {"vary": ["phases", "centers", "radii"], "radius_m": [10.0, 30.0]}


@pytest.mark.parametrize(
    ("sensor", "objective"),
    [
        *((FURTHER, objective) for objective in OBJECTIVES),
        (UNEQUAL, "logdet"),
        (UNEQUAL, "predicted_rms"),
        (VIEWS, "min_eigenvalue"),
    ],
)
def test_objective_gradients_are_those_of_finitedifferences(sensor: Any, objective: str) -> None:
    problem = _problem(objective, RADII, sensor=sensor)
    nlp = nlp_of(problem, STAGE)
    value, (at, sides) = nlp.objective.value, point_near(nlp, problem)
    function = ca.Function("f", [nlp.variables], [value])
    slope = ca.Function("g", [nlp.variables, nlp.sides], [value, ca.gradient(value, nlp.variables)])
    assert_slopes((nlp.gradient or slope)(at, sides)[1], function, at)


CONVEX = [[-60.0, -60.0], [130.0, -60.0], [130.0, 130.0], [-60.0, 130.0]]
DENTED = [[-60.0, -60.0], [130.0, -60.0], [130.0, 130.0], [80.0, 90.0], [-60.0, 130.0]]


@pytest.mark.parametrize(
    ("area", "objective"),
    [(CONVEX, "trace"), (CONVEX[::-1], "min_eigenvalue"), (DENTED, "predicted_rms")],
    ids=["ccw", "cw", "dented"],
)
def test_the_sparse_jacobian_of_the_constraints_is_that_of_finitedifferences(
    area: Any, objective: str
) -> None:
    problem = _problem(
        objective,
        RADII,
        sensor=VIEWS,
        area_m=area,
        # the first lies outside all circles, v1 goes round the second
        keep_out_m=[
            [[50.0, 40.0], [55.0, 40.0], [52.0, 46.0]],
            [[-5.0, -4.0], [6.0, -3.0], [2.0, 5.0]],
        ],
        landmarks_m=[[0.0, -24.0], [70.0, 50.0], [68.0, -9.0], [20.0, 40.0]],
    )
    nlp = nlp_of(problem, STAGE)
    labels = " ".join(nlp.labels)
    named = ("contact", "separation", "clearance", "area_m", "keep_out_m[0]", "keep_out_m[1]")
    assert all(word in labels for word in named)
    assert ("window bound" in labels) == (objective != "predicted_rms")
    at, sides = point_near(nlp, problem)
    assert set(np.sign(sides)) == {1.0, -1.0}
    values, jacobian = nlp.jacobian(at, sides)
    function = ca.Function("g", [nlp.variables, nlp.sides], [nlp.constraints])
    np.testing.assert_allclose(np.array(values), np.array(function(at, sides)))
    assert_slopes(jacobian, lambda moved: function(moved, sides), at)


def test_contacts_among_obstacles_have_the_jacobian_of_finite_differences() -> None:
    problem = _problem(**AMONG_OBSTACLES)
    exact = exact_information(problem)
    open_field = exact_information(replace(problem, team=replace(problem.team, obstacles=())))
    assert np.abs(open_field - exact).max() > 0.1 * np.abs(exact).max()
    nlp = nlp_of(problem, STAGE)
    at, sides = point_near(nlp, problem)
    _, jacobian = nlp.jacobian(at, sides)
    assert_slopes(jacobian, lambda moved: nlp.values(moved, sides)[1], at)


def _drawn_pair(generator: np.random.Generator, senses: list[str]) -> RefineProblem:
    radii = generator.uniform(5.0, 30.0, 2)
    away = radii.sum() + generator.uniform(-8.0, 12.0)
    turn = generator.uniform(0.0, 2.0 * np.pi)
    given = planned(
        orbit=circling(
            radius_m=radii.tolist(),
            direction=senses,
            desync_rad=generator.uniform(-3.0, 3.0, 2).tolist(),
        ),
        formation={
            "centers_m": [[0.0, 0.0], [away * np.cos(turn), away * np.sin(turn)]],
            "links": [],
        },
        min_separation_m=float(10.0 ** generator.uniform(-0.5, 1.2)),
    )
    return posed(given)


def _separation(problem: RefineProblem) -> Callable[[Array], tuple[float, float]]:
    """Of a pair on circles (4, 2): its separation as the solver sees it, and the true one."""
    symbols = ca.MX.sym("X", 4, 2)
    value = ca.Function("s", [symbols], [separations(problem, symbols).values])

    def both(circles: Array) -> tuple[float, float]:
        motion = relative_motion(orbits_of(circles, problem.orbits), np.array([0]), np.array([1]))
        least = float(least_distances(motion)[0][0])
        return float(value(scaled_circles(problem, circles))), least / problem.min_separation

    return both


@pytest.mark.parametrize("senses", [["ccw", "cw"], ["cw", "ccw"], ["ccw", "ccw"], ["cw", "cw"]])
def test_a_separation_that_the_solver_sees_kept_is_kept(senses: list[str]) -> None:
    kept = 0
    for number in range(12):
        problem = _drawn_pair(np.random.default_rng(number), senses)
        if not len(problem.guarded_pairs()):
            continue
        both, generator = _separation(problem), np.random.default_rng([number, 1])
        for _ in range(20):
            moved = circles_of(problem.orbits)
            moved[:2] += generator.uniform(-5.0, 5.0, (2, 2))
            moved[3] += generator.uniform(-np.pi, np.pi, 2)
            seen, ratio = both(moved)
            if senses[0] == senses[1]:
                # exact up to the side of crossing, which it must not change
                assert abs(abs(seen) - ratio) < 1e-5 * max(1.0, ratio)
            if seen >= 1.0:
                kept += 1
                assert ratio >= 1.0 - 1e-9
    assert kept > 100


def test_the_smooth_separation_of_opposite_senses_is_close_to_the_true_one() -> None:
    problem = _problem(
        orbit=circling(direction=["ccw", "cw"]),
        formation={"centers_m": [[0.0, 0.0], [49.0, 0.0]]},
        min_separation_m=8.0,
    )
    moved, both = circles_of(problem.orbits), _separation(problem)
    for gap in np.linspace(-1.0, 3.0, 9):
        moved[0, 1] = 49.0 + gap
        seen, ratio = both(moved)
        assert ratio**2 - 0.08 <= seen <= ratio**2


@pytest.mark.parametrize(
    ("changes", "tolerance"),
    [
        ({"sensor": VIEWS}, 0.01),
        # sightings that are few make a turn's coarse steps rougher than those of bearings alone
        ({"sensor": FURTHER, "heading_sigma_rad": [0.05, 0.2, 0.1]}, 0.03),
    ],
    ids=["views", "distances and compasses"],
)
def test_the_smooth_error_of_mixed_radii_is_near_the_posterior_bound(
    changes: dict[str, Any], tolerance: float
) -> None:
    # at phases that meet the rules: the smooth error's distance from the exact one depends on them
    orbits = planned(**MIXED, sensor=UNEQUAL).orbits
    judged = judge(small(**MIXED, **changes), orbits, bound="never")
    problem = replace(posed(judged, objective="logdet"), duration=120.0)
    np.testing.assert_allclose(
        smooth_rms_of(problem), exact_rms(problem.team, problem.duration), rtol=tolerance
    )


@pytest.mark.parametrize(
    ("motion", "sample_time", "tolerance"),
    [
        ({"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01}, 0.2, 0.02),
        ({"speed_sigma_mps": 0.01, "turn_rate_sigma_rad_s": 0.1}, 1.0, 0.08),
    ],
    ids=["mostly of speed", "mostly of turn rate"],
)
def test_the_smooth_error_follows_radii_that_change(
    motion: dict[str, float], sample_time: float, tolerance: float
) -> None:
    # the noise of a turn grows with the radius, though it is formed for those of the plan
    sensor = [dict(one, sample_time_s=sample_time) for one in UNEQUAL]
    problem = _problem("predicted_rms", RADII, sensor=sensor, motion=motion)
    wider = circles_of(problem.orbits)
    wider[2] *= [1.15, 0.9, 1.1]
    exact = exact_rms(problem.team.on(orbits_of(wider, problem.orbits)), problem.duration)
    np.testing.assert_allclose(smooth_rms_of(problem, wider), exact, rtol=tolerance)


def test_variables_and_circles_are_each_others_inverse() -> None:
    problem = _problem(refine=RADII)
    nlp = nlp_of(problem, STAGE)
    at, _ = point_near(nlp, problem)
    np.testing.assert_allclose(nlp.variables_of(nlp.circles_of(at)), at, rtol=1e-12)


# --- errors as states -----------------------------------------------------------------------------


NOISE = {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01}

BIASED = {"bearing_bias_sigma_rad": 0.1}
WALKING = {"bearing_walk": {"sigma_rad": 0.1, "time_s": 20.0}}
WIND = {"wind": {"sigma_mps": 0.5}}
GUSTS = {"wind": {"gust_sigma_mps": 0.5}}
SCALES = {"motion": {**NOISE, "speed_scale_sigma": 0.1}}
TURNS = {"motion": {**NOISE, "turn_rate_bias_sigma_rad_s": 0.02}}
ALL = {
    "wind": {"sigma_mps": 0.5, "gust_sigma_mps": 0.3, "gust_time_s": 5.0},
    "motion": {**SCALES["motion"], **TURNS["motion"]},
    "heading_sigma_rad": [0.2, 0.1, 0.3],
}


def _erring_problem(
    sensor: dict[str, Any], changes: dict[str, Any], **refine: Any
) -> RefineProblem:
    sensors = [
        {"range_m": reach, "bearing_sigma_rad": 0.1, "sample_time_s": 0.2, "fov_deg": view}
        for reach, view in ((50.0, 200.0), (42.0, 300.0), (55.0, 360.0))
    ]
    keys: dict[str, Any] = {**MIXED, "duration_s": 120.0}
    orbits = planned(**keys, sensor=[{**one, "fov_deg": 360.0} for one in sensors]).orbits
    scenario = small(**keys, **changes, sensor=[{**one, **sensor} for one in sensors])
    return posed(judge(scenario, orbits, bound="never"), **refine)


CASES: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    "wind": ({}, WIND, 0.01),
    "gusts": ({}, GUSTS, 0.05),
    "speed scales": ({}, SCALES, 0.01),
    "turn-rate biases": ({}, TURNS, 0.005),
    "bearing biases": (BIASED, {}, 0.01),
    "bearing walks": (WALKING, {}, 0.03),
    "compass": (BIASED, {"heading_sigma_rad": 0.2}, 0.01),
    "all": (BIASED | WALKING, ALL, 0.05),
}


@pytest.mark.parametrize(("sensor", "changes", "tolerance"), CASES.values(), ids=CASES)
def test_the_smooth_error_with_errors_as_states_is_near_the_posterior_bound(
    sensor: dict[str, Any], changes: dict[str, Any], tolerance: float
) -> None:
    # how much larger the errors make it; the coarse steps alone leave 2 % to poses without errors
    problem = _erring_problem(sensor, changes)
    poses = replace(problem.team, errors=replace(problem.team.errors, estimated=()))
    exact, without = (exact_rms(team, problem.duration) for team in (problem.team, poses))
    assert exact.mean() > (1.0 + 3.0 * tolerance) * without.mean()
    smooth = smooth_rms_of(problem) / smooth_rms_of(replace(problem, team=poses))
    np.testing.assert_allclose(smooth, exact / without, rtol=tolerance)


def test_the_gradient_with_all_errors_is_that_of_finite_differences() -> None:
    problem = _erring_problem(BIASED | WALKING, ALL, objective="predicted_rms", **RADII)
    nlp = nlp_of(replace(problem, duration=40.0), STAGE)
    at, sides = point_near(nlp, problem)
    assert nlp.gradient is not None
    value, slope = nlp.gradient(at, sides)
    np.testing.assert_allclose(float(value), float(nlp.values(at, sides)[0]), rtol=1e-14)
    assert_slopes(slope, lambda moved: nlp.values(moved, sides)[0], at)


def test_the_smooth_error_of_the_paper_grid_is_near_the_posterior_bound() -> None:
    problem = posed(plan(example("paper-grid-same"), bound="never"))
    exact = exact_rms(problem.team, problem.duration)
    np.testing.assert_allclose(smooth_rms_of(problem), exact, rtol=0.01)
