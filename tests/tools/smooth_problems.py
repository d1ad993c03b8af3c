"""What the solver sees of a refinement problem, and the same by the exact code and differences."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.observability.referred_rows import sighting_rows
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.sightings import sightings_over
from syncplan.refinement.problem import RefineProblem, circles_of, samples_of
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


def scaled_circles(problem: RefineProblem) -> Array:
    """Return the plan's circles (4, n), lengths in its mean radius."""
    circles = circles_of(problem.orbits)
    circles[:3] /= problem.scale
    return circles


def smooth_information(problem: RefineProblem, width: float, most: int = 10_000) -> Array:
    """Return the windowed information (3 n, 3 n) with steps as wide as `width`."""
    times = samples_of(problem.window, problem.sensors, problem.orbits.rate, most)
    team = SmoothTeam.of(problem, times)
    circles = ca.MX.sym("X", 4, problem.orbits.count)
    entries = ca.MX(team.sparsity, team.information(circles, width))
    return np.array(ca.Function("W", [circles], [entries])(scaled_circles(problem)))


def exact_information(problem: RefineProblem) -> Array:
    """Return the windowed information (3 n, 3 n) of the plan's sightings, row by row."""
    team, n = problem.team, problem.orbits.count
    seen = sightings_over(team, find_windows(team), problem.window)
    total = np.zeros((3 * n, 3 * n))
    rows = sighting_rows(team, seen)
    for row, observer, target in zip(rows, seen.observers, seen.targets, strict=True):
        dense = np.zeros(3 * n)
        dense[3 * observer : 3 * observer + 3] += row[:3]
        if target < n:
            dense[3 * target : 3 * target + 3] += row[3:]
        total += np.outer(dense, dense)
    return total


def differences(function: Callable[[Array], Any], at: Array, step: float = 1e-6) -> Array:
    """Return (outputs, variables) the slopes by central differences."""
    columns = []
    for k in range(len(at)):
        shift = np.zeros(len(at))
        shift[k] = step
        up, down = (np.array(function(at + sign * shift)).ravel() for sign in (1.0, -1.0))
        columns.append((up - down) / (2.0 * step))
    return np.array(columns).T
