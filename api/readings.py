"""What a scrape reads of a running process, beside what it has counted.

These are jobs and workers, from the database; child processes and their tasks; connections.
"""

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, func, select, text

from api.computing.pool import PoolDepth
from api.connections import Connections
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.queue import JobQueue
from api.metrics import Readings, Source
from api.storage.database import Database
from api.storage.tables import executors, job_parts, jobs, moment
from syncplan.reports.job_contract import STATES, UNFINISHED


@dataclass(frozen=True, slots=True)
class Backlog:
    """The work there is, and who does it.

    Attributes
    ----------
    now : the time by the database
    by_state : jobs in each state, 0 where there is none
    unfinished : jobs by (kind, state)
    oldest_queued : when the job was requested that has waited longest for a worker; None if none
    parts : parts of running jobs without a result
    seen : when each worker had its last heartbeat, None for one that does not say
    versions : workers by version, the empty one where they do not say
    """

    now: str
    by_state: Mapping[str, int]
    unfinished: Mapping[tuple[str, ...], int]
    oldest_queued: str | None
    parts: int
    seen: Mapping[str, str | None]
    versions: Mapping[str, int]


def backlog_of(connection: Connection) -> Backlog:
    """Return how much work there is now.

    One pass over an index counts all jobs; the rest reads those that have not ended.
    """
    states = select(jobs.c.state, func.count()).group_by(jobs.c.state)
    kinds = (
        select(jobs.c.kind, jobs.c.state, func.count())
        .where(jobs.c.state.in_(UNFINISHED))
        .group_by(jobs.c.kind, jobs.c.state)
    )
    oldest = select(func.min(jobs.c.created_at)).where(jobs.c.state == "queued")
    running = select(jobs.c.id).where(jobs.c.state == "running")
    parts = select(func.count()).where(job_parts.c.job_id.in_(running), job_parts.c.data.is_(None))
    workers = connection.execute(select(executors.c.id, executors.c.seen_at, executors.c.version))
    seen: dict[str, str | None] = {}
    versions: dict[str, int] = {}
    for name, seen_at, version in workers:
        seen[name] = seen_at
        versions[version or ""] = versions.get(version or "", 0) + 1
    return Backlog(
        now=moment(connection),
        by_state=dict.fromkeys(STATES, 0) | {row[0]: row[1] for row in connection.execute(states)},
        unfinished={(row[0], row[1]): row[2] for row in connection.execute(kinds)},
        oldest_queued=connection.execute(oldest).scalar(),
        parts=connection.execute(parts).scalar_one(),
        seen=seen,
        versions=versions,
    )


KEPT_S = 1.0


class Cached:
    """A source whose readings, or whose failure, hold for `kept_s`; one thread at a time reads.

    So scrapes cost the database no more than one reading a second. While a reading takes long,
    the others get the last one: a database that hangs costs one thread, not one for each scrape.
    """

    def __init__(
        self,
        source: Source,
        *,
        kept_s: float = KEPT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source = source
        self._kept_s = kept_s
        self._clock = clock
        self._lock = threading.Lock()
        self._until: float | None = None
        self._last: Readings | Exception = {}

    def __call__(self) -> Readings:
        """Return the newest readings there are; raises what reading raised."""
        # the first one is waited for
        if self._lock.acquire(blocking=self._until is None):
            try:
                if self._until is None or self._clock() >= self._until:
                    self._last = self._read()
                    self._until = self._clock() + self._kept_s
            finally:
                self._lock.release()
        last = self._last
        if isinstance(last, Exception):
            raise last
        return last

    def _read(self) -> Readings | Exception:
        try:
            return self._source()
        except Exception as error:
            return error


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


class PoolReadings:
    """A source of the figures of this process's pools, whose depths are asked for by name."""

    def __init__(self, depths: Mapping[str, Callable[[], PoolDepth]]) -> None:
        self._depths = depths

    def __call__(self) -> Readings:
        """Return what the pools do now."""
        found = {name: depth() for name, depth in self._depths.items()}
        tasks: dict[tuple[str, ...], float] = {}
        for name, depth in found.items():
            tasks[name, "running"] = depth.running
            tasks[name, "waiting"] = depth.waiting
        return {
            "syncplan_processes_busy": {(): sum(one.running for one in found.values())},
            "syncplan_pool_processes": {(name,): one.processes for name, one in found.items()},
            "syncplan_pool_tasks": tasks,
            "syncplan_pool_owners_waiting": {(name,): one.owners for name, one in found.items()},
            "syncplan_pool_oldest_waiting_seconds": {
                (name,): one.oldest_s for name, one in found.items()
            },
            "syncplan_pool_children_started": {(name,): one.started for name, one in found.items()},
        }


class ConnectionReadings:
    """A source of the figures of this process's connections."""

    def __init__(self, connections: Connections) -> None:
        self._connections = connections

    def __call__(self) -> Readings:
        """Return how many there are now, and how many were refused."""
        refusals = dict(self._connections.refusals)
        return {
            "syncplan_connections": {(): self._connections.number},
            "syncplan_connections_refused": {
                (reason,): number for reason, number in refusals.items()
            },
        }
