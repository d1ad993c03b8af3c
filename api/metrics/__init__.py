"""What Prometheus reads of a process: one table of metrics, and what counts and renders them.

metric_table      every metric: type, labels, meaning, whose figure it is
registry          the metrics of one application, and the sources that each scrape reads
request_metrics   requests by route and status, refusals by reason
job_metrics       jobs and parts as they start and end
merging           the metrics of several processes as those of one service
"""

from api.metrics.job_metrics import JobTally
from api.metrics.merging import Collected, counted, merged, own
from api.metrics.metric_table import METRICS, MetricEntry
from api.metrics.registry import Metrics, Readings, Source
from api.metrics.request_metrics import RequestMetrics

__all__ = [
    "METRICS",
    "Collected",
    "JobTally",
    "MetricEntry",
    "Metrics",
    "Readings",
    "RequestMetrics",
    "Source",
    "counted",
    "merged",
    "own",
]
