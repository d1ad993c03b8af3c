"""What the solver sees of a refinement problem, and the same by the exact code."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.bounds import posterior_bound
from syncplan.observability.referred_rows import dense_rows, state_rows
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import sightings_over
from syncplan.orbits.team import Team
from syncplan.planning.plan_records import RefinementRecord
from syncplan.planning.plans import Plan
from syncplan.refinement.nlp import StageNlp
from syncplan.refinement.problem import RefineProblem, Stage, circles_of, samples_of
from syncplan.refinement.problem_setup import problem_of
from syncplan.refinement.refiner import options_for
from syncplan.refinement.smooth_bound import coarse_run, smooth_rms
from syncplan.refinement.smooth_team import SmoothTeam

MIXED: dict[str, Any] = {
    "orbit": {
        "radius_m": [20.0, 17.0, 23.0],
        "angular_rate_rad_s": 0.2,
        "direction": ["ccw", "cw", "ccw"],
        "first_phase_rad": 0.7,
        "desync_rad": [0.0, 0.3, -0.2],
    },
    "formation": {"centers_m": [[0.0, 0.0], [68.0, 5.0], [20.0, 66.0]]},
    "landmarks_m": [[0.0, -40.0], [70.0, 50.0], [40.0, 30.0]],
    "min_separation_m": 8.0,
    "duration_s": 60.0,
}
"""Three vehicles of unequal circles and both senses, three landmarks; without sensors."""

STAGE = Stage(samples=64, width=0.05, barrier=0.1, iterations=1, tolerance=1e-5, last=True)
"""A stage of the solver."""


def record_of(refined: Plan) -> RefinementRecord:
    """Return the record of a plan that was refined."""
    assert refined.refinement is not None
    return refined.refinement


def posed(given: Plan, **options: Any) -> RefineProblem:
    """Return the problem of refining a plan."""
    return problem_of(given, options_for(given.scenario, None, options))


def point_near(nlp: StageNlp, problem: RefineProblem) -> tuple[Array, Array]:
    """Return variables near the plan, away from symmetry, and the plan's sides."""
    generator = np.random.default_rng(0)
    circles = circles_of(problem.orbits)
    sides = nlp.sides_of(circles)
    circles[:3] += 0.05 * problem.scale * generator.uniform(-1.0, 1.0, circles[:3].shape)
    circles[3] += 0.2 * generator.uniform(-1.0, 1.0, problem.orbits.count)
    return nlp.variables_of(circles), sides


def scaled_circles(problem: RefineProblem, circles: Array | None = None) -> Array:
    """Return circles (4, n), or the plan's, with lengths in its mean radius."""
    scaled = circles_of(problem.orbits) if circles is None else circles.copy()
    scaled[:3] /= problem.scale
    return scaled


def smooth_information(problem: RefineProblem, width: float, most: int = 10_000) -> Array:
    """Return the windowed information (3 n, 3 n) with steps as wide as `width`."""
    times = samples_of(problem.window, problem.sensors, problem.orbits.rate, most)
    team = SmoothTeam.of(problem, times)
    circles = ca.MX.sym("X", 4, problem.orbits.count)
    entries = ca.MX(team.sparsity, team.information(circles, width))
    return np.array(ca.Function("W", [circles], [entries])(scaled_circles(problem)))


def exact_information(problem: RefineProblem) -> Array:
    """Return the windowed information (3 n, 3 n) of the plan's sightings."""
    team, poses = problem.team, layout_of(problem.team, [])
    seen = sightings_over(team, find_windows(team), problem.window)
    rows = dense_rows(state_rows(team, seen, poses), poses.size)
    return np.asarray(rows.T @ rows)


def information_errors(problem: RefineProblem) -> tuple[Array, list[float]]:
    """Return the exact information, and by what share of it narrower and narrower steps are off."""
    exact = exact_information(problem)
    off = [
        float(np.abs(smooth_information(problem, width) - exact).max() / np.abs(exact).max())
        for width in (0.1, 0.01, 1e-3, 1e-6)
    ]
    return exact, off


def smooth_rms_of(problem: RefineProblem, circles: Array | None = None) -> Array:
    """Return (n,) the smooth error in m of circles (4, n), or of the plan's."""
    run = coarse_run(problem)
    team = SmoothTeam.of(problem, run.times)
    symbols = ca.MX.sym("X", 4, problem.orbits.count)
    rms = smooth_rms(problem, run, team, symbols, 0.02).value
    found = ca.Function("r", [symbols], [rms])(scaled_circles(problem, circles))
    return np.array(found).ravel() * problem.scale


def exact_rms(team: Team, duration: float) -> Array:
    """Return (n,) the error in m by the posterior bound."""
    return posterior_bound(team, find_windows(team), duration).rms_second_half()


def assert_slopes(found: Any, function: Callable[[Array], Any], at: Array) -> None:
    """Check slopes (outputs, variables) against central differences."""
    columns = []
    for step in 1e-6 * np.eye(len(at)):
        up, down = (np.array(function(at + sign * step)).ravel() for sign in (1.0, -1.0))
        columns.append((up - down) / 2e-6)
    wanted, slopes = np.array(columns).T, np.array(ca.DM(found))
    assert np.all(np.isfinite(slopes))
    np.testing.assert_allclose(
        slopes.reshape(wanted.shape), wanted, atol=1e-6 * np.abs(wanted).max(), rtol=1e-5
    )
