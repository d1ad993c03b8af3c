"""Jobs kept: what was asked, how far it is, what came of it, and every change as an event.

    queued --> running --> succeeded | failed
       \\__________\\______> cancelled          an ended job changes no more

Each change raises the job's event number in the same transaction, so that events are numbered
without gaps and a reader who has seen number k asks for those after it.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from sqlalchemy import Connection, delete, func, insert, select, update

from api.computing.tasks import Cut, JobSpec
from api.storage.tables import job_events, job_parts, job_results, jobs, moment, new_id

__all__ = [
    "UNFINISHED",
    "JobRow",
    "Kind",
    "State",
    "add_job",
    "count_by_state",
    "cut_job",
    "delete_ended",
    "end_job",
    "events_after",
    "find_job",
    "finished_parts",
    "keep_part",
    "list_jobs",
    "next_part",
    "note_progress",
    "owner_and_plan",
    "result_of",
    "spec_of",
    "start_job",
    "state_of",
    "trials_of",
    "unfinished",
]

Kind = Literal["refinement", "validation", "sweep"]
State = Literal["queued", "running", "succeeded", "failed", "cancelled"]

UNFINISHED: tuple[State, State] = ("queued", "running")


@dataclass(frozen=True, slots=True)
class JobRow:
    """A job as lists and answers show it; `request` and `error` are JSON."""

    id: str
    kind: Kind
    state: State
    request: str
    plan_id: str | None
    done: int
    total: int
    created_at: str
    started_at: str | None
    ended_at: str | None
    result_plan_id: str | None
    error: str | None
    events: int

    @property
    def ended(self) -> bool:
        """Whether the job changes no more."""
        return self.state not in UNFINISHED


_SHOWN = tuple(jobs.c[name] for name in JobRow.__dataclass_fields__)


def add_job(
    connection: Connection,
    owner: str,
    kind: Kind,
    request: str,
    work: int,
    plan_id: str | None,
    plan_text: str | None,
) -> JobRow:
    """Enter a job as queued and return it."""
    job_id = new_id()
    connection.execute(
        insert(jobs).values(
            id=job_id,
            owner=owner,
            kind=kind,
            state="queued",
            request=request,
            plan_id=plan_id,
            plan_text=plan_text,
            done=0,
            total=work,
            created_at=moment(),
            events=0,
        )
    )
    _change(connection, job_id)
    row = find_job(connection, owner, job_id)
    assert row is not None
    return row


def find_job(connection: Connection, owner: str, job_id: str) -> JobRow | None:
    """Return an owner's job, or None."""
    query = select(*_SHOWN).where(jobs.c.id == job_id, jobs.c.owner == owner)
    found = connection.execute(query).first()
    return None if found is None else JobRow(*found)


def list_jobs(
    connection: Connection, owner: str, limit: int, before: str | None, state: State | None = None
) -> list[JobRow]:
    """Return up to `limit` of an owner's jobs, newest first, older than `before`."""
    query = select(*_SHOWN).where(jobs.c.owner == owner).order_by(jobs.c.id.desc())
    if before is not None:
        query = query.where(jobs.c.id < before)
    if state is not None:
        query = query.where(jobs.c.state == state)
    return [JobRow(*row) for row in connection.execute(query.limit(limit))]


def unfinished(connection: Connection, owner: str | None = None) -> list[str]:
    """Return the identifiers of jobs that have not ended, of one owner or of all."""
    query = select(jobs.c.id).where(jobs.c.state.in_(UNFINISHED))
    if owner is not None:
        query = query.where(jobs.c.owner == owner)
    return list(connection.execute(query).scalars())


def count_by_state(connection: Connection) -> dict[str, int]:
    """Return how many jobs there are in each state that any is in."""
    query = select(jobs.c.state, func.count()).group_by(jobs.c.state)
    return {row[0]: row[1] for row in connection.execute(query)}


def state_of(connection: Connection, job_id: str) -> State | None:
    """Return a job's state; None if there is no such job."""
    query = select(jobs.c.state).where(jobs.c.id == job_id)
    return connection.execute(query).scalar()


