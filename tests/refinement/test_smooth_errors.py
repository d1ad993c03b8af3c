"""The smooth posterior bound with bias states, against the exact one."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.estimation.bounds import posterior_bound
from syncplan.orbits.contacts import find_windows
from syncplan.planning.planner import judge, plan
from syncplan.refinement.nlp import nlp_of
from syncplan.refinement.problem import RefineProblem, Stage, circles_of
from syncplan.refinement.problem_setup import problem_of
from syncplan.refinement.refiner import options_for
from syncplan.refinement.smooth_bound import coarse_run, smooth_rms
from syncplan.refinement.smooth_team import SmoothTeam
from tests.tools.scenarios import small
from tests.tools.smooth_problems import MIXED, differences, scaled_circles

STAGE = Stage(samples=64, width=0.05, barrier=0.1, iterations=1, tolerance=1e-5, last=True)
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


def _problem(sensor: dict[str, Any], changes: dict[str, Any], **refine: Any) -> RefineProblem:
    sensors = [
        {"range_m": reach, "bearing_sigma_rad": 0.1, "sample_time_s": 0.2, "fov_deg": view}
        for reach, view in ((50.0, 200.0), (42.0, 300.0), (55.0, 360.0))
    ]
    keys: dict[str, Any] = {**MIXED, "duration_s": 120.0}
    orbits = plan(small(**keys, sensor=[{**one, "fov_deg": 360.0} for one in sensors])).orbits
    scenario = small(**keys, **changes, sensor=[{**one, **sensor} for one in sensors])
    given = judge(scenario, orbits, bound="never")
    return problem_of(given, options_for(scenario, None, refine))


def _rms(problem: RefineProblem) -> Array:
    run = coarse_run(problem)
    team = SmoothTeam.of(problem, run.times)
    circles = ca.MX.sym("X", 4, problem.orbits.count)
    rms = smooth_rms(problem, run, team, circles, 0.02).value
    found = ca.Function("r", [circles], [rms])(scaled_circles(problem))
    return np.array(found).ravel() * problem.scale


@pytest.mark.parametrize(
    ("sensor", "changes", "tolerance"),
    [
        ({}, WIND, 0.01),
        ({}, GUSTS, 0.05),
        ({}, SCALES, 0.01),
        ({}, TURNS, 0.005),
        (BIASED, {}, 0.01),
        (WALKING, {}, 0.03),
        (BIASED, {"heading_sigma_rad": 0.2}, 0.01),
        (BIASED | WALKING, ALL, 0.05),
    ],
    ids=[
        "wind",
        "gusts",
        "speed scales",
        "turn-rate biases",
        "bearing biases",
        "bearing walks",
        "compass",
        "all",
    ],
)
def test_the_smooth_error_with_errors_as_states_is_near_the_posterior_bound(
    sensor: dict[str, Any], changes: dict[str, Any], tolerance: float
) -> None:
    # how much larger the errors make it; the coarse steps alone leave 2 % to poses without errors
    problem = _problem(sensor, changes)
    poses = replace(problem.team, errors=replace(problem.team.errors, estimated=()))
    exact, without = (
        posterior_bound(team, find_windows(team), problem.duration).rms_second_half()
        for team in (problem.team, poses)
    )
    assert exact.mean() > (1.0 + 3.0 * tolerance) * without.mean()
    smooth = _rms(problem) / _rms(replace(problem, team=poses))
    np.testing.assert_allclose(smooth, exact / without, rtol=tolerance)


def test_the_gradient_with_all_errors_is_that_of_finite_differences() -> None:
    free = {"vary": ["phases", "centers", "radii"], "radius_m": [10.0, 30.0]}
    problem = _problem(BIASED | WALKING, ALL, objective="predicted_rms", **free)
    nlp = nlp_of(replace(problem, duration=40.0), STAGE)
    circles = circles_of(problem.orbits)
    at, sides = nlp.variables_of(circles), nlp.sides_of(circles)
    at = at + 0.02 * np.random.default_rng(0).uniform(-1.0, 1.0, len(at))
    assert nlp.gradient is not None
    value, slope = nlp.gradient(at, sides)
    np.testing.assert_allclose(float(value), float(nlp.values(at, sides)[0]), rtol=1e-14)
    wanted = differences(lambda moved: nlp.values(moved, sides)[0], at)[0]
    found = np.array(slope).ravel()
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max(), rtol=1e-5)
