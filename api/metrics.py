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
from typing import Literal

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.multiprocess import MultiProcessCollector, mark_process_dead
from prometheus_client.registry import Collector

REQUEST_S = (0.001, 0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.15, 0.25, 0.5, 1, 2.5, 5, 10, 20)
JOB_S = (0.1, 0.5, 1, 2.5, 5, 10, 30, 60, 300, 900, 3600, 14400)

MetricType = Literal["counter", "gauge", "histogram"]
Owner = Literal["process", "service"]


@dataclass(frozen=True, slots=True)
class MetricEntry:
    """One metric.

    Attributes
    ----------
    name : exposed name; for a counter, without its suffix `_total`
    of : whether the figure is one of each process, to be combined over processes, or one of the
        whole service, which every process reads from the database alike
    buckets : upper bounds of a histogram's buckets
    over : whether values of several processes are added up, or the largest is taken
    """

    name: str
    type: MetricType
    meaning: str
    labels: tuple[str, ...] = ()
    of: Owner = "process"
    buckets: tuple[float, ...] = ()
    over: Literal["sum", "max"] = "sum"

    @property
    def exposed(self) -> str:
        """Name in queries; for a histogram, the name of its count."""
        return self.name + {"counter": "_total", "histogram": "_count", "gauge": ""}[self.type]


_ENTRIES = (
    MetricEntry(
        "syncplan_http_requests", "counter", "Requests answered", ("method", "route", "status")
    ),
    MetricEntry(
        "syncplan_http_request_duration_seconds",
        "histogram",
        "Time from a request to the first byte of its answer",
        ("method", "route", "status"),
        buckets=REQUEST_S,
    ),
    MetricEntry("syncplan_http_requests_in_flight", "gauge", "Requests being answered"),
    MetricEntry(
        "syncplan_http_refusals",
        "counter",
        "Requests answered with a problem, by its reason",
        ("status", "reason"),
    ),
    MetricEntry("syncplan_connections", "gauge", "Connections, those held for probes included"),
    MetricEntry(
        "syncplan_connections_refused",
        "counter",
        "Connections and requests refused before the application, by reason",
        ("reason",),
    ),
    MetricEntry("syncplan_streams", "gauge", "Open streams of events"),
    MetricEntry("syncplan_jobs", "gauge", "Jobs in each state", ("state",), of="service"),
    MetricEntry(
        "syncplan_jobs_unfinished",
        "gauge",
        "Jobs that wait or run, by kind",
        ("kind", "state"),
        of="service",
    ),
    MetricEntry(
        "syncplan_jobs_oldest_queued_seconds",
        "gauge",
        "Age of the job that has waited longest for a worker, 0 if none waits",
        of="service",
    ),
    MetricEntry(
        "syncplan_parts_unfinished",
        "gauge",
        "Parts of running jobs without a result",
        of="service",
    ),
    MetricEntry(
        "syncplan_parts_oldest_queued_seconds",
        "gauge",
        "Age of the part that has waited longest for a worker, 0 if none waits",
        of="service",
    ),
    MetricEntry("syncplan_workers", "gauge", "Workers, by version", ("version",), of="service"),
    MetricEntry(
        "syncplan_heartbeat_age_seconds",
        "gauge",
        "Age of each worker's last heartbeat",
        ("worker",),
        of="service",
    ),
    MetricEntry(
        "syncplan_job_wait_seconds",
        "histogram",
        "Time from a job's request to its start",
        ("kind",),
        buckets=JOB_S,
    ),
    MetricEntry(
        "syncplan_job_duration_seconds",
        "histogram",
        "Time from a job's start to its end",
        ("kind", "outcome"),
        buckets=JOB_S,
    ),
    MetricEntry(
        "syncplan_part_duration_seconds",
        "histogram",
        "Computing time of a part of a job",
        ("part", "outcome"),
        buckets=JOB_S,
    ),
    MetricEntry("syncplan_job_failures", "counter", "Jobs that failed", ("kind", "reason")),
    MetricEntry("syncplan_processes_busy", "gauge", "Child processes at work"),
    MetricEntry("syncplan_pool_processes", "gauge", "Child processes of a pool", ("pool",)),
    MetricEntry(
        "syncplan_pool_tasks", "gauge", "Tasks that wait in a pool or run", ("pool", "state")
    ),
    MetricEntry(
        "syncplan_pool_owners_waiting", "gauge", "Owners whose tasks wait in a pool", ("pool",)
    ),
    MetricEntry(
        "syncplan_pool_oldest_waiting_seconds",
        "gauge",
        "Age of the task that has waited longest in a pool, 0 if none waits",
        ("pool",),
        over="max",
    ),
    MetricEntry(
        "syncplan_pool_children_started",
        "counter",
        "Child processes started: at the start, and each in place of one that was killed or had "
        "grown",
        ("pool",),
    ),
)

