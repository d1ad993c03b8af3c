"""Designs beside a simple search of each team: 200 random formations, then 600 changes of the best.

The fronts of six briefs, the examples and those of `tests/data/briefs`, effort quick, beside that
simple search: worst predicted errors on the coarse grid. Then all searches of one team, effort
thorough, from three seeds, beside the least error that any search of it has found. Last whole
designs of the three examples: the time until a first formation without a fault is found, and until
the end.

    python benchmarks/designs.py
"""

import statistics
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.designs.candidates import UNFIT
from syncplan.designs.cell_search import BestCandidate
from syncplan.designs.designer import design
from syncplan.designs.ladder import DesignState, Ladder
from syncplan.runtime.machine import single_threaded_blas, usable_cores
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.brief import Brief, brief_of
from tests.tools.fronts import simple_search, worsened

ROOT = Path(__file__).resolve().parents[1]
BRIEFS = sorted((ROOT / "examples" / "briefs").glob("*.yaml"))
FRONTS = BRIEFS + sorted((ROOT / "tests" / "data" / "briefs").glob("*.yaml"))

FIRST_TARGET_S, TARGET_S, WORST_SHARE = 10.0, 180.0, 103.0

TEAM = {
    "area_m": [[0.0, 0.0], [300.0, 0.0], [300.0, 200.0], [0.0, 200.0]],
    "vehicle": {"speed_mps": 5.0, "min_radius_m": 15.0},
    "sensor": {"range_m": 80.0, "bearing_sigma_rad": 0.03, "sample_time_s": 0.1},
    "motion": {"position_random_walk_m_sqrt_s": 0.03, "angle_random_walk_rad_sqrt_s": 0.003},
    "team": {"min": 4, "max": 4},
    "landmarks": {"max": 2},
    "purpose": {"cover": {"share": 0.9, "swath_m": 60.0}},
    "need": {"worst_rms_m": 0.2},
    "effort": "thorough",
}
SEEDS, LEAST_KNOWN_M, CELL_TARGET_S = 3, 0.226, 90.0
"""Number of seeds, least error that a search of TEAM has found, and the time aimed at."""

Fronts = dict[str, tuple[list[float], int]]
Result = tuple[Fronts, list[tuple[float, float]], dict[str, tuple[float, float, int]]]


def front_of(brief: Brief) -> list[BestCandidate]:
    """Return the front that the searches of a brief find."""
    return Ladder(brief, usable_cores(), lambda _state: None, EarlierSearch()).search_all()


@single_threaded_blas
def shares() -> Fronts:
    """Return errors of each brief's front in % of a simple search's, and how many teams worsen."""
    by_brief = {}
    for path in FRONTS:
        brief = brief_of(path).model_copy(update={"effort": "quick"})
        front = front_of(brief)
        pairs = [(team.value, simple_search(brief, team.cell)) for team in front]
        errors = [100.0 * ours / simple for ours, simple in pairs if max(ours, simple) < UNFIT]
        by_brief[path.stem] = errors, len(worsened(front))
    return by_brief


def spread() -> list[tuple[float, float]]:
    """Return the least error found for the team of TEAM, and s, for each seed."""
    rows = []
    for seed in range(SEEDS):
        began = time.perf_counter()
        brief = brief_of({**TEAM, "seed": seed})
        (team,) = front_of(brief)
        rows.append((team.value, time.perf_counter() - began))
    return rows


def times(path: Path) -> tuple[float, float, int]:
    """Return s until a formation without a fault and until the end of a design, and its cells."""
    began, first = time.perf_counter(), [float("inf")]

    def progress(state: DesignState) -> None:
        if any(team.fits for team in state.front):
            first[0] = min(first[0], time.perf_counter() - began)

    designed = design(path, progress=progress)
    return first[0], time.perf_counter() - began, len(designed.front)


def main() -> Result:
    """Return the shares of each front, errors of one team by seed, and the times of each design."""
    return shares(), spread(), {path.stem: times(path) for path in BRIEFS}


def figures(result: Result) -> list[Figure]:
    """Return the rows of the table."""
    fronts, seeds, designs = result
    rows = []
    for name, (errors, _) in fronts.items():
        if errors:
            label = f"front, {name}: errors beside a simple search, median of {len(errors)} teams"
            rows.append(Figure(label, statistics.median(errors), "%"))
            rows.append(Figure("  the largest", max(errors), "%", WORST_SHARE))
    every = [error for errors, _ in fronts.values() for error in errors]
    rows.append(
        Figure(f"all {len(every)} teams, geometric mean", statistics.geometric_mean(every), "%")
    )
    rows.append(Figure("  worse by over 3 %", sum(error > WORST_SHARE for error in every), "", 1.0))
    worse = sum(count for _, count in fronts.values())
    rows.append(Figure("  worse than a smaller team", worse, "", 1.0))
    for seed, (value, seconds) in enumerate(seeds):
        rows.append(Figure(f"least error of a team, seed {seed}", value, "m", 1.1 * LEAST_KNOWN_M))
        rows.append(Figure("  time of its searches", seconds, "s", CELL_TARGET_S))
    for name, (first, whole, cells) in designs.items():
        rows.append(Figure(f"design, {name}: first formation", first, "s", FIRST_TARGET_S))
        rows.append(Figure(f"  whole, {cells} teams", whole, "s", TARGET_S))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
