"""Database: connections, transactions, the file of SQLite, waiting out an outage.

SQLite keeps two files beside an open database. They are gone once the last process that used it has
ended in good order, and on a full disk they can't be made, even to read. Nor can anything be
deleted there: a deletion is written to the log first. A reserve is kept beside its file for both.

The check that the database can be written to leaves nothing in it: a transaction writes as much as
a plan takes and is rolled back. PostgreSQL makes room in its files for that. SQLite would keep the
row in memory, so it gets a cache too small for it and writes to its log, which the next transaction
overwrites. Both detect a full disk, a quota and a read-only database. Nothing is synchronised, so
that on SQLite a check takes a tenth of a millisecond.
"""

import contextlib
import logging
import math
import os
import secrets
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import disk_usage
from typing import Any, Concatenate, ParamSpec, TypeVar

from sqlalchemy import (
    Connection,
    Engine,
    ExceptionContext,
    create_engine,
    event,
    insert,
    make_url,
    text,
)
from sqlalchemy.exc import DBAPIError, OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from api.storage.migrations import needs_upgrade, upgrade
from api.storage.tables import answers
from syncplan.errors import InputError

# --- a reserve on the disk ------------------------------------------------------------------------


_RESERVE_BYTES = 6 * 2**20
"""For what SQLite's log may hold when the disk gets full, and for a deletion."""
_LEAST_RESERVE_BYTES = 2**17
"""For opening the file."""
_LOG_BYTES = 2**21
_LOG_PAGES = 2**8
"""Length of SQLite's log at which it is written to the file."""


def keep_reserve(database: Path, spared: int = _LOG_BYTES) -> None:
    """Reserve disk space for a database, as far as there is more than is spared for its log."""
    with contextlib.suppress(OSError):
        opened = os.open(_reserve_of(database), os.O_CREAT | os.O_WRONLY, 0o600)
        room = disk_usage(database.parent).free - spared
        for size in (min(_RESERVE_BYTES, room), _LEAST_RESERVE_BYTES):
            with contextlib.suppress(OSError):
                os.posix_fallocate(opened, 0, size)
                break
        os.close(opened)


def release_reserve(database: Path) -> bool:
    """Release the reserved space; return whether there was any."""
    try:
        _reserve_of(database).unlink()
    except OSError:
        return False
    return True


def _reserve_of(database: Path) -> Path:
    return database.with_name(f"{database.name}-reserve")


# --- check of writing -----------------------------------------------------------------------------


_CHECK_EVERY_S = 2.0
_CHECKED_BYTES = 2**16
_PATIENCE_MS = 500


class WriteCheck:
    """Check that the database can be written to, tried at most every two seconds.

    Parameters
    ----------
    clock : clock of intervals, in seconds
    """

    def __init__(self, engine: Engine, clock: Callable[[], float] = time.monotonic) -> None:
        self._engine = engine
        self._clock = clock
        self._lock = threading.Lock()
        self._error: Exception | None = None
        self._known_until = clock()

    def failed(self, error: Exception) -> None:
        """Note that a write elsewhere has failed."""
        if _busy(error):
            return
        self._error, self._known_until = error, self._clock() + _CHECK_EVERY_S

    def check(self) -> None:
        """Raise the error that a write met, or would meet now."""
        with self._lock:
            if self._clock() >= self._known_until:
                self._error = self._tried()
                self._known_until = self._clock() + _CHECK_EVERY_S
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
    """Write past a small cache, then restore the connection."""
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
        # a connection whose write has failed is not used again
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
        "body": secrets.token_hex(_CHECKED_BYTES // 2),
        "created_at": "",
    }
    connection.execute(insert(answers).values(row))


def _busy(error: Exception) -> bool:
    """Whether others are writing just now, which shows that this process could too."""
    code = getattr(getattr(error, "orig", None), "sqlite_errorcode", 0)
    return code & 0xFF in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


# --- connections ----------------------------------------------------------------------------------


P = ParamSpec("P")
R = TypeVar("R")

BUSY_S = 10
"""Time that a statement waits for the locks of others (s)."""

