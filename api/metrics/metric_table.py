"""Every metric: its type, labels and meaning, and whether it is a process's or the service's."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from prometheus_client import Counter, Histogram

REQUEST_S = (
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
JOB_S = (0.1, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 900.0, 3600.0, 14400.0)

MetricType = Literal["counter", "gauge", "histogram"]


@dataclass(frozen=True, slots=True)
class MetricEntry:
    """One metric.

    Attributes
    ----------
    name : as it is exposed, a counter's without its suffix `_total`
    of : a figure of the process that is read, to be summed over processes; or one of the whole
        service, which each process reads from the database alike
    buckets : upper bounds, of a histogram
    over : whether values of several processes are added up, or the largest is taken
    """

    name: str
    type: MetricType
    meaning: str
    labels: tuple[str, ...] = ()
    of: Literal["process", "service"] = "process"
    buckets: tuple[float, ...] = ()
    over: Literal["sum", "max"] = "sum"

    @property
    def exposed(self) -> str:
        """The name by which queries find it; of a histogram, that of its count."""
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


def as_counter(name: str) -> Counter:
    """Return a counter of the table, not registered yet."""
    entry = METRICS[name]
    return Counter(entry.name, entry.meaning, entry.labels, registry=None)


def as_histogram(name: str) -> Histogram:
    """Return a histogram of the table, not registered yet."""
    entry = METRICS[name]
    return Histogram(entry.name, entry.meaning, entry.labels, buckets=entry.buckets, registry=None)
