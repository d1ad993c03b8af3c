"""Several HTTP processes on one socket, for more requests than one event loop can serve.

    supervisor --- listening socket, settings, share ---> process 0, with the embedded worker
        |                                                 process 1
        +<-------------------- ready ------------------   ...

The supervisor starts the processes and replaces those that end. It listens but serves nothing: all
of them take connections from the one socket. When it ends, they end too: it asks them to, or the
kernel kills them.

uvicorn's own supervisor restarts a process that fails to start, without a pause and for ever, and
leaves its processes behind when it is killed (tests/service/test_processes.py).
"""

import contextlib
import logging
import os
import signal
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait

from api.computing.child import template
from api.connections import ConnectionTable, Place
from api.logs import configure_logs
from api.metrics import SHARED, Metrics, forget_process
from api.settings import Settings, Share, divided
from syncplan.runtime.child_processes import ChildProcess, connect_to_parent

_GRACE_S = 15.0
"""Time for a process to end (s), longer than it needs to end its requests and children."""

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0
_SOUND_S = 30.0
"""Lifetime (s) from which a process counts as well started."""

_PUBLISH_EVERY_S = 1.0

_logger = logging.getLogger("syncplan.serve")


@dataclass(slots=True, eq=False)
class _Member:
    """A place among the processes, and the process that holds it.

    Attributes
    ----------
    process : None until the next one is started, at `due`
    pause_s : s, pause before the next one
    """

    share: Share
    process: ChildProcess | None = None
    ready: bool = False
    born: float = 0.0
    due: float = 0.0
    pause_s: float = _FIRST_PAUSE_S


def serve_by_processes(settings: Settings, listening: socket.socket) -> bool:
    """Serve on a socket with several processes until SIGTERM or Ctrl-C.

    Returns whether they could start. Call it from the main thread; the processes end with it.
    """
    with (
        _end_signalled() as signalled,
        tempfile.TemporaryDirectory(prefix="syncplan-metrics-") as metrics,
    ):
        # the processes inherit it
        os.environ[SHARED] = metrics
        supervisor = _Supervisor(settings, listening, metrics)
        try:
            return supervisor.run(signalled)
        finally:
            supervisor.close()
            del os.environ[SHARED]


@contextlib.contextmanager
def _end_signalled() -> Iterator[socket.socket]:
    """Socket that becomes readable once a signal to end the service has come."""
    received, sender = socket.socketpair()
    sender.setblocking(False)

    def end(number: int, frame: object) -> None:
        with contextlib.suppress(OSError):
            sender.send(b"!")

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    with received, sender:
        yield received
        for number, handler in before.items():
            signal.signal(number, handler)


class _Supervisor:
    """Supervisor of the processes, kept by number."""

    def __init__(self, settings: Settings, listening: socket.socket, metrics: str) -> None:
        count = settings.http_processes
        self._metrics = metrics
        self._settings = settings
        self._listening = listening
        self._table = ConnectionTable.made(count)
        self._members = [_Member(Share(number, count)) for number in range(count)]
        self._began = False

    def run(self, signalled: socket.socket) -> bool:
        """Keep the processes running until `signalled` is readable; False if one can't start."""
        while True:
            for member in self._members:
                if member.process is None and member.due <= time.monotonic():
                    self._start(member)
            members = {one.process.connection: one for one in self._members if one.process}
            for found in wait([*members, signalled], self._patience_s()):
                if found is signalled:
                    return True
                if not self._hear(members[found]):  # type: ignore[index]
                    return False

    def close(self) -> None:
        """End all processes, in good order if possible."""
        processes = [one.process for one in self._members if one.process is not None]
        for one in processes:
            one.process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + _GRACE_S
        while time.monotonic() < deadline and any(one.process.poll() is None for one in processes):
            time.sleep(0.02)
        for one in processes:
            if one.process.poll() is None:
                _logger.warning("an HTTP process did not end in %g s and is killed", _GRACE_S)
            one.kill()
            one.end()

    def _patience_s(self) -> float | None:
        moments = [one.due for one in self._members if one.process is None]
        return max(0.0, min(moments) - time.monotonic()) if moments else None

    def _start(self, member: _Member) -> None:
        member.born, member.ready = time.monotonic(), False
        kept = (self._listening.fileno(), self._table.descriptor)
        try:
            member.process = ChildProcess("api.processes", "serve", heir=True, keep=kept)
            member.process.connection.send((self._settings, member.share, *kept))
        except OSError as error:
            _logger.error("HTTP process %d could not be started: %s", member.share.number, error)
            self._lost(member)

    def _hear(self, member: _Member) -> bool:
        """Note that a process is ready or has ended; return False if one ends before all began."""
        assert member.process is not None
        try:
            member.process.connection.recv()
        except (EOFError, OSError):
            if not self._began:
                return False
            status = member.process.process.wait()
            _logger.error("HTTP process %d ended, status %d", member.share.number, status)
            self._lost(member)
            return True
        member.ready = True
        self._began = self._began or all(one.ready for one in self._members)
        return True

    def _lost(self, member: _Member) -> None:
        """Count a process as gone and schedule the start of another in its place."""
        if member.process is not None:
            member.process.end()
            forget_process(member.process.process.pid, self._metrics)
        member.process, member.ready = None, False
        self._table.leave(member.share.number)
        now = time.monotonic()
        if now - member.born >= _SOUND_S:
            member.pause_s = _FIRST_PAUSE_S
        member.due = now + member.pause_s
        member.pause_s = min(2.0 * member.pause_s, _LONGEST_PAUSE_S)


# --- one of the processes -----------------------------------------------------------------------


def serve(descriptor: int) -> None:
    """Serve until the supervisor ends this process or itself; main function of the process."""
    template()
    # imports that the supervisor does not need
    from api.main import create_app
    from api.server import serve_until_told

    connection = connect_to_parent(descriptor)
    settings: Settings
    share: Share
    # then the descriptors of the socket and of the table of connections
    settings, share, listening_at, table_at = connection.recv()
    configure_logs(settings.log_level)
    app = create_app(divided(settings, share), share)
    threading.Thread(target=_end_with, args=(connection,), daemon=True, name="supervisor").start()
    threading.Thread(
        target=_publish, args=(app.state.metrics,), daemon=True, name="metrics"
    ).start()

    def ready() -> None:
        with contextlib.suppress(OSError):
            connection.send("ready")

    place = Place(ConnectionTable(table_at, share.count), share.number, ready)
    with socket.socket(fileno=listening_at) as listening:
        started = serve_until_told(app, listening, place)
    logging.shutdown()
    # threads may wait for a database that is away
    os._exit(0 if started else 1)


def _end_with(supervisor: Connection) -> None:
    """End this process once the supervisor, which sends nothing more, has gone."""
    with contextlib.suppress(EOFError, OSError):
        supervisor.recv()
    os.kill(os.getpid(), signal.SIGTERM)


def _publish(metrics: Metrics) -> None:
    while True:
        metrics.publish()
        time.sleep(_PUBLISH_EVERY_S)
