"""Event streams of jobs, with one reader of the database for all followers.

    database --- one query a look ---> FollowedJob ---> every follower of that job
        \\---- a hundred at a time ---> a follower who is behind

A follower costs only memory. The reader has its own thread, so that followers take none from
requests, and rests while there are no followers. While the database is away it looks less often,
and all streams stay open.
"""

import asyncio
import contextlib
import logging
from collections import Counter, deque
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import dropwhile, islice
from typing import Concatenate, ParamSpec, TypeVar

from fastapi.sse import KEEPALIVE_COMMENT, format_sse_event
from sqlalchemy import Connection, Row, and_, or_, select
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from api.problems import TooManyRequests
from api.security import Keyring
from api.storage.database import Database, unavailable
from api.storage.tables import job_events, jobs
from syncplan.studies.job_contract import JobState, has_ended

# --- events ---------------------------------------------------------------------------------------


MOST_EVENTS = 500
"""Most events read at a time."""

_JOBS_AT_ONCE = 200
"""Most jobs in one statement: SQLite limits the depth of a condition."""


@dataclass(frozen=True, slots=True)
class JobHead:
    """State of a job and the number of its last event."""

    state: JobState
    events: int


def events_after(
    connection: Connection, job_id: str, number: int, most: int = MOST_EVENTS
) -> list[tuple[int, str]]:
    """Return up to `most` events of a job after event `number`, in order, as (number, JSON).

    For further events, ask again from the last one on.
    """
    newest = newest_events(connection, {job_id: number}, most)
    return [(number, data) for _, number, data in newest]


def heads_of(connection: Connection, job_ids: Sequence[str]) -> dict[str, JobHead]:
    """Return the heads of jobs by identifier; missing jobs are left out."""
    query = select(jobs.c.id, jobs.c.state, jobs.c.events).where(jobs.c.id.in_(job_ids))
    return {row[0]: JobHead(row[1], row[2]) for row in connection.execute(query)}


def newest_events(
    connection: Connection, after: Mapping[str, int], most: int | None = None
) -> Iterable[Row[str, int, str]]:
    """Return (job, number, JSON) of each job's events after the number given for it, in order.

    If `most` is given, only that many of them.
    """
    wanted = (
        and_(job_events.c.job_id == job_id, job_events.c.number > number)
        for job_id, number in after.items()
    )
    query = (
        select(job_events.c.job_id, job_events.c.number, job_events.c.data)
        .where(or_(*wanted))
        .order_by(job_events.c.job_id, job_events.c.number)
        .limit(most)
    )
    return connection.execute(query)


# --- followed jobs --------------------------------------------------------------------------------


MOST_RECENT = 50
"""Most events of a job kept for its followers; older ones are read again."""


@dataclass(slots=True, eq=False)
class Follower:
    """Follower of a job.

    Attributes
    ----------
    key : digest of the key that requested the stream
    seen : number of the last event sent
    """

    owner: str
    key: bytes
    job_id: str
    seen: int
    ended: bool = False


@dataclass(slots=True, eq=False)
class FollowedJob:
    """A job, its newest events and its followers.

    Attributes
    ----------
    news : set, and replaced, when there is something new
    last : number of the newest event read; None before the first look
    over : whether no event follows `last`
    recent : newest events up to `last`, without gaps, as (number, bytes to send)
    """

    followers: set[Follower] = field(default_factory=set)
    news: asyncio.Event = field(default_factory=asyncio.Event)
    last: int | None = None
    over: bool = False
    recent: deque[tuple[int, bytes]] = field(default_factory=lambda: deque(maxlen=MOST_RECENT))

    @property
    def wanted_after(self) -> int:
        """Number of the event after which to read."""
        if self.last is not None:
            return self.last
        return min((one.seen for one in self.followers), default=0)

    def after(self, number: int) -> list[tuple[int, bytes]] | None:
        """Return the events after event `number`; None if some of them are no longer kept."""
        if self.last is None or number >= self.last:
            return []
        if not self.recent or self.recent[0][0] > number + 1:
            return None
        return list(dropwhile(lambda event: event[0] <= number, self.recent))

    def take(self, head: JobHead | None, found: Iterable[tuple[int, str]]) -> None:
        """Take in what a look has found, and wake the followers if anything is new."""
        before = self.last, self.over
        for number, data in found:
            if self.recent and self.recent[-1][0] != number - 1:
                self.recent.clear()
            self.recent.append((number, sent(number, data)))
            self.last = number
        if self.last is None:
            self.last = 0 if head is None else head.events
        # a missing job was deleted
        self.over = head is None or (has_ended(head.state) and self.last >= head.events)
        if (self.last, self.over) != before:
            self.wake()

    def wake(self) -> None:
        """Make all followers look again."""
        self.news.set()
        self.news = asyncio.Event()


