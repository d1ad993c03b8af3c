"""What workers ask about a job: whether to begin, what to compute, for whom, and its result."""

from sqlalchemy import Connection, select

from api.job_kinds.job_kind import JobSpec
from api.storage.clock import NOW
from api.storage.job_records import change, state_of
from api.storage.tables import job_results, jobs
from syncplan.reports.job_contract import UNFINISHED

__all__ = [
    "owner_and_plan",
    "report_of",
    "spec_of",
    "start_job",
    "trials_of",
]


def start_job(connection: Connection, job_id: str) -> bool:
    """Mark a job as running; return whether there is anything left to do for it."""
    if change(connection, job_id, only=("queued",), state="running", started_at=NOW):
        return True
    return state_of(connection, job_id) == "running"


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


def report_of(connection: Connection, job_id: str) -> str | None:
    """Return the report of a job that has succeeded."""
    query = select(job_results.c.text).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()


def trials_of(connection: Connection, job_id: str) -> bytes | None:
    """Return the figures of each trial of a validation that has succeeded."""
    query = select(job_results.c.trials).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()
