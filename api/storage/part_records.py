"""The parts of a job's trials: cut once, computed by anyone, kept once, counted as progress."""

from collections.abc import Sequence

from sqlalchemy import Connection, func, insert, select, update

from api.computing.tasks import Cut, JobSpec
from api.storage.job_queries import spec_of
from api.storage.job_records import UNFINISHED, change
from api.storage.tables import job_parts, jobs

__all__ = ["cut_job", "finished_parts", "keep_part", "next_part", "note_progress"]


def cut_job(connection: Connection, job_id: str, cuts: Sequence[Cut]) -> int:
    """Enter the parts of a job, unless that was done before; return how many there are.

    0 for a job that has ended.
    """
    if _hold(connection, job_id) is None:
        return 0
    count = _count_parts(connection, job_id)
    if count:
        return count
    rows = [
        {
            "job_id": job_id,
            "number": number,
            "run": cut.run,
            "first_trial": cut.first_trial,
            "trials": cut.trials,
            "done": 0,
        }
        for number, cut in enumerate(cuts)
    ]
    connection.execute(insert(job_parts), rows)
    return len(rows)


def next_part(connection: Connection, job_id: str, number: int) -> tuple[JobSpec, Cut] | None:
    """Return what to compute for a part; None if it is there, or the job has ended."""
    spec = spec_of(connection, job_id)
    if spec is None:
        return None
    query = select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials).where(
        job_parts.c.job_id == job_id, job_parts.c.number == number, job_parts.c.data.is_(None)
    )
    found = connection.execute(query).first()
    return None if found is None else (spec, Cut(*found))


def note_progress(
    connection: Connection, job_id: str, done: int, number: int | None = None
) -> bool:
    """Enter how far a job, or a part of it, is; return whether the job is still unfinished."""
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
        done = _done_in_parts(connection, job_id)
    known, total = held
    if min(done, total) > known:
        change(connection, job_id, done=min(done, total))
    return True


def keep_part(connection: Connection, job_id: str, number: int, data: bytes) -> None:
    """Keep the result of a part and enter the progress; a part kept before stays as it is."""
    if _hold(connection, job_id) is None:
        return
    connection.execute(
        update(job_parts)
        .where(job_parts.c.job_id == job_id, job_parts.c.number == number)
        .where(job_parts.c.data.is_(None))
        .values(data=data, done=job_parts.c.trials)
    )
    note_progress(connection, job_id, _done_in_parts(connection, job_id))


def finished_parts(connection: Connection, job_id: str) -> list[tuple[Cut, bytes]]:
    """Return the results of all parts of a job, in order."""
    query = (
        select(job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials, job_parts.c.data)
        .where(job_parts.c.job_id == job_id)
        .order_by(job_parts.c.number)
    )
    return [(Cut(*row[:3]), row[3]) for row in connection.execute(query)]


def _hold(connection: Connection, job_id: str) -> tuple[int, int] | None:
    """Lock an unfinished job before its parts, as all writers do; return (done, total)."""
    query = select(jobs.c.done, jobs.c.total).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED)
    )
    found = connection.execute(query.with_for_update()).first()
    return None if found is None else (found[0], found[1])


def _count_parts(connection: Connection, job_id: str) -> int:
    query = select(func.count()).select_from(job_parts).where(job_parts.c.job_id == job_id)
    return connection.execute(query).scalar_one()


def _done_in_parts(connection: Connection, job_id: str) -> int:
    query = select(func.coalesce(func.sum(job_parts.c.done), 0)).where(job_parts.c.job_id == job_id)
    return int(connection.execute(query).scalar_one())