def sent(number: int, data: str) -> bytes:
    """Return the bytes of an event in a stream."""
    return format_sse_event(id=str(number), event="job", data_str=data)


# --- the reader -----------------------------------------------------------------------------------


P = ParamSpec("P")
R = TypeVar("R")

_LOOK_EVERY_S = 0.3
_COALESCE_S = 0.02
_LONGEST_WAIT_S = 2.0
_PING_EVERY_S = 15.0
_RETRY_AFTER_S = 5
_AT_ONCE = 100

_logger = logging.getLogger("syncplan.following")


@dataclass(eq=False)
class JobWatch:
    """Followers of jobs and the reader that serves them; used on one event loop.

    Attributes
    ----------
    most_streams : most streams that an owner may have open
    keyring : valid keys; a stream ends when its key does
    is_ending : whether the server is about to end, and with it all streams
    """

    database: Database
    most_streams: int
    keyring: Keyring
    is_ending: Callable[[], bool]

    def __post_init__(self) -> None:
        self._keys_version = self.keyring.version
        self._jobs: dict[str, FollowedJob] = {}
        self._streams: Counter[str] = Counter()
        self._joined = asyncio.Event()
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._away = False
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="following")

    @property
    def streams(self) -> int:
        """Number of open streams."""
        # copied at once: metrics read it from another thread
        return sum(list(self._streams.values()))

    def close(self) -> None:
        """End all streams and abandon the read in progress."""
        self._end_all()
        self._thread.shutdown(wait=False, cancel_futures=True)

    @contextlib.contextmanager
    def following(self, follower: Follower) -> Iterator[None]:
        """Keep a follower until the block ends; raises TooManyRequests."""
        if self._streams[follower.owner] >= self.most_streams:
            raise TooManyRequests(
                f"you have {self.most_streams} event streams open, the most allowed; close one, "
                "or ask for the job itself from time to time",
                retry_after_s=_RETRY_AFTER_S,
            )
        self._streams[follower.owner] += 1
        job = self._jobs.setdefault(follower.job_id, FollowedJob())
        job.followers.add(follower)
        if job.last is None:
            self._joined.set()
        for run in (self._read, self._tick):
            if run.__name__ not in self._tasks or self._tasks[run.__name__].done():
                self._tasks[run.__name__] = asyncio.create_task(run())
        try:
            yield
        finally:
            follower.ended = True
            job.followers.discard(follower)
            if not job.followers:
                del self._jobs[follower.job_id]
            self._streams -= Counter([follower.owner])

    async def events(self, follower: Follower) -> AsyncIterator[bytes]:
        """Yield the bytes of a follower's events until the job or the follower has ended."""
        job = self._jobs[follower.job_id]
        while not follower.ended:
            # before looking, so that nothing is missed
            news = job.news
            found = job.after(follower.seen)
            if found is None:
                found = await self._missed(follower)
                if found is None:
                    continue
            if found:
                follower.seen = found[-1][0]
                yield b"".join(event for _, event in found)
            elif job.over:
                return
            elif not await _within(_PING_EVERY_S, news):
                yield KEEPALIVE_COMMENT

    async def _missed(self, follower: Follower) -> list[tuple[int, bytes]] | None:
        """Next events of a follower who is behind; None if the database is away."""
        found = await self._reading(events_after, follower.job_id, follower.seen, _AT_ONCE)
        if found is None:
            await asyncio.sleep(_LOOK_EVERY_S)
            return None
        return [(number, sent(number, data)) for number, data in found]

    # --- the reader -----------------------------------------------------------------------------

    async def _read(self) -> None:
        """Look at all followed jobs repeatedly while there are any."""
        wait = _LOOK_EVERY_S
        try:
            while self._jobs:
                # followers that join in one rush share a look
                await asyncio.sleep(_COALESCE_S)
                self._joined.clear()
                asked = {name: job.wanted_after for name, job in self._jobs.items() if not job.over}
                found = await self._reading(_look, asked) if asked else {}
                if found is None:
                    wait = min(2.0 * wait, _LONGEST_WAIT_S)
                    await asyncio.sleep(wait)
                    continue
                wait = _LOOK_EVERY_S
                for name in asked.keys() & self._jobs.keys():
                    self._jobs[name].take(*found.get(name, (None, [])))
                await _within(wait, self._joined)
        except Exception as error:
            # clients reconnect and continue where they were
            _logger.error("events can't be read: %s", type(error).__name__, exc_info=error)
            self._end_all()

    async def _tick(self) -> None:
        """End streams when the server or their keys end, even while the reader waits."""
        while self._jobs:
            if self.is_ending():
                self._end_all()
            if self.keyring.version != self._keys_version:
                self._keys_version = self.keyring.version
                self._end_all(lambda stream: not self.keyring.admits(stream.owner, stream.key))
            await asyncio.sleep(_LOOK_EVERY_S)

    async def _reading(
        self, query: Callable[Concatenate[Connection, P], R], *args: P.args, **kwargs: P.kwargs
    ) -> R | None:
        """Run a query in the reader's thread; return its result, None if the database is away."""
        read = partial(self.database.read, query, *args, **kwargs)
        reading = asyncio.get_running_loop().run_in_executor(self._thread, read)
        while not (await asyncio.wait([reading], timeout=_LOOK_EVERY_S))[0]:
            if self.is_ending():
                reading.cancel()
                return None
        error = reading.exception()
        if error is not None and not unavailable(error):
            raise error
        if error is not None and not self._away:
            _logger.warning("the database is away; streams wait for it: %s", error)
        self._away = error is not None
        return None if error is not None else reading.result()

    def _end_all(self, which: Callable[[Follower], bool] = lambda _: True) -> None:
        for job in self._jobs.values():
            for follower in filter(which, job.followers):
                follower.ended = True
            job.wake()


