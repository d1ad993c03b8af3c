"""Plans read for many requests at once, by one statement over a connection that stays open."""

from collections.abc import Sequence

from sqlalchemy import Connection

from api.storage.database import Database, unavailable
from api.storage.group_thread import GroupThread
from api.storage.plan_records import PlanRow, find_plans

_MOST = 16
"""Plans read at once: some are of hundreds of kilobytes."""


class PlanReader:
    """A thread that reads plans; every reading sees what is in the database at that moment."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._connection: Connection | None = None
        self._thread = GroupThread("plan-reader", self._found, _MOST)

    async def find(self, owner: str, plan_id: str) -> PlanRow | None:
        """Return an owner's plan, or None."""
        return await self._thread.ask((owner, plan_id))

    def close(self) -> None:
        """End the thread and close its connection."""
        self._thread.close()
        self._drop()

    def _found(self, asked: Sequence[tuple[str, str]]) -> list[PlanRow | None]:
        if self._connection is not None:
            try:
                return find_plans(self._connection, asked)
            except Exception as error:
                self._drop()
                if not unavailable(error):
                    raise
                # the connection may have been cut long ago: a new one decides
        self._connection = self._database.autocommitting()
        try:
            return find_plans(self._connection, asked)
        except Exception:
            self._drop()
            raise

    def _drop(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
