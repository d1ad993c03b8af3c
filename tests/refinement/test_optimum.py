"""Pairs, phases only: the refined plan against every phase there is, on a fine grid."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.planning.planner import Plan, plan
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.problem import RefineProblem, circles_of, orbits_of
from syncplan.refinement.problem_setup import problem_of
from syncplan.refinement.refiner import options_for, refine
from syncplan.scenario.objectives import OBJECTIVES
from tests.tools.scenarios import circling, small
from tests.tools.smooth_problems import record_of

LANDMARKS = [[0.0, 45.0], [70.0, -40.0]]
SENSOR = {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.3}


SCENARIOS: dict[str, dict[str, Any]] = {
    "same sense": {},
    "opposite senses, unequal radii": {
        "orbit": circling(radius_m=[17.0, 23.0], direction=["cw", "ccw"]),
        "min_separation_m": 12.0,
    },
    "limited views": {
        "sensor": {**SENSOR, "fov_deg": 200.0, "boresight_deg": -60.0},
        "landmarks_m": [*LANDMARKS, [35.0, -40.0]],
    },
}

GRID = 180
ZOOMS, ZOOMED, NARROWER = 3, 9, 5.0


@dataclass(frozen=True, slots=True)
class Seen:
    """A problem and what was measured of it on the grid: moves that violate nothing."""

    problem: RefineProblem
    before: Measurement
    moves: list[float]
    measured: list[Measurement]

    def best(self, objective: str) -> tuple[float, float]:
        """Return the move of the least cost, and that cost."""
        costs = [one.figures.cost(objective) for one in self.measured]
        k = int(np.argmin(costs))
        return self.moves[k], costs[k]

    def look(self, moves: Array) -> None:
        """Measure the plan with the second phase moved."""
        for move in moves:
            circles = circles_of(self.problem.orbits)
            circles[3, 1] += move
            orbits = orbits_of(circles, self.problem.orbits)
            if not measure(self.problem, orbits, predict=False).violations(self.before):
                self.moves.append(float(move))
                self.measured.append(measure(self.problem, orbits))


def _looked_at(given: Plan) -> Seen:
    problem = problem_of(given, options_for(given.scenario, None, {"vary": ["phases"]}))
    seen = Seen(problem, measure(problem, given.orbits), [], [])
    seen.look(np.arange(GRID) * 2.0 * np.pi / GRID)
    return seen


def _zoomed(seen: Seen, objective: str) -> float:
    """The least cost after narrowing the grid about the best of it."""
    reach = 2.0 * np.pi / GRID
    for _ in range(ZOOMS):
        middle, _ = seen.best(objective)
        seen.look(middle + reach * np.linspace(-1.0, 1.0, ZOOMED))
        reach /= NARROWER
    return seen.best(objective)[1]


@pytest.mark.long
@pytest.mark.parametrize("name", SCENARIOS)
def test_no_phases_on_a_fine_grid_are_better_than_the_refined_ones(name: str) -> None:
    given = plan(
        small(**{"landmarks_m": LANDMARKS, "sensor": SENSOR, "duration_s": 90.0, **SCENARIOS[name]})
    )
    seen = _looked_at(given)
    for objective in OBJECTIVES:
        refined = refine(given, objective=objective, vary=["phases"], workers=1)
        least = _zoomed(seen, objective)
        size = float(3 * given.orbits.count) if objective == "logdet" else abs(least)
        assert record_of(refined).after.cost(objective) - least <= 0.01 * size, objective
