"""Prometheus metrics: one table of them, and the classes that count and render them.

Several HTTP processes keep their metrics in files that all of them read (prometheus_client's
multiprocess mode, in the folder that PROMETHEUS_MULTIPROC_DIR names). Counts of processes that have
ended stay: a counter that fell would look like a restart. That mode does not support figures that
are read at a scrape, so each process publishes its own once a second. Figures from the database,
the same for all processes, are read by the process that is scraped.
"""

import logging
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeVar

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.multiprocess import MultiProcessCollector, mark_process_dead
from prometheus_client.registry import Collector

REQUEST_S = (0.001, 0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.15, 0.25, 0.5, 1, 2.5, 5, 10, 20)
JOB_S = (0.1, 0.5, 1, 2.5, 5, 10, 30, 60, 300, 900, 3600, 14400)

MetricType = Literal["counter", "gauge", "histogram"]
Owner = Literal["process", "service"]
Over = Literal["livesum", "livemax", "livemin"]


@dataclass(frozen=True, slots=True)
class MetricEntry:
    """One metric.

    Attributes
    ----------
    name : exposed name; for a counter, without its suffix `_total`
    buckets : upper bounds of a histogram's buckets
    of : whether the figure is one of each process, to be combined over processes, or one of the
        whole service, which every process reads from the database alike
    over : prometheus_client's mode of a gauge: whether values of several processes are added up, or
        the largest or the least is taken
    """

    type: MetricType
    name: str
    meaning: str
    labels: tuple[str, ...] = ()
    buckets: tuple[float, ...] = ()
    of: Owner = "process"
    over: Over = "livesum"

    @property
    def exposed(self) -> str:
        """Name in queries; for a histogram, the name of its count."""
        return self.name + {"counter": "_total", "histogram": "_count", "gauge": ""}[self.type]


_counter = partial(MetricEntry, "counter")
_histogram = partial(MetricEntry, "histogram")
_gauge = partial(MetricEntry, "gauge")
_service_gauge = partial(MetricEntry, "gauge", of="service")

_ENTRIES = (
    _counter("syncplan_http_requests", "Requests answered", ("method", "route", "status")),
    _histogram(
        "syncplan_http_request_duration_seconds",
        "Time from a request to the first byte of its answer",
        ("method", "route", "status"),
        REQUEST_S,
    ),
    _gauge("syncplan_http_requests_in_flight", "Requests being answered"),
    _counter(
        "syncplan_http_refusals",
        "Requests answered with a problem, by its reason",
        ("status", "reason"),
    ),
    _gauge("syncplan_connections", "Connections, those held for probes included"),
    _counter(
        "syncplan_connections_refused",
        "Connections and requests refused before the application, by reason",
        ("reason",),
    ),
    _gauge("syncplan_streams", "Open streams of events"),
    _service_gauge("syncplan_jobs", "Jobs in each state", ("state",)),
    _service_gauge("syncplan_jobs_unfinished", "Jobs that wait or run, by kind", ("kind", "state")),
    _service_gauge(
        "syncplan_jobs_oldest_queued_seconds",
        "Age of the job that has waited longest for a worker, 0 if none waits",
    ),
    _service_gauge("syncplan_parts_unfinished", "Parts of running jobs without a result"),
    _service_gauge(
        "syncplan_parts_oldest_queued_seconds",
        "Age of the part that has waited longest for a worker, 0 if none waits",
    ),
    _service_gauge("syncplan_workers", "Workers, by version", ("version",)),
    _service_gauge(
        "syncplan_heartbeat_age_seconds", "Age of each worker's last heartbeat", ("worker",)
    ),
    _histogram(
        "syncplan_job_wait_seconds", "Time from a job's request to its start", ("kind",), JOB_S
    ),
    _histogram(
        "syncplan_job_duration_seconds",
        "Time from a job's start to its end",
        ("kind", "outcome"),
        JOB_S,
    ),
    _histogram(
        "syncplan_part_duration_seconds",
        "Computing time of a part of a job",
        ("part", "outcome"),
        JOB_S,
    ),
    _counter("syncplan_job_failures", "Jobs that failed", ("kind", "reason")),
    _gauge("syncplan_processes_busy", "Child processes at work"),
    _gauge("syncplan_pool_processes", "Child processes of a pool", ("pool",)),
    _gauge("syncplan_pool_tasks", "Tasks that wait in a pool or run", ("pool", "state")),
    _gauge("syncplan_pool_owners_waiting", "Owners whose tasks wait in a pool", ("pool",)),
    _gauge(
        "syncplan_pool_oldest_waiting_seconds",
        "Age of the task that has waited longest in a pool, 0 if none waits",
        ("pool",),
        over="livemax",
    ),
    _counter(
        "syncplan_pool_children_started",
        "Child processes started: at the start, for owners that would have to wait, and in place "
        "of those that were killed, had grown or were idle after a task",
        ("pool",),
    ),
)

