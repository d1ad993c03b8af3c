"""Stored parts of jobs: attempts at each, its computing time and its result.

A job is divided into batches of trials once. Any worker may compute a batch; its result is kept
once and counted as progress. Batches have the numbers of their rows; the other parts have numbers
below zero, and rows once they are begun.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

from sqlalchemy import ColumnElement, Connection, Row, and_, func, insert, or_, select, update

from api.job_kinds.job_kind import Batch
from api.storage.job_records import change
from api.storage.tables import earlier, job_parts, job_starts, jobs, moment
from syncplan.studies.job_contract import UNFINISHED

BEGINNING = -1
"""Number of the part that a job begins with, the only one of a job computed whole."""

CONCLUSION = -2
"""Number of the part that makes the report from finished batches."""

_DAY_S = 86400.0


@dataclass(frozen=True, slots=True)
class PartHistory:
    """History of a part so far.

    Attributes
    ----------
    attempts : number of attempts that were not given back
    deaths : number of processes that ended while computing it
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
    # one after the other, if two workers begin the same part
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
    """Count one attempt less: the worker gives it back, for example when it is about to end."""
    _change(connection, job_id, number, attempts=job_parts.c.attempts - 1)


def count_death(connection: Connection, job_id: str, number: int) -> int:
    """Count a process that ended while computing a part; return how many have."""
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
        .where(_is_part(job_id, number))
        .values(**values)
        .returning(job_parts.c.attempts, job_parts.c.deaths, job_parts.c.computed_s)
    ).first()
    return None if found is None else PartHistory(*found)


def _is_part(job_id: str, number: int) -> ColumnElement[bool]:
    return and_(job_parts.c.job_id == job_id, job_parts.c.number == number)


def worked_on(connection: Connection, job_ids: set[str], version: str) -> dict[str, bool]:
    """Return those of the jobs that have not ended and that this version works on.

    The value is true where a job is to end early, with the best found so far.
    """
    query = select(jobs.c.id, jobs.c.finishing).where(
        jobs.c.id.in_(job_ids), jobs.c.state.in_(UNFINISHED), jobs.c.version == version
    )
    return {row[0]: bool(row[1]) for row in connection.execute(query)}


def computed_seconds(connection: Connection, owner: str, since: str | None = None) -> float:
    """Return the computing time (s) of an owner's jobs that had not ended before a time.

    Without a time, it is that of 24 hours ago.
    """
    since = since or earlier(moment(connection), _DAY_S)
    query = select(func.coalesce(func.sum(jobs.c.computed_s), 0.0)).where(
        jobs.c.owner == owner, or_(jobs.c.ended_at.is_(None), jobs.c.ended_at >= since)
    )
    return float(connection.execute(query).scalar_one())


# --- searches of refinements and designs ----------------------------------------------------------


def keep_search(connection: Connection, job_id: str, number: int, data: bytes) -> None:
    """Keep the result of one of a job's searches; one kept before stays as it is."""
    known = select(job_starts.c.number).where(
        job_starts.c.job_id == job_id, job_starts.c.number == number
    )
    if connection.execute(known).first() is None:
        connection.execute(insert(job_starts).values(job_id=job_id, number=number, data=data))


def finished_searches(connection: Connection, job_id: str) -> Mapping[int, bytes]:
    """Return the results of a job's finished searches, by number."""
    query = select(job_starts.c.number, job_starts.c.data).where(job_starts.c.job_id == job_id)
    return {row[0]: row[1] for row in connection.execute(query.order_by(job_starts.c.number))}


# --- batches --------------------------------------------------------------------------------------


_NUMBERS = 1_000_000
"""A job that is begun anew numbers its batches from the next multiple of this.

A process that still computes an earlier batch then finds none of that number.
"""

_IS_BATCH = job_parts.c.number >= 0
_TRIALS = job_parts.c.run, job_parts.c.first_trial, job_parts.c.trials
"""Columns of a Batch."""


