"""A pool of child processes: tasks wait in order and can be given up; memory stays bounded.

    submit --> waiting --> a thread for each child --> the child process
                 |                                          |
              cancel: left out                    cancel: killed, and started anew

The thread that started a child outlives it, because the kernel ends a child with that thread.
"""

import contextlib
import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from dataclasses import dataclass, field
from typing import Any

from api.computing.child import Child, ChildGoneError, TooSlowError

__all__ = ["GivenUpError", "Pool", "PoolFullError", "Ticket"]

LARGEST_GROWTH_BYTES = 48 * 2**20
"""A child that has grown by more than this since its first task is replaced."""

_RETRIES = 1
_PAUSE_S = 0.2

_logger = logging.getLogger("syncplan.pool")


class GivenUpError(Exception):
    """The task was cancelled, or the pool closed, before there was a result."""


class PoolFullError(Exception):
    """Too many tasks are waiting already, or have been for too long."""


@dataclass(slots=True)
class Ticket:
    """A task handed in: `future` holds its result; `cancel` gives it up wherever it is.

    Attributes
    ----------
    timeout_s, deadline : how long it may run, and until when it may wait for its turn
    """

    task: str
    arguments: tuple[Any, ...]
    timeout_s: float | None
    progress: Callable[[int], None] | None
    deadline: float | None
    future: "Future[Any]" = field(default_factory=Future)
    cancelled: threading.Event = field(default_factory=threading.Event)
    child: Child | None = None

    def settle(self, error: Exception | None, value: Any = None) -> None:
        """Hand the outcome to the caller, unless it no longer waits."""
        if not self.future.cancelled():
            # the caller may give up at this very moment
            with contextlib.suppress(InvalidStateError):
                if error is None:
                    self.future.set_result(value)
                else:
                    self.future.set_exception(error)

    def cancel(self) -> None:
        """Give the task up: its process is killed, or it is left out when its turn comes."""
        self.cancelled.set()
        child = self.child
        if child is not None:
            child.kill()


class Pool:
    """Child processes, started at once and kept.

    Parameters
    ----------
    size : processes
    background : whether they prepare to run trials, or to answer requests
    niceness : how far they yield to other processes, from 0 to 19
    most_waiting : tasks that may wait before PoolFullError; no limit if None
    """

    def __init__(
        self,
        size: int,
        *,
        background: bool,
        niceness: int = 0,
        most_waiting: int | None = None,
    ) -> None:
        self.size = size
        self._background = background
        self._niceness = niceness
        self._most_waiting = most_waiting
        self._waiting: deque[Ticket] = deque()
        self._changed = threading.Condition()
        self._closed = False
        self._running: dict[int, Ticket] = {}
        self._threads = [
            threading.Thread(target=self._serve, args=(k,), daemon=True, name=f"child-{k}")
            for k in range(size)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def busy(self) -> int:
        """Number of processes that compute something."""
        return len(self._running)

    def submit(
        self,
        task: str,
        *arguments: Any,
        timeout_s: float | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Ticket:
        """Hand in a task; raises PoolFullError. `progress` is called from another thread.

        With `timeout_s`, a task that waits longer than that for its turn ends in PoolFullError.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        ticket = Ticket(task, arguments, timeout_s, progress, deadline)
        with self._changed:
            if self._most_waiting is not None and len(self._waiting) >= self._most_waiting:
                raise PoolFullError
            self._waiting.append(ticket)
            self._changed.notify()
        return ticket

    def call(self, task: str, *arguments: Any, timeout_s: float | None = None) -> Any:
        """Return what a task returns, waiting for it; raises what it raises."""
        return self.submit(task, *arguments, timeout_s=timeout_s).future.result()

    def close(self) -> None:
        """Kill all processes; tasks that wait or run are given up."""
        with self._changed:
            self._closed = True
            waiting = list(self._waiting)
            self._waiting.clear()
            running = list(self._running.values())
            self._changed.notify_all()
        for ticket in waiting:
            ticket.settle(GivenUpError())
        for ticket in running:
            ticket.cancel()
        for thread in self._threads:
            thread.join(timeout=5.0)

    def _serve(self, number: int) -> None:
        """Pass tasks to a child, one at a time; a new child where there is none."""
        child = self._started()
        while True:
            with self._changed:
                while not self._waiting and not self._closed:
                    self._changed.wait()
                if self._closed:
                    break
                ticket = self._running[number] = self._waiting.popleft()
            try:
                child = self._run(ticket, child)
            finally:
                del self._running[number]
            if child is not None and child.memory - child.first_memory > LARGEST_GROWTH_BYTES:
                child.end()
                child = None
            child = child or self._started()
        if child is not None:
            child.end()

    def _started(self) -> Child | None:
        """A new child; None where the system has no room for one just now."""
        try:
            return Child(background=self._background, niceness=self._niceness)
        except OSError as error:
            _logger.error("no process could be started: %s", error)
            return None

    def _run(self, ticket: Ticket, child: Child | None) -> Child | None:
        """Settle a ticket and return the child to go on with, if it is still there."""
        if ticket.future.cancelled():
            return child
        if ticket.deadline is not None and time.monotonic() > ticket.deadline:
            ticket.settle(PoolFullError())
            return child
        for attempt in range(_RETRIES + 1):
            child = ticket.child = child or self._started()
            try:
                if ticket.cancelled.is_set():
                    raise GivenUpError
                if child is None:
                    raise ChildGoneError("no process could be started")
                value = child.call(
                    ticket.task,
                    *ticket.arguments,
                    timeout_s=ticket.timeout_s,
                    progress=ticket.progress,
                )
            except (ChildGoneError, TooSlowError) as error:
                if child is not None:
                    child.end()
                child = None
                if ticket.cancelled.is_set():
                    ticket.settle(GivenUpError())
                elif isinstance(error, TooSlowError) or attempt == _RETRIES:
                    ticket.settle(error)
                else:
                    time.sleep(_PAUSE_S)
                    continue
            except Exception as error:
                ticket.settle(error)
            else:
                ticket.settle(None, value)
            break
        ticket.child = None
        return child