METRICS: Mapping[str, MetricEntry] = {entry.name: entry for entry in _ENTRIES}
"""Every metric by its name."""

M = TypeVar("M", Counter, Histogram, Gauge)


def registered(kind: type[M], name: str, registry: CollectorRegistry) -> M:
    """Return a metric of prometheus_client for an entry of the table."""
    entry = METRICS[name]
    options: dict[str, Any] = {"multiprocess_mode": entry.over} if kind is Gauge else {}
    if entry.buckets:
        options["buckets"] = entry.buckets
    return kind(entry.name, entry.meaning, entry.labels, registry=registry, **options)


# --- jobs -----------------------------------------------------------------------------------------


class JobTally:
    """Counts of the jobs that this process ended, and of the parts that it computed.

    An application exposes them through their registry.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._waits = registered(Histogram, "syncplan_job_wait_seconds", self.registry)
        self._durations = registered(Histogram, "syncplan_job_duration_seconds", self.registry)
        self._failures = registered(Counter, "syncplan_job_failures", self.registry)
        self._parts = registered(Histogram, "syncplan_part_duration_seconds", self.registry)

    def ended(
        self, kind: str, outcome: str, *, waited_s: float, took_s: float, reason: str | None = None
    ) -> None:
        """Count a job that ended; `reason` is the class of a failure."""
        self._waits.labels(kind).observe(max(waited_s, 0.0))
        self._durations.labels(kind, outcome).observe(max(took_s, 0.0))
        if reason is not None:
            self._failures.labels(kind, reason).inc()

    def part_over(self, part: str, outcome: str, took_s: float) -> None:
        """Count a part that was computed or attempted."""
        self._parts.labels(part, outcome).observe(took_s)


# --- the registry ---------------------------------------------------------------------------------


Readings = Mapping[str, Mapping[tuple[str, ...], float]]
"""Values of counters and gauges by name, and by the values of their labels in order."""

Source = Callable[[], Readings]
"""Function that a scrape calls for readings."""

SHARED = "PROMETHEUS_MULTIPROC_DIR"
"""Environment variable that names the folder of shared metrics, set before processes start."""

_OVER: Mapping[str, Over] = {"process_start_time_seconds": "livemin", "process_max_fds": "livemin"}
"""Figures of which the service reports the least over its processes."""

NO_ROUTE = "none"
"""Label of all paths that belong to no route: clients can invent any path."""

_METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT"})

_log = logging.getLogger("api.metrics")


class Metrics:
    """Metrics of one application in its own registry; `jobs` counts the jobs of a worker."""

    def __init__(self, jobs: JobTally | None = None) -> None:
        self._registry = registry = CollectorRegistry()
        self._requests = registered(Counter, "syncplan_http_requests", registry)
        self._latency = registered(Histogram, "syncplan_http_request_duration_seconds", registry)
        self._refusals = registered(Counter, "syncplan_http_refusals", registry)
        self.in_flight = registered(Gauge, "syncplan_http_requests_in_flight", registry)
        self.jobs = jobs or JobTally()
        self._watched: dict[Owner, _Watched] = {"process": _Watched(), "service": _Watched()}
        for collector in (self.jobs.registry, *self._watched.values()):
            registry.register(collector)
        self._process = ProcessCollector(registry=registry)
        self._published = _Published()
        self._publishing = threading.Lock()

    def observe(self, method: str, route: str, status: str, duration_s: float) -> None:
        """Count one answered request."""
        labels = (method if method in _METHODS else "other", route or NO_ROUTE, status)
        self._requests.labels(*labels).inc()
        self._latency.labels(*labels).observe(duration_s)

    def refused(self, status: str, reason: str) -> None:
        """Count one request that was answered with a problem."""
        self._refusals.labels(status, reason).inc()

    def watch(self, *sources: Source, of: Owner = "process") -> None:
        """Add sources for each scrape to read."""
        self._watched[of].sources += sources

    def publish(self) -> None:
        """Make the readings of this process visible to scrapes of the others."""
        with self._publishing:
            for collector in (self._watched["process"], self._process):
                for family in collector.collect():
                    self._published.take(family)

    def render(self) -> tuple[bytes, str]:
        """Return the metrics of all HTTP processes as (text in Prometheus' format, media type)."""
        registry = self._registry
        if SHARED in os.environ:
            self.publish()
            registry = CollectorRegistry()
            MultiProcessCollector(registry)  # type: ignore[no-untyped-call]
            registry.register(self._watched["service"])
        return generate_latest(registry), CONTENT_TYPE_PLAIN_0_0_4


class _Watched(Collector):
    """Figures read from sources at each scrape; a source that fails is left out."""

    def __init__(self) -> None:
        self.sources: tuple[Source, ...] = ()

    def collect(self) -> Iterator[Metric]:
        """Yield the figures that can be read now."""
        for source in self.sources:
            try:
                readings = source()
            except Exception as error:
                # the database may be away, and Prometheus needs the rest
                _log.warning("metrics left out: %s: %s", type(error).__name__, error)
                continue
            for name, values in readings.items():
                yield _family(name, values)


class _Published:
    """Copies of readings as metrics that other processes can find."""

    def __init__(self) -> None:
        self._copies: dict[str, Counter | Gauge] = {}
        self._counted: dict[tuple[str, ...], float] = {}

    def take(self, family: Metric) -> None:
        """Set the copy of a family of counters or gauges to its current values."""
        for sample in family.samples:
            if family.name not in self._copies:
                self._copies[family.name] = _copy_of(family, tuple(sample.labels))
            copy = self._copies[family.name]
            one = copy.labels(**sample.labels) if sample.labels else copy
            if isinstance(one, Gauge):
                one.set(sample.value)
            else:
                key = (family.name, *sample.labels.values())
                one.inc(sample.value - self._counted.get(key, 0.0))
                self._counted[key] = sample.value


def _copy_of(family: Metric, labels: tuple[str, ...]) -> Counter | Gauge:
    name, meaning = family.name, family.documentation
    if family.type == "counter":
        return Counter(name, meaning, labels, registry=None)
    mode = METRICS[name].over if name in METRICS else _OVER.get(name, "livesum")
    return Gauge(name, meaning, labels, registry=None, multiprocess_mode=mode)


def forget_process(pid: int, folder: str) -> None:
    """Drop the gauges of an HTTP process that has ended; its counts stay."""
    mark_process_dead(pid, folder)  # type: ignore[no-untyped-call]


def _family(name: str, values: Mapping[tuple[str, ...], float]) -> Metric:
    entry = METRICS[name]
    kind = CounterMetricFamily if entry.type == "counter" else GaugeMetricFamily
    family = kind(entry.name, entry.meaning, labels=entry.labels)
    for labels, value in values.items():
        family.add_metric(labels, value)
    return family
