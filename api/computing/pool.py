"""A pool of child processes: owners take turns, long work gives way, memory stays bounded.

    submit --> turns of owners --> a thread for each child --> the child process
                 |                                                |
              cancel: left out                        cancel: killed, and started anew
              deadline: left out                      time limit: killed, and started anew

One more thread watches deadlines. It calls for an extra child where an owner waits with nothing
running while all children are busy; the extra child serves only such owners, and ends once idle.
Where more tasks run than processes are kept, those of the owners that have computed most lately
are paused. Where no child may be added, a task of such an owner gives way at its next step, if it
can resume from there, and waits for another turn.
"""

import logging
import math
import threading
import time
from dataclasses import dataclass
from typing import Any

from api.computing.child import (
    GRACE_S,
    Child,
    ChildGoneError,
    ChildNotStartedError,
    TaskFailedError,
    TooSlowError,
)
from api.computing.turns import (
    LEAST_RUN_S,
    GivenUpError,
    OwnerBusyError,
    PoolFullError,
    Ticket,
    Turns,
)
from api.job_kinds.job_kind import Progress
from syncplan.errors import InputError, NoGoError, NoSolutionError


@dataclass(frozen=True, slots=True)
class PoolDepth:
    """State of a pool.

    Attributes
    ----------
    processes : number of child processes, extra and starting ones included
    running, waiting : numbers of tasks
    owners : number of owners with waiting tasks
    oldest_s : s, longest wait of a waiting task, 0 if none waits
    started : number of child processes started since the pool began
    """

    processes: int
    running: int
    waiting: int
    owners: int
    oldest_s: float
    started: int


LARGEST_GROWTH_BYTES = 48 * 2**20
"""Memory growth of a child, not counting the libraries it loads, beyond which it is replaced."""
PATIENCE_S = 0.2
"""Wait of an owner with nothing running before an extra child starts (s)."""

MOST_EXTRA = 8
"""Most extra children: a paused one takes memory alone."""

LONG_S = 1.0
"""Time (s) from which a task yields to shorter ones, if it is to."""

_REMEMBERED_S = 60.0
"""Time (s) in which what an owner has computed decays by the factor 1/e."""

_FORGOTTEN_S = 0.01
_IDLE_S = 5.0
_LOOK_EVERY_S = 0.1
_PAUSE_S = 0.2

_KEEPS_CHILD = (GivenUpError, InputError, NoGoError, NoSolutionError, TaskFailedError)
"""Errors after which a child waits for its next task; after others it may still answer this one."""

_logger = logging.getLogger("syncplan.pool")


