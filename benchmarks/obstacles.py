"""What obstacles to sight add to the time of contact windows and of a plan.

Four rovers between shelves, and a grid of 100 vehicles with 20 obstacles, each with and without
them, the two in turn. Bounds, pilots and single points of failure are left out: they see only what
the windows allow.

    python benchmarks/obstacles.py
"""

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import Figure, print_figures
from syncplan.orbits.contacts import find_windows
from syncplan.planning.planner import plan
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.specification import Scenario

COLUMNS, ROWS, SPACING_M = 10, 10, 70.0
OBSTACLES, SIZE_M, SEED = 20, (4.0, 14.0), 3
REPEATS = 5
CASES = ("4 rovers, 1 shelf", "100 vehicles, 20 obstacles")
PLAN_TARGETS_S = {CASES[0]: 1.0, CASES[1]: 10.0}


def shelves() -> dict[str, Any]:
    """Return the scenario of four rovers with a shelf between two of them."""
    return {
        "orbit": {"radius_m": 2.0, "speed_mps": 0.8, "direction": "ccw"},
        "formation": {"centers_m": [[0, 0], [7, 0], [7, 7], [0, 7]]},
        "landmarks_m": [[-3.5, -3.5], [10.5, -3.5]],
        "obstacles_m": [[[-2, 3.2], [3, 3.2], [3, 3.8], [-2, 3.8]]],
        "sensor": {
            "range_m": 6.0,
            "fov_deg": 200.0,
            "bearing_sigma_rad": 0.02,
            "sample_time_s": 0.1,
        },
    }


def grid() -> dict[str, Any]:
    """Return the scenario of a grid with obstacles of five corners between its circles."""
    generator = np.random.default_rng(SEED)
    gaps = generator.permutation(COLUMNS * (ROWS - 1))[:OBSTACLES]
    obstacles = []
    for gap in gaps.tolist():
        # between a vehicle and the one above it
        middle = SPACING_M * np.array([gap % COLUMNS, gap // COLUMNS + 0.5])
        turns = (np.arange(5) + generator.uniform(0.0, 0.8, 5)) * (2.0 * np.pi / 5)
        arms = generator.uniform(*SIZE_M, 5)[:, None]
        corners = middle + arms * np.column_stack([np.cos(turns), np.sin(turns)])
        obstacles.append(corners.tolist())
    return {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2},
        "formation": {
            "shape": "grid",
            "count": COLUMNS * ROWS,
            "columns": COLUMNS,
            "spacing_m": SPACING_M,
        },
        "landmarks_m": [[-50.0, 0.0], [680.0, 0.0], [-50.0, 630.0], [680.0, 630.0]],
        "obstacles_m": obstacles,
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    }


def main(repeats: int = REPEATS) -> dict[str, float]:
    """Return processor times in s by case, of windows and of a plan, with obstacles and without."""
    result: dict[str, float] = {}
    for case, document in zip(CASES, (shelves(), grid()), strict=True):
        free = {key: one for key, one in document.items() if key != "obstacles_m"}
        scenarios = scenario_from(document), scenario_from(free)
        teams = [plan(one, bound="never").team for one in scenarios]
        result[f"{case} windows"], result[f"{case} windows free"] = _in_turn(
            [partial(find_windows, one) for one in teams], repeats
        )
        result[f"{case} plan"], result[f"{case} plan free"] = _in_turn(
            [partial(_planned, one) for one in scenarios], repeats
        )
    return result


def _planned(scenario: Scenario) -> None:
    plan(scenario, bound="never", pilot=False, single_points=False)


def _in_turn(works: Sequence[Callable[[], Any]], repeats: int) -> list[float]:
    """Processor time in s of the fastest call of each, called in turn."""
    fastest = [float("inf") for _ in works]
    for _ in range(repeats):
        for k, work in enumerate(works):
            began = time.process_time()
            work()
            fastest[k] = min(fastest[k], time.process_time() - began)
    return fastest


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table."""
    rows = []
    for case in CASES:
        rows += [
            Figure(f"windows, {case}", result[f"{case} windows"], "s"),
            Figure(f"windows, {case}: without", result[f"{case} windows free"], "s"),
            Figure(f"plan, {case}", result[f"{case} plan"], "s", PLAN_TARGETS_S[case]),
            Figure(f"plan, {case}: without", result[f"{case} plan free"], "s"),
        ]
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
