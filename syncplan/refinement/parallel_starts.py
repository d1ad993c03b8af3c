"""Starts of a refinement, solved and measured in this process or in child processes.

After Ctrl-C, a start returns the best result it has (see syncplan.runtime.task_crew).
"""

import json
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.refinement import ipopt
from syncplan.refinement.exact_search import improved_nearby
from syncplan.refinement.measures import NO_STANDING, Measurement, Standing, measure
from syncplan.refinement.problem import RefineProblem, circles_of, orbits_of
from syncplan.runtime.task_crew import EarlierSearch, Work, interruption, run_orders


@dataclass(frozen=True, slots=True)
class RefineTask:
    """Task that all starts share.

    Attributes
    ----------
    rule_phases : (n,) rad that meet the rules
    nudged : whether the start at the plan itself is moved a little
    before : the plan's own measurement, with which results are compared
    seed : common to all starts
    predict : whether to compute the posterior bound of results
    """

    problem: RefineProblem
    rule_phases: Array
    nudged: bool
    before: Measurement
    seed: int
    predict: bool


@dataclass(frozen=True, slots=True)
class Attempt:
    """Result of one start: IPOPT's run, and its best candidate by the exact measure.

    Attributes
    ----------
    circles, after : (4, n) and its measurement; None where the solver had no result
    violations : labels of constraints that the plan met and this candidate does not
    """

    start: int
    run: ipopt.SolverRun
    circles: Array | None
    after: Measurement | None
    violations: tuple[str, ...]


Report = Callable[[int, ipopt.SolverProgress], None]
Found = Callable[[Attempt], None]


def attempt(
    task: RefineTask, solver: ipopt.StagedSolver, start: int, steering: ipopt.Steering
) -> Attempt:
    """Return the result of start number `start`."""
    problem = task.problem
    first = ipopt.starting_circles(
        problem, task.rule_phases, task.nudged, start, task.seed, lambda: solver.nlp(0)
    )
    run = solver.solve(first, steering)
    best: Attempt | None = None
    for circles in reversed(run.candidates):
        after = measure(problem, orbits_of(circles, problem.orbits), predict=task.predict)
        violations = tuple(after.violations(task.before))
        found = Attempt(start, run, circles, after, violations)
        best = found if best is None else _better(problem, best, found)
        # later stages are sharper: when time is up, the latest candidate that passes is enough
        if steering.over and not best.violations:
            break
    return best or Attempt(start, run, None, None, ())


def _better(problem: RefineProblem, one: Attempt, other: Attempt) -> Attempt:
    """Attempt that comes first by `rank_of`; the first of equals."""
    return min(one, other, key=lambda item: rank_of(problem, item))


def rank_of(problem: RefineProblem, item: Attempt) -> tuple[bool, Standing]:
    """Return the key that orders attempts: whether they violate a constraint, then standing."""
    if item.after is None:
        return True, NO_STANDING
    return bool(item.violations), item.after.standing(problem.objective.name)


def run_starts(
    task: RefineTask,
    starts: int,
    *,
    workers: int,
    time_limit: float,
    report: Report | None = None,
    found: Found | None = None,
    earlier: Sequence[Attempt] = (),
) -> tuple[list[Attempt], bool]:
    """Return the attempts of all starts, by number, and whether Ctrl-C cut them short.

    After `time_limit` s, and on Ctrl-C, solvers stop and return the best they have; starts that
    have not begun are left out. `found` is called with each new attempt; `earlier` ones are not
    repeated.
    """
    deadline = time.monotonic() + time_limit
    done = {one.start: one for one in earlier}

    def begin(start: int, busy: bool) -> tuple[int, float] | None:
        # the first one always begins, however late
        left = deadline - time.monotonic()
        return None if (done or busy) and left <= 0.0 else (start, left)

    def take(made: Attempt) -> None:
        done[made.start] = made
        if found is not None:
            found(made)

    waiting = [start for start in range(starts) if start not in done]
    interrupted = run_orders(
        start_worker,
        task,
        waiting,
        workers,
        begin=begin,
        take=take,
        report=None if report is None else lambda progress: report(*progress),
    )
    return [done[start] for start in sorted(done)], interrupted


