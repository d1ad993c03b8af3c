"""Pairs, phases only: the refined plan against every phase there is, on a fine grid."""

from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.problem import circles_of, orbits_of
from syncplan.scenario.objectives import OBJECTIVES
from tests.tools.on_paper import plan, refine
from tests.tools.scenarios import circling, small
from tests.tools.smooth_problems import posed, record_of

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

GRID = 120
ZOOMS, ZOOMED, NARROWER = 3, 9, 5.0


@pytest.mark.long
@pytest.mark.parametrize("name", SCENARIOS)
def test_no_phases_on_a_fine_grid_are_better_than_the_refined_ones(name: str) -> None:
    given = plan(
        small(**{"landmarks_m": LANDMARKS, "sensor": SENSOR, "duration_s": 90.0, **SCENARIOS[name]})
    )
    problem = posed(given, vary=["phases"])
    before = measure(problem, given.orbits)
    seen: dict[float, Measurement] = {}

    def look(moves: Array) -> None:
        """Measure the plan with the second phase moved, where that violates nothing."""
        for move in moves.tolist():
            circles = circles_of(problem.orbits)
            circles[3, 1] += move
            found = measure(problem, orbits_of(circles, problem.orbits))
            if not found.violations(before):
                seen[move] = found

    look(np.arange(GRID) * 2.0 * np.pi / GRID)
    for objective in OBJECTIVES:
        refined = refine(
            given, objective=objective, vary=["phases"], workers=1, time_limit_s=3600.0
        )
        reach = 2.0 * np.pi / GRID
        for _ in range(ZOOMS):
            middle = min(seen, key=lambda move: seen[move].figures.cost(objective))
            look(middle + reach * np.linspace(-1.0, 1.0, ZOOMED))
            reach /= NARROWER
        least = min(one.figures.cost(objective) for one in seen.values())
        size = float(3 * given.orbits.count) if objective == "logdet" else abs(least)
        assert record_of(refined).after.cost(objective) - least <= 0.01 * size, objective
