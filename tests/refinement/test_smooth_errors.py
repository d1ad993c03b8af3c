"""The smooth posterior bound with bias states, against the exact one."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from syncplan.planning.planner import judge
from syncplan.refinement.nlp import nlp_of
from syncplan.refinement.problem import RefineProblem
from tests.tools.scenarios import planned, small
from tests.tools.smooth_problems import (
    MIXED,
    STAGE,
    assert_slopes,
    exact_rms,
    point_near,
    posed,
    smooth_rms_of,
)

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
    problem = _problem(sensor, changes)
    poses = replace(problem.team, errors=replace(problem.team.errors, estimated=()))
    exact, without = (exact_rms(team, problem.duration) for team in (problem.team, poses))
    assert exact.mean() > (1.0 + 3.0 * tolerance) * without.mean()
    smooth = smooth_rms_of(problem) / smooth_rms_of(replace(problem, team=poses))
    np.testing.assert_allclose(smooth, exact / without, rtol=tolerance)


def test_the_gradient_with_all_errors_is_that_of_finite_differences() -> None:
    free = {"vary": ["phases", "centers", "radii"], "radius_m": [10.0, 30.0]}
    problem = _problem(BIASED | WALKING, ALL, objective="predicted_rms", **free)
    nlp = nlp_of(replace(problem, duration=40.0), STAGE)
    at, sides = point_near(nlp, problem)
    assert nlp.gradient is not None
    value, slope = nlp.gradient(at, sides)
    np.testing.assert_allclose(float(value), float(nlp.values(at, sides)[0]), rtol=1e-14)
    assert_slopes(slope, lambda moved: nlp.values(moved, sides)[0], at)
