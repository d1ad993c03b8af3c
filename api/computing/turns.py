"""Whose task is next: turns go round the owners, first in, first out within each.

    takes the next task:   the owner with the fewest running tasks
                           of several, the one that was served least recently

Of n owners, one with nothing running waits for at most n - 1 tasks of the others to be taken,
however many wait: each of them then has more running, or was served later. The queue has a limit
for all; where it is full, an owner with a short queue takes a place of the one with the longest
(P. E. McKenney, "Stochastic fairness queueing", INFOCOM 1990).
"""

import itertools
from collections import Counter, deque
from collections.abc import Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

_OWNERS_REMEMBERED = 10_000


class Turns(Generic[T]):
    """Tasks that wait, by owner, and how many of each owner are running. Not thread-safe."""

    def __init__(self) -> None:
        self._waiting: dict[str, deque[T]] = {}
        self._running: Counter[str] = Counter()
        # the numbers of their latest turns, lowest first
        self._served: dict[str, int] = {}
        self._numbers = itertools.count(1)

    def __len__(self) -> int:
        """Number of tasks that wait."""
        return sum(map(len, self._waiting.values()))

    @property
    def owners(self) -> int:
        """Number of owners whose tasks wait."""
        return len(self._waiting)

    def __iter__(self) -> Iterator[T]:
        """Go through the tasks that wait, owner by owner."""
        for queue in self._waiting.values():
            yield from queue

    def held(self, owner: str) -> int:
        """Return how many tasks of an owner wait or run."""
        return len(self._waiting.get(owner, ())) + self._running[owner]

    def add(self, owner: str, task: T) -> None:
        """Let a task wait behind those of its owner."""
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
        """Return the task whose turn it is, which runs from now on; None if none may.

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
        """Enter that a task of an owner runs no more."""
        self._running[owner] -= 1
        if self._running[owner] <= 0:
            del self._running[owner]

    def idle_owners(self) -> list[str]:
        """Return the owners that wait while nothing of theirs runs."""
        return [owner for owner in self._waiting if not self._running[owner]]

    def first_of(self, owner: str) -> T:
        """Return the task of an owner that has waited longest; raises KeyError if none waits."""
        return self._waiting[owner][0]

    def displaced_by(self, owner: str) -> T | None:
        """Take the newest task of the longest queue out, to make room for one of an owner.

        None if no queue would still be longer than the owner's with the new task.
        """
        longest = max(self._waiting, key=lambda one: len(self._waiting[one]), default=owner)
        own = len(self._waiting.get(owner, ()))
        if longest == owner or len(self._waiting[longest]) <= own + 1:
            return None
        task = self._waiting[longest].pop()
        self._tidy(longest)
        return task

    def clear(self) -> list[T]:
        """Take all tasks that wait out of the queue and return them."""
        tasks = list(self)
        self._waiting.clear()
        return tasks

    def _tidy(self, owner: str) -> None:
        if not self._waiting[owner]:
            del self._waiting[owner]
