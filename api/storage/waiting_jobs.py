"""Jobs that have not ended, whose they are to work on, and how one is begun anew."""

from dataclasses import dataclass

from sqlalchemy import Connection, select, update

from api.storage.job_records import forget_parts
from api.storage.tables import jobs
from syncplan.reports.job_contract import UNFINISHED


@dataclass(frozen=True, slots=True)
class WaitingJob:
    """A job that has not ended.

    Attributes
    ----------
    version : that has begun it, ANY_VERSION if none has, None if one from before schema version 2
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
    """Give a job to a version, to begin it again; return whether it was still as it is given here.

    What is finished of it is dropped unless `keep` is given. The progress that is shown stays until
    it is passed.
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
