"""Every change of a job, in order and without gaps."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar

from sqlalchemy import Connection, and_, or_, select

from api.storage.tables import job_events, jobs
from syncplan.reports.job_contract import JobState

T = TypeVar("T")

MOST_EVENTS = 500
"""Most events that are read at a time."""

_JOBS_AT_ONCE = 200
"""Jobs that one statement names: SQLite bounds the depth of a condition."""


@dataclass(frozen=True, slots=True)
class JobHead:
    """A job's state, and the number of its last event."""

    state: JobState
    events: int


def events_after(
    connection: Connection, job_id: str, number: int, most: int = MOST_EVENTS
) -> list[tuple[int, str]]:
    """Return (number, JSON) of the events of a job after the one with a number, in order.

    Up to `most` of them; ask again from the last one on.
    """
    query = (
        select(job_events.c.number, job_events.c.data)
        .where(job_events.c.job_id == job_id, job_events.c.number > number)
        .order_by(job_events.c.number)
        .limit(most)
    )
    return [(row[0], row[1]) for row in connection.execute(query)]


def heads_of(connection: Connection, job_ids: Sequence[str]) -> dict[str, JobHead]:
    """Return the heads of jobs by their identifiers; those that are not there are left out."""
    found = {}
    for some in _portions(job_ids):
        query = select(jobs.c.id, jobs.c.state, jobs.c.events).where(jobs.c.id.in_(some))
        found.update({row[0]: JobHead(row[1], row[2]) for row in connection.execute(query)})
    return found


def newest_events(
    connection: Connection, after: Mapping[str, int]
) -> Iterator[tuple[str, int, str]]:
    """Yield (job, number, JSON) of the events of jobs after a number each, each job's in order."""
    for some in _portions(list(after.items())):
        wanted = (
            and_(job_events.c.job_id == job_id, job_events.c.number > number)
            for job_id, number in some
        )
        query = (
            select(job_events.c.job_id, job_events.c.number, job_events.c.data)
            .where(or_(*wanted))
            .order_by(job_events.c.job_id, job_events.c.number)
        )
        for row in connection.execute(query):
            yield row[0], row[1], row[2]


def _portions(items: Sequence[T]) -> Iterator[list[T]]:
    rest = iter(items)
    while some := list(islice(rest, _JOBS_AT_ONCE)):
        yield some
