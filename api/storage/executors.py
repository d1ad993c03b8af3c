"""Which processes are alive: a count for each, raised with every heartbeat."""

from sqlalchemy import Connection, delete, insert, select, update

from api.storage.tables import executors

__all__ = ["beat", "forget", "living"]


def beat(connection: Connection, executor_id: str) -> None:
    """Raise an executor's count, or enter it."""
    raised = connection.execute(
        update(executors).where(executors.c.id == executor_id).values(beats=executors.c.beats + 1)
    )
    if not raised.rowcount:
        connection.execute(insert(executors).values(id=executor_id, beats=0))


def living(connection: Connection) -> dict[str, int]:
    """Return the counts of all executors entered."""
    return {row[0]: row[1] for row in connection.execute(select(executors.c.id, executors.c.beats))}


def forget(connection: Connection, executor_id: str, beats: int | None = None) -> None:
    """Remove an executor, if its count is still the one given."""
    query = delete(executors).where(executors.c.id == executor_id)
    if beats is not None:
        query = query.where(executors.c.beats == beats)
    connection.execute(query)