_IDLE_S = 20
"""Time after which PostgreSQL ends a transaction whose process has frozen, with its locks (s)."""

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
"""Prefixes of SQLSTATEs: connection, conflict of transactions, resources, locks, shutdown."""

_logger = logging.getLogger("syncplan.storage")


class Database:
    """An engine with two ways to use it, reading and writing: in a block or by one function."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.is_sqlite = engine.dialect.name == "sqlite"
        self._file = Path(engine.url.database or "")
        self._write_check = WriteCheck(engine)

    def reading(self) -> Connection:
        """Return a connection to read with; as a context manager, it closes at the block's end."""
        return self.engine.connect()

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """Transaction, committed if the block succeeds and rolled back otherwise."""
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

    def read(
        self, query: Callable[Concatenate[Connection, P], R], *args: P.args, **kwargs: P.kwargs
    ) -> R:
        """Return the result of a function that reads, called with a connection and arguments."""
        with self.reading() as connection:
            return query(connection, *args, **kwargs)

    def write(
        self, change: Callable[Concatenate[Connection, P], R], *args: P.args, **kwargs: P.kwargs
    ) -> R:
        """Return the result of a function that is called in a transaction of its own."""
        with self.writing() as connection:
            return change(connection, *args, **kwargs)

    def freeing(self, delete: Callable[[Connection], R]) -> R:
        """Return the result of a transaction that deletes; a full disk does not prevent it.

        On SQLite, it then runs in the room of the reserve. The log is emptied, and may grow again
        by as much as is free inside the file.
        """
        if not self.is_sqlite or disk_usage(self._file.parent).free > _LOG_BYTES:
            try:
                return self.write(delete)
            except DBAPIError as error:
                if not (self.is_sqlite and error.connection_invalidated):
                    raise
        try:
            with self.writing() as connection:
                # nobody takes the reserve back while this transaction holds its lock
                release_reserve(self._file)
                # overwriting what is deleted would take as much room; closed after this
                connection.detach()
                connection.exec_driver_sql("PRAGMA secure_delete = OFF")
                return delete(connection)
        finally:
            spared = 0
            with contextlib.suppress(DBAPIError), self.reading() as connection:
                connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
                free = "SELECT * FROM pragma_freelist_count, pragma_page_size"
                spared = math.prod(connection.exec_driver_sql(free).one())
            with contextlib.suppress(DBAPIError), self.writing():
                keep_reserve(self._file, min(_LOG_BYTES, spared))

    def autocommitting(self) -> Connection:
        """Return a connection for the caller to close; each statement is its own transaction."""
        connection = self.engine.connect()
        # connections of SQLite commit each statement unless `writing` has begun a transaction
        if self.is_sqlite:
            return connection
        return connection.execution_options(isolation_level="AUTOCOMMIT")

    def check(self) -> None:
        """Raise the error of reading if the database can't be reached."""
        with self.reading() as connection:
            connection.execute(text("SELECT 1"))

    def check_writing(self) -> None:
        """Raise the error of writing if the database can't be written to.

        A result of the last seconds is used again; see `api.storage.database`.
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
    """Upgrade the schema; one that is up to date is only read, which a full disk allows."""
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
                "options": f"-c statement_timeout={_STATEMENT_S}s -c lock_timeout={BUSY_S}s "
                f"-c idle_in_transaction_session_timeout={_IDLE_S}s",
            },
            **shared,
        )
    engine = create_engine(url, connect_args={"timeout": BUSY_S}, **shared)

    @event.listens_for(engine, "connect")
    def _prepare(connection: Any, _record: Any) -> None:
        # only `writing` begins transactions
        connection.isolation_level = None
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute("PRAGMA synchronous=FULL")
        connection.execute(f"PRAGMA wal_autocheckpoint={_LOG_PAGES}")
        connection.execute("PRAGMA foreign_keys=ON")

    return engine


@event.listens_for(Engine, "handle_error")
def _count_as_away(context: ExceptionContext) -> None:
    """Make a full, failing or read-only disk count as a lost connection.

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
    """Call a function, repeatedly while the database is away, and return its result."""
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
