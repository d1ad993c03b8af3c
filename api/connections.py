"""Connections: limits in all and per address, a reserve for probes, and time limits.

Several processes may take connections from one socket:

    number        0         1         2
    shared table  [ 17 ]    [ 16 ]    [ away ]      connections of each, written by itself

A new connection wakes every process that waits on the socket. A process with more connections than
another gives way for a moment, so that a few clients that stay connected are spread evenly. After
that moment it takes the connection, whatever delays the other.
"""

import logging
import mmap
import os
import resource
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from api.logs import SeldomLog
from api.settings import Settings

LARGEST_RESERVE = 64
"""Most connections beyond the limits held open for a moment, in case they are probes."""

NEVER = float("inf")
"""Due time of a connection from which nothing is expected."""

_MOST_BY_DEFAULT = 4096
_LEAST_BY_DEFAULT = 32
_OTHER_DESCRIPTORS = 320
"""Descriptors left for the database, child processes (four each), the reserve, and files."""

_log = logging.getLogger("api.connections")


_ENOUGH = 65_536
"""Open files to ask for, far more than any limit of the service needs; some systems allow 1e9."""


@dataclass(frozen=True, slots=True)
class ConnectionLimits:
    """Most connections, and the time limits of each.

    Attributes
    ----------
    total : connections of this process
    per_address : connections of one client address, or of one /64 of IPv6
    head_s : s, from the first byte of a head, or from the connection, to the head's end
    body_s : s, from the end of a head to the end of its body
    answer_s : s, for a client to read a further part of its answer
    idle_s : s, between an answer and the next request
    """

    total: int = _MOST_BY_DEFAULT
    per_address: int = _MOST_BY_DEFAULT
    head_s: float = 10.0
    body_s: float = 30.0
    answer_s: float = 30.0
    idle_s: float = 5.0


def limits_of_connections(settings: Settings, descriptors: int) -> ConnectionLimits:
    """Return the limits from the settings, for a process with this many file descriptors."""
    spare = max(_LEAST_BY_DEFAULT, descriptors - _OTHER_DESCRIPTORS)
    total = settings.max_connections or min(_MOST_BY_DEFAULT, spare)
    return ConnectionLimits(
        total=total,
        per_address=settings.max_connections_per_address or max(1, total // 2),
        head_s=settings.head_timeout_s,
        body_s=settings.body_timeout_s,
        answer_s=settings.answer_timeout_s,
        idle_s=settings.idle_timeout_s,
    )


def raise_limit() -> int:
    """Raise this process's limit of open files as far as the system allows, and return it."""
    given = resource.getrlimit(resource.RLIMIT_NOFILE)
    soft, hard = (_ENOUGH if limit == resource.RLIM_INFINITY else limit for limit in given)
    wanted = min(hard, _ENOUGH)
    if soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, given[1]))
    return max(soft, wanted)


class Guest(Protocol):
    """A connection as the limits count it.

    Attributes
    ----------
    network : network under which its address counts
    engaged : whether one of its requests is being answered
    """

    network: str

    @property
    def engaged(self) -> bool:
        """Whether one of its requests is being answered."""

    def turn_away(self) -> None:
        """Answer that there is no room, and close."""


class Connections:
    """The connections of one process, each counted as ordinary or held in the reserve.

    Attributes
    ----------
    refusals : number of refused connections and requests, by reason
    """

    def __init__(self, limits: ConnectionLimits) -> None:
        self.limits = limits
        self.refusals: Counter[str] = Counter()
        self._ordinary: set[Guest] = set()
        self._by_network: Counter[str] = Counter()
        # oldest first
        self._reserve: dict[Guest, None] = {}
        self._seldom = SeldomLog(_log)

    @property
    def number(self) -> int:
        """Number of connections, including the reserve."""
        return len(self._ordinary) + len(self._reserve)

    def enter(self, guest: Guest) -> bool:
        """Admit a connection, or else put it into the reserve; return whether it was admitted.

        A full reserve turns away its oldest guest with no request being answered.
        """
        if self._has_room(guest.network):
            self._admit(guest)
            return True
        if len(self._reserve) >= LARGEST_RESERVE:
            oldest = next((one for one in self._reserve if not one.engaged), guest)
            self._reserve.pop(oldest, None)
            oldest.turn_away()
            if oldest is guest:
                return False
        self._reserve[guest] = None
        return False

    def promote(self, guest: Guest) -> bool:
        """Admit a guest of the reserve if there is room by now; return whether it was admitted."""
        if guest not in self._reserve or not self._has_room(guest.network):
            return False
        del self._reserve[guest]
        self._admit(guest)
        return True

    def leave(self, guest: Guest) -> None:
        """Forget a closed connection."""
        self._reserve.pop(guest, None)
        if guest in self._ordinary:
            self._ordinary.remove(guest)
            self._by_network[guest.network] -= 1
            if not self._by_network[guest.network]:
                del self._by_network[guest.network]

    def refused(self, reason: str, detail: str, address: str) -> None:
        """Count a refusal, and log it now and then."""
        self.refusals[reason] += 1
        self._seldom.warn(reason, detail, address=address)

    def _has_room(self, network: str) -> bool:
        limits = self.limits
        return len(self._ordinary) < limits.total and self._by_network[network] < limits.per_address

    def _admit(self, guest: Guest) -> None:
        self._ordinary.add(guest)
        self._by_network[guest.network] += 1


# --- several processes on one socket -------------------------------------------------------------


_ENTRY_BYTES = 4
_AWAY = 2**32 - 1


class ConnectionTable:
    """Numbers of connections of several processes, in memory that all of them share.

    Parameters
    ----------
    descriptor : file descriptor of the memory, from `made`
    """

    def __init__(self, descriptor: int, count: int) -> None:
        self.descriptor = descriptor
        self._entries = memoryview(mmap.mmap(descriptor, count * _ENTRY_BYTES)).cast("I")

    @classmethod
    def made(cls, count: int) -> "ConnectionTable":
        """Return a table for `count` processes, none of which takes connections yet."""
        with tempfile.TemporaryFile() as file:
            file.truncate(count * _ENTRY_BYTES)
            table = cls(os.dup(file.fileno()), count)
        for number in range(count):
            table.leave(number)
        return table

    def enter(self, number: int, connections: int) -> None:
        """Set the number of connections of a process."""
        self._entries[number] = connections

    def leave(self, number: int) -> None:
        """Mark a process as taking no connections, so that no other gives way to it."""
        self.enter(number, _AWAY)

    def least(self) -> int:
        """Return the smallest connection count of any process."""
        return min(self._entries)


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a process among those on one socket.

    Attributes
    ----------
    begun : callback for when the process takes connections
    """

    table: ConnectionTable
    number: int
    begun: Callable[[], None]

    def gives_way(self, connections: int) -> bool:
        """Publish this process's number of connections; return whether another has fewer."""
        self.table.enter(self.number, connections)
        return self.table.least() < connections

    def leave(self) -> None:
        """Mark this process as taking no more connections."""
        self.table.leave(self.number)