def start_worker(task: RefineTask) -> Work:
    """Return the function that runs a start: of its number and the seconds left."""
    solver = ipopt.StagedSolver(task.problem)

    def work(
        order: tuple[int, float], stop: threading.Event, report: Callable[[Any], None]
    ) -> Attempt:
        start, left = order
        steering = ipopt.Steering(
            time.monotonic() + left, stop.is_set, lambda progress: report((start, progress))
        )
        return attempt(task, solver, start, steering)

    return work


def searched_nearby(
    task: RefineTask, attempts: list[Attempt], deadline: float
) -> tuple[list[Attempt], bool]:
    """Return the attempts, the best improved by exact search, and whether Ctrl-C cut it short.

    Where the plan itself is better than all attempts, the search begins at the plan; its result
    then replaces the best attempt's candidate.
    """
    if not attempts:
        return attempts, False
    problem, before = task.problem, task.before
    number = min(range(len(attempts)), key=lambda k: rank_of(problem, attempts[k]))
    best = attempts[number]
    circles, own = best.circles, (False, before.standing(problem.objective.name))
    if circles is None or rank_of(problem, best) >= own:
        circles = circles_of(problem.orbits)
    generator = np.random.default_rng(task.seed)
    with interruption() as interrupted:

        def over() -> bool:
            return interrupted.is_set() or time.monotonic() >= deadline

        found = improved_nearby(
            problem, before, circles, generator, predict=task.predict, over=over
        )
        if found is None:
            return attempts, interrupted.is_set()
        improved = replace(best, circles=found[0], after=found[1], violations=())
        return [*attempts[:number], improved, *attempts[number + 1 :]], interrupted.is_set()


# --- finished starts as bytes ---------------------------------------------------------------------
#
# The circles and IPOPT's report are kept. The exact measure is taken again: it is the same to the
# byte, and data kept by another process need not be trusted.


def keeper(earlier: EarlierSearch | None, first: int) -> Found:
    """Return a function that keeps the attempts of a round of starts, numbered from `first` on.

    Starts that were stopped are not kept.
    """

    def keep(made: Attempt) -> None:
        if earlier is not None and not made.run.stopped:
            earlier.keep(first + made.start, _packed(made))

    return keep


def kept_attempts(earlier: EarlierSearch | None, task: RefineTask, numbers: range) -> list[Attempt]:
    """Return the attempts of a round that were kept, measured again and numbered from 0 on.

    Their runs no longer have candidates.
    """
    found = {} if earlier is None else earlier.finished
    return [_unpacked(found[k], task, k - numbers.start) for k in numbers if k in found]


def _packed(attempt: Attempt) -> bytes:
    """Attempt as JSON, whose numbers read back unchanged."""
    run, circles = attempt.run, attempt.circles
    values = {
        "circles": None if circles is None else circles.tolist(),
        "violations": attempt.violations,
        "status": run.status,
        "iterations": run.iterations,
        "violation": run.violation,
        "dual_residual": run.dual_residual,
        "unmet": run.unmet,
    }
    return json.dumps(values).encode()


def _unpacked(data: bytes, task: RefineTask, start: int) -> Attempt:
    values = json.loads(data)
    run = ipopt.SolverRun(
        candidates=(),
        status=values["status"],
        stopped=False,
        iterations=values["iterations"],
        violation=values["violation"],
        dual_residual=values["dual_residual"],
        unmet=tuple(values["unmet"]),
    )
    circles = after = None
    if values["circles"] is not None:
        circles = np.array(values["circles"])
        orbits = orbits_of(circles, task.problem.orbits)
        after = measure(task.problem, orbits, predict=task.predict)
    return Attempt(start, run, circles, after, tuple(values["violations"]))
