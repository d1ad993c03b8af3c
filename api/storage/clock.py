"""The one clock by which rows are dated, ordered and deleted: the database's.

Clocks of machines differ, and one that is a week ahead would delete what others have just made.
PostgreSQL has a clock of its own; SQLite reads that of the machine, which is the one its processes
share.
"""

import secrets
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import Connection, String, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement


class _Now(FunctionElement[str]):
    """The time as tables hold it: 2026-05-01T09:00:00.000000Z."""

    type = String()
    inherit_cache = True


@compiles(_Now, "postgresql")
def _on_postgresql(_element: _Now, _compiler: Any, **_: Any) -> str:
    # now() would be the time at which the transaction began
    form = 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"'
    return f"to_char(clock_timestamp() AT TIME ZONE 'UTC', '{form}')"


@compiles(_Now, "sqlite")
def _on_sqlite(_element: _Now, _compiler: Any, **_: Any) -> str:
    # to the millisecond, which is all that SQLite gives
    return "strftime('%Y-%m-%dT%H:%M:%f', 'now') || '000Z'"


NOW = _Now()
"""The time, for statements that write or compare it."""


def moment(connection: Connection) -> str:
    """Return the time as tables hold it: 2026-05-01T09:00:00.000000Z."""
    return connection.execute(select(NOW)).scalar_one()


def earlier(time: str, seconds: float) -> str:
    """Return a time so many seconds before another, both as tables hold them."""
    when = datetime.fromisoformat(time) - timedelta(seconds=seconds)
    return when.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def new_id(time: str) -> str:
    """Return an identifier that sorts by time: a UUID of version 7 (RFC 9562, section 5.7)."""
    since = datetime.fromisoformat(time) - datetime(1970, 1, 1, tzinfo=UTC)
    value = (since // timedelta(milliseconds=1)) << 80 | secrets.randbits(80)
    value = value & ~(0xF << 76) | 0x7 << 76
    value = value & ~(0x3 << 62) | 0x2 << 62
    return str(UUID(int=value))
