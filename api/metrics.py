"""What Prometheus reads: requests by route and status, jobs by state, busy child processes."""

import logging
import time
from collections.abc import Callable, Iterator, Mapping

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.logs import route_template

__all__ = ["Metrics", "RequestMetrics"]

BUCKETS_S = (
    0.001,
    0.002,
    0.005,
    0.01,
    0.025,
    0.05,
    0.1,
    0.15,
    0.25,
    0.5,
    1.0,
    2.5,
    5.0,
    10.0,
    20.0,
)
NO_ROUTE = "none"
"""Label of all paths that belong to no route: clients can invent any path."""

_METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT"})
_LABELS = ("method", "route", "status")

_log = logging.getLogger("api.metrics")


class Metrics:
    """The metrics of one application, in a registry of its own."""

    def __init__(self) -> None:
        registry = CollectorRegistry()
        self._registry = registry
        self._requests = Counter(
            "syncplan_http_requests", "Requests answered", _LABELS, registry=registry
        )
        self._latency = Histogram(
            "syncplan_http_request_duration_seconds",
            "Time from a request to the first byte of its answer",
            _LABELS,
            buckets=BUCKETS_S,
            registry=registry,
        )
        self.in_flight = Gauge(
            "syncplan_http_requests_in_flight", "Requests being answered", registry=registry
        )
        self._watched = _Watched()
        registry.register(self._watched)
        ProcessCollector(registry=registry)

    def observe(self, method: str, route: str, status: str, duration_s: float) -> None:
        """Count one answered request."""
        labels = (method if method in _METHODS else "other", route or NO_ROUTE, status)
        self._requests.labels(*labels).inc()
        self._latency.labels(*labels).observe(duration_s)

    def watch_jobs(self, count: Callable[[], Mapping[str, int]]) -> None:
        """Let each reading call `count` for the number of jobs in each state."""
        self._watched.jobs = count

    def watch_processes(self, busy: Callable[[], int]) -> None:
        """Let each reading call `busy` for the number of child processes at work."""
        self._watched.processes = busy

    def render(self) -> tuple[bytes, str]:
        """Return (text in Prometheus' format, its media type)."""
        return generate_latest(self._registry), CONTENT_TYPE_PLAIN_0_0_4


class _Watched(Collector):
    """Gauges read from elsewhere at each scrape; one that fails is left out."""

    def __init__(self) -> None:
        self.jobs: Callable[[], Mapping[str, int]] | None = None
        self.processes: Callable[[], int] | None = None

    def collect(self) -> Iterator[Metric]:
        """Return the gauges that can be read now."""
        for read in (self._jobs, self._processes):
            try:
                metric = read()
            except Exception as error:
                # the database may be away, and Prometheus needs the rest
                _log.warning("gauge left out: %s: %s", type(error).__name__, error)
                continue
            if metric is not None:
                yield metric

    def _jobs(self) -> Metric | None:
        if self.jobs is None:
            return None
        metric = GaugeMetricFamily("syncplan_jobs", "Jobs in each state", labels=["state"])
        for state, number in self.jobs().items():
            metric.add_metric([state], number)
        return metric

    def _processes(self) -> Metric | None:
        if self.processes is None:
            return None
        return GaugeMetricFamily(
            "syncplan_processes_busy", "Child processes at work", value=self.processes()
        )


class RequestMetrics:
    """ASGI middleware that counts and times requests.

    A stream counts when it begins to answer, and stays in flight until it ends.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request; anything but HTTP goes through untouched."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = time.perf_counter()
        answered = False

        async def watched(message: Message) -> None:
            nonlocal answered
            if message["type"] == "http.response.start" and not answered:
                answered = True
                self._observe(scope, str(message["status"]), started)
            await send(message)

        with self.metrics.in_flight.track_inprogress():
            try:
                await self.app(scope, receive, watched)
            finally:
                if not answered:
                    self._observe(scope, "unanswered", started)

    def _observe(self, scope: Scope, status: str, started: float) -> None:
        elapsed = time.perf_counter() - started
        self.metrics.observe(scope["method"], route_template(scope), status, elapsed)
