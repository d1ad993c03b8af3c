"""Owners with much long work, more of them than there are processes: nobody else starves."""

import contextlib
import re
from collections.abc import Iterator

import httpx2
import pytest

from tests.tools.api_servers import done, key_of, planned, serving, speaking
from tests.tools.processes import wait_until
from tests.tools.raw_connections import connected, request_of
from tests.tools.scenarios import document, shared_circles
from tests.tools.serving import Server

GREEDY = ("eve", "mal", "tom")
"""More than twice as many as the server has processes."""

LONG = {"time_limit_s": 60.0, "starts": 200}


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with one process for requests and one for jobs."""
    folder = tmp_path_factory.mktemp("starved")
    with serving(folder, " ".join(("ann", *GREEDY)), SYNCPLAN_PROCESSES="1") as attacked:
        yield attacked


def state(http: httpx2.Client, job: str) -> str:
    """The state of a job."""
    return str(http.get(job).json()["state"])


@pytest.mark.long
def test_refinements_of_others_do_not_keep_a_small_job_waiting(server: Server) -> None:
    with contextlib.ExitStack() as stack:
        ann, *greedy = (stack.enter_context(speaking(server, owner)) for owner in ("ann", *GREEDY))
        plan = planned(ann)["id"]
        refinements = []
        for http in greedy:
            path = f"/v1/plans/{planned(http)['id']}/refinements"
            refinements.append(http.post(path, json=LONG).raise_for_status().headers["location"])
        # two of them have a process at least
        wait_until(
            lambda: (
                [state(*job) for job in zip(greedy, refinements, strict=True)].count("running") >= 2
            )
        )
        answer = ann.post(f"/v1/plans/{plan}/validations", json={"trials": 16})
        done(ann, answer.raise_for_status().headers["location"])
        for http, job in zip(greedy, refinements, strict=True):
            assert state(http, job) == "running"
            http.post(f"{job}/cancel").raise_for_status()


def running(http: httpx2.Client) -> float:
    """The number of requests that are computed just now."""
    figures = http.get("/metrics").text
    count = re.search(r'syncplan_pool_tasks\{pool="requests",state="running"\} (\S+)', figures)
    assert count
    return float(count[1])


@pytest.mark.long
def test_slow_plans_of_others_do_not_keep_a_request_waiting(server: Server) -> None:
    slow = [request_of("/v1/plans", key_of(owner), shared_circles(8)) for owner in GREEDY]
    with contextlib.ExitStack() as stack:
        ann = stack.enter_context(speaking(server, "ann"))
        crowd = [stack.enter_context(connected(server.port)) for _ in range(4) for _ in GREEDY]
        for place, connection in enumerate(crowd):
            connection.sendall(slow[place % len(slow)])
            connection.setblocking(False)
        # twice as many are computed as there are processes
        wait_until(lambda: running(ann) >= 2)
        assert ann.post("/v1/plans", json=document()).status_code == 201
        for connection in crowd[: len(GREEDY)]:
            with pytest.raises(BlockingIOError):
                connection.recv(1)
