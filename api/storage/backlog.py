"""How much work waits: unfinished jobs by kind, and since when the oldest is queued."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Connection, func, select

from api.storage.tables import jobs
from syncplan.reports.job_contract import STATES, UNFINISHED

__all__ = ["Backlog", "backlog_of"]


@dataclass(frozen=True, slots=True)
class Backlog:
    """The work there is.

    Attributes
    ----------
    by_state : jobs in each state, 0 where there is none
    unfinished : jobs by (kind, state)
    oldest_queued : when the job was requested that has waited longest for a worker; None if none
    """

    by_state: Mapping[str, int]
    unfinished: Mapping[tuple[str, ...], int]
    oldest_queued: str | None


def backlog_of(connection: Connection) -> Backlog:
    """Return how much work there is now; indices bound what it costs to the unfinished jobs."""
    states = select(jobs.c.state, func.count()).group_by(jobs.c.state)
    kinds = (
        select(jobs.c.kind, jobs.c.state, func.count())
        .where(jobs.c.state.in_(UNFINISHED))
        .group_by(jobs.c.kind, jobs.c.state)
    )
    oldest = select(func.min(jobs.c.created_at)).where(jobs.c.state == "queued")
    return Backlog(
        by_state=dict.fromkeys(STATES, 0) | {row[0]: row[1] for row in connection.execute(states)},
        unfinished={(row[0], row[1]): row[2] for row in connection.execute(kinds)},
        oldest_queued=connection.execute(oldest).scalar(),
    )