class Pool:
    """Child processes, started at once and kept; MOST_EXTRA more while owners are blocked.

    Parameters
    ----------
    size : number of processes kept, and of tasks that compute at once
    niceness : niceness of the processes, from 0 to 19
    later_niceness : niceness from the time on when a task has computed for LONG_S
    memory_bytes : most memory of a process before OutOfMemoryError; no limit if None
    most_waiting : tasks that may wait before PoolFullError; no limit if None
    most_of_owner : tasks of one owner that may wait or run before OwnerBusyError; no limit if None
    """

    def __init__(
        self,
        size: int,
        *,
        niceness: int = 0,
        later_niceness: int = 0,
        memory_bytes: int | None = None,
        most_waiting: int | None = None,
        most_of_owner: int | None = None,
    ) -> None:
        self.size = size
        self._niceness = niceness
        self._later_niceness = later_niceness
        self._memory_bytes = memory_bytes
        self._most_waiting = math.inf if most_waiting is None else most_waiting
        self._most_of_owner = math.inf if most_of_owner is None else most_of_owner
        self._turns: Turns[Ticket] = Turns()
        self._running: set[Ticket] = set()
        self._children: set[Child] = set()
        self._idle_since: dict[str, float] = {}
        # s, computed lately
        self._spent: dict[str, float] = {}
        self._begun = 0
        self.ready = False
        """Whether a process has been ready for tasks since the pool began."""
        self._closed = False
        lock = threading.RLock()
        self._work = threading.Condition(lock)
        self._clock = threading.Condition(lock)
        self._help = threading.Condition(lock)
        self._threads = [
            threading.Thread(target=self._serve, args=(k >= size,), daemon=True, name=f"child-{k}")
            for k in range(size + MOST_EXTRA)
        ]
        self._threads.append(threading.Thread(target=self._watch, daemon=True, name="deadlines"))
        for thread in self._threads:
            thread.start()

    def depth(self) -> PoolDepth:
        """Return the current state of the pool."""
        with self._work:
            first = min((one.submitted for one in self._turns), default=None)
            return PoolDepth(
                processes=len(self._children),
                running=len(self._running),
                waiting=len(self._turns),
                owners=self._turns.owners,
                oldest_s=0.0 if first is None else time.monotonic() - first,
                started=self._begun,
            )

    def submit(
        self,
        task: str,
        *arguments: Any,
        owner: str = "",
        timeout_s: float | None = None,
        deadline_s: float | None = None,
        retries: int = 1,
        progress: Progress | None = None,
        resumes: bool = False,
    ) -> Ticket:
        """Submit a task; raises PoolFullError, OwnerBusyError.

        `timeout_s` limits how long it computes: the task is asked to end, a little later its
        process is killed, and it fails with TooSlowError. `deadline_s` limits how long it waits and
        runs: it fails with PoolFullError if it mostly waited, else with TooSlowError. A task whose
        process is killed is tried again `retries` times. `progress` is called from another thread.
        One that `resumes` from the searches that it has reported may fail with GaveWayError.
        """
        now = time.monotonic()
        deadline = math.inf if deadline_s is None else now + deadline_s
        ticket = Ticket(
            task,
            arguments,
            owner,
            timeout_s,
            deadline,
            retries,
            progress,
            resumes,
            now,
            self._give_up,
            self._interrupt,
        )
        with self._work:
            displaced = self._room_for(owner)
            if self._is_idle():
                self._clock.notify_all()
            self._turns.add(owner, ticket)
            self._work.notify_all()
        if displaced is not None:
            displaced.settle(PoolFullError())
        # a caller that cancels the future waits no longer
        ticket.future.add_done_callback(
            lambda future: ticket.cancel(spare=True) if future.cancelled() else None
        )
        return ticket

    def call(self, task: str, *arguments: Any, timeout_s: float | None = None) -> Any:
        """Submit a task, wait for it and return its result; raises its errors."""
        return self.submit(task, *arguments, timeout_s=timeout_s).future.result()

    def close(self) -> None:
        """Kill all processes; tasks that wait or run are given up."""
        with self._work:
            self._closed = True
            waiting = self._turns.clear()
            running = list(self._running)
            children = list(self._children)
            for condition in (self._work, self._clock, self._help):
                condition.notify_all()
        for ticket in waiting:
            ticket.settle(GivenUpError())
        for ticket in running:
            ticket.cancel()
        for child in children:
            child.kill()
        for thread in self._threads:
            thread.join(timeout=5.0)

    def _room_for(self, owner: str) -> Ticket | None:
        """Make room for an owner's task; return the task it displaces. Raises PoolFullError."""
        if self._closed:
            raise PoolFullError
        if self._turns.held(owner) >= self._most_of_owner:
            raise OwnerBusyError
        if len(self._turns) < self._most_waiting:
            return None
        displaced = self._turns.displaced_by(owner)
        if displaced is None:
            raise PoolFullError
        return displaced

    def _give_up(self, ticket: Ticket, spare: bool) -> None:
        now = time.monotonic()
        with self._work:
            ticket.settle(GivenUpError())
            self._turns.remove(ticket.owner, ticket)
            if not spare:
                ticket.killed_at = now
            elif ticket.began is not None:
                ticket.killed_at = ticket.began + LEAST_RUN_S
            self._kill_if_due(ticket, now)

    def _interrupt(self, ticket: Ticket) -> None:
        with self._work:
            # under the lock, so that it is still at this task
            if ticket.child is not None:
                ticket.finishing = True
                ticket.child.interrupt()

    def _kill_if_due(self, ticket: Ticket, now: float) -> None:
        """Kill a due task's process; under the lock, so that it is still at this task."""
        if ticket in self._running and ticket.child is not None and ticket.killed_at <= now:
            ticket.child.kill()

    # --- deadlines ------------------------------------------------------------------------------

    def _watch(self) -> None:
        """Give up tasks past their deadlines, and help blocked owners."""
        now = time.monotonic()
        while True:
            with self._clock:
                self._clock.wait(None if self._is_idle() else _LOOK_EVERY_S)
                if self._closed:
                    return
                before, now = now, time.monotonic()
                late = [one for one in self._turns if one.deadline <= now]
                for ticket in late:
                    self._turns.remove(ticket.owner, ticket)
                for ticket in self._running:
                    self._kill_if_due(ticket, now)
                    if ticket.deadline <= now:
                        late.append(ticket)
                self._share(now, now - before)
                if self._blocks(now):
                    self._help.notify()
                    if len(self._running) == self.size + MOST_EXTRA:
                        self._ask_to_give_way()
            for ticket in late:
                ticket.settle(ticket.late())

    def _is_idle(self) -> bool:
        return not self._turns and not self._running

    def _blocks(self, now: float) -> bool:
        """Whether an owner with nothing running has waited too long while all children are busy."""
        if len(self._running) < self.size:
            return False
        first = [(self._turns.first_of(one).submitted, one) for one in self._turns.idle_owners()]
        return any(now - max(at, self._idle_since.get(one, 0.0)) > PATIENCE_S for at, one in first)

    def _share(self, now: float, elapsed: float) -> None:
        """Let as many tasks compute as processes are kept: of the owners that have spent least."""
        kept = math.exp(-elapsed / _REMEMBERED_S)
        self._spent = {owner: kept * s for owner, s in self._spent.items() if s > _FORGOTTEN_S}
        for ticket in self._running:
            if ticket.child is not None and ticket.child.paused:
                ticket.paused_s += min(elapsed, now - (ticket.began or now))
            self._count(ticket)
        turns = sorted(
            self._running,
            key=lambda task: (not task.is_ending, self._spent[task.owner], task.submitted),
        )
        for turn, ticket in enumerate(turns):
            if ticket.child is not None:
                self._keep_time(ticket, ticket.child)
                ticket.child.pause(turn >= self.size)
                if self._later_niceness > self._niceness and ticket.ran_s > LONG_S:
                    ticket.child.give_way(self._later_niceness)

    def _keep_time(self, ticket: Ticket, child: Child) -> None:
        """Ask a task to end once its time is computed, and kill its process if it goes on."""
        over_s = -1.0 if ticket.timeout_s is None else ticket.ran_s - ticket.timeout_s
        if over_s > GRACE_S:
            child.kill()
        elif over_s > 0.0 and not ticket.timed_out:
            ticket.timed_out = True
            child.alarm()

    def _count(self, ticket: Ticket) -> None:
        """Add what a task has computed since it was last counted to what its owner has spent."""
        spent = self._spent.get(ticket.owner, 0.0)
        self._spent[ticket.owner] = spent + ticket.ran_s - ticket.counted_s
        ticket.counted_s = ticket.ran_s

    def _ask_to_give_way(self) -> None:
        """Ask the task of the owner that has spent most, of those that resume, unless one is."""
        able = [ticket for ticket in self._running if ticket.resumes]
        if able and not any(ticket.gives_way for ticket in able):
            max(able, key=lambda ticket: self._spent.get(ticket.owner, 0.0)).gives_way = True

    # --- children -------------------------------------------------------------------------------

    def _serve(self, extra: bool) -> None:
        """Pass tasks to a child, one at a time; start an extra one for a task, others beforehand.

        One that has been idle since its task ends: a fresh one shares more memory.
        """
        child = None if extra else self._started()
        while not self._closed:
            fresh = child is None or (child.fresh and not extra)
            ticket = self._next(extra, None if fresh else _IDLE_S)
            if ticket is not None:
                try:
                    child = self._run(ticket, child)
                finally:
                    with self._work:
                        self._running.discard(ticket)
                        self._count(ticket)
                        self._turns.done(ticket.owner)
                        self._idle_since[ticket.owner] = time.monotonic()
                        self._work.notify_all()
            worn = child is not None and (
                child.yielded or not child.complete or child.growth > LARGEST_GROWTH_BYTES
            )
            if child is not None and (worn or ticket is None):
                self._end(child)
                child = None
            if child is None and not extra:
                child = self._started()
        if child is not None:
            self._end(child)

    def _end(self, child: Child) -> None:
        """End a child."""
        with self._work:
            self._children.discard(child)
        child.end()

    def _next(self, extra: bool, idle_s: float | None) -> Ticket | None:
        """Wait for the next task; None once closed, or once a child has been idle for `idle_s`."""
        until = math.inf if idle_s is None else time.monotonic() + idle_s
        with self._work:
            if extra:
                self._help.wait(idle_s)
            while not self._closed:
                ticket = self._turns.take(idle_owners=extra)
                if ticket is not None:
                    self._running.add(ticket)
                if ticket is not None or extra or time.monotonic() >= until:
                    return ticket
                self._work.wait(None if idle_s is None else until - time.monotonic())
        return None

    def _started(self) -> Child | None:
        """New child, ready for tasks; None if the system can't start one, or once closed."""
        if self._closed:
            return None
        try:
            child = Child(niceness=self._niceness, memory_bytes=self._memory_bytes)
        except OSError as error:
            _logger.error("no process could be started: %s", error)
            return None
        with self._work:
            self._begun += 1
            self._children.add(child)
            if self._closed:
                child.kill()
        try:
            child.wait_until_ready()
        except ChildGoneError as error:
            if not self._closed:
                _logger.error("a process ended before it was ready: %s", error)
            self._end(child)
            return None
        self.ready = True
        return child

    def _run(self, ticket: Ticket, child: Child | None) -> Child | None:
        """Run and settle a ticket; return the child if it can serve the next one."""
        for attempt in range(ticket.retries + 1):
            child = child or self._started()
            error, value = self._tried(ticket, child)
            kept = error is None or isinstance(error, _KEEPS_CHILD)
            if child is not None and (child.killed or not kept):
                self._end(child)
                child = None
            if not isinstance(error, ChildGoneError) or ticket.future.done():
                break
            if attempt < ticket.retries:
                time.sleep(_PAUSE_S)
        ticket.settle(error, value)
        return child

    def _tried(self, ticket: Ticket, child: Child | None) -> tuple[Exception | None, Any]:
        """Return (error, None) if a task failed in a child, else (None, value)."""
        if child is None:
            return ChildNotStartedError("no process could be started"), None
        with self._work:
            if ticket.future.done():
                return GivenUpError(), None
            ticket.child = child
            ticket.began, ticket.ended = time.monotonic(), None
            ticket.paused_s = ticket.counted_s = 0.0
            ticket.finishing = ticket.timed_out = False
            limit = ticket.allowed(ticket.began)
        try:
            value = child.call(
                ticket.task, *ticket.arguments, timeout_s=limit, progress=ticket.report
            )
        except TooSlowError as error:
            # one that was paused has mostly waited
            return (ticket.late() if time.monotonic() >= ticket.deadline else error), None
        except Exception as error:
            gone = isinstance(error, ChildGoneError) and ticket.timed_out
            return (TooSlowError() if gone else error), None
        finally:
            with self._work:
                ticket.child, ticket.ended = None, time.monotonic()
                child.pause(False)
        return None, value
