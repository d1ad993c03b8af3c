"""Designs beside a simple way on the same budget: the best of random formations, then a refinement.

Ten teams of the example briefs, each searched by CMA-ES and by drawing as many formations at
random; both results are refined in the same way and predicted exactly. Then all searches of one
team, effort thorough, from three seeds, beside the least error that any search of it has found.
Last whole designs of the three briefs: the time until a first formation without a fault is found,
and until the end.

    python benchmarks/designs.py
"""

import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.designs.candidates import Cell, Space
from syncplan.designs.cell_search import Found, search
from syncplan.designs.designer import design
from syncplan.designs.judgement import refined
from syncplan.designs.ladder import DesignState, Ladder
from syncplan.runtime.machine import single_threaded_blas, usable_cores
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.brief import brief_of

ROOT = Path(__file__).resolve().parents[1]
BRIEFS = sorted((ROOT / "examples" / "briefs").glob("*.yaml"))

CELLS = {
    "multirotors-over-a-field": (Cell(3, 2), Cell(4, 2), Cell(4, 3), Cell(5, 3)),
    "aircraft-in-a-corridor": (Cell(4, 2), Cell(4, 3), Cell(5, 2)),
    "rovers-between-shelves": (Cell(5, 2), Cell(5, 3), Cell(5, 4)),
}
EVALUATIONS = 3000
FIRST_TARGET_S, TARGET_S, SHARE_TARGET = 10.0, 180.0, 80.0

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
SEEDS, LEAST_KNOWN_M, CELL_TARGET_S = 3, 0.233, 90.0
"""Number of seeds, least error that a search of TEAM has found, and the time aimed at."""

Result = tuple[
    list[tuple[str, float, float]], list[tuple[float, float]], dict[str, tuple[float, float, int]]
]


def at_random(space: Space, evaluations: int) -> Found:
    """Return the best of so many random candidates."""
    generator = np.random.default_rng(0)
    points = generator.uniform(0.0, 1.0, (evaluations, space.size))
    values = [space.value(point) for point in points]
    best = int(np.argmin(values))
    return Found(points[best], values[best], evaluations)


def error(space: Space, found: Found) -> float:
    """Return the worst predicted error in m of a refined formation, inf if it has faults."""
    if not found.fits:
        return float("inf")
    rms = refined(space, space.plan(found.point)).prediction.rms
    return float("inf") if rms is None else float(rms.max())


@single_threaded_blas
def gains() -> list[tuple[str, float, float]]:
    """Return the name of each team, its error by CMA-ES and that of random formations."""
    rows = []
    for path in BRIEFS:
        brief = brief_of(path)
        for cell in CELLS[path.stem]:
            space = Space(brief, cell)
            ours = error(space, search(space, EVALUATIONS, (0,)))
            theirs = error(space, at_random(space, EVALUATIONS))
            name = f"{path.stem}, {cell.vehicles} and {cell.landmarks}"
            rows.append((name, ours, theirs))
    return rows


def spread() -> list[tuple[float, float]]:
    """Return the least error found for the team of TEAM, and s, for each seed."""
    rows = []
    for seed in range(SEEDS):
        began = time.perf_counter()
        brief = brief_of({**TEAM, "seed": seed})
        ladder = Ladder(brief, usable_cores(), lambda _state: None, EarlierSearch())
        (cell,) = ladder.search_all()
        rows.append((cell.found.value, time.perf_counter() - began))
    return rows


def times(path: Path) -> tuple[float, float, int]:
    """Return s until a formation without a fault and until the end of a design, and its cells."""
    began, first = time.perf_counter(), [float("inf")]

    def progress(state: DesignState) -> None:
        if any(one.found.fits for one in state.front):
            first[0] = min(first[0], time.perf_counter() - began)

    found = design(path, progress=progress)
    return first[0], time.perf_counter() - began, len(found.front)


def main() -> Result:
    """Return the errors of each team, those of one team by seed, and the times of each design."""
    return gains(), spread(), {path.stem: times(path) for path in BRIEFS}


def figures(result: Result) -> list[Figure]:
    """Return the rows of the table."""
    errors, seeds, designs = result
    rows = []
    for name, ours, theirs in errors:
        rows.append(Figure(f"worst error, {name}", ours, "m"))
        rows.append(Figure("  of random formations, refined", theirs, "m"))
    shares = [100.0 * ours / theirs for _, ours, theirs in errors]
    rows.append(Figure("  of these, median", statistics.median(shares), "%", SHARE_TARGET))
    for seed, (value, seconds) in enumerate(seeds):
        rows.append(Figure(f"least error of a team, seed {seed}", value, "m", 1.1 * LEAST_KNOWN_M))
        rows.append(Figure("  time of its searches", seconds, "s", CELL_TARGET_S))
    for name, (first, whole, cells) in designs.items():
        rows.append(Figure(f"design, {name}: first formation", first, "s", FIRST_TARGET_S))
        rows.append(Figure(f"  whole, {cells} teams", whole, "s", TARGET_S))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
