"""A child process that runs tasks by name, and the parent's handle on it.

At its time limit, a task is first interrupted by an alarm and cleans up as after any error.
"""

import contextlib
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from typing import Any

from api.computing import tasks
from api.job_kinds.job_kind import FinishedSearch, Progress, Shown
from syncplan.errors import InputError, NoGoError, NoSolutionError, ProcessEndedError
from syncplan.runtime.child_processes import ChildProcess, connect_to_parent
from syncplan.runtime.machine import keep_loaded, limit_memory

# --- time limit -----------------------------------------------------------------------------------


_AGAIN_S = 2.0
_LEAST_S = 0.001


class TimeUp(BaseException):
    """The time of the task is over; no `except Exception` in its code catches this."""


class Alarm:
    """Alarm that raises TimeUp in the main thread, repeatedly, once a task's time is over.

    It can't interrupt code that never returns to Python: the parent ends such a process.
    """

    def __init__(self) -> None:
        self._set = False
        signal.signal(signal.SIGALRM, self._ring)

    def set(self, seconds: float | None) -> None:
        """Start the time of a task; None sets no limit."""
        if seconds is not None:
            self._set = True
            signal.setitimer(signal.ITIMER_REAL, max(seconds, _LEAST_S), _AGAIN_S)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Raise nothing within the block; a TimeUp that is due is raised later."""
        before, self._set = self._set, False
        try:
            yield
        finally:
            self._set = before

    def clear(self) -> None:
        """End the time of a task."""
        # first: nothing is raised from here on
        self._set = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _ring(self, *_: object) -> None:
        if self._set:
            raise TimeUp


# --- the process ----------------------------------------------------------------------------------


GRACE_S = 5.0
"""Time that an interrupted task may take to end (s) before its process is killed."""

_PROGRESS_EVERY_S = 0.2
_IDLE_S = 2.0
_WITH_PROGRESS = {"computed_batch", "computed_job"}


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
    background : whether it prepares to run trials, or to answer requests
    niceness : niceness of the process, from 0 to 19
    memory_bytes : most memory of the process, and of each that it starts; no limit if None
    """

    def __init__(
        self, *, background: bool, niceness: int = 0, memory_bytes: int | None = None
    ) -> None:
        self._process = ChildProcess("api.computing.child", "serve")
        self._process.connection.send((background, niceness, memory_bytes))
        self.pid = self._process.process.pid
        self.growth = 0
        self.killed = False

    def wait_until_ready(self) -> None:
        """Wait until the process has loaded what tasks need; raises ChildGoneError."""
        try:
            self._process.connection.recv()
        except (EOFError, OSError):
            raise ChildGoneError(self._process.complaint()) from None

    def call(
        self,
        task: str,
        *arguments: Any,
        timeout_s: float | None = None,
        progress: Progress | None = None,
    ) -> Any:
        """Return the result of a task; raises InputError, NoSolutionError or an error above."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s + GRACE_S
        connection = self._process.connection
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
            gone = OutOfMemoryError if _of_memory(complaint) else ChildGoneError
            raise gone(complaint) from None

    def interrupt(self) -> None:
        """Send SIGINT: a search returns the best it has, and any other task ignores it."""
        self._process.process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Kill the process without waiting for its end; a call under way raises ChildGoneError."""
        self.killed = True
        self._process.kill(wait=False)

    def end(self) -> None:
        """End the process, which must be idle, and free its resources."""
        self._process.kill()
        self._process.end()


def serve(descriptor: int) -> None:
    """Run tasks until the parent ends; main function of the process."""
    connection = connect_to_parent(descriptor)
    background, niceness, memory_bytes = connection.recv()
    os.nice(niceness)
    if memory_bytes is not None:
        limit_memory(memory_bytes)
    alarm = Alarm()
    tasks.warm_up(trials=background)
    keep_loaded()
    connection.send(("ready", None))

    def progress_every() -> Progress:
        last = time.monotonic()

        def report(done: int | Shown | FinishedSearch) -> None:
            nonlocal last
            # numbers alone come often, and only the last one matters
            if not isinstance(done, int) or time.monotonic() - last >= _PROGRESS_EVERY_S:
                last = time.monotonic()
                # a message cut off by the alarm would be the last one
                with alarm.paused():
                    connection.send(("progress", done))

        return report

    first_memory, libraries, searched = 0, 0, background
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            if not searched and not connection.poll(_IDLE_S):
                tasks.warm_up_searches()
                keep_loaded()
                searched = True
            name, arguments, timeout_s = connection.recv()
            extra = (progress_every(),) if name in _WITH_PROGRESS else ()
            try:
                alarm.set(timeout_s)
                answer = _outcome(getattr(tasks, name), *arguments, *extra)
            except TimeUp:
                answer = "failed", TooSlowError("out of time")
            finally:
                alarm.clear()
            # libraries that a task loads stay in use, and are not loaded again
            if len(sys.modules) > libraries:
                first_memory, libraries = _memory(), len(sys.modules)
            connection.send(("growth", _memory() - first_memory))
            connection.send(answer)


def _outcome(task: Callable[..., Any], *arguments: Any) -> tuple[str, Any]:
    """Return the answer to a task: its value, or the error to raise in the parent."""
    try:
        return "done", task(*arguments)
    except (InputError, NoSolutionError, NoGoError) as error:
        return "failed", error
    except Exception as error:
        if isinstance(error, MemoryError) or _of_memory(str(error)):
            return "failed", OutOfMemoryError(traceback.format_exc())
        if isinstance(error, ProcessEndedError):
            return "failed", ChildGoneError(str(error))
        return "failed", TaskFailedError(traceback.format_exc())


def _of_memory(complaint: str) -> bool:
    """Whether the last words of a process, or of a C++ library, report a lack of memory."""
    return any(words in complaint for words in ("MemoryError", "bad_alloc", "llocate memory"))


def _memory() -> int:
    """Memory of this process in bytes; 0 if the system does not report it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
