"""The batches of a job's trials: divided once, computed by anyone, kept once, counted as progress.

The table calls them parts.
"""

from collections.abc import Sequence

from sqlalchemy import Connection, func, insert, select, update

from api.job_kinds.job_kind import Batch, JobSpec
from api.storage.job_queries import spec_of
from api.storage.job_records import change
from api.storage.tables import job_parts, jobs
from syncplan.reports.job_contract import UNFINISHED

__all__ = ["divide_job", "finished_batches", "keep_batch", "next_batch", "note_progress"]


def divide_job(connection: Connection, job_id: str, batches: Sequence[Batch]) -> int:
    """Enter the batches of a job, unless that was done before; return how many there are.

    0 for a job that has ended.
    """
    if _hold(connection, job_id) is None:
        return 0
    count = _count_batches(connection, job_id)
    if count:
        return count
    rows = [
        {
            "job_id": job_id,
            "number": number,
            "run": batch.run,
            "first_trial": batch.first_trial,
            "trials": batch.trials,
            "done": 0,
        }
        for number, batch in enumerate(batches)
    ]
    connection.execute(insert(job_parts), rows)
    return len(rows)


def next_batch(connection: Connection, job_id: str, number: int) -> tuple[JobSpec, Batch] | None:
    """Return what to compute for a batch; None if its result is there, or the job has ended."""
    spec = spec_of(connection, job_id)
    if spec is None:
        return None
    query = select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials).where(
        job_parts.c.job_id == job_id, job_parts.c.number == number, job_parts.c.data.is_(None)
    )
    found = connection.execute(query).first()
    return None if found is None else (spec, Batch(*found))


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
    known, total = held
    if min(done, total) > known:
        change(connection, job_id, done=min(done, total))
    return True


def keep_batch(connection: Connection, job_id: str, number: int, data: bytes) -> None:
    """Keep the result of a batch and enter the progress; one kept before stays as it is."""
    if _hold(connection, job_id) is None:
        return
    connection.execute(
        update(job_parts)
        .where(job_parts.c.job_id == job_id, job_parts.c.number == number)
        .where(job_parts.c.data.is_(None))
        .values(data=data, done=job_parts.c.trials)
    )
    note_progress(connection, job_id, _done_in_batches(connection, job_id))


def finished_batches(connection: Connection, job_id: str) -> list[tuple[Batch, bytes]]:
    """Return the results of all batches of a job, in order."""
    query = (
        select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials, job_parts.c.data)
        .where(job_parts.c.job_id == job_id)
        .order_by(job_parts.c.number)
    )
    return [(Batch(*row[:3]), row[3]) for row in connection.execute(query)]


def _hold(connection: Connection, job_id: str) -> tuple[int, int] | None:
    """Lock an unfinished job before its batches, as all writers do; return (done, total)."""
    query = select(jobs.c.done, jobs.c.total).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED)
    )
    found = connection.execute(query.with_for_update()).first()
    return None if found is None else (found[0], found[1])


def _count_batches(connection: Connection, job_id: str) -> int:
    query = select(func.count()).select_from(job_parts).where(job_parts.c.job_id == job_id)
    return connection.execute(query).scalar_one()


def _done_in_batches(connection: Connection, job_id: str) -> int:
    query = select(func.coalesce(func.sum(job_parts.c.done), 0)).where(job_parts.c.job_id == job_id)
    return int(connection.execute(query).scalar_one())
