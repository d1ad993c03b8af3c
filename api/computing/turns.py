"""Tasks submitted to a pool, and the turns that its owners take.

    takes the next task:   the owner with the fewest running tasks
                           of several, the one that was served least recently

Tasks of one owner are first in, first out. Among n owners, one with nothing running waits for at
most n - 1 tasks of the others to be taken, however many wait: each of them then has more running,
or was served later. The queue has one limit for all. When it is full, an owner with a short queue
takes a place of the one with the longest (P. E. McKenney, "Stochastic fairness queueing", INFOCOM
1990).
"""

import contextlib
import itertools
import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, InvalidStateError
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from api.computing.child import Child, TooSlowError
from api.job_kinds.job_kind import FinishedSearch, Progress, Shown

# --- tasks ----------------------------------------------------------------------------------------


LEAST_RUN_S = 2.0
"""Time (s) that a task may run before its process is killed, once nobody waits for it."""


class GivenUpError(Exception):
    """The task was cancelled, or the pool closed, before there was a result."""


class PoolFullError(Exception):
    """Too many tasks are waiting already, or this one waited too long for its turn."""


class GaveWayError(Exception):
    """The task was ended after a step that it resumes from: others wait for its process."""


class OwnerBusyError(PoolFullError):
    """The owner has as many tasks waiting and running as one owner may have."""


@dataclass(slots=True, eq=False)
class Ticket:
    """A submitted task: `future` holds its result; `cancel` gives it up at any stage.

    A task whose future is already done is neither begun nor tried again.

    Attributes
    ----------
    owner : owner whose turn it takes
    timeout_s : longest time it may run (s); None for no limit
    deadline : monotonic time by which there must be an answer, waiting included; or infinite
    retries : number of further tries after its process was killed
    resumes : whether it goes on, submitted again, from the searches that it has reported
    give_up, interrupted : functions that `cancel` and `interrupt` call
    timed_out : whether it was asked to end as its time is over
    submitted, began, ended : monotonic times; `began` when a process that was ready got it
    killed_at : monotonic time at which its process is killed; infinite unless it was given up
    paused_s, counted_s : time for which its process was paused, and computing time counted (s)
    gives_way, finishing : whether it is to end at its next finished search, or early
    """

    task: str
    arguments: tuple[Any, ...]
    owner: str
    timeout_s: float | None
    deadline: float
    retries: int
    progress: Progress | None
    resumes: bool
    submitted: float
    give_up: Callable[["Ticket", bool], None]
    interrupted: Callable[["Ticket"], None]
    future: "Future[Any]" = field(default_factory=Future)
    child: Child | None = None
    began: float | None = None
    ended: float | None = None
    killed_at: float = math.inf
    paused_s: float = 0.0
    counted_s: float = 0.0
    gives_way: bool = False
    finishing: bool = False
    timed_out: bool = False

    @property
    def is_ending(self) -> bool:
        """Whether it was asked to end, for which it must not be paused."""
        return self.gives_way or self.finishing or self.timed_out

    @property
    def ran_s(self) -> float:
        """Time that a process has spent on it (s), pauses left out; 0 before it begins."""
        if self.began is None:
            return 0.0
        until = time.monotonic() if self.ended is None else self.ended
        return max(until - self.began - self.paused_s, 0.0)

    def report(self, progress: int | Shown | FinishedSearch) -> None:
        """Pass progress to the caller; raises GaveWayError once it is to give way and can."""
        if self.progress is not None:
            self.progress(progress)
        if self.gives_way and isinstance(progress, FinishedSearch):
            raise GaveWayError

    def settle(self, error: Exception | None, value: Any = None) -> None:
        """Pass the outcome to the caller, unless it has one or no longer waits."""
        # the caller may give up at this very moment
        with contextlib.suppress(InvalidStateError):
            if error is None:
                self.future.set_result(value)
            else:
                self.future.set_exception(error)

    def cancel(self, *, spare: bool = False) -> None:
        """Give the task up: it leaves the queue, or its process is killed.

        With `spare`, a process that began less than LEAST_RUN_S ago may run for that long.
        """
        self.give_up(self, spare)

    def interrupt(self) -> None:
        """Ask the task to return the best it has, as Ctrl-C does, if it runs and can."""
        self.interrupted(self)

    def allowed(self, now: float) -> float | None:
        """Return how long after now (s) an answer must be there; None for no limit."""
        return None if math.isinf(self.deadline) else max(self.deadline - now, LEAST_RUN_S)

    def late(self) -> Exception:
        """Return the error of a task past its deadline, by whether it mostly waited or ran."""
        waited_s = math.inf if self.began is None else self.began - self.submitted + self.paused_s
        if waited_s > self.ran_s:
            return PoolFullError()
        return TooSlowError()


