"""Readings of a running process for a scrape of the metrics, in addition to its counts.

They cover jobs and workers, from the database; child processes and their tasks; connections.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from sqlalchemy import func, select, text

from api.computing.pool import PoolDepth
from api.connections import Connections
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.queue import JobQueue
from api.metrics import Readings, Source
from api.storage.database import Database
from api.storage.tables import executors, job_parts, jobs, moment
from syncplan.studies.job_contract import STATES, UNFINISHED

_LONGEST_READ_MS = 2000


@dataclass(slots=True, eq=False)
class Cached:
    """A source whose readings, or failure, are kept for `kept_s`; one thread at a time reads.

    Scrapes thus cost the database at most one reading a second. While a reading takes long, other
    threads get the last one: a database that hangs costs one thread, not one for each scrape.
    """

    source: Source
    kept_s: float = 1.0
    clock: Callable[[], float] = time.monotonic
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _until: float | None = None
    _last: Readings | Exception = field(default_factory=dict)

    def __call__(self) -> Readings:
        """Return the newest readings; raises the error of a failed reading."""
        # all threads wait for the first reading
        if self._lock.acquire(blocking=self._until is None):
            try:
                if self._until is None or self.clock() >= self._until:
                    self._last = self._read()
                    self._until = self.clock() + self.kept_s
            finally:
                self._lock.release()
        last = self._last
        if isinstance(last, Exception):
            raise last
        return last

    def _read(self) -> Readings | Exception:
        try:
            return self.source()
        except Exception as error:
            return error


def job_readings(database: Database, queue: JobQueue) -> Readings:
    """Return readings of jobs, their parts and workers: their numbers and ages.

    The figures are the same in every process. One pass over an index counts all jobs; the other
    queries read those that have not ended.
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
    workers = select(executors.c.id, executors.c.seen_at, executors.c.version)
    by_state: dict[tuple[str, ...], float] = {(state,): 0 for state in STATES}
    unfinished: dict[tuple[str, ...], float] = {
        (kind, state): 0 for kind in JOB_KINDS for state in UNFINISHED
    }
    with database.reading() as connection:
        if not database.is_sqlite:
            connection.execute(text(f"SET LOCAL statement_timeout = {_LONGEST_READ_MS}"))
        by_state |= {(state,): number for state, number in connection.execute(states)}
        unfinished |= {(kind, state): n for kind, state, n in connection.execute(kinds)}
        oldest_queued = connection.execute(oldest).scalar()
        waiting_parts = connection.execute(parts).scalar_one()
        living = connection.execute(workers).all()
        now = datetime.fromisoformat(moment(connection))
    return {
        "syncplan_jobs": by_state,
        "syncplan_jobs_unfinished": unfinished,
        "syncplan_jobs_oldest_queued_seconds": {(): _age_s(_time(oldest_queued), now)},
        "syncplan_parts_unfinished": {(): waiting_parts},
        "syncplan_parts_oldest_queued_seconds": {(): _age_s(queue.oldest(), now)},
        # the version is empty where workers do not state it
        "syncplan_workers": Counter((version or "",) for _, _, version in living),
        "syncplan_heartbeat_age_seconds": {
            (name,): _age_s(_time(seen), now) for name, seen, _ in living if seen
        },
    }


def _time(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)


def _age_s(since: datetime | None, now: datetime) -> float:
    """Seconds from `since` to `now`; 0 if `since` is None."""
    return 0.0 if since is None else max((now - since).total_seconds(), 0.0)


def pool_readings(depths: Mapping[str, Callable[[], PoolDepth]]) -> Readings:
    """Return readings of this process's pools; `depths` return the state of each."""
    found = {name: depth() for name, depth in depths.items()}
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


def connection_readings(connections: Connections) -> Readings:
    """Return readings of the connections to this process and of its refusals."""
    refusals = dict(connections.refusals)
    return {
        "syncplan_connections": {(): connections.number},
        "syncplan_connections_refused": {(reason,): number for reason, number in refusals.items()},
    }
