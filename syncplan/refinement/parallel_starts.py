"""Starts of a refinement, solved and measured in this process or in child processes.

A child (see syncplan.runtime.child_processes) ignores Ctrl-C: the parent sends it the order to
stop, and it returns the best result it has.
"""

import contextlib
import json
import os
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import ProcessEndedError
from syncplan.refinement import ipopt
from syncplan.refinement.exact_search import improved_nearby
from syncplan.refinement.measures import NO_STANDING, Measurement, Standing, measure
from syncplan.refinement.problem import RefineProblem, circles_of, orbits_of
from syncplan.runtime.child_processes import ChildProcess, connect_to_parent


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
    waiting = [start for start in range(starts) if start not in done]

    def take(made: Attempt) -> None:
        done[made.start] = made
        if found is not None:
            found(made)

    run = _run_in_children if min(workers, len(waiting)) > 1 else _run_here
    interrupted = bool(waiting) and run(
        _StartsToRun(task, waiting, done, deadline, report, take), workers
    )
    return [done[start] for start in sorted(done)], interrupted


@dataclass(frozen=True, slots=True)
class _StartsToRun:
    """Waiting and finished starts, with callbacks for progress and results."""

    task: RefineTask
    waiting: list[int]
    done: Mapping[int, Attempt]
    deadline: float
    report: Report | None
    take: Found

    def over(self) -> bool:
        """Return whether to begin no further start; the first one always begins, however late."""
        return bool(self.done) and time.monotonic() >= self.deadline


def _run_here(search: _StartsToRun, _workers: int) -> bool:
    solver = ipopt.StagedSolver(search.task.problem)
    report = search.report
    with _interruption() as interrupted:
        for start in search.waiting:
            if interrupted.is_set() or search.over():
                break

            def pass_on(progress: ipopt.SolverProgress, number: int = start) -> None:
                if report is not None:
                    report(number, progress)

            steering = ipopt.Steering(search.deadline, interrupted.is_set, pass_on)
            search.take(attempt(search.task, solver, start, steering))
        return interrupted.is_set()


@contextlib.contextmanager
def _interruption() -> Iterator[threading.Event]:
    """Context of an event that Ctrl-C sets, if this is the main thread."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    before = signal.signal(signal.SIGINT, lambda *_: event.set())
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)


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
    with _interruption() as interrupted:

        def over() -> bool:
            return interrupted.is_set() or time.monotonic() >= deadline

        found = improved_nearby(
            problem, before, circles, generator, predict=task.predict, over=over
        )
        if found is None:
            return attempts, interrupted.is_set()
        improved = replace(best, circles=found[0], after=found[1], violations=())
        return [*attempts[:number], improved, *attempts[number + 1 :]], interrupted.is_set()


# --- child processes ----------------------------------------------------------------------------


class _Child:
    """Child process that runs starts, one after the other."""

    def __init__(self, number: int, task: RefineTask, messages: "queue.Queue[Any]") -> None:
        self.number, self.messages = number, messages
        self.process = ChildProcess("syncplan.refinement.parallel_starts", "serve_tasks")
        self.send(task)
        threading.Thread(target=self._listen, daemon=True).start()

    def send(self, message: Any) -> None:
        """Send the task, (start, seconds left), or "stop"."""
        with contextlib.suppress(OSError):
            self.process.connection.send(message)

    def _listen(self) -> None:
        with contextlib.suppress(EOFError, OSError, TypeError):
            while True:
                self.messages.put((self.number, *self.process.connection.recv()))
        self.messages.put((self.number, "gone", None))


def _run_in_children(search: _StartsToRun, workers: int) -> bool:
    messages: queue.Queue[Any] = queue.Queue()
    waiting = search.waiting[:]
    children: list[_Child] = []
    busy: set[int] = set()

    def give(child: _Child) -> None:
        if waiting and not (search.over() or (busy and time.monotonic() >= search.deadline)):
            child.send((waiting.pop(0), search.deadline - time.monotonic()))
            busy.add(child.number)

    with _interruption() as interrupted:
        try:
            for number in range(min(workers, len(waiting))):
                children.append(_Child(number, search.task, messages))
                give(children[-1])
            stopping = False
            while busy:
                if interrupted.is_set() and not stopping:
                    stopping = True
                    waiting.clear()
                    for child in children:
                        child.send("stop")
                try:
                    number, kind, value = messages.get(timeout=0.05)
                except queue.Empty:
                    continue
                if kind == "progress" and search.report is not None:
                    search.report(*value)
                elif kind == "done":
                    search.take(value)
                    busy.discard(number)
                    give(children[number])
                elif kind == "gone" and number in busy:
                    raise ProcessEndedError(
                        f"a process of the refinement ended: {children[number].process.complaint()}"
                    )
        finally:
            for child in children:
                child.process.end()
        return interrupted.is_set()


def serve_tasks(descriptor: int) -> None:
    """Run the starts that the parent orders, until it ends; main function of a child process."""
    connection = connect_to_parent(descriptor)
    task: RefineTask = connection.recv()
    solver = ipopt.StagedSolver(task.problem)
    orders: queue.Queue[tuple[int, float]] = queue.Queue()
    stop = threading.Event()
    threading.Thread(target=_take_orders, args=(connection, orders, stop), daemon=True).start()
    while True:
        start, left = orders.get()

        def pass_on(progress: ipopt.SolverProgress, number: int = start) -> None:
            _answer(connection, ("progress", (number, progress)))

        steering = ipopt.Steering(time.monotonic() + left, stop.is_set, pass_on)
        _answer(connection, ("done", attempt(task, solver, start, steering)))


def _take_orders(
    connection: Connection, orders: "queue.Queue[tuple[int, float]]", stop: threading.Event
) -> None:
    """Queue the parent's orders; exit at the end of the stream, as no one waits for a result."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            order = connection.recv()
            if order == "stop":
                stop.set()
            else:
                orders.put(order)
    os._exit(0)


def _answer(connection: Connection, message: Any) -> None:
    try:
        connection.send(message)
    except BrokenPipeError:
        os._exit(0)


# --- finished starts as bytes ---------------------------------------------------------------------
#
# The circles and IPOPT's report are kept. The exact measure is taken again: it is the same to the
# byte, and data kept by another process need not be trusted.


@dataclass(frozen=True, slots=True)
class EarlierSearch:
    """Starts kept from an interrupted refinement, and the function that keeps further ones.

    Attributes
    ----------
    finished : finished starts by number, as they were kept
    spent_s : s, part of its time limit that is spent
    keep : called with the number and the bytes of each start that ends by itself
    """

    finished: Mapping[int, bytes]
    spent_s: float
    keep: Callable[[int, bytes], None]


def keeper(earlier: EarlierSearch | None, first: int) -> Callable[[Attempt], None] | None:
    """Return a function that keeps the attempts of a round of starts, numbered from `first` on.

    Starts that were stopped are not kept.
    """
    if earlier is None:
        return None

    def keep(made: Attempt) -> None:
        if not made.run.stopped:
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
