"""Followers of jobs on one reader: order, catching up, outages, rest, and ends."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable
from typing import Any
from unittest.mock import Mock

import pytest
from sqlalchemy import delete, event
from sqlalchemy.exc import OperationalError

from api import following
from api.following import MOST_RECENT, Follower, JobWatch
from api.problems import TooManyRequests
from api.security import Keyring
from api.settings import load_settings
from api.storage.database import Database
from api.storage.job_records import NewJob, add_job, change, end_job
from api.storage.tables import jobs
from tests.tools.processes import PATIENCE_S

NEW = NewJob("validation", "{}", 1000, None, None)


@pytest.fixture
def job(database: Database) -> str:
    """A job with one event."""
    return added(database)


def added(database: Database) -> str:
    """Enter a job and return its identifier."""
    with database.writing() as connection:
        return add_job(connection, "ann", NEW).id


def changed(database: Database, job_id: str, times: int = 1) -> None:
    """Change a job so often."""
    with database.writing() as connection:
        for _ in range(times):
            assert change(connection, job_id, state="running")


def ended(database: Database, job_id: str) -> None:
    """End a job."""
    with database.writing() as connection:
        assert end_job(connection, job_id, "cancelled")


def run(database: Database, test: Callable[[JobWatch], Awaitable[None]], **options: Any) -> None:
    """Run a test with a watch, which is closed at the end."""

    async def within() -> None:
        given = {
            "most_streams": 1000,
            "keyring": Keyring(load_settings()),
            "is_ending": lambda: False,
            **options,
        }
        watch = JobWatch(database, **given)
        try:
            async with asyncio.timeout(PATIENCE_S):
                await test(watch)
        finally:
            watch.close()

    asyncio.run(within())


async def numbers(watch: JobWatch, job_id: str, seen: int = 0) -> AsyncGenerator[int, None]:
    """Yield the numbers of a new follower's events."""
    follower = Follower("ann", b"", job_id, seen)
    with watch.following(follower):
        async for text in watch.events(follower):
            for line in text.decode().splitlines():
                if line.startswith("id: "):
                    yield int(line.removeprefix("id: "))


async def all_numbers(watch: JobWatch, job_id: str, seen: int = 0) -> list[int]:
    """Return the numbers of all events up to the end of a stream."""
    return [number async for number in numbers(watch, job_id, seen)]


def test_a_follower_gets_what_came_after_the_event_it_names(database: Database, job: str) -> None:
    changed(database, job, 5 * MOST_RECENT)
    ended(database, job)

    async def test(watch: JobWatch) -> None:
        for seen in (0, 1, 7, 249, 250, 251, 252, 9_999):
            assert await all_numbers(watch, job, seen) == list(range(seen + 1, 5 * MOST_RECENT + 3))

    run(database, test)


def test_followers_old_and_new_see_every_change_in_order(database: Database, job: str) -> None:
    async def test(watch: JobWatch) -> None:
        async with asyncio.TaskGroup() as group:
            tasks = []
            for _ in range(8):
                tasks += [group.create_task(all_numbers(watch, job)) for _ in range(5)]
                await asyncio.to_thread(changed, database, job, 30)
                await asyncio.sleep(0.1)
            await asyncio.to_thread(changed, database, job, 3 * MOST_RECENT)
            await asyncio.to_thread(ended, database, job)
        for task in tasks:
            assert task.result() == list(range(1, 8 * 30 + 3 * MOST_RECENT + 3))

    run(database, test)


def test_a_look_asks_as_often_for_a_thousand_as_for_one(database: Database) -> None:
    """Two statements for up to 200 jobs, and none while nobody follows."""
    followed = [added(database) for _ in range(150)]
    asked = 0

    @event.listens_for(database.engine, "before_cursor_execute")
    def count(*_: object) -> None:
        nonlocal asked
        asked += 1

    async def test(watch: JobWatch) -> None:
        nonlocal asked
        streams = [numbers(watch, one) for one in followed for _ in range(6)]
        assert await asyncio.gather(*(anext(one) for one in streams)) == [1] * len(streams)
        assert watch.streams == 900
        assert asked <= 6
        asked = 0
        await asyncio.sleep(0.7)
        assert 1 <= asked <= 4
        for one in streams:
            await one.aclose()
        await asyncio.sleep(0.7)
        asked = 0
        await asyncio.sleep(0.7)
        assert asked == watch.streams == 0

    run(database, test)


