"""A process that has loaded what others need: they are forked from it and share its memory.

    TemplateProcess.fork --- descriptors ---> the template process --- fork ---> ForkedProcess
           ^                                                                          |
           +------------------------------- messages ---------------------------------+

The template loads in stages, and forks from the first one on: a successor, forked from it, loads
the next stage and then takes its place. Each has one thread, so that no fork copies a lock that
another thread holds. The kernel ends the first with the process that uses it, and its successors
and all children with the first. Children are held by descriptors: the kernel uses numbers of
processes again. Where there are no such descriptors (they came with Linux 5.3), each process loads
everything by itself.
"""

import contextlib
import gc
import logging
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import weakref
from collections.abc import Callable
from importlib import import_module
from multiprocessing.connection import Connection, Pipe, wait
from typing import NoReturn

from syncplan.runtime.child_processes import (
    ChildProcess,
    connect_to_parent,
    end_with,
    shut_down,
)
from syncplan.runtime.machine import defer_garbage, keep_loaded


def _has_descriptors() -> bool:
    with contextlib.suppress(AttributeError, OSError):
        os.close(os.pidfd_open(os.getpid()))
        return True
    return False


FORKS = _has_descriptors()
"""Whether processes are forked from a template on this system."""

_PAUSE_S = 0.5
_SOUND_S = 30.0
"""Lifetime (s) from which a template counts as well started."""

_logger = logging.getLogger("syncplan.template")


class TemplateProcess:
    """Template process, started anew if it ends, for as long as this process runs.

    Parameters
    ----------
    module : module that it imports
    load : function of the module; a generator that loads everything in stages
    serve : function of the module that children call with their descriptor
    """

    def __init__(self, module: str, load: str, serve: str) -> None:
        self._names = module, load, serve
        # open for as long as this process runs: requests wait while the template is started anew
        self._requests, self._served = socket.socketpair()
        if FORKS:
            # the kernel ends a process with the thread that started it
            threading.Thread(target=self._keep, daemon=True, name="template").start()

    def fork(self) -> ChildProcess:
        """Return a process that calls `serve`, with the stages that are loaded so far."""
        if not FORKS:
            child = ChildProcess(__name__, "serve_alone")
            child.connection.send(self._names)
            return child
        return ForkedProcess(self._requests)

    def _keep(self) -> None:
        pause_s = _PAUSE_S
        while True:
            began = time.monotonic()
            try:
                process = ChildProcess(__name__, "serve_forks", keep=[self._served.fileno()])
            except OSError as error:
                _logger.error("the template process could not be started: %s", error)
            else:
                with contextlib.suppress(EOFError, OSError):
                    process.connection.send((self._served.fileno(), *self._names))
                    process.connection.recv()
                _logger.error("the template process ended: %s", process.complaint())
                process.end()
            pause_s = _PAUSE_S if time.monotonic() - began > _SOUND_S else 2.0 * pause_s
            time.sleep(min(pause_s, _SOUND_S))


class ForkedProcess(ChildProcess):
    """Process forked from a template, which waits for requests at the other end of a socket.

    It is the leader of a process group with the processes that it starts. There is no exit status:
    the template is its parent.
    """

    def __init__(self, requests: socket.socket) -> None:
        self.connection, theirs = Pipe()
        self._descriptor = self.connection.fileno()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        self.process: _Forked = _Forked(self.connection)
        self.complete = False
        with theirs:
            socket.send_fds(requests, [b"f"], [theirs.fileno(), self._errors.fileno()])

    def wait_until_begun(self) -> None:
        """Wait until the process is there; raises EOFError if it never will be."""
        number, self.complete = self.connection.recv()
        self.process.hold(number)


_OF_GROUP = (signal.SIGSTOP, signal.SIGCONT, signal.SIGKILL)


