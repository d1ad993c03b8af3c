"""Live processes, each with a count that every heartbeat raises, and their versions.

A version stays here after its processes, to show since when none of them has been alive.
"""

import contextlib
from collections.abc import Mapping

from sqlalchemy import Connection, delete, func, insert, select, update
from sqlalchemy.exc import IntegrityError

from api.storage.tables import NOW, executors, moment, versions


def beat(connection: Connection, executor_id: str, version: str) -> None:
    """Raise an executor's count, or enter it, and note that its version is alive."""
    raised = connection.execute(
        update(executors)
        .where(executors.c.id == executor_id)
        .values(beats=executors.c.beats + 1, seen_at=NOW)
    )
    if not raised.rowcount:
        connection.execute(
            insert(executors).values(id=executor_id, beats=0, version=version, seen_at=NOW)
        )
    seen = update(versions).where(versions.c.version == version).values(seen_at=NOW)
    if not connection.execute(seen).rowcount:
        # another process may enter the version at the same moment
        with contextlib.suppress(IntegrityError), connection.begin_nested():
            connection.execute(insert(versions).values(version=version, seen_at=NOW))


def living(connection: Connection) -> dict[str, int]:
    """Return the counts of all executors entered."""
    return {row[0]: row[1] for row in connection.execute(select(executors.c.id, executors.c.beats))}


def agreed_moment(connection: Connection) -> str:
    """Return the latest time that every living executor has reached.

    By the database's clock, it lags by a heartbeat at most. SQLite's clock is that of each process,
    which may be wrong: if it is ahead, that of the others counts.
    """
    last = connection.execute(select(func.min(executors.c.seen_at))).scalar()
    now = moment(connection)
    return now if last is None else min(last, now)


def living_versions(connection: Connection) -> set[str | None]:
    """Return the versions of all executors entered; None for one before schema version 2."""
    return set(connection.execute(select(executors.c.version)).scalars())


def last_seen(connection: Connection) -> Mapping[str, str]:
    """Return the time at which an executor of each version was last alive."""
    return {row[0]: row[1] for row in connection.execute(select(versions))}


def forget(connection: Connection, executor_id: str, beats: int | None = None) -> None:
    """Remove an executor; if `beats` is given, only while that is still its count."""
    query = delete(executors).where(executors.c.id == executor_id)
    if beats is not None:
        query = query.where(executors.c.beats == beats)
    connection.execute(query)
