"""The database: connections, transactions, the file of SQLite, waiting out an outage."""

import logging
import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from sqlalchemy import Connection, Engine, ExceptionContext, create_engine, event, make_url, text
from sqlalchemy.exc import DBAPIError, OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from api.storage.disk_reserve import keep_reserve, release_reserve
from api.storage.migrations import needs_upgrade, upgrade
from api.storage.write_check import WriteCheck
from syncplan.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

BUSY_S = 10
"""How long a statement waits for others' locks."""

_CONNECT_S = 3
_STATEMENT_S = 60
_UPGRADE_LOCK = 0x73796E63
_LONGEST_WAIT_S = 2.0
_NO_DISK = {
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
}

_PASSING = _NO_DISK | {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED}
_READ_ONLY = "25006"
_PASSING_STATES = ("08", "40", "53", "55", "57P", _READ_ONLY)
"""SQLSTATEs that begin so: connection, conflict of transactions, resources, locks, shutdown."""

_logger = logging.getLogger("syncplan.storage")


class Database:
    """An engine with the two ways to use it: `reading` and `writing`."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.is_sqlite = engine.dialect.name == "sqlite"
        self._write_check = WriteCheck(engine)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection to read with."""
        with self.engine.connect() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction, committed where the block ends well and rolled back otherwise."""
        try:
            with self.engine.begin() as connection:
                if self.is_sqlite:
                    # waits its turn now, rather than failing at the first write after a read
                    connection.exec_driver_sql("BEGIN IMMEDIATE")
                yield connection
        except DBAPIError as error:
            if unavailable(error):
                self._write_check.failed(error)
            raise

    def autocommitting(self) -> Connection:
        """Return a connection to keep and to close: each statement is a transaction of its own."""
        connection = self.engine.connect()
        # SQLite's commit each statement unless `writing` has begun a transaction
        if self.is_sqlite:
            return connection
        return connection.execution_options(isolation_level="AUTOCOMMIT")

    def check(self) -> None:
        """Raise what reading raises if the database can't be reached."""
        with self.reading() as connection:
            connection.execute(text("SELECT 1"))

    def check_writing(self) -> None:
        """Raise what writing raises if the database can't be written to.

        What was seen in the last seconds is not tried again; see `api.storage.write_check`.
        """
        self._write_check.check()

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


def open_database(url: str) -> Database:
    """Return the database of a SQLAlchemy URL, its schema brought up to date.

    Raises InputError if it can't be opened.
    """
    parsed = make_url(url)
    # a password may also stand among the parameters
    shown = parsed.set(query={}).render_as_string(hide_password=True)
    file = Path(parsed.database or "") if parsed.get_backend_name() == "sqlite" else None
    try:
        if file is not None:
            # no other user of this machine may read it
            file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not file.exists():
                os.close(os.open(file, os.O_CREAT | os.O_RDWR, 0o600))
        database = Database(_engine(url, file is not None))
        try:
            _bring_up_to_date(database)
        except DBAPIError as error:
            if file is None or not unavailable(error) or not release_reserve(file):
                raise
            _bring_up_to_date(database)
    except (SQLAlchemyError, OSError) as error:
        reason = str(getattr(error, "orig", None) or error).strip().splitlines()[0]
        raise InputError(f"can't be opened: {reason}", source=shown) from None
    if file is not None:
        keep_reserve(file)
    return database


def _bring_up_to_date(database: Database) -> None:
    """Upgrade the schema; one that is up to date is only read, as it can be on a full disk."""
    with database.reading() as connection:
        if not needs_upgrade(connection):
            return
    with database.writing() as connection:
        if not database.is_sqlite:
            # one process upgrades, the others wait
            connection.execute(text(f"SELECT pg_advisory_xact_lock({_UPGRADE_LOCK})"))
        upgrade(connection)


def _engine(url: str, sqlite: bool) -> Engine:
    shared: dict[str, Any] = {
        "pool_size": 10,
        "max_overflow": 30,
        "pool_timeout": BUSY_S,
        # what users plan does not belong in logs
        "hide_parameters": True,
    }
    if not sqlite:
        return create_engine(
            url,
            pool_pre_ping=True,
            connect_args={
                "connect_timeout": _CONNECT_S,
                "options": f"-c statement_timeout={_STATEMENT_S}s -c lock_timeout={BUSY_S}s",
            },
            **shared,
        )
    engine = create_engine(url, connect_args={"timeout": BUSY_S}, **shared)

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, _record: Any) -> None:
        # transactions are begun by `writing` alone
        connection.isolation_level = None
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute("PRAGMA synchronous=FULL")
        connection.execute("PRAGMA foreign_keys=ON")

    return engine


@event.listens_for(Engine, "handle_error")
def _count_as_away(context: ExceptionContext) -> None:
    """Let a disk that is full, fails or can only be read count as a connection lost.

    DBOS, with engines of its own, waits for a connection to come back; any other error of the
    database ends its workflow.
    """
    code = getattr(context.original_exception, "sqlite_errorcode", 0)
    state = getattr(context.original_exception, "sqlstate", None)
    if code & 0xFF in _NO_DISK or state == _READ_ONLY:
        context.is_disconnect = True
        context.invalidate_pool_on_disconnect = False


def unavailable(error: BaseException) -> bool:
    """Return whether an error means that the database can't be reached or written to just now."""
    if isinstance(error, PoolTimeoutError):
        return True
    if not isinstance(error, DBAPIError):
        return False
    if error.connection_invalidated:
        return True
    code = getattr(error.orig, "sqlite_errorcode", None)
    if code is not None:
        return code & 0xFF in _PASSING
    state = getattr(error.orig, "sqlstate", None)
    # psycopg has no state for a connection that it could not make
    return isinstance(error, OperationalError) and (
        state is None or state.startswith(_PASSING_STATES)
    )


def patiently(function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> R:
    """Return what the function returns, called again for as long as the database is away."""
    wait = 0.1
    while True:
        try:
            return function(*args, **kwargs)
        except Exception as error:
            if not unavailable(error):
                raise
            _logger.warning("the database is away, trying again in %.1f s: %s", wait, error)
            time.sleep(wait)
            wait = min(2.0 * wait, _LONGEST_WAIT_S)
