"""Five hundred followers of a job: memory alone, and no one else waits for them."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from socket import socket

import httpx2
import pytest

from api.storage.database import open_database
from api.storage.job_records import change
from tests.tools.api_servers import key_of, problem, serving, speaking
from tests.tools.processes import memory, wait_until, worked
from tests.tools.raw_connections import answered, crowd_of, read_until, request_of
from tests.tools.scenarios import document
from tests.tools.serving import Server

FOLLOWERS = 500
CHECKS = 30
STEPS = 20
ROOM = {"SYNCPLAN_MAX_STREAMS": "2000", "SYNCPLAN_MAX_QUEUED_JOBS": "100"}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that does no jobs."""
    with serving(tmp_path_factory.mktemp("site"), "ann bob", "--no-worker", **ROOM) as one:
        yield one


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


@contextmanager
def following(server: Server, number: int, path: str, owner: str) -> Iterator[list[socket]]:
    """Connections on which a stream has begun, or another answer is there."""
    with crowd_of(server, number, request_of(path, key_of(owner))) as crowd:
        wait_until(lambda: answered(crowd) == number)
        yield crowd


@pytest.mark.long
def test_every_follower_gets_every_event_and_memory_is_given_back(
    server: Server, ann: httpx2.Client, job: str
) -> None:
    process = server.popen.pid
    database = open_database(f"sqlite:///{server.log.parent}/data/syncplan.db")

    def followed(job: str) -> int:
        with following(server, FOLLOWERS, f"/v1/jobs/{job}/events", "ann") as streams:
            held = memory(process)
            for _ in range(STEPS):
                with database.writing() as connection:
                    assert change(connection, job, state="running")
                time.sleep(0.02)
            ann.post(f"/v1/jobs/{job}/cancel")
            for one in streams:
                lines = read_until(one, b"0\r\n\r\n").splitlines()
                numbers = [line for line in lines if line.startswith(b"id: ")]
                assert numbers == [b"id: %d" % (k + 1) for k in range(STEPS + 2)]
            return held

    with following(server, FOLLOWERS, f"/v1/jobs/{job}", "ann"):
        before = memory(process)
    assert followed(job) - before < FOLLOWERS * 64 * 1024
    # Python's allocator keeps what it once had; more than that would be a leak
    after = memory(process)
    followed(queued(ann))
    wait_until(lambda: memory(process) < 1.1 * after)
    database.close()


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
        with following(server, 3, at, "ann"):
            refused = problem(ann.get(at), 429)
            assert refused.detail.startswith("you have 3 event streams open, the most allowed")
            with following(server, 1, f"/v1/jobs/{queued(bob)}/events", "bob") as his:
                assert b"200 OK" in read_until(his[0], b"event: job")
        # a place is free as soon as somebody leaves
        with following(server, 1, at, "ann") as streams:
            assert b"200 OK" in read_until(streams[0], b"event: job")
        assert server.stop() == 0


@pytest.mark.long
def test_followers_cost_no_processor_time_and_health_is_answered_as_ever(
    server: Server, job: str
) -> None:
    """The same number of reads of the job is the measure of what 500 requests cost."""
    process, at = server.popen.pid, f"/v1/jobs/{job}"

    def cost(path: str, then_s: float) -> tuple[float, float]:
        before = worked(process)
        with following(server, FOLLOWERS, path, "ann"):
            time.sleep(then_s)
            return worked(process) - before, healthy(server)

    alone = healthy(server)
    reads, _ = cost(at, 0.0)
    followed, beside = cost(f"{at}/events", 2.0)
    print(f"reads {reads:.2f} s, followers {followed:.2f} s; alone {alone}, beside {beside}")
    assert followed < 2.5 * reads
    assert beside < 6.0 * max(alone, healthy(server))
