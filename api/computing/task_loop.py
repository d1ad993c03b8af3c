"""Loop of a child process: a task by name, its progress and its answer, until the parent ends.

At its time limit, a task is first interrupted by an alarm and cleans up as after any error.
"""

import contextlib
import os
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from typing import Any

from api.computing import tasks
from api.computing.child import (
    ChildGoneError,
    OutOfMemoryError,
    TaskFailedError,
    TooSlowError,
    of_memory,
)
from api.job_kinds.job_kind import FinishedSearch, Progress, Shown
from syncplan.errors import InputError, NoGoError, NoSolutionError, ProcessEndedError
from syncplan.runtime.child_processes import connect_to_parent
from syncplan.runtime.machine import limit_memory

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
        """Start a task, whose time is over after so many seconds, or once the parent says so."""
        self._set = True
        if seconds is not None:
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
            # again, also where the parent rang once
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S, _AGAIN_S)
            raise TimeUp


# --- the loop -------------------------------------------------------------------------------------


_PROGRESS_EVERY_S = 0.2
_WITH_PROGRESS = {"computed_batch", "computed_job"}

load = tasks.load


def serve(descriptor: int) -> None:
    """Run tasks until the parent ends; main function of the process."""
    connection = connect_to_parent(descriptor)
    niceness, memory_bytes, os.environ["TMPDIR"] = connection.recv()
    tempfile.tempdir = None
    os.nice(niceness)
    if memory_bytes is not None:
        limit_memory(memory_bytes)
    alarm = Alarm()
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

    first_memory, libraries = 0, 0
    with contextlib.suppress(EOFError, BrokenPipeError):
        while True:
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
        if isinstance(error, MemoryError) or of_memory(str(error)):
            return "failed", OutOfMemoryError(traceback.format_exc())
        if isinstance(error, ProcessEndedError):
            return "failed", ChildGoneError(str(error))
        return "failed", TaskFailedError(traceback.format_exc())


def _memory() -> int:
    """Memory of this process in bytes, files left out; 0 if the system does not report it."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            _, resident, of_files, *_ = map(int, file.read().split())
        return (resident - of_files) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0
