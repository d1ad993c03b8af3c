"""How long the losses of a team take to judge, and what single points of failure add to a plan.

Every loss of one vehicle, sensor or landmark of a grid of 50 vehicles with four landmarks, bounds
over 200 s included, on two threads; the filter's kernels are compiled before. Then the search for
single points of failure that every plan makes, of the paper's grid and of the 50 vehicles.

    python benchmarks/losses.py
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.observability.loss_ranks import decisive_losses
from syncplan.observability.rank import assess_team
from syncplan.orbits.sightings import single_losses
from syncplan.planning.loss_study import what_if
from syncplan.planning.planner import plan
from syncplan.planning.plans import Plan
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.loading import load_scenario, scenario_from

EXAMPLES = Path(__file__).resolve().parents[1] / "examples" / "scenarios"
THREADS = 2
REPEATS = 5

STUDY_TARGET_S = 10.0
SEARCH_TARGETS_S = {6: 0.005, 50: 0.15}


def main() -> dict[str, float]:
    """Return the times in s: of the study, and of the search by number of vehicles."""
    grid, large = plan(load_scenario(EXAMPLES / "paper-grid-same.yaml")), plan(_large())
    what_if(grid, threads=THREADS)
    return {
        "losses": float(len(single_losses(large.team))),
        "study": _time(lambda: what_if(large, threads=THREADS), 1),
        "search 6": _search_time(grid),
        "search 50": _search_time(large),
    }


@single_threaded_blas
def _search_time(judged: Plan) -> float:
    assessed = assess_team(judged.team, judged.scenario.window)
    losses = single_losses(judged.team)
    return _time(lambda: decisive_losses(assessed, losses), REPEATS)


def _time(work: Callable[[], Any], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def _large() -> Any:
    return scenario_from(
        {
            "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2},
            "formation": {"shape": "grid", "count": 50, "columns": 10, "spacing_m": 70.0},
            "landmarks_m": [[-50.0, 0.0], [680.0, 0.0], [-50.0, 280.0], [680.0, 280.0]],
            "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
            "duration_s": 200.0,
        }
    )


def figures(result: dict[str, float]) -> list[Figure]:
    """Return the rows of the table."""
    rows = [
        Figure(
            f"what-if, all {result['losses']:.0f} single losses of 50 vehicles, {THREADS} threads",
            result["study"],
            "s",
            STUDY_TARGET_S,
        )
    ]
    for count, target in SEARCH_TARGETS_S.items():
        what = f"single points of failure, {count} vehicles"
        rows.append(Figure(what, result[f"search {count}"], "s", target))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
