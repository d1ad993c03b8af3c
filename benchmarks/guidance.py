"""How long guidance takes a decision for a team of six, and how soon vehicles are back in phase.

Two decisions a second of guidance `mpc` for the paper's grid: with estimates off by 0.5 m and
0.02 rad, new at each decision, which is rougher than any filter's, and while a vehicle that was
held returns. The median over decisions, in wall time on one thread; the solver's time is that of
OSQP itself (its updates of data and factors, and iterations), and set-up is all else. One program
for the whole team, its vehicles' side by side in blocks, is solved for comparison; both sides have
to agree. Then seconds from the end of a hold of 20 s until the phase stays within 1 s, by guidance
`track` and by `mpc`, with perfect estimates.

    python benchmarks/guidance.py
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from syncplan.arrays import Array, Flags
from syncplan.guidance.predictive_guidance import (
    RHO,
    SETTINGS,
    PredictiveGuidance,
    PredictiveOptions,
    ProgramSolver,
    Solution,
)
from syncplan.guidance.predictive_program import Program
from tests.tools.exact_flights import (
    Guidance,
    Hold,
    fly,
    narrow,
    paper_grid,
    predictive,
    tracking,
)

HOLD = Hold(vehicle=1, time=100.0, length=20.0)
BEGIN, END, SAMPLES = 90.0, 190.0, 5
SIGMA = (0.5, 0.5, 0.02)
ROUNDS = 3

LIMITS = {"0 to 8 m/s, 0.8 rad/s": (0.0, 8.0, 0.8), "2 to 6 m/s, 0.8 rad/s": (2.0, 6.0, 0.8)}

MOST_SETUP, MOST_SOLVER, LEAST_SOONER = 1e-3, 1.5e-3, 1.0 / 0.7
"""s a decision of the team; times as soon as with `track`."""

AGREED = 0.02
"""Most difference of changes of both sides, in units of the plan's speed and rate."""


@dataclass(frozen=True, slots=True)
class Times:
    """Medians over decisions, in s: of set-up, of the solver, of one program for the team."""

    setup: float
    solver: float
    blocks: float | None = None


class _Timed:
    """A solver that adds up the time it takes; and the team's programs at each decision."""

    def __init__(self, inside: ProgramSolver) -> None:
        self.inside, self.seconds = inside, 0.0
        self.programs: list[tuple[Program, Array, Solution]] = []

    def solve(self, program: Program, multipliers: Array) -> Solution:
        kept = Program(*(part.copy() for part in program))
        began = time.perf_counter()
        found = self.inside.solve(program, multipliers)
        self.seconds += time.perf_counter() - began
        self.programs.append((kept, multipliers.copy(), found))
        return found


def _timed(noisy: bool) -> Times:
    orbits, limits = paper_grid()
    generator = np.random.default_rng(1)
    guidance: Any = PredictiveGuidance(orbits, limits)
    timed = guidance._free = _Timed(guidance._free)
    team = _Team(orbits.count)
    setup, solver, blocks = [], [], []
    still = np.zeros((orbits.count, 2))

    def guide(now: float, poses: Array, before: Array, held: Flags) -> Array:
        estimates = poses + noisy * generator.normal(size=poses.shape) * SIGMA
        timed.seconds, timed.programs = 0.0, []
        began = time.perf_counter()
        found = guidance.decide(now, estimates, still, before, held)
        whole = time.perf_counter() - began
        setup.append(whole - timed.seconds)
        solver.append(timed.seconds)
        if noisy:
            blocks.append(team.seconds(timed.programs))
        commands: Array = found.commands
        return commands

    fly(orbits, limits, guide, SAMPLES, BEGIN, END, None if noisy else HOLD)
    medians = [float(np.median(times)) for times in (setup, solver, blocks) if times]
    return Times(*medians)


