"""How much work waits and who works on it: what metrics show of the whole service."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Connection, func, select

from api.storage.clock import moment
from api.storage.tables import executors, job_parts, jobs
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
