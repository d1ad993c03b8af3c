"""Every change of a job, in order and without gaps."""

from sqlalchemy import Connection, select

from api.storage.tables import job_events

__all__ = ["MOST_EVENTS", "events_after"]

MOST_EVENTS = 500
"""Most events that are read at a time."""


def events_after(connection: Connection, job_id: str, number: int) -> list[tuple[int, str]]:
    """Return (number, JSON) of the events of a job after the one with a number, in order.

    Up to MOST_EVENTS of them; ask again from the last one on.
    """
    query = (
        select(job_events.c.number, job_events.c.data)
        .where(job_events.c.job_id == job_id, job_events.c.number > number)
        .order_by(job_events.c.number)
        .limit(MOST_EVENTS)
    )
    return [(row[0], row[1]) for row in connection.execute(query)]