# --- turns ----------------------------------------------------------------------------------------


T = TypeVar("T")

_OWNERS_REMEMBERED = 10_000


class Turns(Generic[T]):
    """Waiting tasks by owner, and the number of each owner's running tasks. Not thread-safe."""

    def __init__(self) -> None:
        self._waiting: dict[str, deque[T]] = {}
        self._running: Counter[str] = Counter()
        # number of each owner's latest turn, lowest first
        self._served: dict[str, int] = {}
        self._numbers = itertools.count(1)

    def __len__(self) -> int:
        """Number of waiting tasks."""
        return sum(map(len, self._waiting.values()))

    @property
    def owners(self) -> int:
        """Number of owners with waiting tasks."""
        return len(self._waiting)

    def __iter__(self) -> Iterator[T]:
        """Iterate over the waiting tasks, owner by owner."""
        for queue in self._waiting.values():
            yield from queue

    def held(self, owner: str) -> int:
        """Return the number of an owner's tasks that wait or run."""
        return len(self._waiting.get(owner, ())) + self._running[owner]

    def add(self, owner: str, task: T) -> None:
        """Queue a task behind those of its owner."""
        self._waiting.setdefault(owner, deque()).append(task)

    def remove(self, owner: str, task: T) -> bool:
        """Take a task out of the queue and return whether it was there."""
        try:
            self._waiting.get(owner, deque()).remove(task)
        except ValueError:
            return False
        self._tidy(owner)
        return True

    def take(self, *, idle_owners: bool = False) -> T | None:
        """Take the task whose turn it is, which runs from now on; None if there is none.

        With `idle_owners`, only owners with nothing running count.
        """
        owners = self.idle_owners() if idle_owners else list(self._waiting)
        if not owners:
            return None
        owner = min(owners, key=lambda one: (self._running[one], self._served.get(one, 0)))
        task = self._waiting[owner].popleft()
        self._tidy(owner)
        self._running[owner] += 1
        self._served.pop(owner, None)
        self._served[owner] = next(self._numbers)
        if len(self._served) > _OWNERS_REMEMBERED:
            del self._served[next(iter(self._served))]
        return task

    def done(self, owner: str) -> None:
        """Note that a task of an owner no longer runs."""
        self._running[owner] -= 1
        if self._running[owner] <= 0:
            del self._running[owner]

    def idle_owners(self) -> list[str]:
        """Return the owners with waiting tasks and none running."""
        return [owner for owner in self._waiting if not self._running[owner]]

    def first_of(self, owner: str) -> T:
        """Return an owner's longest-waiting task; raises KeyError if none waits."""
        return self._waiting[owner][0]

    def displaced_by(self, owner: str) -> T | None:
        """Remove and return the newest task of the longest queue, to make room for an owner's.

        None if no queue is longer than the owner's would be with the new task.
        """
        longest = max(self._waiting, key=lambda one: len(self._waiting[one]), default=owner)
        own = len(self._waiting.get(owner, ()))
        if longest == owner or len(self._waiting[longest]) <= own + 1:
            return None
        task = self._waiting[longest].pop()
        self._tidy(longest)
        return task

    def clear(self) -> list[T]:
        """Remove and return all waiting tasks."""
        tasks = list(self)
        self._waiting.clear()
        return tasks

    def _tidy(self, owner: str) -> None:
        if not self._waiting[owner]:
            del self._waiting[owner]
