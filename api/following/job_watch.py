"""One reader of the database for all who follow jobs: a follower costs memory alone.

    database --- one query a look ---> FollowedJob ---> every follower of that job
        \\---- a hundred at a time ---> a follower who is behind

The reader has a thread of its own, so that followers take none from requests, and rests while
nobody follows. While the database is away it looks less often, and everybody stays.
"""

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Concatenate, ParamSpec, TypeVar

from fastapi.sse import KEEPALIVE_COMMENT
from sqlalchemy import Connection

from api.following.followed_job import MOST_RECENT, FollowedJob, Follower, sent
from api.problems import TooManyRequests
from api.security import Keyring
from api.storage.database import Database, unavailable
from api.storage.events import JobHead, events_after, heads_of, newest_events

P = ParamSpec("P")
R = TypeVar("R")

_LOOK_EVERY_S = 0.3
_COALESCE_S = 0.02
_LONGEST_WAIT_S = 2.0
_PING_EVERY_S = 15.0
_RETRY_AFTER_S = 5
_AT_ONCE = 100

_logger = logging.getLogger("syncplan.following")


class JobWatch:
    """Those who follow jobs, and the reader that serves them; used on one event loop.

    Parameters
    ----------
    most_streams : that an owner may have open
    keyring : a stream ends when its key does
    is_ending : whether the server is about to end, and with it all streams
    """

    def __init__(
        self,
        database: Database,
        *,
        most_streams: int,
        keyring: Keyring,
        is_ending: Callable[[], bool],
    ) -> None:
        self._database = database
        self._keyring = keyring
        self._keys_version = keyring.version
        self._most_streams = most_streams
        self._is_ending = is_ending
        self._jobs: dict[str, FollowedJob] = {}
        self._streams: Counter[str] = Counter()
        self._joined = asyncio.Event()
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._away = False
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="following")

    @property
    def streams(self) -> int:
        """Number of open streams."""
        # at once: metrics read it from another thread
        return sum(list(self._streams.values()))

    def close(self) -> None:
        """End all streams and give up what is being read."""
        self._end_all()
        self._thread.shutdown(wait=False, cancel_futures=True)

    @contextlib.contextmanager
    def following(self, follower: Follower) -> Iterator[None]:
        """Keep a follower for as long as the block lasts; raises TooManyRequests."""
        if self._streams[follower.owner] >= self._most_streams:
            raise TooManyRequests(
                f"you have {self._most_streams} event streams open, the most allowed; close one, "
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
        """Yield a follower's events as they are sent, until the job or the follower has ended."""
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
        """The next events of one who is behind; None if the database is away."""
        found = await self._reading(events_after, follower.job_id, follower.seen, _AT_ONCE)
        if found is None:
            await asyncio.sleep(_LOOK_EVERY_S)
            return None
        return [(number, sent(number, data)) for number, data in found]

    # --- the reader -----------------------------------------------------------------------------

    async def _read(self) -> None:
        """Look at all jobs that are followed, again and again while there are any."""
        wait = _LOOK_EVERY_S
        try:
            while self._jobs:
                # those who come in one rush share a look
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
            # clients come back and go on where they were
            _logger.error("events can't be read: %s", type(error).__name__, exc_info=error)
            self._end_all()

    async def _tick(self) -> None:
        """End the streams with the server or their keys, whatever the reader waits for."""
        while self._jobs:
            if self._is_ending():
                self._end_all()
            if self._keyring.version != self._keys_version:
                self._keys_version = self._keyring.version
                self._end_all(lambda one: not self._keyring.admits(one.owner, one.key))
            await asyncio.sleep(_LOOK_EVERY_S)

    async def _reading(
        self, query: Callable[Concatenate[Connection, P], R], *args: P.args, **kwargs: P.kwargs
    ) -> R | None:
        """What a query returns, run in the reader's thread; None if the database is away."""

        def read() -> R:
            with self._database.reading() as connection:
                return query(connection, *args, **kwargs)

        reading = asyncio.get_running_loop().run_in_executor(self._thread, read)
        while not (await asyncio.wait([reading], timeout=_LOOK_EVERY_S))[0]:
            if self._is_ending():
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
    """What is new of each job after an event, the newest MOST_RECENT at most."""
    heads = heads_of(connection, list(asked))
    after = {
        name: max(asked[name], head.events - MOST_RECENT)
        for name, head in heads.items()
        if head.events > asked[name]
    }
    found: dict[str, Found] = {name: (head, []) for name, head in heads.items()}
    for name, number, data in newest_events(connection, after):
        found[name][1].append((number, data))
    return found


async def _within(seconds: float, event: asyncio.Event) -> bool:
    """Return whether an event is set within a time."""
    try:
        async with asyncio.timeout(seconds):
            return await event.wait()
    except TimeoutError:
        return False
