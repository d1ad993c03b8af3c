"""The parent's handle on a child process that runs tasks by name, and the template of them.

Children are forked from one template for each process that uses them, which has loaded what tasks
need: see api.computing.task_loop.
"""

import contextlib
import os
import signal
import time
from functools import cache
from typing import TYPE_CHECKING, Any

from api.computing.scratch import Scratch, sweep
from syncplan.runtime.template_process import FORKS, TemplateProcess

if TYPE_CHECKING:
    from api.job_kinds.job_kind import Progress

GRACE_S = 5.0
"""Time that an interrupted task may take to end (s) before its process is killed."""


class ChildGoneError(Exception):
    """The process ended before it answered: killed by others."""


class OutOfMemoryError(Exception):
    """The task exceeded its memory limit."""


class ChildNotStartedError(ChildGoneError):
    """The system could not start a process just now."""


class TaskFailedError(Exception):
    """The task failed by a fault of the program; the text is the trace, only for the log."""


class TooSlowError(Exception):
    """The task exceeded its time limit."""


class Child:
    """One child process, one task at a time.

    Only `kill` and `interrupt` may be called from another thread.

    Parameters
    ----------
    niceness : niceness of the process, from 0 to 19
    memory_bytes : most memory of the process, and of each that it starts; no limit if None
    """

    def __init__(self, *, niceness: int = 0, memory_bytes: int | None = None) -> None:
        self._scratch = Scratch()
        try:
            self._process = template().fork()
            self._process.connection.send((niceness, memory_bytes, self._scratch.folder))
        except OSError:
            self._scratch.remove()
            raise
        self.growth = 0
        self.killed = self.paused = self.yielded = False
        self.fresh = False
        """Whether it shares all memory with the template, as before its first task."""
        self.complete = False
        """Whether its template had loaded everything when it was forked."""

    @property
    def pid(self) -> int:
        """Number of the process, once it is ready."""
        return self._process.process.pid

    def wait_until_ready(self) -> None:
        """Wait until the process is there and can take tasks; raises ChildGoneError."""
        try:
            self._process.wait_until_begun()
            self._process.connection.recv()
            self.fresh, self.complete = True, self._process.complete
        except (EOFError, OSError):
            raise ChildGoneError(self._process.complaint()) from None

    def call(
        self,
        task: str,
        *arguments: Any,
        timeout_s: float | None = None,
        progress: "Progress | None" = None,
    ) -> Any:
        """Return the result of a task; raises InputError, NoSolutionError or an error above."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s + GRACE_S
        connection = self._process.connection
        self.fresh = not FORKS
        try:
            connection.send((task, arguments, timeout_s))
            while True:
                left = None if deadline is None else max(deadline - time.monotonic(), 0.0)
                if not connection.poll(left):
                    self.kill()
                    raise TooSlowError
                kind, value = connection.recv()
                if kind == "progress":
                    if progress is not None:
                        progress(value)
                elif kind == "growth":
                    self.growth = value
                elif kind == "done":
                    return value
                else:
                    raise value
        except (EOFError, OSError):
            complaint = self._process.complaint()
            gone = OutOfMemoryError if of_memory(complaint) else ChildGoneError
            raise gone(complaint) from None

    def interrupt(self) -> None:
        """Send SIGINT: a search returns the best it has, and any other task ignores it."""
        self._process.process.send_signal(signal.SIGINT)

    def alarm(self) -> None:
        """Tell the process that the time of its task is over."""
        self._process.process.send_signal(signal.SIGALRM)

    def pause(self, paused: bool) -> None:
        """Stop the process, or have it go on."""
        if paused != self.paused:
            self.paused = paused
            self._process.process.send_signal(signal.SIGSTOP if paused else signal.SIGCONT)

    def give_way(self, niceness: int) -> None:
        """Raise the niceness of the process, for good, to so much above that of this process."""
        if FORKS and not self.yielded:
            self.yielded = True
            with contextlib.suppress(OSError):
                os.setpriority(os.PRIO_PGRP, self.pid, min(os.nice(0) + niceness, 19))

    def kill(self) -> None:
        """Kill the process without waiting for its end; a call under way raises ChildGoneError."""
        self.killed = True
        self._process.kill(wait=False)

    def end(self) -> None:
        """End the process, which must be idle, and free its resources."""
        self._process.kill()
        self._process.end()
        self._scratch.remove()


@cache
def template() -> TemplateProcess:
    """Return the template of this process, begun with the first call."""
    sweep()
    return TemplateProcess("api.computing.task_loop", "load", "serve")


def of_memory(complaint: str) -> bool:
    """Return whether the last words of a process, or of a C++ library, report a lack of memory."""
    return any(words in complaint for words in ("MemoryError", "bad_alloc", "llocate memory"))
