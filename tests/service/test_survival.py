"""Jobs that survive: processes stopped and frozen, the database away.

Real servers, real workers and a real PostgreSQL. tests.searches.survival kills
servers, workers and children at random moments.
"""

import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Literal

import pytest

from tests.tools.api_servers import problem
from tests.tools.busy_children import at_work, busy, on_duty
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import example
from tests.tools.serving import Postgres, Process
from tests.tools.survival import designed, quick, refinement, sweep_of_ranges, validation

pytestmark = pytest.mark.long

LONG = 100_000
"""Trials of a validation that takes minutes."""

# --- stopped ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "victim"),
    [("sqlite", "server"), ("postgresql", "worker")],
    indirect=["address"],
)
def test_what_ends_in_good_order_gives_its_jobs_up_at_once(
    address: str | None, tmp_path: Path, victim: Literal["server", "worker"]
) -> None:
    # nobody is found dead in this test: what was given up is there for others at once
    with quick(tmp_path, address, SYNCPLAN_DEAD_AFTER_S="600") as site:
        process: Process = site.serve(*(["--no-worker"] if victim == "worker" else []))
        if victim == "worker":
            process = site.work()
        for order in (validation(600, 1), refinement(0), designed()):
            site.hand_in(order)
        busy(site, process, 2)
        assert process.stop() == 0
        site.see_family_gone(process)
        assert site.held_by(process) == []
        _ = site.serve() if victim == "server" else site.work()
        site.see_all_done()


def test_a_worker_frozen_until_it_counts_as_dead_does_no_harm(
    tmp_path: Path, postgres: Postgres
) -> None:
    with quick(tmp_path, postgres.new_database()) as site:
        site.serve("--no-worker")
        first = site.work()
        for order in (validation(600, 1), refinement(0), sweep_of_ranges(200, 3)):
            site.hand_in(order)
        busy(site, first, 2)
        first.popen.send_signal(signal.SIGSTOP)
        site.work()
        wait_until(lambda: not site.held_by(first), otherwise=site.logs)
        first.popen.send_signal(signal.SIGCONT)
        site.see_all_done()


def test_a_cancelled_job_stops_long_before_its_end_and_stays_cancelled(tmp_path: Path) -> None:
    with quick(tmp_path) as site:
        site.serve("--no-worker")
        worker = site.work()
        # its children have got ready, and compute no more
        wait_until(lambda: len(site.family(worker)) >= 2, otherwise=site.logs)
        wait_until(lambda: not at_work(site, worker), otherwise=site.logs)
        plan_id = site.hand_in_plan()
        body = {"trials": LONG, "seed": 0}
        path = f"/v1/plans/{plan_id}/validations"
        first, second = (site.ask("POST", path, json=body).json()["id"] for _ in range(2))
        wait_until(lambda: site.job(first)["progress"]["done"] > 0, otherwise=site.logs)
        computing = busy(site, worker, 2)
        assert site.ask("POST", f"/v1/jobs/{second}/cancel").json()["state"] == "cancelled"
        assert site.ask("POST", f"/v1/jobs/{first}/cancel").json()["state"] == "cancelled"
        wait_until(lambda: not computing & at_work(site, worker), 60.0, site.logs)
        site.see_ended_once(first, "cancelled")
        # what is left of a cancelled job holds up nobody
        site.wait_for(site.hand_in(validation(10, 0)), "succeeded")
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


@pytest.mark.parametrize("address", ["sqlite", "postgresql"], indirect=True)
def test_processes_that_start_on_nothing_at_the_same_moment_all_come_up(
    address: str | None, tmp_path: Path
) -> None:
    with quick(tmp_path, address) as site:
        with ThreadPoolExecutor() as pool:
            for begun in (pool.submit(site.serve, "--no-worker"), pool.submit(site.work)):
                begun.result(timeout=PATIENCE_S)
        site.hand_in(validation(10, 0))
        site.see_all_done()


# --- the database away --------------------------------------------------------------------------


def every_request(plan_id: str, job_id: str) -> list[tuple[str, str, dict[str, Any]]]:
    """Requests of all kinds that need the database."""
    scenario = example("paper-grid-same").model_dump(mode="json", exclude_none=True)
    return [
        ("GET", "/readyz", {}),
        ("POST", "/v1/plans", {"json": scenario}),
        ("POST", "/v1/plans", {"json": scenario, "headers": {"idempotency-key": "again"}}),
        ("GET", "/v1/plans", {}),
        ("GET", f"/v1/plans/{plan_id}", {}),
        ("DELETE", f"/v1/plans/{plan_id}", {}),
        ("POST", f"/v1/plans/{plan_id}/validations", {"json": {"trials": 10}}),
        ("POST", f"/v1/plans/{plan_id}/refinements", {"json": {}}),
        ("POST", "/v1/sweeps", {"json": {"scenario": scenario, "range_m": [50.0]}}),
        ("GET", "/v1/jobs", {}),
        ("GET", f"/v1/jobs/{job_id}", {}),
        ("GET", f"/v1/jobs/{job_id}/events", {"headers": {"accept": "text/event-stream"}}),
        ("GET", f"/v1/jobs/{job_id}/result", {}),
        ("POST", f"/v1/jobs/{job_id}/cancel", {}),
    ]


def test_the_database_away_for_ten_seconds_costs_nothing_but_time(
    tmp_path: Path, postgres: Postgres
) -> None:
    with quick(tmp_path, postgres.new_database(), SYNCPLAN_DEAD_AFTER_S="8") as site:
        server = site.serve()
        worker, ending = site.work(), site.work()
        plan_id = site.hand_in_plan()
        jobs = [
            site.hand_in(order, None if order.kind != "validation" else plan_id)
            for order in (validation(600, 1), refinement(0), validation(600, 2))
        ]
        busy(site, server)
        on_duty(site, 2)
        with ThreadPoolExecutor() as pool:
            followed = pool.submit(site.events, jobs[0])
            streams = "\nsyncplan_streams 1.0\n"
            wait_until(lambda: streams in site.ask("GET", "/metrics").text, otherwise=site.logs)
            postgres.stop()
            away = time.monotonic()
            try:
                while time.monotonic() - away < 10.0:
                    for method, path, options in every_request(plan_id, jobs[0]):
                        answer = site.ask(method, path, **options)
                        problem(answer, 503)
                        assert int(answer.headers["retry-after"]) >= 1
                    assert site.ask("GET", "/healthz").status_code == 200
                    assert site.ask("GET", "/metrics").status_code in (200, 503)
                    if ending.popen.returncode is None:
                        assert ending.stop() == 0
            finally:
                postgres.start()
            assert followed.result(timeout=PATIENCE_S)[-1]["state"] == "succeeded"
        site.see_all_done()
        assert server.popen.poll() is worker.popen.poll() is None
        # the one that ended could not say so, and nobody else was taken for dead
        found_dead = [line for line in site.log_lines() if "is dead" in line]
        assert all(f"-{ending.popen.pid}-" in line for line in found_dead)
