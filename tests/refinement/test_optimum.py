"""Small teams, phases only: the refined plan against every phase there is, on a fine grid."""

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

LANDMARKS = [[0.0, 45.0], [70.0, -40.0]]


def _pair(directions: Any, **changes: Any) -> dict[str, Any]:
    document: dict[str, Any] = {
        "orbit": circling(direction=directions),
        "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
        "landmarks_m": LANDMARKS,
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.3},
        "duration_s": 90.0,
    }
    document.update(changes)
    return document


SCENARIOS: dict[str, dict[str, Any]] = {
    "same sense": _pair("ccw"),
    "opposite senses": _pair(["ccw", "cw"]),
    "opposite senses, unequal radii": _pair(
        ["cw", "ccw"],
        orbit=circling(radius_m=[17.0, 23.0], direction=["cw", "ccw"]),
        min_separation_m=12.0,
    ),
    "limited views": _pair(
        "ccw",
        sensor={
            "range_m": 50.0,
            "fov_deg": 200.0,
            "boresight_deg": -60.0,
            "bearing_sigma_rad": 0.1,
            "sample_time_s": 0.3,
        },
        landmarks_m=[[0.0, 45.0], [70.0, -40.0], [35.0, -40.0]],
    ),
    "unequal ranges": _pair(
        "ccw",
        sensor=[
            {"range_m": reach, "bearing_sigma_rad": sigma, "sample_time_s": 0.3}
            for reach, sigma in ((50.0, 0.1), (40.0, 0.05))
        ],
    ),
    "three of one sense": _pair(
        "ccw",
        formation={"centers_m": [[0.0, 0.0], [70.0, 0.0], [35.0, 60.0]]},
    ),
    "three of both senses": _pair(
        ["ccw", "cw", "ccw"],
        orbit=circling(radius_m=[20.0, 18.0, 22.0], direction=["ccw", "cw", "ccw"]),
        formation={"centers_m": [[0.0, 0.0], [68.0, 10.0], [140.0, -5.0]]},
        landmarks_m=[[0.0, 45.0], [35.0, -30.0]],
    ),
}

IN_SUITE = ("same sense", "opposite senses, unequal radii", "limited views")
"""The others take minutes: `python -m tests.refinement.test_optimum` shows the gaps of all."""

GRID = {2: 360, 3: 48}
ZOOMS, ZOOMED, NARROWER = 3, 9, 5.0


@dataclass(frozen=True, slots=True)
class Seen:
    """A problem and what was measured of it on the grid: moves that violate nothing."""

    problem: RefineProblem
    before: Measurement
    moves: list[Array]
    measured: list[Measurement]

    def best(self, objective: str) -> tuple[Array, float]:
        """Return the moves of the least cost, and that cost."""
        costs = [one.figures.cost(objective) for one in self.measured]
        k = int(np.argmin(costs))
        return self.moves[k], costs[k]

    def look(self, moves: list[Array]) -> None:
        """Measure the plan with all phases but the first one moved."""
        for move in moves:
            circles = circles_of(self.problem.orbits)
            circles[3, 1:] += move
            orbits = orbits_of(circles, self.problem.orbits)
            if not measure(self.problem, orbits, predict=False).violations(self.before):
                self.moves.append(move)
                self.measured.append(measure(self.problem, orbits))


def _looked_at(given: Plan) -> Seen:
    problem = problem_of(given, options_for(given.scenario, None, {"vary": ["phases"]}))
    others = given.orbits.count - 1
    angles = 2.0 * np.pi * np.arange(GRID[others + 1]) / GRID[others + 1]
    seen = Seen(problem, measure(problem, given.orbits), [], [])
    seen.look([np.zeros(others)])
    seen.look(list(np.stack(np.meshgrid(*[angles] * others), axis=-1).reshape(-1, others)))
    return seen


def _zoomed(seen: Seen, objective: str) -> float:
    """The least cost after narrowing the grid about the best of it."""
    others = seen.problem.orbits.count - 1
    reach = 2.0 * np.pi / GRID[others + 1]
    for _ in range(ZOOMS):
        middle, _ = seen.best(objective)
        steps = reach * np.linspace(-1.0, 1.0, ZOOMED)
        around = np.stack(np.meshgrid(*[steps] * others), axis=-1).reshape(-1, others)
        seen.look(list(middle + around))
        reach /= NARROWER
    return seen.best(objective)[1]


def gaps(name: str) -> dict[str, float]:
    """Return by what share the grid's best figure beats the refined one, for each objective."""
    given = plan(small(**SCENARIOS[name]))
    seen = _looked_at(given)
    found: dict[str, float] = {}
    for objective in OBJECTIVES:
        refined = refine(given, objective=objective, vary=["phases"], workers=1)
        assert refined.refinement is not None
        reached = refined.refinement.after.cost(objective)
        least = _zoomed(seen, objective)
        size = float(3 * given.orbits.count) if objective == "logdet" else abs(least)
        found[objective] = (reached - least) / size
    return found


@pytest.mark.long
@pytest.mark.parametrize("name", IN_SUITE)
def test_no_phases_on_a_fine_grid_are_better_than_the_refined_ones(name: str) -> None:
    for objective, gap in gaps(name).items():
        assert gap <= 0.01, objective


if __name__ == "__main__":
    for scenario in SCENARIOS:
        shares = ", ".join(f"{key} {100.0 * gap:.3f} %" for key, gap in gaps(scenario).items())
        print(f"{scenario}: {shares}", flush=True)
