"""The process that starts HTTP processes, keeps their number, and collects their metrics.

It listens and serves nothing: all of them take connections from the one socket. Whatever ends it
ends them too: it asks them to, or the kernel kills them.
"""

import contextlib
import logging
import signal
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any

from api.metrics import Collected
from api.processes.scraping import Scrapes
from api.settings import Settings
from api.shares import ConnectionTable, Enrolment, Share
from syncplan.runtime.child_processes import ChildProcess

_GRACE_S = 15.0
"""Longer than a process takes that ends its requests and its children in good order."""

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0
_SOUND_S = 30.0
"""A process that has lived for so long did not fail at its start."""

_logger = logging.getLogger("syncplan.serve")


@dataclass(slots=True, eq=False)
class _Member:
    """A place among the processes and who has it.

    Attributes
    ----------
    process : None until the next one is started, at `due`
    pause_s : how long to wait before that
    """

    share: Share
    process: ChildProcess | None = None
    ready: bool = False
    born: float = 0.0
    due: float = 0.0
    pause_s: float = _FIRST_PAUSE_S


def serve_by_processes(settings: Settings, listening: socket.socket) -> bool:
    """Serve on a socket by several processes until SIGTERM or Ctrl-C.

    Returns whether they could start. Call it from the main thread, with which they end.
    """
    with _end_signalled() as signalled:
        supervisor = _Supervisor(settings, listening)
        try:
            return supervisor.run(signalled)
        finally:
            supervisor.close()


@contextlib.contextmanager
def _end_signalled() -> Iterator[socket.socket]:
    """A socket that can be read from once a signal has come that ends the service."""
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
    """The processes, by their numbers."""

    def __init__(self, settings: Settings, listening: socket.socket) -> None:
        count = settings.http_processes
        self._settings = settings
        self._listening = listening
        self._table = ConnectionTable.made(count)
        self._members = [_Member(Share(number, count)) for number in range(count)]
        self._scrapes = Scrapes(self._send)
        self._began = False
        self._takes: dict[str, Callable[[_Member, Any], None]] = {
            "ready": self._ready,
            "scrape": self._scrape,
            "sampled": self._sampled,
        }

    def run(self, signalled: socket.socket) -> bool:
        """Keep the processes until `signalled` can be read; False if one can't begin at all."""
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
            self._scrapes.conclude_due()

    def close(self) -> None:
        """End all processes, in good order if they can."""
        processes = [one.process for one in self._members if one.process is not None]
        for one in processes:
            one.process.terminate()
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
        if self._scrapes.deadline is not None:
            moments.append(self._scrapes.deadline)
        return max(0.0, min(moments) - time.monotonic()) if moments else None

    def _start(self, member: _Member) -> None:
        member.born, member.ready = time.monotonic(), False
        kept = (self._listening.fileno(), self._table.descriptor)
        try:
            member.process = ChildProcess("api.processes.member", "serve", heir=True, keep=kept)
            member.process.connection.send(Enrolment(self._settings, member.share, *kept))
        except OSError as error:
            _logger.error("HTTP process %d could not be started: %s", member.share.number, error)
            self._lost(member)

    def _hear(self, member: _Member) -> bool:
        """Take what a process sends; return False if it has ended before all had begun."""
        assert member.process is not None
        try:
            kind, value = member.process.connection.recv()
        except (EOFError, OSError):
            if not self._began:
                return False
            status = member.process.process.wait()
            _logger.error("HTTP process %d ended, status %d", member.share.number, status)
            self._lost(member)
            return True
        self._takes[kind](member, value)
        return True

    def _ready(self, member: _Member, _value: None) -> None:
        member.ready = True
        self._began = self._began or all(one.ready for one in self._members)

    def _scrape(self, member: _Member, asked_as: int) -> None:
        present = [one.share.number for one in self._members if one.ready]
        self._scrapes.ask(member.share.number, asked_as, present)

    def _sampled(self, member: _Member, sample: tuple[int, Collected]) -> None:
        self._scrapes.sampled(member.share.number, *sample)

    def _lost(self, member: _Member) -> None:
        """Count a process as gone and plan the start of another in its place."""
        if member.process is not None:
            member.process.end()
        member.process, member.ready = None, False
        self._table.leave(member.share.number)
        self._scrapes.ended(member.share.number)
        now = time.monotonic()
        if now - member.born >= _SOUND_S:
            member.pause_s = _FIRST_PAUSE_S
        member.due = now + member.pause_s
        member.pause_s = min(2.0 * member.pause_s, _LONGEST_PAUSE_S)

    def _send(self, number: int, kind: str, value: object) -> None:
        process = self._members[number].process
        # one that has just ended is heard of next
        if process is not None:
            with contextlib.suppress(OSError):
                process.connection.send((kind, value))
