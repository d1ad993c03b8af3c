"""What a process counts of jobs: how long they wait and take, and why they fail."""

from prometheus_client.registry import Collector

from api.metrics.metric_table import as_counter, as_histogram

__all__ = ["JobTally"]


class JobTally:
    """Counts of the jobs that this process started or ended."""

    def __init__(self) -> None:
        self._waits = as_histogram("syncplan_job_wait_seconds")
        self._durations = as_histogram("syncplan_job_duration_seconds")
        self._failures = as_counter("syncplan_job_failures")

    @property
    def collectors(self) -> tuple[Collector, ...]:
        """What an application registers to expose the counts."""
        return self._waits, self._durations, self._failures

    def started(self, kind: str, waited_s: float) -> None:
        """Count a job that began after it had waited for so long."""
        self._waits.labels(kind).observe(max(waited_s, 0.0))

    def ended(self, kind: str, outcome: str, took_s: float, reason: str = "") -> None:
        """Count a job that ended; `reason` is the class of a failure."""
        self._durations.labels(kind, outcome).observe(max(took_s, 0.0))
        if outcome == "failed":
            self._failures.labels(kind, reason or "unknown").inc()
