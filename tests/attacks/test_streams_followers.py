"""Five hundred followers of a job: memory alone, and no one else waits for them.

A key that has leaked is withdrawn while the service runs, and its streams end.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from socket import socket
from typing import Any

import httpx2
import pytest

from api.storage.database import open_database
from api.storage.job_records import change
from tests.tools.api_servers import key_of, serving, speaking
from tests.tools.processes import PATIENCE_S, memory, wait_until, worked
from tests.tools.raw_connections import answered, crowd_of, read_until, request_of
from tests.tools.scenarios import document
from tests.tools.serving import Server

FOLLOWERS = 500
CHECKS = 30
STEPS = 20
ROOM = {"SYNCPLAN_MAX_STREAMS": "2000", "SYNCPLAN_MAX_QUEUED_JOBS": "100"}
OLD, NEW, OTHER = "old-0123456789abcdef", "new-0123456789abcdef", key_of("bob")

pytestmark = pytest.mark.long


def listed(path: Path, *entries: str) -> None:
    """Put keys in the place of those that are there, as a whole."""
    beside = path.with_name("next")
    beside.write_text("\n".join(("# owners", *entries)))
    beside.chmod(0o600)
    beside.replace(path)


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with the key of one more owner."""
    path = tmp_path_factory.mktemp("keys") / "keys"
    listed(path, f"eve:{OLD}")
    return path


@pytest.fixture(scope="module")
def server(keys: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that does no jobs."""
    given = {**ROOM, "SYNCPLAN_API_KEYS_FILE": str(keys)}
    with serving(tmp_path_factory.mktemp("site"), "ann bob", "--no-worker", **given) as one:
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
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        for _ in range(CHECKS):
            began = time.perf_counter()
            assert http.get("/healthz").status_code == 200
            times.append(time.perf_counter() - began)
    return min(times)


@contextmanager
def following(server: Server, number: int, path: str, owner: str) -> Iterator[list[socket]]:
    """Connections on which a stream has begun, or another answer is there."""
    with crowd_of(server.port, number, request_of(path, key_of(owner))) as crowd:
        wait_until(lambda: answered(crowd) == number)
        yield crowd


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


def test_a_key_is_changed_without_downtime_and_the_old_one_ends_with_its_streams(
    server: Server, keys: Path
) -> None:
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:

        def asked(method: str, path: str, key: str, **options: Any) -> httpx2.Response:
            headers = {"authorization": f"Bearer {key}"}
            return http.request(method, path, headers=headers, **options)

        def status(key: str) -> int:
            return asked("GET", "/v1/plans", key).status_code

        def job_of(key: str) -> str:
            plan = asked("POST", "/v1/plans", key, json=document()).headers["location"]
            return str(asked("POST", f"{plan}/validations", key).headers["location"])

        hers, his = job_of(OLD), job_of(OTHER)
        with (
            crowd_of(server.port, 3, request_of(f"{hers}/events", OLD)) as old,
            crowd_of(server.port, 1, request_of(f"{his}/events", OTHER)) as other,
        ):
            for one in (*old, *other):
                read_until(one, b"event: job")
            listed(keys, f"eve:{OLD}", f"eve:{NEW}")
            wait_until(lambda: status(NEW) == 200)
            assert status(OLD) == status(OTHER) == 200
            with crowd_of(server.port, 1, request_of(f"{hers}/events", NEW)) as new:
                read_until(new[0], b"event: job")
                listed(keys, f"eve:{NEW}")
                for one in old:
                    assert read_until(one, b"0\r\n\r\n").endswith(b"0\r\n\r\n")
                assert status(OLD) == 401
                assert status(NEW) == status(OTHER) == 200
                # the streams of other keys go on
                for job, key, stream in ((hers, NEW, new), (his, OTHER, other)):
                    asked("POST", f"{job}/cancel", key).raise_for_status()
                    assert b"cancelled" in read_until(stream[0], b"cancelled")
        # nobody is locked out by a slip of the pen
        listed(keys, "eve")
        said = "the keys of before stay"
        wait_until(lambda: status(NEW) == 200 and said in server.log.read_text())
        assert NEW not in server.log.read_text()
