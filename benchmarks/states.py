"""How long the posterior bound takes with errors beside the poses as states.

Processor time of the bound with its start-up index on grids of 6, 12 and 24 vehicles over 2,000
samples: poses alone, wind, every error there is, and what errors cost that the filter leaves out.

    python benchmarks/states.py
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.grids import grid_scenario
from syncplan.estimation.bounds import posterior_bound
from syncplan.estimation.considered_errors import expected_errors
from syncplan.estimation.referred_system import PosteriorBound
from syncplan.orbits.contacts import Windows
from syncplan.orbits.error_states import ERROR_STATES
from syncplan.orbits.team import Team
from syncplan.planning.planner import plan
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.loading import scenario_from

COUNTS = (6, 12, 24)
"""Vehicles of each grid."""

DURATION_S, STEPS, REPEATS = 200.0, 2000, 5

TARGET_S = 1.0
"""Of six vehicles with every error there is."""

LABELS = {
    "poses": "posterior bound, poses alone",
    "wind": "posterior bound, wind as states",
    "all": "posterior bound, every error as states",
    "neglected": "cost of every error, all left out",
}


def _scenario(count: int) -> dict[str, Any]:
    shared = grid_scenario(count)
    return {
        **shared,
        "sensor": {**shared["sensor"], "bearing_bias_sigma_rad": 0.02},
        "motion": {"speed_scale_sigma": 0.02, "turn_rate_bias_sigma_rad_s": 0.005},
        "wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2},
        "duration_s": DURATION_S,
    }


def _works(team: Team, windows: Windows) -> dict[str, Callable[[], PosteriorBound]]:
    def estimating(names: tuple[str, ...]) -> Team:
        return replace(team, errors=replace(team.errors, estimated=names))

    def bound(names: tuple[str, ...]) -> PosteriorBound:
        return posterior_bound(estimating(names), windows, DURATION_S, start_up=True)

    return {
        "poses": lambda: bound(()),
        "wind": lambda: bound(("wind",)),
        "all": lambda: bound(tuple(ERROR_STATES)),
        "neglected": lambda: expected_errors(estimating(()), windows, DURATION_S),
    }


@single_threaded_blas
def main() -> dict[tuple[int, str], float]:
    """Return the least s of each work by vehicles and name."""
    found: dict[tuple[int, str], float] = {}
    for count in COUNTS:
        made = plan(scenario_from(_scenario(count)), bound="never")
        works = _works(made.team, made.windows)
        for name, work in works.items():
            work()
            times = []
            for _ in range(REPEATS):
                began = time.process_time()
                work()
                times.append(time.process_time() - began)
            found[count, name] = min(times)
    return found


def figures(result: dict[tuple[int, str], float]) -> list[Figure]:
    """Return the rows of the table: times of each recursion."""
    return [
        Figure(
            f"{LABELS[name]}, {count} vehicles",
            seconds,
            "s",
            TARGET_S if (count, name) == (6, "all") else None,
        )
        for (count, name), seconds in result.items()
    ]


if __name__ == "__main__":
    print_figures(figures(main()))
