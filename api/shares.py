"""One of several HTTP processes on a socket: its part of the limits, and of the connections.

    number        0         1         2
    shared table  [ 17 ]    [ 16 ]    [ away ]      connections of each, written by itself

A new connection wakes every process that waits on the socket. Who has more connections than another
lets that one go first for a moment, so that a few clients that stay connected are spread evenly;
after that moment it takes the connection, whatever keeps the other.
"""

import mmap
import os
import struct
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from api.settings import Settings

_DIVIDED = (
    "max_connections",
    "max_connections_per_address",
    "max_plan_queue",
    "max_refused_keys",
    "max_requests",
    "max_streams",
)
"""Limits of the whole service, of which each process keeps its part."""

_ENTRY = struct.Struct("=I")
_AWAY = 2**32 - 1


@dataclass(frozen=True, slots=True)
class Share:
    """Which of how many processes this one is, from 0 on."""

    number: int = 0
    count: int = 1

    @property
    def first(self) -> bool:
        """Whether this process does what one process alone does."""
        return self.number == 0

    def of(self, total: int) -> int:
        """Return this process's part of a total; parts add up to it, but each is at least 1."""
        return max(1, (total + self.count - 1 - self.number) // self.count)


ALONE = Share()
"""The share of a service of one HTTP process."""


def divided(settings: Settings, share: Share) -> Settings:
    """Return the settings of one of several processes, of which the first has the worker."""
    update: dict[str, Any] = {
        name: share.of(total) for name in _DIVIDED if (total := getattr(settings, name)) is not None
    }
    if not share.first:
        update["embedded_worker"] = False
    return settings.model_copy(update=update)


class ConnectionTable:
    """How many connections each process has, in memory that all of them share.

    Parameters
    ----------
    descriptor : of the memory, from `made`
    """

    def __init__(self, descriptor: int, count: int) -> None:
        self.descriptor = descriptor
        self.count = count
        self._memory = mmap.mmap(descriptor, count * _ENTRY.size)

    @classmethod
    def made(cls, count: int) -> "ConnectionTable":
        """Return a table for so many processes, none of which takes connections yet."""
        with tempfile.TemporaryFile() as file:
            file.truncate(count * _ENTRY.size)
            table = cls(os.dup(file.fileno()), count)
        for number in range(count):
            table.leave(number)
        return table

    def enter(self, number: int, connections: int) -> None:
        """State how many connections a process has."""
        _ENTRY.pack_into(self._memory, number * _ENTRY.size, connections)

    def leave(self, number: int) -> None:
        """State that a process takes no connections: nobody lets it go first."""
        self.enter(number, _AWAY)

    def least(self) -> int:
        """Return the connections of the process that has fewest."""
        entries: list[int] = [entry for (entry,) in _ENTRY.iter_unpack(self._memory[:])]
        return min(entries)


@dataclass(frozen=True, slots=True)
class Place:
    """A process's place among those on one socket.

    Attributes
    ----------
    begun : called once it takes connections
    """

    table: ConnectionTable
    number: int
    begun: Callable[[], None]

    def gives_way(self, connections: int) -> bool:
        """State how many connections there are; return whether another process has fewer."""
        self.table.enter(self.number, connections)
        return self.table.least() < connections

    def leave(self) -> None:
        """State that no more connections are taken."""
        self.table.leave(self.number)


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
