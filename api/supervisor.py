"""The process that starts HTTP processes, keeps their number, and collects their metrics.

    supervisor --- listening socket, settings, share ---> member 0, with the embedded worker
        |                                                 member 1
        +---- asks for samples, answers scrapes ------->  ...

It serves nothing itself: all of them take connections from the one socket. Whatever ends it ends
them too: it asks them to, or the kernel kills them. uvicorn's own supervisor restarts a process
that can't begin for ever, and its processes outlive it where it is killed
(tests/service/test_processes.py).

    member 1: scrape --> round: sample? to all --> sampled, sampled, ... --> scraped to member 1

A process that does not answer a scrape in time counts with its last sample, one that has ended with
what it had counted by then, so that no counter falls.
"""

import contextlib
import itertools
import logging
import signal
import socket
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from typing import Any

from api.connections import ConnectionTable
from api.metrics import Collected, counted, merged, own
from api.settings import Settings, Share
from syncplan.runtime.child_processes import ChildProcess

# --- scrapes --------------------------------------------------------------------------------------


_PATIENCE_S = 1.5


@dataclass(slots=True, eq=False)
class _Round:
    """A scrape that waits for samples of those missing, until its deadline."""

    asker: int
    asked_as: int
    missing: set[int]
    deadline: float
    samples: list[Collected] = field(default_factory=list)


class Scrapes:
    """The scrapes under way, and what is known of every process.

    Parameters
    ----------
    send : sends a process, by its number, a kind of message and a value
    clock : s
    """

    def __init__(
        self,
        send: Callable[[int, str, object], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._send = send
        self._clock = clock
        self._numbers = itertools.count()
        self._rounds: dict[int, _Round] = {}
        self._last: dict[int, Collected] = {}
        self._departed: Collected = []

    @property
    def deadline(self) -> float | None:
        """When `conclude_due` is to be called next, in s of the clock; None if never."""
        return min((one.deadline for one in self._rounds.values()), default=None)

    def ask(self, asker: int, asked_as: int, present: Collection[int]) -> None:
        """Begin a scrape for a process, which knows it by a number of its own."""
        number = next(self._numbers)
        deadline = self._clock() + _PATIENCE_S
        self._rounds[number] = _Round(asker, asked_as, set(present), deadline)
        for member in present:
            self._send(member, "sample", number)

    def sampled(self, member: int, number: int, metrics: Collected) -> None:
        """Take the sample of a process."""
        self._last[member] = metrics
        found = self._rounds.get(number)
        if found is not None and member in found.missing:
            found.missing.remove(member)
            found.samples.append(metrics)
            if not found.missing:
                self._conclude(number)

    def ended(self, member: int) -> None:
        """Keep what a process has counted that is gone."""
        gone = counted(self._last.pop(member, ()))
        self._departed = merged([self._departed, gone])
        for number, one in list(self._rounds.items()):
            one.missing.discard(member)
            if one.asker == member:
                del self._rounds[number]
            elif not one.missing:
                self._conclude(number)

    def conclude_due(self) -> None:
        """Answer the scrapes that have waited long enough."""
        now = self._clock()
        for number in [number for number, one in self._rounds.items() if one.deadline <= now]:
            self._conclude(number)

    def _conclude(self, number: int) -> None:
        one = self._rounds.pop(number)
        late = [own(self._last.get(member, ())) for member in one.missing]
        samples = [*one.samples, *late, self._departed]
        self._send(one.asker, "scraped", (one.asked_as, samples))


# --- processes ------------------------------------------------------------------------------------


_GRACE_S = 15.0
"""Longer than a process takes that ends its requests and its children in good order."""

_FIRST_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0
_SOUND_S = 30.0
"""A process that has lived for so long did not fail at its start."""

_logger = logging.getLogger("syncplan.serve")


@dataclass(frozen=True, slots=True)
class Enrolment:
    """What the supervisor hands a process.

    Attributes
    ----------
    listening, table : descriptors of the socket and of the table of connections
    """

    settings: Settings
    share: Share
    listening: int
    table: int


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
            member.process = ChildProcess("api.member", "serve", heir=True, keep=kept)
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
