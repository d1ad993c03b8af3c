"""Bytes of each owner, summed row by row over the tables of a database."""

from collections import Counter

from sqlalchemy import Connection, select

from api.storage.owner_bytes import ROW_BYTES
from api.storage.tables import (
    answers,
    job_events,
    job_parts,
    job_results,
    job_starts,
    jobs,
    plans,
    recordings,
)

__all__ = ["summed_bytes"]

_SIZED = {
    plans: ("name", "text", "outline"),
    jobs: ("request", "plan_text", "error"),
    answers: ("headers", "body"),
    recordings: ("overview", "data"),
    job_results: ("text", "trials"),
    job_parts: ("data",),
    job_starts: ("data",),
    job_events: ("data",),
}


def summed_bytes(connection: Connection) -> dict[str, Counter[str]]:
    """Return the bytes of each owner by kind."""
    owners = {row.id: row.owner for row in connection.execute(select(jobs.c.id, jobs.c.owner))}
    sums: dict[str, Counter[str]] = {}
    for table, columns in _SIZED.items():
        for row in connection.execute(select(table)).mappings():
            owner = row["owner"] if "owner" in row else owners[row["job_id"]]
            values = [row[column] for column in columns if row[column] is not None]
            size = sum(len(value.encode() if isinstance(value, str) else value) for value in values)
            kind = table.name if "owner" in row else "jobs"
            sums.setdefault(owner, Counter())[kind] += ROW_BYTES + size
    return sums