METRICS: Mapping[str, MetricEntry] = {entry.name: entry for entry in _ENTRIES}
"""Every metric by its name."""


def as_counter(name: str, registry: CollectorRegistry) -> Counter:
    """Return a counter for an entry of the table."""
    entry = METRICS[name]
    return Counter(entry.name, entry.meaning, entry.labels, registry=registry)


def as_histogram(name: str, registry: CollectorRegistry) -> Histogram:
    """Return a histogram for an entry of the table."""
    entry = METRICS[name]
    return Histogram(
        entry.name, entry.meaning, entry.labels, buckets=entry.buckets, registry=registry
    )


# --- jobs -----------------------------------------------------------------------------------------


class JobTally:
    """Counts of the jobs that this process ended, and of the parts that it computed.

    An application exposes them through their registry.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._waits = as_histogram("syncplan_job_wait_seconds", self.registry)
        self._durations = as_histogram("syncplan_job_duration_seconds", self.registry)
        self._failures = as_counter("syncplan_job_failures", self.registry)
        self._parts = as_histogram("syncplan_part_duration_seconds", self.registry)

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

_EARLIEST = ("process_start_time_seconds", "process_max_fds")
"""Figures of which the service reports the least over its processes."""

NO_ROUTE = "none"
"""Label of all paths that belong to no route: clients can invent any path."""

_METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT"})

_log = logging.getLogger("api.metrics")


class Metrics:
    """Metrics of one application in its own registry; `jobs` counts the jobs of a worker."""

    def __init__(self, jobs: JobTally | None = None) -> None:
        self._registry = registry = CollectorRegistry()
        self._requests = as_counter("syncplan_http_requests", registry)
        self._latency = as_histogram("syncplan_http_request_duration_seconds", registry)
        self._refusals = as_counter("syncplan_http_refusals", registry)
        in_flight = METRICS["syncplan_http_requests_in_flight"]
        self.in_flight = Gauge(
            in_flight.name, in_flight.meaning, registry=registry, multiprocess_mode="livesum"
        )
        self.jobs = jobs or JobTally()
        self._of_process = _Watched()
        self._of_service = _Watched()
        for one in (self.jobs.registry, self._of_process, self._of_service):
            registry.register(one)
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
        watched = self._of_process if of == "process" else self._of_service
        watched.sources += sources

    def publish(self) -> None:
        """Make the readings of this process visible to scrapes of the others."""
        with self._publishing:
            for collector in (self._of_process, self._process):
                for family in collector.collect():
                    self._published.take(family)

    def render(self) -> tuple[bytes, str]:
        """Return the metrics of all HTTP processes as (text in Prometheus' format, media type)."""
        registry = self._registry
        if SHARED in os.environ:
            self.publish()
            registry = CollectorRegistry()
            MultiProcessCollector(registry)  # type: ignore[no-untyped-call]
            registry.register(self._of_service)
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
    if name in _EARLIEST:
        return Gauge(name, meaning, labels, registry=None, multiprocess_mode="livemin")
    largest = name in METRICS and METRICS[name].over == "max"
    mode: Literal["livemax", "livesum"] = "livemax" if largest else "livesum"
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
