"""Finished starts of a refinement as bytes, for a refinement that is interrupted and goes on later.

Kept are the circles and what IPOPT reported. The exact measure is taken again: it is the same to
the byte, and what was kept by another process needs no trust.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from syncplan.refinement.ipopt import SolverRun
from syncplan.refinement.measures import measure
from syncplan.refinement.parallel_starts import Attempt, RefineTask
from syncplan.refinement.problem import orbits_of


@dataclass(frozen=True, slots=True)
class EarlierSearch:
    """What an interrupted refinement has kept, and where this one keeps what it finishes.

    Attributes
    ----------
    finished : finished starts by number, as they were kept
    spent_s : s of its time limit that are spent
    keep : called with the number and the bytes of each start that ends by itself
    """

    finished: Mapping[int, bytes]
    spent_s: float
    keep: Callable[[int, bytes], None]


def keeper(earlier: EarlierSearch | None, first: int) -> Callable[[Attempt], None] | None:
    """Return what keeps the attempts of a round of starts, which are numbered from `first` on.

    Of a start that was stopped nothing is kept.
    """
    if earlier is None:
        return None

    def keep(made: Attempt) -> None:
        if not made.run.stopped:
            earlier.keep(first + made.start, _packed(made))

    return keep


def kept_attempts(earlier: EarlierSearch | None, task: RefineTask, numbers: range) -> list[Attempt]:
    """Return the attempts of a round that were kept, measured again, numbered from 0 on.

    Their runs have no candidates any more.
    """
    found = {} if earlier is None else earlier.finished
    return [_unpacked(found[k], task, k - numbers.start) for k in numbers if k in found]


def _packed(attempt: Attempt) -> bytes:
    """An attempt as JSON, whose numbers read back as they were."""
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
    run = SolverRun(
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