def test_followers_stay_while_the_database_is_away(
    database: Database, job: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    changed(database, job, 3 * MOST_RECENT)
    away = False
    for name in ("heads_of", "events_after"):
        there = getattr(following, name)

        def asked(*arguments: Any, there: Callable[..., Any] = there) -> Any:
            if away:
                raise OperationalError("select", {}, Exception("gone"), connection_invalidated=True)
            return there(*arguments)

        monkeypatch.setattr(following, name, asked)

    async def test(watch: JobWatch) -> None:
        nonlocal away
        stream = numbers(watch, job, 3 * MOST_RECENT)
        assert await anext(stream) == 3 * MOST_RECENT + 1
        away = True
        late = asyncio.create_task(all_numbers(watch, job))
        await asyncio.to_thread(ended, database, job)
        await asyncio.sleep(1.0)
        assert not late.done()
        away = False
        assert [number async for number in stream] == [3 * MOST_RECENT + 2]
        assert await late == list(range(1, 3 * MOST_RECENT + 3))

    run(database, test)
    warnings = [one for one in caplog.records if one.name == "syncplan.following"]
    assert [one.getMessage().partition(";")[0] for one in warnings] == ["the database is away"]


def test_a_fault_of_the_reader_ends_streams_and_the_next_follower_has_a_new_one(
    database: Database, job: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def test(watch: JobWatch) -> None:
        stream = numbers(watch, job)
        assert await anext(stream) == 1
        with monkeypatch.context() as broken:
            broken.setattr(following, "heads_of", Mock(side_effect=KeyError("no such key")))
            assert [number async for number in stream] == []
        assert await anext(numbers(watch, job)) == 1

    run(database, test)
    assert [one.levelname for one in caplog.records if one.name == "syncplan.following"] == [
        "ERROR"
    ]


def test_streams_end_when_their_job_is_deleted(database: Database, job: str) -> None:
    async def test(watch: JobWatch) -> None:
        stream = numbers(watch, job)
        assert await anext(stream) == 1
        with database.writing() as connection:
            connection.execute(delete(jobs).where(jobs.c.id == job))
        assert [number async for number in stream] == []

    run(database, test)


def test_streams_end_with_the_server_even_while_the_database_hangs(
    database: Database, job: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hangs, ending = asyncio.Event(), False

    async def test(watch: JobWatch) -> None:
        nonlocal ending
        stream = numbers(watch, job)
        assert await anext(stream) == 1
        loop = asyncio.get_running_loop()
        release = asyncio.Event()

        def hang(*_: object) -> dict[str, Any]:
            loop.call_soon_threadsafe(hangs.set)
            asyncio.run_coroutine_threadsafe(release.wait(), loop).result()
            return {}

        monkeypatch.setattr(following, "heads_of", hang)
        await hangs.wait()
        late = asyncio.create_task(all_numbers(watch, added(database)))
        await asyncio.sleep(0.1)
        ending = True
        assert [number async for number in stream] == []
        assert await late == []
        release.set()

    run(database, test, is_ending=lambda: ending)


def test_an_owner_has_a_limit_and_gets_its_places_back(database: Database, job: str) -> None:
    async def test(watch: JobWatch) -> None:
        streams = [numbers(watch, job) for _ in range(2)]
        for one in streams:
            await anext(one)
        with pytest.raises(TooManyRequests), watch.following(Follower("ann", b"", job, 0)):
            pass
        with watch.following(Follower("bob", b"", job, 0)):
            assert watch.streams == 3
        await streams[0].aclose()
        assert await anext(numbers(watch, job)) == 1

    run(database, test, most_streams=2)
