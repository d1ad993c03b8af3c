"""Rows written for many requests at once: one transaction, and one wait for the disk, for all.

Whoever waits is answered once its rows are on the disk, as if it had written alone.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from sqlalchemy import Connection

from api.storage.database import Database, unavailable
from api.storage.group_thread import GroupThread

R = TypeVar("R")

_MOST = 16
"""Plans written at once: some are of hundreds of kilobytes."""

_Write = Callable[[Connection], Any]


class PlanWriter:
    """A thread that writes what requests have computed.

    It is for rows that nobody else waits for or writes at the same time: what holds a lock, or
    may meet one, takes a transaction of its own.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._thread: GroupThread[_Write, Any] = GroupThread("plan-writer", self._written, _MOST)

    async def write(self, change: Callable[[Connection], R]) -> R:
        """Return what `change` returns once that is committed; raises what it raises.

        It may be called again, in another transaction, after one that was rolled back.
        """
        result: R = await self._thread.ask(change)
        return result

    def close(self) -> None:
        """End the thread."""
        self._thread.close()

    def _written(self, changes: Sequence[_Write]) -> list[Any]:
        try:
            with self._database.writing() as connection:
                return [change(connection) for change in changes]
        except Exception as error:
            if len(changes) == 1 or unavailable(error):
                raise
        # one of them failed: each has its own outcome
        return [self._alone(change) for change in changes]

    def _alone(self, change: _Write) -> Any:
        try:
            with self._database.writing() as connection:
                return change(connection)
        except Exception as error:
            return error
