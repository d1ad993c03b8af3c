"""Jobs that wait and run and the workers there are, as the database has them."""

from datetime import datetime

from sqlalchemy import text

from api.job_kinds.job_table import JOB_KINDS
from api.jobs.queue import JobQueue
from api.metrics import Readings
from api.storage.backlog import backlog_of
from api.storage.database import Database
from syncplan.reports.job_contract import UNFINISHED

_LONGEST_READ_MS = 2000


class JobReadings:
    """A source of the figures of all jobs and workers, the same in every process."""

    def __init__(self, database: Database, queue: JobQueue) -> None:
        self._database = database
        self._queue = queue

    def __call__(self) -> Readings:
        """Return how many jobs and workers there are, and how long they have waited."""
        with self._database.reading() as connection:
            if not self._database.is_sqlite:
                connection.execute(text(f"SET LOCAL statement_timeout = {_LONGEST_READ_MS}"))
            found = backlog_of(connection)
        now = datetime.fromisoformat(found.now)
        parts_since = self._queue.oldest()
        unfinished: dict[tuple[str, ...], int] = {
            (kind, state): 0 for kind in JOB_KINDS for state in UNFINISHED
        }
        return {
            "syncplan_jobs": {(state,): number for state, number in found.by_state.items()},
            "syncplan_jobs_unfinished": {**unfinished, **found.unfinished},
            "syncplan_jobs_oldest_queued_seconds": {(): _age_s(_time(found.oldest_queued), now)},
            "syncplan_parts_unfinished": {(): found.parts},
            "syncplan_parts_oldest_queued_seconds": {(): _age_s(parts_since, now)},
            "syncplan_workers": {(name,): number for name, number in found.versions.items()},
            "syncplan_heartbeat_age_seconds": {
                (name,): _age_s(_time(seen), now) for name, seen in found.seen.items() if seen
            },
        }


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)


def _age_s(since: datetime | None, now: datetime) -> float:
    """Seconds from one time to another; 0 from none."""
    return 0.0 if since is None else max((now - since).total_seconds(), 0.0)
