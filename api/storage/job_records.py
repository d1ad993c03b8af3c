"""Stored jobs: request, progress and result, and every change as an event.

syncplan.studies.job_contract lists the states of a job. Each change raises the job's event number
in the same transaction, so that events are numbered without gaps and a reader who has seen number k
asks for those after it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Any

from sqlalchemy import Connection, Table, delete, func, insert, null, select, update

from api.job_kinds.job_kind import JobReport, JobSpec
from api.storage.tables import (
    NOW,
    job_events,
    job_parts,
    job_results,
    job_starts,
    jobs,
    newest,
    next_id,
    recordings,
)
from syncplan.studies.job_contract import UNFINISHED, EndState, JobKindName, JobState

ANY_VERSION = ""
"""Version of a job that no syncplan has begun."""


@dataclass(frozen=True, slots=True)
class JobRow:
    """A job as answers show it; `request`, left out of lists, and `error` are JSON."""

    id: str
    kind: JobKindName
    state: JobState
    request: str | None
    plan_id: str | None
    done: int
    total: int
    created_at: str
    started_at: str | None
    ended_at: str | None
    result_plan_id: str | None
    error: str | None
    recording_id: str | None


@dataclass(frozen=True, slots=True)
class NewJob:
    """A requested job; `request` is checked, `total` is its work in the kind's unit.

    `plan_text` is a copy, so that the job outlives the plan; `traceparent` is the trace of the
    request.
    """

    kind: JobKindName
    request: str
    total: int
    plan_id: str | None
    plan_text: str | None
    traceparent: str | None = None
    recording_id: str | None = None


_SHOWN = tuple(jobs.c[name] for name in JobRow.__dataclass_fields__)
# a sweep's request holds a scenario
_LISTED = tuple(null() if column.name == "request" else column for column in _SHOWN)
_THERE = jobs.c.deleted == 0


def add_job(connection: Connection, owner: str, new: NewJob) -> JobRow:
    """Enter a job as queued and return it."""
    job_id, created_at = next_id(connection, jobs, owner)
    connection.execute(
        insert(jobs).values(
            **asdict(new),
            id=job_id,
            owner=owner,
            state="queued",
            done=0,
            created_at=created_at,
            events=0,
            version=ANY_VERSION,
        )
    )
    change(connection, job_id)
    row = find_job(connection, owner, job_id)
    assert row is not None
    return row


def find_job(connection: Connection, owner: str, job_id: str) -> JobRow | None:
    """Return an owner's job, or None."""
    query = select(*_SHOWN).where(jobs.c.id == job_id, jobs.c.owner == owner, _THERE)
    found = connection.execute(query).first()
    return None if found is None else JobRow(*found)


def list_jobs(
    connection: Connection,
    owner: str,
    limit: int,
    before: str | None,
    state: JobState | None = None,
) -> list[JobRow]:
    """Return up to `limit` of an owner's jobs, newest first, older than `before`."""
    query = select(*_LISTED).where(_THERE)
    if state is not None:
        query = query.where(jobs.c.state == state)
    return [JobRow(*row) for row in newest(connection, jobs, query, owner, limit, before)]


def hold_owner(connection: Connection, owner: str) -> None:
    """Serialise the transactions of an owner that call this."""
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(func.hashtext(owner))))


def count_unfinished(connection: Connection, owner: str) -> int:
    """Return the number of an owner's jobs that have not ended."""
    mine = jobs.c.owner == owner, jobs.c.state.in_(UNFINISHED)
    return connection.execute(select(func.count()).select_from(jobs).where(*mine)).scalar_one()


def state_of(connection: Connection, job_id: str) -> JobState | None:
    """Return a job's state; None if there is no such job."""
    query = select(jobs.c.state).where(jobs.c.id == job_id)
    return connection.execute(query).scalar()


# --- changes ------------------------------------------------------------------------------------


def end_job(
    connection: Connection,
    job_id: str,
    state: EndState,
    *,
    error: dict[str, Any] | None = None,
    report: JobReport | None = None,
    plan_id: str | None = None,
) -> bool:
    """End a job, once; return whether this call ended it."""
    # only a job under way is computed from its plan
    values: dict[str, Any] = {"state": state, "ended_at": NOW, "plan_text": None}
    values["result_plan_id"] = plan_id
    if error is not None:
        values["error"] = json.dumps(error)
    if state == "succeeded":
        values["done"] = jobs.c.total
    if not change(connection, job_id, **values):
        return False
    if report is not None:
        connection.execute(insert(job_results).values(job_id=job_id, **asdict(report)))
    forget_parts(connection, job_id)
    return True


def finish_job(connection: Connection, job_id: str) -> bool:
    """Ask a job to end with the best found so far; return whether it has not ended yet."""
    asked = update(jobs).where(jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED))
    return bool(connection.execute(asked.values(finishing=1)).rowcount)


def forget_parts(connection: Connection, job_id: str) -> None:
    """Delete the parts and the finished searches of a job."""
    _clear(connection, job_id, job_parts, job_starts)


def delete_job(connection: Connection, job_id: str) -> bool:
    """Delete a job if it has ended; return whether it had.

    Its row stays, emptied, until it expires: the time that it took still counts, and its worker may
    be about to add to it.
    """
    emptied = {"request": "null", "plan_text": None, "error": None, "events": 0, "deleted": 1}
    ended = update(jobs).where(jobs.c.id == job_id, jobs.c.state.not_in(UNFINISHED))
    if not connection.execute(ended.values(emptied)).rowcount:
        return False
    _clear(connection, job_id, job_parts, job_starts, job_results, job_events)
    return True


