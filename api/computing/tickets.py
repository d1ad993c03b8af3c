"""Tasks handed in to a pool: whose they are, how long they may take, what came of them."""

import contextlib
import math
import time
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from dataclasses import dataclass, field
from typing import Any

from api.computing.child import Child, TooSlowError
from api.job_kinds.job_tasks import Progress

LEAST_RUN_S = 2.0
"""A task that nobody waits for any more may run for so long (s) before its process is killed.

That is about the time (s) that a new process takes to start, so impatient clients cost at most as
much in new processes as they were given in computing.
"""


class GivenUpError(Exception):
    """The task was cancelled, or the pool closed, before there was a result."""


class PoolFullError(Exception):
    """Too many tasks are waiting already, or this one waited too long for its turn."""


class OwnerBusyError(PoolFullError):
    """The owner has as many tasks waiting and running as one owner may have."""


@dataclass(slots=True, eq=False)
class Ticket:
    """A task handed in: `future` holds its result; `cancel` gives it up wherever it is.

    A task whose future is done before it has ended is not begun, or begun again.

    Attributes
    ----------
    owner : whose turn it takes
    timeout_s : how long it may run (s); None without limit
    deadline : monotonic time by which there must be an answer, waiting included; or infinite
    retries : how often it is tried again after its process was killed
    give_up : what `cancel` calls
    submitted, began, ended : monotonic times; `began` when a process that was ready got it
    killed_at : monotonic time at which its process is killed; infinite unless it was given up
    """

    task: str
    arguments: tuple[Any, ...]
    owner: str
    timeout_s: float | None
    deadline: float
    retries: int
    progress: Progress | None
    submitted: float
    give_up: Callable[["Ticket", bool], None]
    future: "Future[Any]" = field(default_factory=Future)
    child: Child | None = None
    began: float | None = None
    ended: float | None = None
    killed_at: float = math.inf

    @property
    def ran_s(self) -> float:
        """How long a process has been at it so far (s), or was; 0 before it begins."""
        if self.began is None:
            return 0.0
        return (time.monotonic() if self.ended is None else self.ended) - self.began

    def settle(self, error: Exception | None, value: Any = None) -> None:
        """Hand the outcome to the caller, unless it has one or no longer waits."""
        # the caller may give up at this very moment
        with contextlib.suppress(InvalidStateError):
            if error is None:
                self.future.set_result(value)
            else:
                self.future.set_exception(error)

    def cancel(self, *, spare: bool = False) -> None:
        """Give the task up: it leaves the queue, or its process is killed.

        With `spare`, a process that began less than LEAST_RUN_S ago is given until then.
        """
        self.give_up(self, spare)

    def allowed(self, now: float) -> float | None:
        """Return how long the task may run if it begins now (s); None without limit."""
        left = max(self.deadline - now, LEAST_RUN_S)
        limit = min(left, math.inf if self.timeout_s is None else self.timeout_s)
        return None if math.isinf(limit) else limit

    def late(self) -> Exception:
        """Return the error of a task past its deadline: it was slow, or the others were."""
        if self.began is None or self.began - self.submitted > self.deadline - self.began:
            return PoolFullError()
        return TooSlowError()
