"""Refinement for logdet beside SciPy's solvers, and how its time and memory grow with the team.

Side by side: centres may move 5 m each way, phases turn freely, least distances are 10 m and every
contact is kept. syncplan's IPOPT starts from the plan, once. SciPy's SLSQP and trust-constr are
given the same variables, bounds, weights and constraints as a cost written for speed in NumPy (see
vectorised_team.py; that it is the same function is checked before anything is timed), whose
derivatives they take by finite differences. All are judged by the exact log det of what they found.

Growth: whole processes of `python -m syncplan refine` on grids of 6 to 50 vehicles.

    python benchmarks/refinement.py
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import BFGS, Bounds, NonlinearConstraint, OptimizeResult, minimize

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import Figure, print_figures
from benchmarks.sides import metered
from benchmarks.vectorised_team import VectorisedTeam
from syncplan.arrays import Array
from syncplan.planning.planner import plan
from syncplan.refinement.ipopt import StagedSolver
from syncplan.refinement.measures import Measurement, measure
from syncplan.refinement.nlp import nlp_of
from syncplan.refinement.problem import RefineProblem, Stage, circles_of, orbits_of, stages_of
from syncplan.refinement.problem_setup import problem_of
from syncplan.refinement.refiner import options_for
from syncplan.runtime.machine import single_threaded_blas
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.objectives import OBJECTIVES

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = {6: 3, 12: 4, 24: 6, 50: 10}
COMPARED = (6, 12, 24)
RATIO_TARGET = 5.0
AGREEMENT = 1e-9
CAP_S = {6: 45.0, 12: 30.0, 24: 30.0}
"""After these seconds SciPy's solvers are stopped at the end of an iteration."""

EQUAL = 0.05
"""Differences of log det, in nats, that count as none: 0.1 % of each deviation at 6 vehicles."""