def _clear(connection: Connection, job_id: str, *tables: Table) -> None:
    """Delete a job's rows of tables."""
    for table in tables:
        connection.execute(delete(table).where(table.c.job_id == job_id))


def change(
    connection: Connection,
    job_id: str,
    *,
    only: Sequence[JobState] = UNFINISHED,
    shown: Mapping[str, Any] = MappingProxyType({}),
    **values: Any,
) -> bool:
    """Change columns of a job if its state is one of `only`; return whether it was.

    Each change is recorded as an event, with the keys in `shown`.
    """
    changed = connection.execute(
        update(jobs)
        .where(jobs.c.id == job_id, jobs.c.state.in_(only))
        .values(events=jobs.c.events + 1, **values)
        .returning(jobs.c.events, jobs.c.state, jobs.c.done, jobs.c.total, NOW)
    ).first()
    if changed is None:
        return False
    number, state, done, total, at = changed
    event = {"state": state, "progress": {"done": done, "total": total}, "at": at, **shown}
    connection.execute(
        insert(job_events).values(job_id=job_id, number=number, data=json.dumps(event))
    )
    return True


# --- queries of workers ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class BegunJob:
    """A job under way, the plan it is about, and how often it was begun anew."""

    spec: JobSpec
    owner: str
    begun: int
    plan_id: str | None


def start_job(connection: Connection, job_id: str, version: str) -> BegunJob | None:
    """Mark a waiting job as running, if this version may begin it; return it if it runs."""
    query = select(jobs.c.id).where(
        jobs.c.id == job_id, jobs.c.state == "queued", jobs.c.version.in_((ANY_VERSION, version))
    )
    if connection.execute(query.with_for_update()).first() is not None:
        change(
            connection, job_id, only=("queued",), state="running", version=version, started_at=NOW
        )
    return begun_job(connection, job_id, version)


def begun_job(connection: Connection, job_id: str, version: str) -> BegunJob | None:
    """Return a job that runs and that this version has begun; None otherwise."""
    of_job = (jobs.c.id, jobs.c.kind, jobs.c.request, jobs.c.plan_text)
    of_recording = (recordings.c.data, recordings.c.overview)
    query = (
        select(*of_job, *of_recording, jobs.c.owner, jobs.c.begun, jobs.c.plan_id)
        .outerjoin_from(jobs, recordings, jobs.c.recording_id == recordings.c.id)
        .where(jobs.c.id == job_id, jobs.c.state == "running", jobs.c.version == version)
    )
    found = connection.execute(query).first()
    return None if found is None else BegunJob(JobSpec(*found[:6]), *found[6:])


@dataclass(frozen=True, slots=True)
class JobLife:
    """Times and outcome of a job; `error` is JSON."""

    kind: str
    state: str
    traceparent: str | None
    created_at: str
    started_at: str | None
    ended_at: str | None
    error: str | None


def life_of(connection: Connection, job_id: str) -> JobLife | None:
    """Return the times and the outcome of a job; None if there is no such job."""
    columns = (jobs.c[name] for name in JobLife.__dataclass_fields__)
    found = connection.execute(select(*columns).where(jobs.c.id == job_id)).first()
    return None if found is None else JobLife(*found)


def report_of(connection: Connection, job_id: str) -> str | None:
    """Return the report of a job that has succeeded."""
    query = select(job_results.c.text).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()


def trials_of(connection: Connection, job_id: str) -> bytes | None:
    """Return the figures of each trial of a job that has succeeded."""
    query = select(job_results.c.trials).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()


# --- jobs that wait -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class WaitingJob:
    """A job that has not ended.

    Attributes
    ----------
    version : version that began it, ANY_VERSION if none has, None if one before schema version 2
    begun : how often it was begun anew
    """

    id: str
    owner: str
    version: str | None
    begun: int


def jobs_that_wait(connection: Connection) -> list[WaitingJob]:
    """Return all jobs that have not ended."""
    query = select(jobs.c.id, jobs.c.owner, jobs.c.version, jobs.c.begun)
    return [
        WaitingJob(*row) for row in connection.execute(query.where(jobs.c.state.in_(UNFINISHED)))
    ]


def begin_anew(connection: Connection, job: WaitingJob, version: str, *, keep: bool) -> bool:
    """Give a job to a version, to begin it anew; return whether it was still as given.

    Its finished parts are dropped unless `keep` is given. The progress shown stays until it is
    passed.
    """
    same = jobs.c.version.is_(None) if job.version is None else jobs.c.version == job.version
    changed = connection.execute(
        update(jobs)
        .where(jobs.c.id == job.id, jobs.c.state.in_(UNFINISHED), same, jobs.c.begun == job.begun)
        .values(version=version, begun=job.begun + 1)
    )
    if changed.rowcount and not keep:
        forget_parts(connection, job.id)
    return bool(changed.rowcount)


# --- jobs that ended long ago ---------------------------------------------------------------------


def ended_before(connection: Connection, time: str, most: int) -> list[str]:
    """Return the identifiers of up to `most` jobs that ended before a time."""
    query = select(jobs.c.id).where(jobs.c.state.not_in(UNFINISHED), jobs.c.ended_at < time)
    return list(connection.execute(query.limit(most)).scalars())


def forget_jobs(connection: Connection, job_ids: Sequence[str]) -> None:
    """Delete the rows of jobs, with everything that refers to them."""
    connection.execute(delete(jobs).where(jobs.c.id.in_(job_ids)))
