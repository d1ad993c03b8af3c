"""A worker beside a server: its own paths, and jobs as both count them and show them as traces."""

import asyncio
import contextlib
import re
import sqlite3
import threading
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import httpx2
import pytest
from opentelemetry.proto.trace.v1.trace_pb2 import Span, Status

from api.calls import Caller, computed
from api.computing.pool import Pool
from api.jobs.job_counts import JobCounts
from api.metrics import Metrics
from api.problems import Unavailable
from api.routes.service_routes import readyz
from api.storage.database import Database
from api.storage.job_records import NewJob, add_job, end_job
from tests.service.conftest import Hollow
from tests.tools.api_servers import done, key_of, planned, problem, serving, speaking
from tests.tools.processes import wait_until
from tests.tools.serving import QUICK, Process, free_port, running, settings_of
from tests.tools.span_collector import SpanCollector, attributes_of, collecting

KEYS = {"SYNCPLAN_API_KEYS": f"ann:{key_of('ann')}"}
TRACE = "0af7651916cd43dd8448eb211c80319c"
PARENT = {"traceparent": f"00-{TRACE}-b7ad6b7169203331-01"}
NAME = "secret-survey"


@pytest.fixture(scope="module")
def collector() -> Iterator[SpanCollector]:
    """Where the server and its worker send their spans."""
    with collecting() as one:
        yield one


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where logs and data lie."""
    return tmp_path_factory.mktemp("traced")


@pytest.fixture(scope="module")
def clients(
    folder: Path, collector: SpanCollector
) -> Iterator[tuple[httpx2.Client, httpx2.Client]]:
    """Connections to a server without a worker of its own, and to the worker beside it."""
    port = free_port()
    given = {**settings_of(folder / "data"), **collector.settings, **KEYS, **QUICK}
    with serving(folder, "ann", "--no-worker", **collector.settings) as server:
        worker = Process("worker", "--port", str(port), log=folder / "work", **given)
        with (
            running(worker),
            speaking(server, "ann") as http,
            httpx2.Client(base_url=f"http://127.0.0.1:{port}", headers=http.headers) as beside,
        ):
            wait_until(lambda: ready(beside), otherwise=lambda: worker.log.read_text()[-3000:])
            yield http, beside
            assert worker.stop() == 0


def ready(worker: httpx2.Client) -> bool:
    """Whether a worker says that it is."""
    with contextlib.suppress(httpx2.TransportError):
        return worker.get("/readyz").status_code == 200
    return False


# --- a worker's own paths -------------------------------------------------------------------------


@pytest.mark.long
def test_a_worker_answers_machines_and_nobody_else(
    clients: tuple[httpx2.Client, httpx2.Client],
) -> None:
    _, worker = clients
    assert worker.get("/healthz").json() == {"status": "ok"}
    problem(worker.get("/metrics", headers={"authorization": ""}), 401)
    figures = worker.get("/metrics").text
    assert 'syncplan_pool_processes{pool="jobs"} 1.0' in figures
    assert 'syncplan_jobs{state="queued"} 0.0' in figures
    assert 'syncplan_http_refusals_total{reason="unauthorized",status="401"} 1.0' in figures
    for path in ("/", "/v1/plans", "/openapi.json", "/v1/jobs"):
        problem(worker.get(path), 404)


@pytest.mark.long
def test_a_worker_without_a_heartbeat_is_not_ready(
    clients: tuple[httpx2.Client, httpx2.Client], folder: Path
) -> None:
    _, worker = clients
    with contextlib.closing(
        sqlite3.connect(folder / "data" / "syncplan.db", isolation_level=None)
    ) as other:
        # nobody else can write, so no heartbeat is written; reading goes on
        other.execute("BEGIN IMMEDIATE")
        wait_until(lambda: not ready(worker))
        assert worker.get("/healthz").status_code == 200
    wait_until(lambda: ready(worker))


def test_a_service_whose_processes_are_starting_is_not_ready(
    hollow: list[Hollow], monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded = threading.Event()
    monkeypatch.setattr(Hollow, "wait_until_ready", lambda _: loaded.wait())
    pool = Pool(1)
    service = Mock(pool=pool, heartbeat=None)
    service.settings.dead_after_s = 1.0
    with contextlib.closing(pool):
        wait_until(lambda: bool(hollow))
        with pytest.raises(Unavailable, match="starting"):
            readyz(service)
        # a request waits, and is not said to be one of too many
        service.settings.plan_timeout_s = 0.2
        request = Mock(receive=asyncio.Event().wait)
        request.app.state.service = service
        with pytest.raises(Unavailable, match="starting"):
            asyncio.run(computed(Caller(request, "ann"), "ready"))
        loaded.set()
        wait_until(lambda: pool.ready)
        assert readyz(service).status == "ok"


# --- jobs -----------------------------------------------------------------------------------------


def submitted(http: httpx2.Client, trials: int, headers: dict[str, str]) -> str:
    """Submit a validation and return where its job is."""
    path = f"/v1/plans/{planned(http, name=NAME)['id']}/validations"
    answer = http.post(path, json={"trials": trials}, headers=headers)
    assert answer.status_code == 202, answer.text
    return answer.headers["location"]


def spans_of(collector: SpanCollector, job: str) -> dict[str, Span]:
    """The spans of a job by name, the last one of each."""
    number = job.rpartition("/")[2]
    of_jobs = [one for one in collector.spans if "syncplan.job.id" in attributes_of(one)]
    return {one.name: one for one in of_jobs if attributes_of(one)["syncplan.job.id"] == number}


def count(http: httpx2.Client, name: str, **labels: str) -> float:
    """A figure of a process; 0 where it is not there."""
    for line in http.get("/metrics").text.splitlines():
        found = re.fullmatch(rf"{name}(?:\{{(.*)\}})? (\S+)", line)
        if found and dict(re.findall(r'(\w+)="([^"]*)"', found[1] or "")) == labels:
            return float(found[2])
    return 0.0


@pytest.mark.long
def test_a_job_is_counted_and_traced_where_it_ends(
    clients: tuple[httpx2.Client, httpx2.Client], collector: SpanCollector
) -> None:
    http, worker = clients
    job = submitted(http, 40, PARENT)
    done(http, job)
    ended = {"kind": "validation", "outcome": "succeeded"}
    wait_until(lambda: count(worker, "syncplan_job_duration_seconds_count", **ended) == 1)
    assert count(http, "syncplan_job_duration_seconds_count", **ended) == 0
    assert count(worker, "syncplan_job_wait_seconds_count", kind="validation") == 1
    for part in ("beginning", "batch", "conclusion"):
        labels = {"part": part, "outcome": "done"}
        assert count(worker, "syncplan_part_duration_seconds_count", **labels) >= 1

    names = {"job validation", "part beginning", "part batch", "part conclusion"}
    wait_until(lambda: spans_of(collector, job).keys() == names)
    for span in spans_of(collector, job).values():
        assert (span.trace_id.hex(), span.status.code == Status.STATUS_CODE_ERROR) == (TRACE, False)
    assert {attributes_of(one.resource)["service.name"] for one in collector.taken} == {"syncplan"}
    shown = attributes_of(spans_of(collector, job)["job validation"])
    assert shown["syncplan.job.kind"] == "validation"
    assert shown["syncplan.job.outcome"] == "succeeded"
    # the request's own span, under which the job's stand
    asked = "POST /v1/plans/{plan_id}/validations"
    wait_until(lambda: any(one.name == asked for one in collector.spans))
    requests = [one for one in collector.spans if one.name == asked]
    assert [one.trace_id.hex() for one in requests] == [TRACE]
    # none says who asked, or for what
    for span in collector.spans:
        for word in (NAME, "ann-", "radius_m", "Bearer"):
            assert word not in str(span)


@pytest.mark.long
def test_a_cancelled_job_is_counted_by_the_server(
    clients: tuple[httpx2.Client, httpx2.Client], collector: SpanCollector
) -> None:
    http, worker = clients
    job = submitted(http, 90_000, {})
    wait_until(lambda: http.get(job).json()["state"] == "running")
    http.post(f"{job}/cancel").raise_for_status()
    http.post(f"{job}/cancel").raise_for_status()
    ended = {"kind": "validation", "outcome": "cancelled"}
    assert count(http, "syncplan_job_duration_seconds_count", **ended) == 1
    assert count(worker, "syncplan_job_duration_seconds_count", **ended) == 0
    wait_until(lambda: "job validation" in spans_of(collector, job))
    span = spans_of(collector, job)["job validation"]
    assert attributes_of(span)["syncplan.job.outcome"] == "cancelled"
    assert span.trace_id.hex() != TRACE


def test_a_failure_is_counted_by_its_reason(database: Database) -> None:
    metrics = Metrics()
    counts = JobCounts(database, metrics.jobs)
    error = {"title": "No solution", "detail": "too far apart"}
    with database.writing() as connection:
        row = add_job(connection, "ann", NewJob("refinement", "{}", 1, None, None))
        counts.job_over(row.id)
        end_job(connection, row.id, "failed", error=error)
    counts.job_over(row.id)
    counts.job_over("nobody")
    text = metrics.render()[0].decode()
    assert 'syncplan_job_failures_total{kind="refinement",reason="no-solution"} 1.0' in text
    ended = 'syncplan_job_duration_seconds_count{kind="refinement",outcome="failed"} 1.0'
    assert ended in text