def spec_of(connection: Connection, job_id: str) -> JobSpec | None:
    """Return what is to be computed for a job that has not ended; None otherwise."""
    query = select(jobs.c.id, jobs.c.kind, jobs.c.request, jobs.c.plan_text).where(
        jobs.c.id == job_id, jobs.c.state.in_(UNFINISHED)
    )
    found = connection.execute(query).first()
    return None if found is None else JobSpec(*found)


def owner_and_plan(connection: Connection, job_id: str) -> tuple[str, str | None]:
    """Return a job's owner and the plan it is about."""
    found = connection.execute(
        select(jobs.c.owner, jobs.c.plan_id).where(jobs.c.id == job_id)
    ).one()
    return found[0], found[1]


def result_of(connection: Connection, job_id: str) -> str | None:
    """Return the report of a job that has succeeded."""
    query = select(job_results.c.text).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()


def trials_of(connection: Connection, job_id: str) -> bytes | None:
    """Return the figures of each trial of a validation that has succeeded."""
    query = select(job_results.c.trials).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()


def events_after(connection: Connection, job_id: str, number: int) -> list[tuple[int, str]]:
    """Return (number, JSON) of the events of a job after the one with a number, in order."""
    query = (
        select(job_events.c.number, job_events.c.data)
        .where(job_events.c.job_id == job_id, job_events.c.number > number)
        .order_by(job_events.c.number)
    )
    return [(row[0], row[1]) for row in connection.execute(query)]


# --- changes ------------------------------------------------------------------------------------


def start_job(connection: Connection, job_id: str) -> bool:
    """Mark a job as running; return whether there is anything left to do for it."""
    if _change(connection, job_id, only=("queued",), state="running", started_at=moment()):
        return True
    return state_of(connection, job_id) == "running"


def cut_job(connection: Connection, job_id: str, cuts: Sequence[Cut]) -> int:
    """Enter the parts of a job, unless that was done before; return how many there are."""
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
        _change(connection, job_id, done=min(done, total))
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


def end_job(
    connection: Connection,
    job_id: str,
    state: Literal["succeeded", "failed", "cancelled"],
    *,
    error: dict[str, Any] | None = None,
    report: str | None = None,
    trials: bytes | None = None,
    plan_id: str | None = None,
) -> bool:
    """End a job, once; return whether this was the one that ended it."""
    values: dict[str, Any] = {"state": state, "ended_at": moment(), "result_plan_id": plan_id}
    if error is not None:
        values["error"] = json.dumps(error)
    if state == "succeeded":
        values["done"] = jobs.c.total
    if not _change(connection, job_id, **values):
        return False
    if report is not None:
        connection.execute(insert(job_results).values(job_id=job_id, text=report, trials=trials))
    connection.execute(delete(job_parts).where(job_parts.c.job_id == job_id))
    return True


def delete_ended(connection: Connection, before: str) -> list[str]:
    """Delete jobs that ended before a time, with all that hangs on them; return which."""
    query = select(jobs.c.id).where(jobs.c.state.not_in(UNFINISHED), jobs.c.ended_at < before)
    old = list(connection.execute(query).scalars())
    if old:
        connection.execute(delete(jobs).where(jobs.c.id.in_(old)))
    return old


def _change(
    connection: Connection, job_id: str, *, only: Sequence[State] = UNFINISHED, **values: Any
) -> bool:
    """Change a job in one of the states `only`, and tell of it; return whether it was."""
    changed = connection.execute(
        update(jobs)
        .where(jobs.c.id == job_id, jobs.c.state.in_(only))
        .values(events=jobs.c.events + 1, **values)
        .returning(jobs.c.events, jobs.c.state, jobs.c.done, jobs.c.total)
    ).first()
    if changed is None:
        return False
    number, state, done, total = changed
    told = {"state": state, "progress": {"done": done, "total": total}, "at": moment()}
    connection.execute(
        insert(job_events).values(job_id=job_id, number=number, data=json.dumps(told))
    )
    return True


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
