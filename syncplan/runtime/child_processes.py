"""Child processes for tasks: plain Python, messages over a pipe, ended with their parent.

A child imports from its parent's path, not from its working directory. On Linux the kernel ends it
with the thread that started it, even before it has imported what it runs; elsewhere it ends when it
next reads the pipe. It inherits no secrets: it has its parent's environment without keys, passwords
and settings, and the pipe as its only file.
"""

import contextlib
import ctypes
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from multiprocessing.connection import Connection, Pipe
from typing import Protocol

from syncplan.runtime.machine import defer_garbage

_CODE = (
    "import sys; sys.path[:] = {path!r}; from syncplan.runtime.child_processes import begin; "
    "begin({parent}); from {module} import {function} as serve; serve({descriptor})"
)
_PR_SET_PDEATHSIG = 1
_GRACE_S = 10.0

_WITHHELD = re.compile(
    r"(SYNCPLAN|OTEL)_|PG[A-Z]+$|.*(KEY|PASSW(OR)?D|SECRET|TOKEN|CREDENTIAL|DATABASE_URL)",
    re.IGNORECASE,
)
"""Variables withheld from children: settings, PostgreSQL's, and names that suggest a secret."""


CHILD_VARIABLES = {
    "OPENBLAS_NUM_THREADS": "1",
    # glibc: arrays of a task reuse the memory that the last one has freed
    "MALLOC_MMAP_THRESHOLD_": str(8 * 2**20),
    "MALLOC_TRIM_THRESHOLD_": str(24 * 2**20),
}
"""Variables that children get instead of their parent's."""


class RunningProcess(Protocol):
    """What is used of a process: methods of subprocess.Popen."""

    @property
    def pid(self) -> int:
        """Number of the process."""
        ...

    def poll(self) -> int | None:
        """Return the exit status; None while the process runs."""
        ...

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status once the process has ended; raises TimeoutExpired."""
        ...

    def send_signal(self, number: int, /) -> None:
        """Send a signal, unless the process has ended."""
        ...

    def kill(self) -> None:
        """End the process at once."""
        ...


class ChildProcess:
    """Running child process; `connection` carries picklable messages both ways.

    `complete` is False if it was forked before its template had loaded everything.

    It runs a new interpreter; syncplan.runtime.template_process forks processes instead.

    Parameters
    ----------
    module, function : function that the child calls with the descriptor for connect_to_parent
    heir : whether it is a part of the same program: it then inherits the whole environment, and
        writes where the parent does
    keep : further descriptors that the child inherits
    """

    def __init__(
        self, module: str, function: str, *, heir: bool = False, keep: Sequence[int] = ()
    ) -> None:
        self.connection, theirs = Pipe()
        self.complete = True
        self._descriptor = self.connection.fileno()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        errors = None if heir else self._errors
        code = _CODE.format(
            path=sys.path,
            module=module,
            function=function,
            descriptor=theirs.fileno(),
            parent=os.getpid(),
        )
        with theirs:
            self.process: RunningProcess = subprocess.Popen(
                [sys.executable, "-P", "-c", code],
                stdin=subprocess.DEVNULL,
                stdout=errors,
                stderr=errors,
                pass_fds=[theirs.fileno(), *keep],
                env=dict(os.environ) if heir else {**_environment(), **CHILD_VARIABLES},
            )

    def complaint(self) -> str:
        """Return the last line the process wrote, or its exit status."""
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else f"exit status {self.process.poll()}"

    def wait_until_begun(self) -> None:
        """Wait until the process is there; raises EOFError if it never will be."""

    def end(self) -> None:
        """Close the connection, which ends the process, and wait for its end."""
        if self.connection.closed:
            return
        # closing alone does nothing while another thread waits for a message
        shut_down(self._descriptor)
        self.connection.close()
        try:
            self.process.wait(timeout=_GRACE_S)
        except subprocess.TimeoutExpired:
            self.kill()
        self._errors.close()

    def kill(self, *, wait: bool = True) -> None:
        """End the process at once, whatever it is doing; with `wait`, return when it has ended."""
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        if wait:
            self.process.wait()


def shut_down(descriptor: int) -> None:
    """Shut a connection down: whoever waits for a message at either end is at its end."""
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as both:
        both.shutdown(socket.SHUT_RDWR)


def _environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if not _WITHHELD.match(name)}


def connect_to_parent(descriptor: int) -> Connection:
    """Return the child's end of the connection; Ctrl-C is the parent's to handle."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return Connection(descriptor)


def begin(parent: int) -> None:
    """Defer garbage, and end with the parent, if the kernel can."""
    defer_garbage()
    end_with(parent)


def end_with(parent: int) -> None:
    """Have the kernel end this process with its parent's thread, if it can."""
    if not sys.platform.startswith("linux"):
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