Found = tuple[JobHead | None, list[tuple[int, str]]]


def _look(connection: Connection, asked: Mapping[str, int]) -> dict[str, Found]:
    """Head and new events of each job, at most the newest MOST_RECENT."""
    found: dict[str, Found] = {}
    rest = iter(asked)
    while some := list(islice(rest, _JOBS_AT_ONCE)):
        heads = heads_of(connection, some)
        found.update({name: (head, []) for name, head in heads.items()})
        after = {
            name: max(asked[name], head.events - MOST_RECENT)
            for name, head in heads.items()
            if head.events > asked[name]
        }
        if after:
            for name, number, data in newest_events(connection, after):
                found[name][1].append((number, data))
    return found


async def _within(seconds: float, event: asyncio.Event) -> bool:
    """Return whether an event is set within a time."""
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            return await event.wait()
    return False


_HEADERS = {"cache-control": "no-cache", "x-accel-buffering": "no"}
"""Headers that stop caches and proxies from holding back events."""


class EventStream(StreamingResponse):
    """Event stream whose follower is registered while it is sent.

    Raises TooManyRequests, before the answer begins, if the owner has too many streams.
    """

    def __init__(self, watch: JobWatch, follower: Follower) -> None:
        super().__init__(watch.events(follower), headers=_HEADERS, media_type="text/event-stream")
        self._watch = watch
        self._follower = follower

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the stream until the job, the client or the server has ended."""
        with self._watch.following(self._follower):
            await super().__call__(scope, receive, send)
