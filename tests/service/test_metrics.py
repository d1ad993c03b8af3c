"""Metrics: counts by route and status, gauges that are asked for, nothing shared by two apps."""

import asyncio
import threading
import time
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from fastapi import APIRouter, FastAPI
from fastapi.testclient import TestClient
from prometheus_client.parser import text_string_to_metric_families
from starlette.types import Receive, Scope, Send

from api.answering import Answering
from api.metrics import Metrics, Readings
from api.problems import TooManyRequests
from api.readings import Cached
from tests.tools.api_apps import bare_app
from tests.tools.processes import PATIENCE_S

Samples = dict[tuple[str, tuple[tuple[str, str], ...]], float]


def _samples(metrics: Metrics) -> Samples:
    text, media = metrics.render()
    assert media == "text/plain; version=0.0.4; charset=utf-8"
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text.decode())
        for sample in family.samples
    }


def _counts(metrics: Metrics, kind: str = "requests") -> dict[tuple[str, ...], float]:
    return {
        tuple(value for _, value in labels): number
        for (name, labels), number in _samples(metrics).items()
        if name == f"syncplan_http_{kind}_total"
    }


def _app(metrics: Metrics) -> FastAPI:
    app = bare_app(metrics=metrics)
    router = APIRouter()

    @router.get("/plans/{plan_id}")
    def plan(plan_id: int) -> float:
        return _samples(metrics)["syncplan_http_requests_in_flight", ()]

    @router.get("/crash")
    def crash() -> None:
        raise RuntimeError

    @router.get("/busy")
    def busy() -> None:
        raise TooManyRequests("wait", retry_after_s=1)

    app.include_router(router, prefix="/v1")
    return app


def test_requests_and_refusals_are_counted_apart() -> None:
    metrics, other = Metrics(), Metrics()
    client = TestClient(_app(metrics))
    began = time.monotonic()
    # this one is in flight, and none when all are answered
    assert client.get("/v1/plans/1").json() == 1
    took = time.monotonic() - began
    for path in ("plans/2", "plans/x", "crash", "busy", "busy", "nothing", "else", ""):
        client.get(f"/v1/{path}")
    client.post("/v1/plans/1")
    # what a client invents is one label
    client.request("BREW", "/nothing")
    client.request("MILK", "/nothing")
    assert _counts(metrics) == {
        ("GET", "/v1/plans/{plan_id}", "200"): 2,
        ("GET", "/v1/plans/{plan_id}", "422"): 1,
        ("GET", "/v1/crash", "500"): 1,
        ("GET", "/v1/busy", "429"): 2,
        ("POST", "/v1/plans/{plan_id}", "405"): 1,
        ("GET", "none", "404"): 3,
        ("other", "none", "404"): 2,
    }
    assert _counts(metrics, "refusals") == {
        ("invalid-request", "422"): 1,
        ("internal", "500"): 1,
        ("not-found", "404"): 5,
        ("too-many-requests", "429"): 2,
        ("method-not-allowed", "405"): 1,
    }
    samples = _samples(metrics)
    labels = (("method", "GET"), ("route", "/v1/plans/{plan_id}"), ("status", "200"))
    assert samples["syncplan_http_request_duration_seconds_count", labels] == 2
    assert 0 < samples["syncplan_http_request_duration_seconds_sum", labels] < took + 1.0
    assert samples["syncplan_http_requests_in_flight", ()] == 0
    assert not _counts(other)


def test_a_request_that_gets_no_answer_is_counted() -> None:
    metrics = Metrics()

    async def given_up(scope: Scope, receive: Receive, send: Send) -> None:
        raise asyncio.CancelledError

    async def nothing(*_: Any) -> Any: ...

    async def call() -> None:
        route = SimpleNamespace(path="/")
        scope = {"type": "http", "method": "GET", "path": "/", "headers": [], "route": route}
        await Answering(given_up, metrics, 1000, {})(scope, nothing, nothing)

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(call())
    assert _counts(metrics) == {("GET", "/", "unanswered"): 1}
    assert _samples(metrics)["syncplan_http_requests_in_flight", ()] == 0


def test_sources_are_read_at_each_scrape_and_not_before() -> None:
    metrics = Metrics()
    jobs: dict[tuple[str, ...], float] = {("queued",): 2}
    source = Mock(return_value={"syncplan_jobs": jobs})
    metrics.watch(source)
    metrics.watch(lambda: {"syncplan_processes_busy": {(): 3}})
    source.assert_not_called()
    samples = _samples(metrics)
    assert samples["syncplan_jobs", (("state", "queued"),)] == 2
    assert samples["syncplan_processes_busy", ()] == 3
    jobs.update({("queued",): 0, ("running",): 1})
    samples = _samples(metrics)
    assert samples["syncplan_jobs", (("state", "queued"),)] == 0
    assert samples["syncplan_jobs", (("state", "running"),)] == 1


def test_a_source_that_fails_leaves_the_others(caplog: pytest.LogCaptureFixture) -> None:
    metrics = Metrics()
    gone = Mock(side_effect=ConnectionError("the database is gone"))
    metrics.watch(gone, lambda: {"syncplan_processes_busy": {(): 1}})
    names = {name for name, _ in _samples(metrics)}
    assert "syncplan_processes_busy" in names
    assert "syncplan_jobs" not in names
    assert "the database is gone" in caplog.text


def test_scrapes_read_a_source_once_a_second() -> None:
    clock = Mock()
    first, third = ({"syncplan_processes_busy": {(): number}} for number in (1, 3))
    source = Mock(side_effect=[first, ConnectionError("away"), third])
    metrics = Metrics()
    metrics.watch(Cached(source, kept_s=1.0, clock=clock))
    seen = []
    for clock.return_value in (100.0, 100.9, 101.0, 101.9, 102.0):
        seen.append(_samples(metrics).get(("syncplan_processes_busy", ())))
    assert seen == [1, 1, None, None, 3]


def test_scrapes_do_not_wait_for_one_that_hangs() -> None:
    now, hanging, goes_on = [0.0], threading.Event(), threading.Event()

    def source() -> Readings:
        if now[0] > 0.0:
            hanging.set()
            assert goes_on.wait(PATIENCE_S)
        return {"syncplan_processes_busy": {(): 1 + now[0]}}

    cached = Cached(source, kept_s=1.0, clock=lambda: now[0])
    assert cached() == {"syncplan_processes_busy": {(): 1}}
    now[0] = 5.0
    first = threading.Thread(target=cached)
    first.start()
    assert hanging.wait(PATIENCE_S)
    assert cached() == {"syncplan_processes_busy": {(): 1}}
    goes_on.set()
    first.join()
    assert cached() == {"syncplan_processes_busy": {(): 6}}


def test_jobs_count_by_kind_and_outcome() -> None:
    metrics = Metrics()
    metrics.jobs.ended("sweep", "succeeded", waited_s=3.0, took_s=20.0)
    metrics.jobs.ended("sweep", "failed", waited_s=0.0, took_s=0.2, reason="no-solution")
    metrics.jobs.part_over("batch", "done", 7.0)
    samples = _samples(metrics)
    kind, outcome = ("kind", "sweep"), ("outcome", "succeeded")
    assert samples["syncplan_job_wait_seconds_sum", (kind,)] == 3.0
    assert samples["syncplan_job_duration_seconds_sum", (kind, outcome)] == 20.0
    assert samples["syncplan_job_failures_total", (kind, ("reason", "no-solution"))] == 1
    part = (("outcome", "done"), ("part", "batch"))
    assert samples["syncplan_part_duration_seconds_sum", part] == 7.0