class _Team:
    """One program of the whole team, without separation, a block for each vehicle."""

    def __init__(self, count: int) -> None:
        from osqp import OSQP
        from scipy.sparse import block_diag, csc_matrix

        steps = PredictiveOptions().steps
        self.entries, self.size, self.rows = steps * (2 * steps + 1), 2 * steps, 4 * steps
        hessian = csc_matrix(np.triu(np.ones((self.size, self.size))))
        rows = csc_matrix(block_diag([ProgramSolver(steps).pattern] * count))
        rows.sort_indices()
        none = np.zeros(count * self.rows)
        self.solver: Any = OSQP()
        hessians = csc_matrix(block_diag([hessian] * count))
        start = np.zeros(count * self.size)
        settings = {**SETTINGS, "rho": RHO}
        self.solver.setup(hessians, start, rows, none - 1.0, none + 1.0, **settings)
        self.start = start

    def seconds(self, programs: list[tuple[Program, Array, Solution]]) -> float:
        """Return how long the programs take as one. Raises RuntimeError where changes differ."""
        began = time.perf_counter()
        self.solver.update(
            q=np.concatenate([one.gradient[: self.size] for one, _, _ in programs]),
            l=np.concatenate([one.lower[: self.rows] for one, _, _ in programs]),
            u=np.concatenate([one.upper[: self.rows] for one, _, _ in programs]),
            Px=np.concatenate([one.hessian[: self.entries] for one, _, _ in programs]),
        )
        self.solver.warm_start(self.start, np.concatenate([y for _, y, _ in programs]))
        found = self.solver.solve(raise_error=False)
        seconds = time.perf_counter() - began
        off = np.abs(found.x - np.concatenate([one.change for _, _, one in programs])).max()
        if off > AGREED:
            raise RuntimeError(f"one program for the team: changes {off:.3f} off the vehicles' own")
        return seconds


def _back(name: str, guidance: str) -> float:
    """S until vehicle 1 is back in phase."""
    orbits, limits = paper_grid()
    limits = narrow(limits, *LIMITS[name])
    laws: dict[str, tuple[Guidance, int]] = {
        "track": (tracking(orbits, limits), 1),
        "mpc": (predictive(PredictiveGuidance(orbits, limits)), SAMPLES),
    }
    return fly(orbits, limits, *laws[guidance], BEGIN, END, HOLD).back_after(HOLD)


def main(rounds: int = ROUNDS) -> dict[str, Any]:
    """Return Times of rough estimates and of a return, and s until back in phase by limits."""
    found: dict[str, Any] = {}
    for label, noisy in (("rough", True), ("return", False)):
        timed = [_timed(noisy) for _ in range(rounds + 1)][1:]  # the first compiles
        found[label] = min(timed, key=lambda one: one.setup + one.solver)
    for name in LIMITS:
        found[name] = {guidance: _back(name, guidance) for guidance in ("track", "mpc")}
    return found


def figures(result: dict[str, Any]) -> list[Figure]:
    """Return the rows of the table."""
    rows = []
    for label, text in (("return", "a held vehicle returns"), ("rough", "rough estimates")):
        times: Times = result[label]
        name = f"Guidance mpc, a decision for 6 vehicles, {text}"
        rows.append(Figure(f"{name}: set-up", times.setup, "s", MOST_SETUP))
        rows.append(Figure(f"{name}: solver", times.solver, "s", MOST_SOLVER))
        if times.blocks is not None:
            rows.append(Figure("  as one program for the team", times.blocks, "s"))
    for name in LIMITS:
        seconds = result[name]
        rows.append(Figure(f"Back in phase after a hold of 20 s, {name}: mpc", seconds["mpc"], "s"))
        sooner = seconds["track"] / seconds["mpc"]
        rows.append(Figure("  track", seconds["track"], "s"))
        rows.append(Figure("  times as soon", sooner, "x", LEAST_SOONER))
    return rows


if __name__ == "__main__":
    print_figures(figures(main()))
