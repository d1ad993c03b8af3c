"""One job that is followed: what was read of it last, and those who wait for more."""

import asyncio
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import dropwhile

from fastapi.sse import format_sse_event

from api.storage.events import JobHead
from syncplan.reports.job_contract import has_ended

MOST_RECENT = 50
"""Events of a job that are kept for those who follow it; older ones are read again."""


@dataclass(slots=True, eq=False)
class Follower:
    """Someone who follows a job.

    Attributes
    ----------
    key : digest of the key that the stream was asked for with
    seen : number of the last event that was sent
    """

    owner: str
    key: bytes
    job_id: str
    seen: int
    ended: bool = False


@dataclass(slots=True, eq=False)
class FollowedJob:
    """A job, its newest events, and who follows it.

    Attributes
    ----------
    news : set, and replaced, when there is something new
    last : number of the newest event that was read; None before the first look
    over : nothing comes after `last`
    recent : (number, as sent) of the newest events, without gaps, up to `last`
    """

    followers: set[Follower] = field(default_factory=set)
    news: asyncio.Event = field(default_factory=asyncio.Event)
    last: int | None = None
    over: bool = False
    recent: deque[tuple[int, bytes]] = field(default_factory=lambda: deque(maxlen=MOST_RECENT))

    @property
    def wanted_after(self) -> int:
        """The event after which it is to be read."""
        if self.last is not None:
            return self.last
        return min((one.seen for one in self.followers), default=0)

    def after(self, number: int) -> list[tuple[int, bytes]] | None:
        """Return the events after one; None if they are older than what is kept."""
        if self.last is None or number >= self.last:
            return []
        if not self.recent or self.recent[0][0] > number + 1:
            return None
        return list(dropwhile(lambda event: event[0] <= number, self.recent))

    def take(self, head: JobHead | None, found: Iterable[tuple[int, str]]) -> None:
        """Take in what a look has found, and wake the followers if it is new."""
        before = self.last, self.over
        for number, data in found:
            if self.recent and self.recent[-1][0] != number - 1:
                self.recent.clear()
            self.recent.append((number, sent(number, data)))
            self.last = number
        if self.last is None:
            self.last = 0 if head is None else head.events
        # a job that is gone was deleted
        self.over = head is None or (has_ended(head.state) and self.last >= head.events)
        if (self.last, self.over) != before:
            self.wake()

    def wake(self) -> None:
        """Let all followers look again."""
        self.news.set()
        self.news = asyncio.Event()


def sent(number: int, data: str) -> bytes:
    """Return an event as a stream sends it."""
    return format_sse_event(id=str(number), event="job", data_str=data)
