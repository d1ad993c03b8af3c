"""Solution of one start of a refinement by IPOPT, in stages.

Each stage narrows the step between seen and unseen; the last one takes as many of the sensor's own
samples as time allows. First derivatives are CasADi's (Andersson, Gillis, Horn, Rawlings and Diehl,
Math. Prog. Comp. 11, 2019); second ones IPOPT's limited-memory approximation (Wächter and Biegler,
On the implementation of an interior-point filter line-search algorithm, Math. Prog. 106, 2006).
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.refinement.nlp import StageNlp, nlp_of
from syncplan.refinement.problem import RefineProblem, Stage, circles_of, stages_of

_FEASIBLE = 1e-6
"""Largest violation of a feasible iterate."""


@dataclass(frozen=True, slots=True)
class SolverProgress:
    """State of a solver: stage (from 0), iterations in all, objective and largest violation."""

    stage: int
    iteration: int
    objective: float
    violation: float


@dataclass(frozen=True, slots=True)
class Steering:
    """Limits and callbacks of a run.

    Attributes
    ----------
    deadline : time.monotonic() after which it stops
    stopped : called at every iteration; ends the run if true
    report : called with the progress at every iteration
    """

    deadline: float = float("inf")
    stopped: Callable[[], bool] = lambda: False
    report: Callable[[SolverProgress], None] = lambda _: None

    @property
    def over(self) -> bool:
        """Whether to stop now."""
        return self.stopped() or time.monotonic() >= self.deadline


@dataclass(frozen=True, slots=True)
class SolverRun:
    """Result of the solver from one start.

    Attributes
    ----------
    candidates : (4, n) circles in m and rad: the result of each stage, in order; of a stage that
        was stopped, the best feasible iterate
    status : IPOPT's status in the last stage
    stopped : whether time or the user ended it
    iterations : total of all stages
    violation, dual_residual : IPOPT's own values at the end, scaled
    unmet : labels of the constraints most violated at the end, worst first
    """

    candidates: tuple[Array, ...]
    status: str
    stopped: bool
    iterations: int
    violation: float
    dual_residual: float
    unmet: tuple[str, ...]


class StagedSolver:
    """IPOPT on the stages of one problem, each compiled once for all starts."""

    def __init__(self, problem: RefineProblem) -> None:
        self.problem = problem
        self.stages = stages_of(problem)
        self._compiled: dict[int, tuple[StageNlp, _Watcher, ca.Function]] = {}

    def nlp(self, number: int) -> StageNlp:
        """Return the nonlinear program of a stage."""
        return self._compile(number)[0]

    def solve(self, start: Array, steering: Steering | None = None) -> SolverRun:
        """Return the result of all stages from the circles `start` (4, n) in m and rad."""
        watch = steering or Steering()
        candidates: list[Array] = []
        guess, iterations = start, 0
        status = "not started"
        statistics: dict[str, Any] = {}
        unmet: tuple[str, ...] = ()
        for number in range(len(self.stages)):
            if watch.over:
                break
            nlp, watcher, solver = self._compile(number)
            watcher.begin(watch, iterations)
            sides = nlp.sides_of(guess)
            found = solver(
                x0=nlp.variables_of(guess),
                p=sides,
                lbx=nlp.lower,
                ubx=nlp.upper,
                lbg=nlp.constraint_lower,
                ubg=np.inf,
            )
            statistics = solver.stats()
            iterations += int(statistics["iter_count"])
            status = str(statistics["return_status"])
            variables = np.array(found["x"]).ravel()
            if watch.over and watcher.best is not None:
                variables = watcher.best
            if not np.all(np.isfinite(variables)):
                break
            guess = nlp.circles_of(variables)
            candidates.append(guess)
            unmet = _unmet(nlp, variables, sides)
        residuals = statistics.get("iterations", {})
        return SolverRun(
            candidates=tuple(candidates),
            status=status,
            stopped=watch.over,
            iterations=iterations,
            violation=_last(residuals, "inf_pr"),
            dual_residual=_last(residuals, "inf_du"),
            unmet=unmet,
        )

    def _compile(self, number: int) -> "tuple[StageNlp, _Watcher, ca.Function]":
        if number not in self._compiled:
            nlp = nlp_of(self.problem, self.stages[number])
            watcher = _Watcher(nlp, number)
            solver = _ipopt(nlp, self.stages[number], watcher)
            self._compiled[number] = nlp, watcher, solver
        return self._compiled[number]


def _ipopt(nlp: StageNlp, stage: Stage, watcher: "_Watcher") -> ca.Function:
    options: dict[str, Any] = {
        "print_time": False,
        # multipliers of the parameters are not used and would take further derivatives
        "calc_lam_p": False,
        "no_nlp_grad": True,
        "show_eval_warnings": False,
        "jac_g": nlp.jacobian,
        "iteration_callback": watcher,
        "ipopt": {
            "sb": "yes",
            "print_level": 0,
            "hessian_approximation": "limited-memory",
            "limited_memory_max_history": int(np.clip(nlp.size // 3, 6, 50)),
            "honor_original_bounds": "yes",
            "linear_solver": "mumps",
            "max_iter": stage.iterations,
            "tol": stage.tolerance,
            "acceptable_tol": 10.0 * stage.tolerance,
            "acceptable_iter": 8,
            "mu_init": 1e-2,
            "bound_push": 1e-3,
            "bound_frac": 1e-3,
        },
    }
    if nlp.gradient is not None:
        options["grad_f"] = nlp.gradient
    return ca.nlpsol("refine", "ipopt", nlp.as_dictionary(), options)


_NAMED = 4
"""Largest number of constraints named as unmet."""


def _unmet(nlp: StageNlp, variables: Array, sides: Array) -> tuple[str, ...]:
    excess = nlp.violations(variables, sides)
    worst = np.argsort(-excess)[:_NAMED]
    return tuple(nlp.labels[k] for k in worst if excess[k] > 100.0 * _FEASIBLE)


def _last(iterations: dict[str, Any], name: str) -> float:
    values = iterations.get(name) or [float("nan")]
    return float(values[-1])


class _Watcher(ca.Callback):
    """Callback of every IPOPT iteration: reports, keeps the best feasible iterate, may stop."""

    def __init__(self, nlp: StageNlp, stage: int) -> None:
        super().__init__()
        self.nlp, self.stage = nlp, stage
        self.begin(Steering(), 0)
        self.construct("watcher", {})

    def begin(self, watch: Steering, before: int) -> None:
        """Reset for a run, after `before` iterations of earlier stages."""
        self.watch, self.iteration = watch, before
        self.best: Array | None = None
        self.best_objective = float("inf")

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        name = ca.nlpsol_out(index)
        if name == "f":
            return ca.Sparsity.scalar()
        size = {
            "x": self.nlp.size,
            "lam_x": self.nlp.size,
            "lam_p": self.nlp.sides.numel(),
        }.get(name)
        if name in ("g", "lam_g"):
            size = len(self.nlp.labels)
        return ca.Sparsity.dense(size) if size else ca.Sparsity(0, 0)

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        """Record one iterate; return 1 to stop."""
        values = dict(
            zip((ca.nlpsol_out(k) for k in range(len(arguments))), arguments, strict=True)
        )
        objective = float(values["f"])
        excess = self.nlp.excess(np.array(values["g"]).ravel())
        violation = float(excess.max(initial=0.0))
        if violation <= _FEASIBLE and objective < self.best_objective:
            self.best, self.best_objective = np.array(values["x"]).ravel(), objective
        self.iteration += 1
        self.watch.report(SolverProgress(self.stage, self.iteration, objective, violation))
        return [ca.DM(int(self.watch.over))]


# --- starting points ------------------------------------------------------------------------------
#
# Start k draws from the k-th child of SeedSequence(seed), so it depends neither on the number of
# starts nor on where they run. A random start is the most promising of several draws, by the
# softest stage's objective and constraints.


_NUDGE_RAD = 0.1
_DESYNC_RAD = 0.4
_SCATTER_RAD = 1.2
"""Random shifts of phases, from the plan's or those of the rules."""

