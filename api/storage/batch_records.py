"""The batches of a job's trials: divided once, computed by anyone, kept once, counted as progress.

The table calls them parts, and holds the other parts of jobs too, under numbers below zero; see
`api.storage.part_records`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import Connection, func, insert, select, update

from api.job_kinds.job_tasks import Batch
from api.storage.job_records import change
from api.storage.tables import job_parts, jobs
from syncplan.reports.job_contract import UNFINISHED

_NUMBERS = 1_000_000
"""A job that is begun anew numbers its batches from the next multiple of this.

A process that still computes a batch of before then finds none of that number.
"""

_IS_BATCH = job_parts.c.number >= 0


@dataclass(frozen=True, slots=True)
class _Held:
    """A job that is locked."""

    done: int
    total: int
    begun: int


def divide_job(
    connection: Connection, job_id: str, batches: Sequence[Batch], begun: int = 0
) -> bool:
    """Enter the batches of a job, unless that was done before; return whether they are there.

    They are not for a job that has ended, or was begun anew since it was begun for the
    `begun`-th time.
    """
    held = _hold(connection, job_id)
    if held is None or held.begun != begun:
        return False
    if is_divided(connection, job_id):
        return True
    rows = [
        {
            "job_id": job_id,
            "number": begun * _NUMBERS + number,
            "run": batch.run,
            "first_trial": batch.first_trial,
            "trials": batch.trials,
            "done": 0,
        }
        for number, batch in enumerate(batches)
    ]
    connection.execute(insert(job_parts), rows)
    return True


def is_divided(connection: Connection, job_id: str) -> bool:
    """Return whether a job has batches."""
    query = select(job_parts.c.number).where(job_parts.c.job_id == job_id, _IS_BATCH)
    return connection.execute(query.limit(1)).first() is not None


def unfinished_batches(
    connection: Connection, job_id: str, most: int, skipped: int = 0
) -> list[tuple[int, int]]:
    """Return the first batches without a result as (number, turn), `skipped` of them left out.

    The turn counts the job's batches from 0, however often it was begun.
    """
    query = (
        select(job_parts.c.number, job_parts.c.number % _NUMBERS)
        .where(job_parts.c.job_id == job_id, _IS_BATCH, job_parts.c.data.is_(None))
        .order_by(job_parts.c.number)
        .offset(skipped)
        .limit(most)
    )
    return [(row[0], row[1]) for row in connection.execute(query)]


def next_batch(connection: Connection, job_id: str, number: int) -> Batch | None:
    """Return a batch to compute; None if its result is there, or there is none of the number."""
    query = select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials).where(
        job_parts.c.job_id == job_id, job_parts.c.number == number, job_parts.c.data.is_(None)
    )
    found = connection.execute(query).first()
    return None if found is None else Batch(*found)


def note_progress(
    connection: Connection, job_id: str, done: int, number: int | None = None
) -> bool:
    """Enter how far a job, or a batch of it, is; return whether the job is still unfinished."""
    held = _hold(connection, job_id)
    if held is None:
        return False
    if number is not None:
        connection.execute(
            update(job_parts)
            .where(job_parts.c.job_id == job_id, job_parts.c.number == number)
            .where(job_parts.c.done < done)
            .values(done=done)
        )
        done = _done_in_batches(connection, job_id)
    if min(done, held.total) > held.done:
        change(connection, job_id, done=min(done, held.total))
    return True


def keep_batch(connection: Connection, job_id: str, number: int, data: bytes) -> bool:
    """Keep the result of a batch and enter the progress; one kept before stays as it is.

    Returns whether the job goes on.
    """
    if _hold(connection, job_id) is None:
        return False
    connection.execute(
        update(job_parts)
        .where(job_parts.c.job_id == job_id, job_parts.c.number == number)
        .where(job_parts.c.data.is_(None))
        .values(data=data, done=job_parts.c.trials)
    )
    return note_progress(connection, job_id, _done_in_batches(connection, job_id))


def finished_batches(connection: Connection, job_id: str) -> list[tuple[Batch, bytes]]:
    """Return the results of all batches of a job, in order."""
    query = (
        select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials, job_parts.c.data)
        .where(job_parts.c.job_id == job_id, _IS_BATCH)
        .order_by(job_parts.c.number)
    )
    return [(Batch(*row[:3]), row[3]) for row in connection.execute(query)]


def _hold(connection: Connection, job_id: str) -> _Held | None:
    """Lock an unfinished job before its batches, as all writers do."""
    query = select(jobs.c.done, jobs.c.total, jobs.c.begun).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED)
    )
    found = connection.execute(query.with_for_update()).first()
    return None if found is None else _Held(*found)


def _done_in_batches(connection: Connection, job_id: str) -> int:
    query = select(func.coalesce(func.sum(job_parts.c.done), 0)).where(
        job_parts.c.job_id == job_id, _IS_BATCH
    )
    return int(connection.execute(query).scalar_one())
