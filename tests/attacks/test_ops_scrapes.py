"""A busy service on PostgreSQL: a table that hangs, and twenty long jobs of one owner.

Scrapes of the metrics hold up neither each other nor requests, and jobs no job of another.
"""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import httpx2
import psycopg
import pytest

from api.storage.database import BUSY_S
from tests.tools.api_servers import serving, speaking
from tests.tools.processes import memory_given_back, wait_until
from tests.tools.scenarios import example
from tests.tools.serving import Postgres, Server

SCRAPES = 60
"""More than the 40 threads that answer requests."""

LONG_JOBS = 20
PATIENCE_S = 100.0
"""For a job that takes a second or, where a process is started for it, a few."""

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def address(postgres: Postgres) -> str:
    """Where the database of the service is."""
    return postgres.new_database()


@pytest.fixture(scope="module")
def server(address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service with two processes for jobs."""
    settings = {"SYNCPLAN_PROCESSES": "2", "SYNCPLAN_DATABASE_URL": address}
    with serving(tmp_path_factory.mktemp("busy"), "ann bob", **settings) as one:
        yield one


def test_scrapes_of_a_locked_table_leave_room_for_requests(server: Server, address: str) -> None:
    """A backup or a migration locks tables; each scrape used to wait for them in a thread."""

    def asked(path: str) -> tuple[int, float]:
        began = time.monotonic()
        with speaking(server, "ann") as http:
            status = http.get(path).status_code
        return status, time.monotonic() - began

    with (
        psycopg.connect(address) as other,
        ThreadPoolExecutor(SCRAPES + 1) as clients,
    ):
        # the first readings, and what they load
        assert asked("/metrics")[0] == 200
        time.sleep(1.1)
        other.execute("LOCK TABLE jobs IN ACCESS EXCLUSIVE MODE")
        scrapes = [clients.submit(asked, "/metrics") for _ in range(SCRAPES)]
        time.sleep(0.5)
        status, took_s = asked("/v1/plans")
        answers = [one.result() for one in scrapes]
        other.rollback()
    print(f"a list of plans took {took_s:.2f} s, scrapes {max(s for _, s in answers):.2f} s")
    assert status == 200
    assert {one for one, _ in answers} == {200}
    # what waits for the table waits so long
    assert took_s < BUSY_S
    assert max(seconds for _, seconds in answers) < BUSY_S


def long_job(number: int, plan_id: str, scenario: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The path and the body of a job that takes minutes: of each kind in turn."""
    validation = (f"/v1/plans/{plan_id}/validations", {"trials": 100_000, "seed": number})
    search = {"vary": ["phases", "centers"], "starts": 1000, "time_limit_s": 600}
    sweep = {"scenario": scenario, "range_m": [45.0, 55.0], "trials": 50_000, "seed": number}
    return (validation, (f"/v1/plans/{plan_id}/refinements", search), ("/v1/sweeps", sweep))[
        number % 3
    ]


def succeeded(http: httpx2.Client, job: str) -> bool:
    shown = http.get(f"/v1/jobs/{job}").json()
    assert shown["state"] not in ("failed", "cancelled"), shown
    return bool(shown["state"] == "succeeded")


def test_twenty_long_jobs_do_not_hold_up_a_short_one_of_another(server: Server) -> None:
    scenario = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
    with speaking(server, "ann") as ann, speaking(server, "bob") as bob:
        plans = {one: one.post("/v1/plans", json=scenario).json()["id"] for one in (ann, bob)}
        with memory_given_back(server.popen.pid):
            for number in range(LONG_JOBS):
                path, body = long_job(number, plans[ann], scenario)
                answer = ann.post(path, json=body)
                assert answer.status_code == 202, answer.text

        def at_work() -> int:
            jobs = ann.get("/v1/jobs").json()["items"]
            return sum(job["state"] == "running" for job in jobs)

        wait_until(lambda: at_work() >= 2)
        path = f"/v1/plans/{plans[bob]}/validations"
        for seed in range(3):
            job = bob.post(path, json={"trials": 10, "seed": seed}).json()["id"]
            wait_until(partial(succeeded, bob, job), PATIENCE_S)
        ended = [job["id"] for job in ann.get("/v1/jobs").json()["items"] if job["ended_at"]]
        assert ended == []
        assert at_work() >= 2