def document(count: int) -> dict[str, Any]:
    """Return the scenario of a grid with four landmarks beside it, none of them an obstacle."""
    columns = COLUMNS[count]
    rows, width = -(-count // columns), 70 * (columns - 1)
    return {
        "name": f"grid-{count}",
        "formation": {"shape": "grid", "count": count, "columns": columns, "spacing_m": 70},
        "orbit": {"radius_m": 20, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        "landmarks_m": [
            [width + 50, 0],
            [width + 50, 70],
            [-50, 70 * (rows - 1)],
            [width / 2, -45],
        ],
        "sensor": {"range_m": 50, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
        "initial_sigma": {"position_m": 5, "heading_rad": 0.1},
        "min_separation_m": 10,
        "landmark_clearance_m": 0,
        "duration_s": 200,
    }


def paper_grid() -> dict[str, Any]:
    """Return paper-grid-same with a least distance."""
    centers = [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]
    links = [(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 1), (2, 5)]
    return document(6) | {
        "name": "paper-grid-same",
        "formation": {"centers_m": centers, "links": [[f"v{a}", f"v{b}"] for a, b in links]},
        "landmarks_m": [[190, 0], [190, 70]],
    }


# --- side by side --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one solver came to.

    Attributes
    ----------
    seconds : from the plan's circles to those found
    logdet : exact, of the best circles of any stage that violate nothing the plan met
    iterations : in all stages
    capped : whether time ran out
    """

    seconds: float
    logdet: float
    iterations: int
    capped: bool


@dataclass(frozen=True, slots=True)
class Posed:
    """A problem, and the exact measurement of the plan it starts from."""

    problem: RefineProblem
    before: Measurement

    @classmethod
    def of(cls, scenario: dict[str, Any]) -> "Posed":
        """Return the problem that `refine` poses itself."""
        given = plan(scenario_from(scenario))
        options = options_for(given.scenario, None, {"objective": "logdet", "starts": 1})
        problem = problem_of(given, options)
        return cls(problem, measure(problem, given.orbits, predict=False))

    def best(self, candidates: list[Array]) -> float:
        """Return the largest exact log det of candidates (4, n) that violate nothing."""
        logdets = [self.before.figures.logdet]
        for circles in candidates:
            after = measure(self.problem, orbits_of(circles, self.problem.orbits), predict=False)
            if not after.violations(self.before):
                logdets.append(after.figures.logdet)
        return max(logdets)


def check_agreement(posed: Posed) -> float:
    """Return the largest relative difference of both costs and constraints at random points.

    Raises RuntimeError where it is above AGREEMENT: there is nothing to compare then.
    """
    random, worst = np.random.default_rng(0), 0.0
    for stage in stages_of(posed.problem):
        program, team = nlp_of(posed.problem, stage), VectorisedTeam.of(posed.problem, stage)
        circles = circles_of(posed.problem.orbits)
        given, sides = program.variables_of(circles), program.sides_of(circles)
        for _ in range(10):
            shift = 0.1 * random.standard_normal(program.size)
            x = np.clip(given + shift, program.lower, program.upper)
            theirs, constraints = program.values(x, sides)
            expected = np.append(
                float(theirs), np.array(constraints).ravel() - program.constraint_lower
            )
            found = np.append(team.cost(x), team.room(x))
            worst = max(worst, float(np.abs(found / expected - 1.0).max()))
    if not worst <= AGREEMENT:
        raise RuntimeError(f"the two costs differ by {worst:.1e}: nothing to compare")
    return worst


def by_ipopt(posed: Posed) -> tuple[Outcome, Outcome]:
    """Return what syncplan comes to with a first start, and with a further one.

    Building the expressions counts for the first; they serve all starts of a refinement.
    """
    outcomes = []
    begin = time.perf_counter()
    solver = StagedSolver(posed.problem)
    for _ in range(2):
        run = solver.solve(circles_of(posed.problem.orbits))
        seconds = time.perf_counter() - begin
        outcomes.append(Outcome(seconds, posed.best(list(run.candidates)), run.iterations, False))
        begin = time.perf_counter()
    return outcomes[0], outcomes[1]


class _Clock:
    """Stops a solver of SciPy, at the end of an iteration, when time is up."""

    def __init__(self, cap: float) -> None:
        self.begin, self.cap = time.perf_counter(), cap

    @property
    def seconds(self) -> float:
        return time.perf_counter() - self.begin

    @property
    def over(self) -> bool:
        return self.seconds >= self.cap

    def __call__(self, intermediate_result: OptimizeResult) -> None:
        if self.over:
            raise StopIteration


def _slsqp(team: VectorisedTeam, start: Array, clock: _Clock) -> OptimizeResult:
    """SLSQP with its own tolerance, more iterations than its default of 100."""
    return minimize(
        team.cost,
        start,
        method="SLSQP",
        bounds=Bounds(team.lower, team.upper),
        constraints={"type": "ineq", "fun": team.room},
        callback=clock,
        options={"maxiter": 500},
    )


def _trust_constr(team: VectorisedTeam, start: Array, clock: _Clock) -> OptimizeResult:
    """trust-constr with IPOPT's tolerance: to its own default of 1e-8 it runs on for minutes."""
    return minimize(
        team.cost,
        start,
        method="trust-constr",
        jac="2-point",
        hess=BFGS(),
        bounds=Bounds(team.lower, team.upper),
        constraints=NonlinearConstraint(team.room, 0.0, np.inf, jac="2-point", hess=BFGS()),
        callback=clock,
        options={"gtol": 1e-5, "xtol": 1e-6, "maxiter": 2000},
    )


OURS = "syncplan"

Solver = Callable[[VectorisedTeam, Array, _Clock], OptimizeResult]

SOLVERS: dict[str, tuple[Solver, bool]] = {
    "SLSQP in stages": (_slsqp, True),
    "SLSQP, last stage": (_slsqp, False),
    "trust-constr, last stage": (_trust_constr, False),
}
"""Solver, and whether it goes through syncplan's stages or starts with the last one at once."""


def by_scipy(posed: Posed, solver: Solver, stages: tuple[Stage, ...], cap: float) -> Outcome:
    """Return what a solver of SciPy comes to; setting it up counts."""
    problem = posed.problem
    clock, candidates, iterations = _Clock(cap), [], 0
    unit = np.array([[problem.scale]] * 3 + [[1.0]])
    circles = circles_of(problem.orbits) / unit
    for stage in stages:
        team = VectorisedTeam.of(problem, stage)
        start = np.clip(circles.ravel(order="F")[team.free], team.lower, team.upper)
        found = solver(team, start, clock)
        iterations += int(found.nit)
        circles = team.circles_of(np.clip(found.x, team.lower, team.upper))
        candidates.append(circles * unit)
        if clock.over:
            break
    return Outcome(clock.seconds, posed.best(candidates), iterations, clock.over)


@single_threaded_blas
def compare(count: int) -> tuple[Posed, dict[str, Outcome]]:
    """Return the outcomes of syncplan and of SciPy's solvers for a team of 6, 12 or 24."""
    posed = Posed.of(paper_grid() if count == 6 else document(count))
    check_agreement(posed)
    stages = stages_of(posed.problem)
    runs = [by_ipopt(posed) for _ in range(3)]
    outcomes = {
        name: min((run[k] for run in runs), key=lambda one: one.seconds)
        for k, name in enumerate((OURS, f"{OURS}, a further start"))
    }
    for name, (solver, staged) in SOLVERS.items():
        chosen = stages if staged else stages[-1:]
        outcomes[name] = by_scipy(posed, solver, chosen, CAP_S[count])
    return posed, outcomes


# --- growth --------------------------------------------------------------------------------------

RUNS: dict[str, tuple[int, tuple[str, ...], float | None]] = {
    **{
        f"logdet, one start, {count} vehicles": (
            count,
            ("--objective", "logdet", "--starts", "1"),
            target,
        )
        for count, target in {6: 3.0, 12: None, 24: 20.0, 50: 60.0}.items()
    },
    **{
        f"predicted_rms, one start, {count} vehicles": (
            count,
            ("--objective", "predicted_rms", "--starts", "1"),
            target,
        )
        for count, target in {6: 20.0, 12: None, 24: None}.items()
    },
    "as it comes, 6 vehicles": (6, (), None),
}
"""Vehicles, options, most seconds."""

MEMORY_TARGET_MB = 2048.0


@dataclass(frozen=True, slots=True)
class Process:
    """One process of `syncplan refine`: s, MB at the peak, and the record in its plan."""

    seconds: float
    peak: float
    record: dict[str, Any]

    @property
    def outcome(self) -> str:
        """Iterations, and the objective before and after."""
        objective = OBJECTIVES[self.record["objective"]]
        before, after = (self.record[side][objective.key] for side in ("before", "after"))
        digits = 3 if objective.predicted else 2
        iterations = sum(start["iterations"] for start in self.record["starts"])
        cut = ", cut short" if self.record["cut_short"] else ""
        return f"{iterations} iterations, {before:.{digits}f} to {after:.{digits}f}{cut}"


def measured(count: int, options: tuple[str, ...]) -> Process:
    """Return time and memory of a whole process. Raises RuntimeError if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        scenario, result = Path(folder) / "scenario.yaml", Path(folder) / "plan.json"
        scenario.write_text(json.dumps(document(count)), encoding="utf-8")
        command = [sys.executable, "-m", "syncplan", "refine", str(scenario), *options]
        seconds, peak = metered([*command, "-o", str(result)], ROOT)
        record = json.loads(result.read_text(encoding="utf-8"))["refinement"]
    return Process(seconds, peak, record)


def growth(counts: list[int], values: list[float]) -> float:
    """Return the exponent of a power law through the values, by least squares of logarithms."""
    return float(np.polyfit(np.log(counts), np.log(values), 1)[0])


# --- figures -------------------------------------------------------------------------------------


def compare_figures(count: int, posed: Posed, outcomes: dict[str, Outcome]) -> list[Figure]:
    """Return seconds of all, and by how much syncplan is faster to an equal or better result."""
    label, ours = f"refinement, {count} vehicles", outcomes[OURS]
    before = posed.before.figures.logdet
    shown = []
    for name, one in outcomes.items():
        cut = ", capped" if one.capped else ""
        outcome = f"log det {before:.2f} to {one.logdet:.2f}, {one.iterations} iterations{cut}"
        shown.append(Figure(f"{label}: {name}, {outcome}", one.seconds, "s"))
    for name, one in outcomes.items():
        if not name.startswith(OURS):
            ahead = ours.logdet - one.logdet
            result = f"a result lower by {-ahead:.2f}" if ahead < 0.0 else "a better result"
            result = "an equal result" if abs(ahead) <= EQUAL else result
            what = f"{label}: faster than {name}, to {result}"
            shown.append(Figure(what, one.seconds / ours.seconds, "x", RATIO_TARGET))
    return shown


def growth_figures(processes: dict[str, Process]) -> list[Figure]:
    """Return time and memory of each process, and the exponents of those with `logdet`."""
    shown = []
    for name, one in processes.items():
        shown.append(Figure(f"refine, {name}: {one.outcome}", one.seconds, "s", RUNS[name][2]))
        target = MEMORY_TARGET_MB if name.startswith("logdet") else None
        shown.append(Figure(f"refine, {name}: peak memory", one.peak, "MB", target))
    chosen = [(RUNS[name][0], one) for name, one in processes.items() if name.startswith("logdet")]
    counts = [count for count, _ in chosen]
    for what, values in (
        ("time", [one.seconds for _, one in chosen]),
        ("memory", [one.peak for _, one in chosen]),
    ):
        exponent = growth(counts, values)
        shown.append(Figure(f"refine, logdet, one start: growth of {what}", exponent, "power"))
    return shown


Results = tuple[dict[int, tuple[Posed, dict[str, Outcome]]], dict[str, Process]]


def main() -> Results:
    """Return the outcomes side by side by size of team, and the processes by name of run."""
    compared = {count: compare(count) for count in COMPARED}
    return compared, {name: measured(count, given) for name, (count, given, _) in RUNS.items()}


def figures(results: Results) -> list[Figure]:
    """Return all figures: side by side, then growth."""
    compared, processes = results
    shown = [row for count, one in compared.items() for row in compare_figures(count, *one)]
    return shown + growth_figures(processes)


if __name__ == "__main__":
    print_figures(figures(main()))
