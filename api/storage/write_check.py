"""Whether the database can be written to, found out without leaving anything in it.

A transaction writes as much as a plan takes and is rolled back. PostgreSQL makes room in its files
for that. SQLite would keep it in memory, so it is given a cache too small for it: it writes to its
log, which the next transaction writes over. A full disk, a quota and a read-only database are found
by both. Nothing is synchronised, so that on SQLite a check takes a tenth of a millisecond.
"""

import secrets
import sqlite3
import threading
import time
from collections.abc import Callable

from sqlalchemy import Connection, Engine, insert
from sqlalchemy.exc import DBAPIError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from api.storage.tables import answers

_EVERY_S = 2.0
_SIZE = 2**16
_PATIENCE_MS = 500


class WriteCheck:
    """What is known about writing: tried at most every two seconds, however many ask.

    Parameters
    ----------
    clock : of intervals, in seconds
    """

    def __init__(self, engine: Engine, clock: Callable[[], float] = time.monotonic) -> None:
        self._engine = engine
        self._clock = clock
        self._lock = threading.Lock()
        self._error: Exception | None = None
        self._known_until = clock()

    def failed(self, error: Exception) -> None:
        """Note that somebody's write has failed."""
        if _busy(error):
            return
        self._error, self._known_until = error, self._clock() + _EVERY_S

    def check(self) -> None:
        """Raise the error that a write met, or would meet now."""
        with self._lock:
            if self._clock() >= self._known_until:
                self._error = self._tried()
                self._known_until = self._clock() + _EVERY_S
            error = self._error
        if error is not None:
            raise error.with_traceback(None)

    def _tried(self) -> Exception | None:
        try:
            with self._engine.connect() as connection:
                if self._engine.dialect.name == "sqlite":
                    _write_on_sqlite(connection)
                else:
                    _write(connection)
                    connection.rollback()
        except (DBAPIError, PoolTimeoutError) as error:
            return None if _busy(error) else error
        return None


def _write_on_sqlite(connection: Connection) -> None:
    """Write past a small cache; the connection is as before afterwards."""
    before = {
        name: connection.exec_driver_sql(f"PRAGMA {name}").scalar()
        for name in ("busy_timeout", "cache_size")
    }
    connection.exec_driver_sql(f"PRAGMA busy_timeout = {_PATIENCE_MS}")
    connection.exec_driver_sql("PRAGMA cache_size = 1")
    try:
        connection.exec_driver_sql("BEGIN IMMEDIATE")
        _write(connection)
    finally:
        connection.rollback()
        # one whose write has failed is not used again
        if not connection.closed and not connection.invalidated:
            for name, value in before.items():
                connection.exec_driver_sql(f"PRAGMA {name} = {value}")


def _write(connection: Connection) -> None:
    row = {
        "owner": "",
        "key": secrets.token_hex(),
        "request_digest": "",
        "status": 0,
        "headers": "",
        # random, so that PostgreSQL does not compress it
        "body": secrets.token_hex(_SIZE // 2),
        "created_at": "",
    }
    connection.execute(insert(answers).values(row))


def _busy(error: Exception) -> bool:
    """Whether others are writing just now, and so could this process."""
    code = getattr(getattr(error, "orig", None), "sqlite_errorcode", 0)
    return code & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