class _Forked:
    """A forked process, held by a descriptor of it, with the methods of subprocess.Popen."""

    def __init__(self, connection: Connection) -> None:
        self.pid = 0
        self._connection = connection

    def hold(self, pid: int) -> None:
        """Hold the process of this number."""
        self._descriptor = os.pidfd_open(pid)
        weakref.finalize(self, os.close, self._descriptor)
        self.pid = pid

    def poll(self) -> int | None:
        """Return -1 once the process has ended; None while it runs."""
        return None if self.pid and not wait([self._descriptor], 0.0) else -1

    def wait(self, timeout: float | None = None) -> int:
        """Return -1 once the process has ended; raises TimeoutExpired."""
        if self.pid and not wait([self._descriptor], timeout):
            raise subprocess.TimeoutExpired("a forked process", timeout or 0.0)
        return -1

    def send_signal(self, number: int, /) -> None:
        """Send a signal to the process; stop, continue and kill also those that it has started."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                if number in _OF_GROUP:
                    os.killpg(self.pid, number)
                else:
                    signal.pidfd_send_signal(self._descriptor, number)

    def kill(self) -> None:
        """End the process at once, or as soon as it is forked."""
        if self.pid:
            self.send_signal(signal.SIGKILL)
        elif not self._connection.closed:
            shut_down(self._connection.fileno())


# --- in the template, and in what is forked from it -----------------------------------------------


def serve_forks(descriptor: int) -> None:
    """Fork on request as soon as the first stage is loaded; main function of the template.

    For each further stage, a successor loads it and then forks instead, so that none waits for it.
    """
    connection = connect_to_parent(descriptor)
    requests_at, module, load, serve = connection.recv()
    library = import_module(module)
    template = _Template(socket.socket(fileno=requests_at), connection, getattr(library, serve))
    # the kernel forgets children that have ended; a signal to all of a service is its server's
    for number in (signal.SIGCHLD, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for _ in getattr(library, load)():
        _settle()
        template.hand_over()
    _settle()
    template.take_over(complete=True)
    template.fork_until()


def _settle() -> None:
    """Keep what is loaded out of the way of garbage collection and of what children allocate."""
    gc.collect()
    keep_loaded()


class _Template:
    """The template in one of its processes: requests, connection to the parent."""

    def __init__(
        self, requests: socket.socket, connection: Connection, serve: Callable[[int], None]
    ) -> None:
        self._requests = requests
        # another of the template's processes may be faster
        self._requests.setblocking(False)
        self._connection = connection
        self._serve = serve
        self._predecessor: Connection | None = None
        self._complete = False

    def hand_over(self) -> None:
        """Fork a successor that loads the next stage; returns in it alone.

        This process forks until the successor takes over, and ends with it. If no successor can be
        forked, this process loads the next stage itself; requests wait meanwhile.
        """
        self.take_over()
        parent = os.getpid()
        try:
            successor, predecessor = Pipe(duplex=False)
            forked = os.fork() == 0
        except OSError as error:
            print(error, file=sys.stderr, flush=True)
            return
        if forked:
            end_with(parent)
            successor.close()
            self._predecessor = predecessor
            defer_garbage()
            return
        predecessor.close()
        self.fork_until(successor)
        with contextlib.suppress(EOFError):
            while True:
                successor.recv()
        os._exit(1)

    def take_over(self, *, complete: bool = False) -> None:
        """Fork from now on, in place of the predecessor."""
        self._complete = complete
        if self._predecessor is not None:
            self._predecessor.send(None)

    def fork_until(self, *ends: Connection) -> None:
        """Fork on request until there is something to read at an end."""
        while not set(ends).intersection(wait([self._requests, *ends])):
            with contextlib.suppress(BlockingIOError):
                self._fork()

    def _fork(self) -> None:
        """Fork a process for the next request; raises BlockingIOError if there is none."""
        # Python 3.11 leaves out the flags that recv_fds is given
        _, descriptors, *_ = socket.recv_fds(self._requests, 1, 2)
        parent = os.getpid()
        try:
            # without room for both, the kernel passes fewer
            forked = len(descriptors) == 2 and os.fork() == 0
        except OSError as error:
            # the parent sees the end of the connection
            print(error, file=sys.stderr, flush=True)
            forked = False
        if forked:
            self._begin(parent, *descriptors)
        for at in descriptors:
            os.close(at)

    def _begin(self, parent: int, connection_at: int, errors_at: int) -> NoReturn:
        status = 1
        try:
            self._requests.close()
            self._connection.close()
            os.setpgid(0, 0)
            for number in (signal.SIGCHLD, signal.SIGTERM):
                signal.signal(number, signal.SIG_DFL)
            for at in (1, 2):
                os.dup2(errors_at, at)
            os.close(errors_at)
            end_with(parent)
            Connection(os.dup(connection_at)).send((os.getpid(), self._complete))
            self._serve(connection_at)
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stderr.flush()
            os._exit(status)


def serve_alone(descriptor: int) -> None:
    """Load all stages, then serve: main function where nothing is forked."""
    module, load, serve = Connection(os.dup(descriptor)).recv()
    library = import_module(module)
    for _ in getattr(library, load)():
        pass
    getattr(library, serve)(descriptor)
