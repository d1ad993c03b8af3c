"""Jobs that ended long ago: found first, deleted once nothing else is left of them."""

from collections.abc import Sequence

from sqlalchemy import Connection, delete, select

from api.storage.tables import jobs
from syncplan.reports.job_contract import UNFINISHED


def ended_before(connection: Connection, time: str, most: int) -> list[str]:
    """Return the identifiers of up to `most` jobs that ended before a time."""
    query = select(jobs.c.id).where(jobs.c.state.not_in(UNFINISHED), jobs.c.ended_at < time)
    return list(connection.execute(query.limit(most)).scalars())


def delete_jobs(connection: Connection, job_ids: Sequence[str]) -> None:
    """Delete jobs, with everything that refers to them."""
    connection.execute(delete(jobs).where(jobs.c.id.in_(job_ids)))
