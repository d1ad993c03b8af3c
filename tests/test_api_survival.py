"""Jobs that survive: processes killed, stopped and frozen, the database away, the disk full.

Real servers, real workers and a real PostgreSQL; see tests.search_survival for more moments.
"""

import contextlib
import random
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from pathlib import Path
from typing import Literal

import pytest

import syncplan
from tests.scenarios import example
from tests.serving import Postgres, Process, wait_until
from tests.survival import (
    Site,
    kill_at,
    new_database,
    quick,
    refinement,
    sweep_of_ranges,
    validation,
)

pytestmark = pytest.mark.slow

LONG = 100_000
"""Trials of a validation that takes minutes."""

EACH = pytest.mark.parametrize("address", ["sqlite", "postgresql"], indirect=True)


@pytest.fixture(scope="module")
def postgres(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Postgres]:
    started = Postgres(tmp_path_factory.mktemp("postgres"))
    yield started
    started.stop()


@pytest.fixture
def address(request: pytest.FixtureRequest) -> str | None:
    """Where an empty PostgreSQL database is; None for SQLite."""
    if request.param == "sqlite":
        return None
    return new_database(request.getfixturevalue("postgres"))


def at_work(site: Site, process: Process) -> set[int]:
    """Children of a process that compute just now."""
    before = {one: _ticks(one) for one in site.family(process)}
    time.sleep(0.4)
    return {one for one, ticks in before.items() if _ticks(one) - ticks >= 10}


def _ticks(process: int) -> int:
    """Hundredths of a second that a process has computed; 0 once it is gone."""
    with contextlib.suppress(OSError):
        values = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return int(values[11]) + int(values[12])
    return 0


def alive(process: int) -> bool:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def busy(site: Site, process: Process, number: int = 1) -> set[int]:
    """Children of a process, once that many of them compute for a job."""
    found: set[int] = set()

    def enough() -> bool:
        found.clear()
        found.update(at_work(site, process))
        return len(found) >= number

    wait_until(enough, 30.0, site.logs)
    return found


# --- killed -------------------------------------------------------------------------------------


@EACH
@pytest.mark.parametrize(("victim", "seed"), [("server", 1), ("worker", 2)])
def test_jobs_come_to_their_bytes_once_whoever_is_killed(
    address: str | None, tmp_path: Path, victim: Literal["server", "worker"], seed: int
) -> None:
    moments = random.Random(f"{seed} {address is None}")
    orders = [validation(1200, 1), refinement(0), sweep_of_ranges(200, 3), validation(600, 2)]
    with quick(tmp_path, address) as site:
        kill_at(site, orders, [moments.uniform(0.0, 1.5), moments.uniform(0.0, 4.0)], victim)


def test_a_server_killed_right_after_it_accepted_a_job_has_accepted_it(tmp_path: Path) -> None:
    with quick(tmp_path) as site:
        kill_at(site, [validation(200, 1)], [0.0, 0.0], "server")


def test_the_jobs_of_a_dead_worker_go_on_within_15_seconds(tmp_path: Path) -> None:
    with Site(tmp_path, SYNCPLAN_PROCESSES="1") as site:
        site.serve("--no-worker")
        first = site.work()
        job_id = site.hand_in(validation(4000, 1))
        busy(site, first)
        second = site.work()
        wait_until(lambda: "worker" in (tmp_path / "worker.log").read_text(), 30.0)
        site.kill(first)
        killed = time.monotonic()
        wait_until(lambda: job_id in site.held_by(second), 15.0, site.logs)
        assert time.monotonic() - killed < 15.0
        site.see_all_done()


@EACH
def test_a_client_that_asks_again_gets_each_plan_and_job_once(
    address: str | None, tmp_path: Path
) -> None:
    moments = random.Random(f"again {address is None}")
    with quick(tmp_path, address) as site:
        server = site.serve()
        over = threading.Event()

        def hand_in(seed: int) -> int:
            with syncplan.Client(site.url) as client:
                for number in count():
                    made = client.plan(example("paper-grid-same"))
                    job = client.validate(made, trials=10, seed=seed)
                    site.plans[made.id] = site.ask("GET", f"/v1/plans/{made.id}").text
                    site.jobs[job.id] = validation(10, seed)
                    if over.is_set():
                        return number + 1
            raise AssertionError

        with ThreadPoolExecutor() as pool:
            clients = [pool.submit(hand_in, seed) for seed in range(3)]
            for _ in range(3):
                time.sleep(moments.uniform(0.2, 1.5))
                site.kill(server)
                server = site.serve()
            over.set()
            handed_in = sum(client.result(timeout=60.0) for client in clients)
        assert site.count("plans") == site.count("jobs") == handed_in
        site.see_all_done()


