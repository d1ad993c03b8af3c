"""What workers ask about a job: whether to begin, what to compute, for whom, and its result."""

from dataclasses import dataclass

from sqlalchemy import Connection, select

from api.job_kinds.job_tasks import JobSpec
from api.storage.clock import NOW
from api.storage.job_records import ANY_VERSION, change
from api.storage.tables import job_results, jobs, recordings


@dataclass(frozen=True, slots=True)
class BegunJob:
    """A job under way; `begun` counts how often it was begun anew."""

    spec: JobSpec
    owner: str
    begun: int


def start_job(connection: Connection, job_id: str, version: str) -> BegunJob | None:
    """Mark a job as running, if it waits and may be begun by this version; return it if it runs."""
    query = select(jobs.c.id).where(
        jobs.c.id == job_id, jobs.c.state == "queued", jobs.c.version.in_((ANY_VERSION, version))
    )
    if connection.execute(query.with_for_update()).first() is not None:
        started = {"state": "running", "version": version, "started_at": NOW}
        change(connection, job_id, only=("queued",), **started)
    return begun_job(connection, job_id, version)


def begun_job(connection: Connection, job_id: str, version: str) -> BegunJob | None:
    """Return a job that runs and was begun by this version; None otherwise."""
    specified = (jobs.c.id, jobs.c.kind, jobs.c.request, jobs.c.plan_text, recordings.c.data)
    query = (
        select(jobs.c.owner, jobs.c.begun, *specified)
        .outerjoin_from(jobs, recordings, jobs.c.recording_id == recordings.c.id)
        .where(jobs.c.id == job_id, jobs.c.state == "running", jobs.c.version == version)
    )
    found = connection.execute(query).first()
    return None if found is None else BegunJob(JobSpec(*found[2:]), found[0], found[1])


@dataclass(frozen=True, slots=True)
class JobLife:
    """When a job was requested, started and ended, and how; `error` is JSON."""

    kind: str
    state: str
    traceparent: str | None
    created_at: str
    started_at: str | None
    ended_at: str | None
    error: str | None


def life_of(connection: Connection, job_id: str) -> JobLife | None:
    """Return the times and the end of a job; None if there is no such job."""
    columns = (jobs.c[name] for name in JobLife.__dataclass_fields__)
    found = connection.execute(select(*columns).where(jobs.c.id == job_id)).first()
    return None if found is None else JobLife(*found)


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
    """Return the figures of each trial of a job that has succeeded."""
    query = select(job_results.c.trials).where(job_results.c.job_id == job_id)
    return connection.execute(query).scalar()
