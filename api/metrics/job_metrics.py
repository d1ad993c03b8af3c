"""What a process counts of jobs: how long they wait and take, and why they fail."""

from prometheus_client.registry import Collector

from api.metrics.metric_table import as_counter, as_histogram


class JobTally:
    """Counts of the jobs that this process ended, and of the parts that it computed."""

    def __init__(self) -> None:
        self._waits = as_histogram("syncplan_job_wait_seconds")
        self._durations = as_histogram("syncplan_job_duration_seconds")
        self._failures = as_counter("syncplan_job_failures")
        self._parts = as_histogram("syncplan_part_duration_seconds")

    @property
    def collectors(self) -> tuple[Collector, ...]:
        """What an application registers to expose the counts."""
        return self._waits, self._durations, self._failures, self._parts

    def ended(
        self, kind: str, outcome: str, *, waited_s: float, took_s: float, reason: str | None = None
    ) -> None:
        """Count a job that ended; `reason` is the class of a failure."""
        self._waits.labels(kind).observe(max(waited_s, 0.0))
        self._durations.labels(kind, outcome).observe(max(took_s, 0.0))
        if reason is not None:
            self._failures.labels(kind, reason).inc()

    def part_over(self, part: str, outcome: str, took_s: float) -> None:
        """Count a part that was computed, or tried to be."""
        self._parts.labels(part, outcome).observe(took_s)
