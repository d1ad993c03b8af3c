"""The metrics of one application: what it counts, and sources that each scrape reads."""

import logging
from collections.abc import Callable, Iterator, Mapping

from prometheus_client import CollectorRegistry, Gauge, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.registry import Collector

from api.metrics.job_metrics import JobTally
from api.metrics.merging import Collected
from api.metrics.metric_table import METRICS, as_counter, as_histogram

Readings = Mapping[str, Mapping[tuple[str, ...], float]]
"""Values of counters and gauges by name, and by the values of their labels in order."""

Source = Callable[[], Readings]
"""What a scrape asks for readings."""

NO_ROUTE = "none"
"""Label of all paths that belong to no route: clients can invent any path."""

_METHODS = frozenset({"DELETE", "GET", "HEAD", "OPTIONS", "PATCH", "POST", "PUT"})

_log = logging.getLogger("api.metrics")


class Metrics:
    """The metrics of one application, in a registry of its own; `jobs` counts those of a worker."""

    def __init__(self, jobs: JobTally | None = None) -> None:
        registry = CollectorRegistry()
        self._registry = registry
        self._requests = as_counter("syncplan_http_requests")
        self._latency = as_histogram("syncplan_http_request_duration_seconds")
        self._refusals = as_counter("syncplan_http_refusals")
        in_flight = METRICS["syncplan_http_requests_in_flight"]
        self.in_flight = Gauge(in_flight.name, in_flight.meaning, registry=None)
        self.jobs = jobs or JobTally()
        self._watched = _Watched()
        for one in (
            self._requests,
            self._latency,
            self._refusals,
            self.in_flight,
            *self.jobs.collectors,
            self._watched,
        ):
            registry.register(one)
        ProcessCollector(registry=registry)
        self.gather: Callable[[], Collected] = self.own

    def observe(self, method: str, route: str, status: str, duration_s: float) -> None:
        """Count one answered request."""
        labels = (method if method in _METHODS else "other", route or NO_ROUTE, status)
        self._requests.labels(*labels).inc()
        self._latency.labels(*labels).observe(duration_s)

    def refused(self, status: str, reason: str) -> None:
        """Count one request that was answered with a problem."""
        self._refusals.labels(status, reason).inc()

    def watch(self, *sources: Source) -> None:
        """Let each scrape read these sources as well."""
        self._watched.sources += sources

    def own(self) -> Collected:
        """Return the metrics of this process."""
        return list(self._registry.collect())

    def render(self) -> tuple[bytes, str]:
        """Return (text in Prometheus' format, its media type), of the whole service.

        It is that of this process unless `gather` was set to ask others.
        """
        families = _Gathered(self.gather())
        return generate_latest(families), CONTENT_TYPE_PLAIN_0_0_4


class _Gathered(Collector):
    """Metrics that have been read already."""

    def __init__(self, metrics: Collected) -> None:
        self._metrics = metrics

    def collect(self) -> Iterator[Metric]:
        """Return them."""
        return iter(self._metrics)


class _Watched(Collector):
    """Figures read from elsewhere at each scrape; a source that fails is left out."""

    def __init__(self) -> None:
        self.sources: tuple[Source, ...] = ()

    def collect(self) -> Iterator[Metric]:
        """Return the figures that can be read now."""
        for source in self.sources:
            try:
                readings = source()
            except Exception as error:
                # the database may be away, and Prometheus needs the rest
                _log.warning("metrics left out: %s: %s", type(error).__name__, error)
                continue
            for name, values in readings.items():
                yield _family(name, values)


def _family(name: str, values: Mapping[tuple[str, ...], float]) -> Metric:
    entry = METRICS[name]
    kind = CounterMetricFamily if entry.type == "counter" else GaugeMetricFamily
    family = kind(entry.name, entry.meaning, labels=entry.labels)
    for labels, value in values.items():
        family.add_metric(labels, value)
    return family
