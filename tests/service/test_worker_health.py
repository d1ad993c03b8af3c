"""A worker's own paths: whether it lives and works, and what it counts."""

import contextlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import httpx2
import pytest

from api.computing.pool import Pool
from api.problems import Unavailable
from api.routes.service_routes import readyz
from tests.tools.api_servers import key_of, problem
from tests.tools.processes import wait_until
from tests.tools.serving import QUICK, Process, free_port, running, settings_of

KEYS = {"SYNCPLAN_API_KEYS": f"ann:{key_of('ann')}"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the worker's log and data lie."""
    return tmp_path_factory.mktemp("worker")


@pytest.fixture(scope="module")
def http(folder: Path) -> Iterator[httpx2.Client]:
    """A connection to the port of a worker that is ready; it ends in good order."""
    port = free_port()
    log = folder / "log"
    given = {**settings_of(folder / "data"), **QUICK, **KEYS}
    worker = Process("worker", "--port", str(port), log=log, **given)
    with running(worker), httpx2.Client(base_url=f"http://127.0.0.1:{port}") as client:

        def ready() -> bool:
            assert worker.popen.poll() is None, log.read_text()
            with contextlib.suppress(httpx2.TransportError):
                return client.get("/readyz").status_code == 200
            return False

        wait_until(ready, otherwise=lambda: log.read_text()[-3000:])
        yield client
        assert worker.stop() == 0


@pytest.mark.long
def test_a_worker_answers_machines_and_nobody_else(http: httpx2.Client) -> None:
    assert http.get("/healthz").json() == {"status": "ok"}
    problem(http.get("/metrics"), 401)
    key = {"authorization": f"Bearer {key_of('ann')}"}
    figures = http.get("/metrics", headers=key).text
    assert 'syncplan_pool_processes{pool="jobs"} 1.0' in figures
    assert 'syncplan_jobs{state="queued"} 0.0' in figures
    assert 'syncplan_http_refusals_total{reason="unauthorized",status="401"} 1.0' in figures
    for path in ("/", "/v1/plans", "/openapi.json", "/v1/jobs"):
        problem(http.get(path, headers=key), 404)


@pytest.mark.long
def test_a_worker_without_a_heartbeat_is_not_ready(http: httpx2.Client, folder: Path) -> None:
    with contextlib.closing(
        sqlite3.connect(folder / "data" / "syncplan.db", isolation_level=None)
    ) as other:
        # nobody else can write, so no heartbeat is written; reading goes on
        other.execute("BEGIN IMMEDIATE")
        wait_until(lambda: http.get("/readyz").status_code == 503)
        assert http.get("/healthz").status_code == 200
    wait_until(lambda: http.get("/readyz").status_code == 200)


def test_a_service_whose_processes_are_starting_is_not_ready() -> None:
    pool = Pool(1, background=False)
    service = Mock(pool=pool, heartbeat=None)
    service.settings.dead_after_s = 1.0
    with contextlib.closing(pool):
        with pytest.raises(Unavailable, match="starting"):
            readyz(service)
        wait_until(lambda: pool.ready)
        assert readyz(service).status == "ok"