def divide_job(
    connection: Connection, job_id: str, batches: Sequence[Batch], begun: int = 0
) -> bool:
    """Enter the batches of a job, unless that was done before; return whether they are there.

    They are not if the job has ended, or was begun anew since it was begun for the `begun`-th time.
    """
    held = _hold(connection, job_id)
    if held is None or held.begun != begun:
        return False
    if is_divided(connection, job_id):
        return True
    rows = [
        {"job_id": job_id, "number": number, "done": 0, **asdict(batch)}
        for number, batch in enumerate(batches, begun * _NUMBERS)
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
    """Return up to `most` batches without a result, as (number, turn), after `skipped` others.

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
    """Return a batch to compute; None if its result is there, or there is no such batch."""
    query = select(*_TRIALS).where(_is_part(job_id, number), job_parts.c.data.is_(None))
    found = connection.execute(query).first()
    return None if found is None else Batch(*found)


def note_progress(
    connection: Connection,
    job_id: str,
    done: int,
    number: int | None = None,
    shown: Mapping[str, Any] = MappingProxyType({}),
) -> bool:
    """Enter the progress of a job, or of a batch of it; return whether the job is unfinished.

    `shown` are further keys of the event.
    """
    held = _hold(connection, job_id)
    if held is None:
        return False
    if number is not None:
        connection.execute(
            update(job_parts)
            .where(_is_part(job_id, number), job_parts.c.done < done)
            .values(done=done)
        )
        done = _done_in_batches(connection, job_id)
    if min(done, held.total) > held.done or shown:
        change(connection, job_id, shown=shown, done=max(min(done, held.total), held.done))
    return True


def keep_batch(
    connection: Connection, job_id: str, number: int, data: bytes, *, shows: bool = False
) -> bool:
    """Keep the result of a batch and enter the progress; one kept before stays as it is.

    With `shows` the event states of how many first trials the job has figures by now. Returns
    whether the job goes on.
    """
    if _hold(connection, job_id) is None:
        return False
    connection.execute(
        update(job_parts)
        .where(_is_part(job_id, number), job_parts.c.data.is_(None))
        .values(data=data, done=job_parts.c.trials)
    )
    first = sum(batch.trials for batch, _ in first_batches(connection, job_id)) if shows else 0
    shown = {"finished": first} if first else {}
    return note_progress(connection, job_id, _done_in_batches(connection, job_id), shown=shown)


MOST_SHOWN_BYTES = 32 * 2**20
"""Most bytes of finished batches that figures of a job under way are drawn from."""


def first_batches(connection: Connection, job_id: str) -> list[tuple[Batch, int]]:
    """Return the finished batches of a job's first run, from trial 0 on without a gap.

    Each with its number. Batches that exceed MOST_SHOWN_BYTES together are left out.
    """
    query = (
        select(*_TRIALS, job_parts.c.number, func.length(job_parts.c.data))
        .where(job_parts.c.job_id == job_id, _IS_BATCH, job_parts.c.run == 0)
        .order_by(job_parts.c.first_trial)
    )
    found, size = [], 0
    for *place, number, length in connection.execute(query):
        size += MOST_SHOWN_BYTES + 1 if length is None else length
        if size > MOST_SHOWN_BYTES:
            break
        found.append((Batch(*place), number))
    return found


def finished_batches(
    connection: Connection, job_id: str, numbers: Sequence[int] | None = None
) -> list[tuple[Batch, bytes]]:
    """Return the results of all batches of a job, or of those with these numbers, in order."""
    query = (
        select(*_TRIALS, job_parts.c.data)
        .where(job_parts.c.job_id == job_id, _IS_BATCH)
        .order_by(job_parts.c.number)
    )
    if numbers is not None:
        query = query.where(job_parts.c.number.in_(numbers))
    return [(Batch(*row[:3]), row[3]) for row in connection.execute(query)]


def _hold(connection: Connection, job_id: str) -> Row[int, int, int] | None:
    """Lock an unfinished job before its batches, as all writers do; return (done, total, begun)."""
    query = select(jobs.c.done, jobs.c.total, jobs.c.begun).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED)
    )
    return connection.execute(query.with_for_update()).first()


def _done_in_batches(connection: Connection, job_id: str) -> int:
    query = select(func.coalesce(func.sum(job_parts.c.done), 0)).where(
        job_parts.c.job_id == job_id, _IS_BATCH
    )
    return int(connection.execute(query).scalar_one())