_DRAWS = 24
_PENALTY = 10.0
"""Cost of a unit of violation, in units of the objective."""


def starting_circles(
    problem: RefineProblem,
    rule_phases: Array,
    nudged: bool,
    start: int,
    seed: int,
    softest: Callable[[], StageNlp],
) -> Array:
    """Return the initial circles (4, n) in m and rad of start number `start` (from 0).

    `rule_phases` (n,) rad meet the rules. `nudged` moves the plan itself a little: a plan that is
    not observable may be a saddle point, where all slopes vanish. `softest` returns the nonlinear
    program of the softest stage, by which random starts are chosen.
    """
    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(start,)))
    given = circles_of(problem.orbits)
    if start == 0:
        shift = _NUDGE_RAD * generator.standard_normal(given.shape[1]) if nudged else 0.0
        return _limited(problem, given, given[3] + shift)
    if start == 1:
        shift = _DESYNC_RAD * generator.uniform(-1.0, 1.0, given.shape[1])
        return _limited(problem, given, rule_phases + shift)
    draws = [_drawn(problem, rule_phases, generator, k) for k in range(_DRAWS)]
    return _most_promising(softest(), draws)


def _drawn(
    problem: RefineProblem, rule_phases: Array, generator: np.random.Generator, draw: int
) -> Array:
    """Random circles within bounds; phases near the rules, in every second draw anywhere."""
    given, freedom = circles_of(problem.orbits), problem.freedom
    low = np.maximum(freedom.lower[:3], given[:3] - problem.scale)
    high = np.minimum(freedom.upper[:3], given[:3] + problem.scale)
    circles = given.copy()
    circles[:3] = generator.uniform(low, np.maximum(high, low))
    spread = np.pi if draw % 2 else _SCATTER_RAD
    return _limited(
        problem, circles, rule_phases + spread * generator.uniform(-1.0, 1.0, given.shape[1])
    )


def _limited(problem: RefineProblem, circles: Array, phases: Array) -> Array:
    """Circles within their bounds, with phases wrapped about the middle of theirs."""
    freedom = problem.freedom
    limited = np.clip(circles, freedom.lower, freedom.upper)
    if problem.area.limited and freedom.free[:2].all():
        moved = problem.area.nearest_clear(limited[:2].T, limited[2], paths=True)
        if moved is not None:
            limited[:2] = np.clip(moved.T, freedom.lower[:2], freedom.upper[:2])
    middle = 0.5 * (freedom.lower[3] + freedom.upper[3])
    limited[3] = np.where(
        freedom.free[3], middle + (phases - middle + np.pi) % (2.0 * np.pi) - np.pi, middle
    )
    return limited


def _most_promising(nlp: StageNlp, draws: list[Array]) -> Array:
    costs = []
    for circles in draws:
        variables, sides = nlp.variables_of(circles), nlp.sides_of(circles)
        objective = float(nlp.values(variables, sides)[0])
        violated = float(nlp.violations(variables, sides).sum())
        cost = objective + _PENALTY * violated
        costs.append(cost if np.isfinite(cost) else np.inf)
    return draws[int(np.argmin(costs))]
