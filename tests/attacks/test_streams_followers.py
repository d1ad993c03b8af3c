"""Five hundred followers of a job: memory alone, and no one else waits for them."""

import asyncio
import time
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from api.storage.database import Database, open_database
from api.storage.job_records import change
from tests.tools.api_servers import key_of, problem, serving, speaking
from tests.tools.followers import Stream, connected
from tests.tools.processes import memory, wait_until, worked
from tests.tools.scenarios import document
from tests.tools.serving import Server

FOLLOWERS = 500
CHECKS = 30
STEPS = 20
ROOM = {"SYNCPLAN_MAX_STREAMS": "2000", "SYNCPLAN_MAX_QUEUED_JOBS": "100"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Database]]:
    """A server that does no jobs, and its database."""
    folder = tmp_path_factory.mktemp("site")
    with serving(folder, "ann bob", "--no-worker", **ROOM) as server:
        database = open_database(f"sqlite:///{folder}/data/syncplan.db")
        yield server, database
        database.close()


@pytest.fixture(scope="module")
def server(site: tuple[Server, Database]) -> Server:
    """The server."""
    return site[0]


@pytest.fixture(scope="module")
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The one who follows."""
    with speaking(server, "ann") as http:
        yield http


@pytest.fixture
def job(ann: httpx2.Client) -> str:
    """A job that waits for good."""
    return queued(ann)


def queued(http: httpx2.Client) -> str:
    """Ask for a job and return its identifier."""
    plan = http.post("/v1/plans", json=document()).json()["id"]
    made: str = http.post(f"/v1/plans/{plan}/validations", json={"trials": 1000}).json()["id"]
    return made


def healthy(server: Server) -> float:
    """Return the least time in s of some health checks: other work on the machine adds to it."""
    times = []
    with httpx2.Client(base_url=server.url, timeout=300.0) as http:
        for _ in range(CHECKS):
            began = time.perf_counter()
            assert http.get("/healthz").status_code == 200
            times.append(time.perf_counter() - began)
    return min(times)


async def read(server: Server, job: str) -> None:
    """Read a job as often as it is followed, all at once."""
    async with connected(server, f"/v1/jobs/{job}", FOLLOWERS, key_of("ann")) as streams:
        await answered(streams, b"}}")


async def answered(streams: list[Stream], with_: bytes) -> None:
    """Wait until all have read something."""
    await asyncio.gather(*(one.read_until(with_) for one in streams))


@pytest.mark.long
def test_every_follower_gets_every_event_and_memory_is_given_back(
    site: tuple[Server, Database], ann: httpx2.Client, job: str
) -> None:
    server, database = site
    process = server.popen.pid

    async def followed(job: str) -> int:
        async with connected(server, f"/v1/jobs/{job}/events", FOLLOWERS, key_of("ann")) as streams:
            await answered(streams, b"event: job")
            held = memory(process)
            for _ in range(STEPS):
                with database.writing() as connection:
                    assert change(connection, job, state="running")
                await asyncio.sleep(0.02)
            await asyncio.to_thread(ann.post, f"/v1/jobs/{job}/cancel")
            for one in streams:
                text = await one.read_until(b"0\r\n\r\n")
                numbers = [line for line in text.splitlines() if line.startswith(b"id: ")]
                assert numbers == [b"id: %d" % (k + 1) for k in range(STEPS + 2)]
            return held

    asyncio.run(read(server, job))
    before = memory(process)
    assert asyncio.run(followed(job)) - before < FOLLOWERS * 64 * 1024
    # Python's allocator keeps what it once had; more than that would be a leak
    after = memory(process)
    asyncio.run(followed(queued(ann)))
    wait_until(lambda: memory(process) < 1.1 * after)


@pytest.mark.long
def test_an_owner_has_so_many_streams_and_takes_none_from_others(
    tmp_path: Path,
) -> None:
    with (
        serving(tmp_path, "ann bob", "--no-worker", SYNCPLAN_MAX_STREAMS="3") as server,
        speaking(server, "ann") as ann,
        speaking(server, "bob") as bob,
    ):
        at = f"/v1/jobs/{queued(ann)}/events"

        async def full() -> None:
            async with connected(server, at, 3, key_of("ann")) as streams:
                await answered(streams, b"event: job")
                refused = problem(await asyncio.to_thread(ann.get, at), 429)
                assert refused.detail.startswith("you have 3 event streams open, the most allowed")
                other = f"/v1/jobs/{await asyncio.to_thread(queued, bob)}/events"
                async with connected(server, other, 1, key_of("bob")) as his:
                    assert b"200 OK" in await his[0].read_until(b"event: job")
            # a place is free as soon as somebody leaves
            async with connected(server, at, 1, key_of("ann")) as streams:
                assert b"200 OK" in await streams[0].read_until(b"event: job")
            assert server.stop() == 0

        asyncio.run(full())


@pytest.mark.long
def test_followers_cost_no_processor_time_and_health_is_answered_as_ever(
    server: Server, job: str
) -> None:
    """The same number of reads of the job is the measure of what 500 requests cost."""
    process, at = server.popen.pid, f"/v1/jobs/{job}"

    async def cost(path: str, until: bytes, then_s: float) -> tuple[float, float]:
        before = worked(process)
        async with connected(server, path, FOLLOWERS, key_of("ann")) as streams:
            await answered(streams, until)
            await asyncio.sleep(then_s)
            spent = worked(process) - before
            return spent, await asyncio.to_thread(healthy, server)

    alone = healthy(server)
    reads, _ = asyncio.run(cost(at, b"}}", 0.0))
    followed, beside = asyncio.run(cost(f"{at}/events", b"event: job", 2.0))
    print(f"reads {reads:.2f} s, followers {followed:.2f} s; alone {alone}, beside {beside}")
    assert followed < 2.5 * reads
    assert beside < 6.0 * max(alone, healthy(server))