def test_what_a_refinement_started_goes_with_the_server(tmp_path: Path) -> None:
    with quick(tmp_path) as site:
        server = site.serve()
        site.hand_in(refinement(0))

        def grandchildren() -> set[int]:
            family = site.family(server)
            return {one for one in family if _parent(one) in family}

        wait_until(lambda: len(grandchildren()) >= 2, 30.0, site.logs)
        site.kill(server)
        site.serve()
        site.see_all_done()


def _parent(process: int) -> int:
    with contextlib.suppress(OSError):
        return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
    return 0


# --- stopped ------------------------------------------------------------------------------------


@EACH
@pytest.mark.parametrize("victim", ["server", "worker"])
def test_what_ends_in_good_order_gives_its_jobs_up_at_once(
    address: str | None, tmp_path: Path, victim: Literal["server", "worker"]
) -> None:
    # nobody is found dead in this test: what was given up is there for others at once
    with quick(tmp_path, address, SYNCPLAN_DEAD_AFTER_S="600") as site:
        process: Process = site.serve(*(["--no-worker"] if victim == "worker" else []))
        if victim == "worker":
            process = site.work()
        site.hand_in(validation(2400, 1))
        site.hand_in(refinement(0))
        busy(site, process, 2)
        began = time.monotonic()
        assert process.stop() == 0
        assert time.monotonic() - began < 10.0
        site.see_family_gone(process)
        assert site.held_by(process) == []
        _ = site.serve() if victim == "server" else site.work()
        site.see_all_done()


@EACH
def test_a_worker_frozen_until_it_counts_as_dead_does_no_harm(
    address: str | None, tmp_path: Path
) -> None:
    with quick(tmp_path, address) as site:
        site.serve("--no-worker")
        first = site.work()
        for order in (validation(1200, 1), refinement(0), sweep_of_ranges(200, 3)):
            site.hand_in(order)
        busy(site, first, 2)
        first.popen.send_signal(signal.SIGSTOP)
        site.work()
        wait_until(lambda: not site.held_by(first), 30.0, site.logs)
        first.popen.send_signal(signal.SIGCONT)
        site.see_all_done()


@EACH
def test_a_cancelled_job_stops_within_two_seconds_and_stays_cancelled(
    address: str | None, tmp_path: Path
) -> None:
    with quick(tmp_path, address) as site:
        site.serve("--no-worker")
        worker = site.work()
        plan_id = site.hand_in_plan()
        body = {"trials": LONG, "seed": 0}
        path = f"/v1/plans/{plan_id}/validations"
        first, second = (site.ask("POST", path, json=body).json()["id"] for _ in range(2))
        site.wait_for(first, "running")
        computing = busy(site, worker, 2)
        site.ask("POST", f"/v1/jobs/{second}/cancel")
        assert site.ask("POST", f"/v1/jobs/{first}/cancel").json()["state"] == "cancelled"
        wait_until(lambda: not any(map(alive, computing)), 2.0, site.logs)
        site.see_ended_once(first, "cancelled")
        third = site.ask("POST", path, json=body).json()["id"]
        busy(site, worker, 2)
        with ThreadPoolExecutor() as pool:
            cancelled = pool.submit(site.ask, "POST", f"/v1/jobs/{third}/cancel")
            site.kill(worker)
        assert cancelled.result().json()["state"] == "cancelled"
        site.work()
        site.see_nothing_left()
        for job_id in (first, second, third):
            site.see_ended_once(job_id, "cancelled")
            assert site.job(job_id)["state"] == "cancelled"


# --- begun --------------------------------------------------------------------------------------


@EACH
def test_processes_that_start_on_nothing_at_the_same_moment_all_come_up(
    address: str | None, tmp_path: Path
) -> None:
    with quick(tmp_path, address) as site, quick(tmp_path, address) as other:
        with ThreadPoolExecutor() as pool:
            started = [pool.submit(one.serve, "--no-worker") for one in (site, other)] + [
                pool.submit(site.work)
            ]
            for one in started:
                one.result(timeout=60.0)
        site.hand_in(validation(100, 1))
        site.see_all_done()
