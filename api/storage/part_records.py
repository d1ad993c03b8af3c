"""The parts of jobs that workers compute: how often each was begun, and how long it took.

Batches have the numbers of their rows; the others have numbers below zero, and rows once they are
begun.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import Connection, func, insert, or_, select, update

from api.storage.tables import job_parts, job_starts, jobs
from syncplan.reports.job_contract import UNFINISHED

BEGINNING = -1
"""The number of the part that a job begins with; the only one of a job that is computed whole."""

CONCLUSION = -2
"""The number of the part that makes the report of finished batches."""


@dataclass(frozen=True, slots=True)
class PartHistory:
    """What became of a part so far.

    Attributes
    ----------
    attempts : how often it was begun and not given back
    deaths : how often the process that computed it ended
    computed_s : computing time of all attempts
    """

    attempts: int
    deaths: int
    computed_s: float


def begin_part(
    connection: Connection, job_id: str, number: int, version: str
) -> PartHistory | None:
    """Count an attempt at a part and return its history.

    None if its job does not run any more, is another version's, or has no such batch.
    """
    # one after the other, where two workers begin the same part
    job = select(jobs.c.id).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED), jobs.c.version == version
    )
    if connection.execute(job.with_for_update()).first() is None:
        return None
    history = _change(connection, job_id, number, attempts=job_parts.c.attempts + 1)
    if history is not None or number >= 0:
        return history
    row = {"run": 0, "first_trial": 0, "trials": 0, "done": 0, "attempts": 1}
    connection.execute(insert(job_parts).values(job_id=job_id, number=number, **row))
    return PartHistory(1, 0, 0.0)


def withdraw_part(connection: Connection, job_id: str, number: int) -> None:
    """Count an attempt less: it was given back, by a worker that ends in good order."""
    _change(connection, job_id, number, attempts=job_parts.c.attempts - 1)


def count_death(connection: Connection, job_id: str, number: int) -> int:
    """Count that the process that computed a part ended; return how often one did."""
    history = _change(connection, job_id, number, deaths=job_parts.c.deaths + 1)
    return 0 if history is None else history.deaths


def add_seconds(connection: Connection, job_id: str, number: int, seconds: float) -> None:
    """Add to the computing time of a part and of its job."""
    connection.execute(
        update(jobs).where(jobs.c.id == job_id).values(computed_s=jobs.c.computed_s + seconds)
    )
    _change(connection, job_id, number, computed_s=job_parts.c.computed_s + seconds)


def _change(
    connection: Connection, job_id: str, number: int, **values: object
) -> PartHistory | None:
    found = connection.execute(
        update(job_parts)
        .where(job_parts.c.job_id == job_id, job_parts.c.number == number)
        .values(**values)
        .returning(job_parts.c.attempts, job_parts.c.deaths, job_parts.c.computed_s)
    ).first()
    return None if found is None else PartHistory(*found)


def worked_on(connection: Connection, job_ids: set[str], version: str) -> set[str]:
    """Return which jobs have not ended and are this version's to work on."""
    query = select(jobs.c.id).where(
        jobs.c.id.in_(job_ids), jobs.c.state.in_(UNFINISHED), jobs.c.version == version
    )
    return set(connection.execute(query).scalars())


def computed_seconds(connection: Connection, owner: str, since: str) -> float:
    """Return the computing time of an owner's jobs that have not ended before a time."""
    query = select(func.coalesce(func.sum(jobs.c.computed_s), 0.0)).where(
        jobs.c.owner == owner, or_(jobs.c.ended_at.is_(None), jobs.c.ended_at >= since)
    )
    return float(connection.execute(query).scalar_one())


# --- starts of refinements ----------------------------------------------------------------------


def keep_start(connection: Connection, job_id: str, number: int, data: bytes) -> None:
    """Keep what a start of a refinement found; one kept before stays as it is."""
    known = select(job_starts.c.number).where(
        job_starts.c.job_id == job_id, job_starts.c.number == number
    )
    if connection.execute(known).first() is None:
        connection.execute(insert(job_starts).values(job_id=job_id, number=number, data=data))


def finished_starts(connection: Connection, job_id: str) -> Mapping[int, bytes]:
    """Return what finished starts of a refinement found, by number."""
    query = select(job_starts.c.number, job_starts.c.data).where(job_starts.c.job_id == job_id)
    return {row[0]: row[1] for row in connection.execute(query.order_by(job_starts.c.number))}
