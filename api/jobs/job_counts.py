"""Counts and traces of the jobs that a process ends and the parts that it computes."""

import json
import logging
from datetime import UTC, datetime, timedelta

from api.computing.turns import Ticket
from api.metrics import JobTally
from api.storage.database import Database
from api.storage.job_records import JobLife, life_of
from api.storage.part_records import BEGINNING, CONCLUSION
from api.telemetry import record_span, spans_wanted

_UNNUMBERED = {BEGINNING: "beginning", CONCLUSION: "conclusion"}

_logger = logging.getLogger("syncplan.jobs")


class JobCounts:
    """Counter of a process's jobs and parts in its metrics; records spans if they are exported.

    A job does not fail because it could not be counted.
    """

    def __init__(self, database: Database, tally: JobTally) -> None:
        self._database = database
        self.tally = tally

    def job_over(self, job_id: str) -> None:
        """Count a job that this process has ended, however it ended."""
        life = self._life(job_id)
        if life is None or life.ended_at is None:
            return
        created, ended = map(datetime.fromisoformat, (life.created_at, life.ended_at))
        # a job cancelled in the queue has never started
        started = ended if life.started_at is None else datetime.fromisoformat(life.started_at)
        reason = _reason(life.error) if life.state == "failed" else None
        self.tally.ended(
            life.kind,
            life.state,
            waited_s=(started - created).total_seconds(),
            took_s=(ended - started).total_seconds(),
            reason=reason,
        )
        if spans_wanted():
            said = {"syncplan.job.kind": life.kind, "syncplan.job.outcome": life.state}
            record_span(
                f"job {life.kind}", job_id, life.traceparent, (started, ended), said, reason
            )

    def part_over(self, job_id: str, number: int, ticket: Ticket | None, outcome: str) -> None:
        """Count a part whose task is over, unless it never began."""
        if ticket is None or ticket.began is None:
            return
        took_s = ticket.ran_s
        part = _UNNUMBERED.get(number, "batch")
        self.tally.part_over(part, outcome, took_s)
        life = self._life(job_id) if spans_wanted() else None
        if life is not None:
            ended = datetime.now(UTC)
            said: dict[str, str | int] = {
                "syncplan.job.kind": life.kind,
                "syncplan.part.number": number,
                "syncplan.part.outcome": outcome,
            }
            times = ended - timedelta(seconds=took_s), ended
            failure = None if outcome in ("done", "given-up") else outcome
            record_span(f"part {part}", job_id, life.traceparent, times, said, failure)

    def _life(self, job_id: str) -> JobLife | None:
        try:
            return self._database.read(life_of, job_id)
        except Exception as error:
            _logger.warning("job %s is not counted: %s", job_id, error)
            return None


def _reason(error: str | None) -> str:
    """Class of a failure, from its title, such as bad-input."""
    title = json.loads(error or "{}").get("title", "unknown")
    return str(title).lower().replace(" ", "-")
