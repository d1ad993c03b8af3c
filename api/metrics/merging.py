"""The metrics of several processes as those of one service.

What processes count is summed, also what those have counted that have ended: a counter that fell
would look like a restart. What each process reads alike from the database is taken once.
"""

from collections.abc import Callable, Iterable, Sequence

from prometheus_client.core import Metric
from prometheus_client.samples import Sample

from api.metrics.metric_table import METRICS

Collected = Sequence[Metric]
"""The metrics of a process at one moment."""

_EARLIEST = ("process_start_time_seconds", "process_max_fds")
_COUNTS = {"counter", "histogram"}

_Key = tuple[str, tuple[tuple[str, str], ...]]


def merged(processes: Iterable[Collected]) -> Collected:
    """Return the metrics of a service of these processes."""
    families: dict[str, list[Metric]] = {}
    for metrics in processes:
        for metric in metrics:
            families.setdefault(metric.name, []).append(metric)
    return [_one(found[:1] if _of_service(found[0]) else found) for found in families.values()]


def counted(metrics: Collected) -> Collected:
    """Return what stays of the metrics of a process that has ended: its counts."""
    return [one for one in metrics if one.type in _COUNTS]


def own(metrics: Collected) -> Collected:
    """Return what holds of a process that can't be asked just now: not what it has read."""
    return [one for one in metrics if not _of_service(one)]


def _of_service(metric: Metric) -> bool:
    entry = METRICS.get(metric.name)
    return entry is not None and entry.of == "service"


def _one(found: Collected) -> Metric:
    values: dict[_Key, Sample] = {}
    for metric in found:
        for sample in metric.samples:
            key = (sample.name, tuple(sorted(sample.labels.items())))
            known = values.get(key)
            values[key] = (
                sample
                if known is None
                else known._replace(value=_reduction(sample.name)((known.value, sample.value)))
            )
    together = Metric(found[0].name, found[0].documentation, found[0].type)
    together.samples = list(values.values())
    return together


def _reduction(name: str) -> Callable[[Iterable[float]], float]:
    if name in METRICS and METRICS[name].over == "max":
        return max
    return min if name in _EARLIEST or name.endswith("_created") else sum
