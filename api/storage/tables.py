"""Tables of the newest schema version; times are RFC 3339 in UTC, identifiers are ordered.

One clock dates, orders and deletes rows: the database's. Clocks of machines differ, and one that is
a week ahead would delete what others have just made. PostgreSQL has a clock of its own; SQLite
reads that of the machine, which is the one its processes share.
"""

import secrets
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Connection,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    Row,
    Select,
    String,
    Table,
    Text,
    func,
    select,
)
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.sql.functions import FunctionElement

# --- the clock ------------------------------------------------------------------------------------


class _Now(FunctionElement[str]):
    """The current time as stored in tables: 2026-05-01T09:00:00.000000Z."""

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
"""The current time, for statements that write or compare it."""


def moment(connection: Connection) -> str:
    """Return the current time as stored in tables: 2026-05-01T09:00:00.000000Z."""
    return connection.execute(select(NOW)).scalar_one()


def earlier(time: str, seconds: float) -> str:
    """Return the time so many seconds before another, both as stored in tables."""
    when = datetime.fromisoformat(time) - timedelta(seconds=seconds)
    return when.strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def newest(
    connection: Connection,
    table: Table,
    query: Select[*tuple[Any, ...]],
    owner: str,
    limit: int,
    before: str | None,
) -> Sequence[Row[*tuple[Any, ...]]]:
    """Return up to `limit` of an owner's rows that a query selects, newest first.

    They are older than the identifier `before`, if one is given.
    """
    query = query.where(table.c.owner == owner).order_by(table.c.id.desc()).limit(limit)
    if before is not None:
        query = query.where(table.c.id < before)
    return connection.execute(query).all()


def next_id(connection: Connection, table: Table, owner: str) -> tuple[str, str]:
    """Return an identifier that follows all of an owner's in a table, and the current time.

    After a clock was set back, identifiers run ahead of it, so that a new row is the newest.
    """
    last = select(func.max(table.c.id)).where(table.c.owner == owner)
    time, newest_id = connection.execute(select(NOW, last.scalar_subquery())).one()
    return new_id(time, after=newest_id), time


def new_id(time: str, after: str | None = None) -> str:
    """Return an identifier that sorts by time: a UUID of version 7 (RFC 9562, section 5.7).

    It sorts after another one if that is given, as if made a millisecond later where it must.
    """
    since = datetime.fromisoformat(time) - datetime(1970, 1, 1, tzinfo=UTC)
    stamp = since // timedelta(milliseconds=1)
    if after is not None:
        stamp = max(stamp, (UUID(after).int >> 80) + 1)
    value = stamp << 80 | secrets.randbits(80)
    value = value & ~(0xF << 76) | 0x7 << 76
    value = value & ~(0x3 << 62) | 0x2 << 62
    return str(UUID(int=value))


# --- tables ---------------------------------------------------------------------------------------


METADATA = MetaData()

schema_version = Table(
    "syncplan_schema",
    METADATA,
    Column("version", Integer, primary_key=True, autoincrement=False),
    # the oldest version whose processes can work on this one
    Column("usable_from", Integer),
)

plans = Table(
    "plans",
    METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("parent_id", String(36)),
    Column("created_at", String(27), nullable=False),
    Column("name", Text),
    Column("vehicles", Integer, nullable=False),
    Column("observable", Boolean, nullable=False),
    Column("predicted_rms_m", Float),
    Column("etag", String(64), nullable=False),
    Column("text", Text, nullable=False),
    Column("worst_predicted_rms_m", Float),
    # what a small map shows, as JSON; null for plans stored before schema version 7
    Column("outline", Text),
    Index("plans_of_owner", "owner", "id"),
)

jobs = Table(
    "jobs",
    METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("request", Text, nullable=False),
    Column("plan_id", String(36)),
    # a copy until the job ends, so that deleting the plan does not break it
    Column("plan_text", Text),
    Column("done", Integer, nullable=False),
    Column("total", Integer, nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("started_at", String(27)),
    Column("ended_at", String(27)),
    Column("result_plan_id", String(36)),
    Column("error", Text),
    Column("events", Integer, nullable=False),
    # of the syncplan that works on it: empty until one does, None for one before schema version 2
    Column("version", String(40)),
    # how often it was begun anew
    Column("begun", Integer, nullable=False, server_default="0"),
    # computing time of the children that worked on it, over all attempts
    Column("computed_s", Float, nullable=False, server_default="0"),
    # the trace of the request, as W3C Trace Context writes it
    Column("traceparent", String(55)),
    # for a replay only
    Column("recording_id", String(36)),
    # 1 once it is to end early, with the best found so far
    Column("finishing", Integer, nullable=False, server_default="0"),
    # 1 once its owner has deleted it
    Column("deleted", Integer, nullable=False, server_default="0"),
    Index("jobs_of_owner", "owner", "id"),
    Index("jobs_by_state", "state", "ended_at"),
)


recordings = Table(
    "recordings",
    METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("size", Integer, nullable=False),
    # overview, as JSON
    Column("overview", Text, nullable=False),
    # as syncplan.recordings.log packs it
    Column("data", LargeBinary, nullable=False),
    Index("recordings_of_owner", "owner", "id"),
)


def _job_id() -> "Column[str]":
    return Column("job_id", String(36), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


job_results = Table(
    "job_results",
    METADATA,
    _job_id(),
    Column("text", Text, nullable=False),
    # figures of each trial of a validation or flight, packed by its kind
    Column("trials", LargeBinary),
)

job_parts = Table(
    "job_parts",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("run", Integer, nullable=False),
    Column("first_trial", Integer, nullable=False),
    Column("trials", Integer, nullable=False),
    Column("done", Integer, nullable=False),
    Column("data", LargeBinary),
    # how often it was begun, and how often its child ended
    Column("attempts", Integer, nullable=False, server_default="0"),
    Column("deaths", Integer, nullable=False, server_default="0"),
    # over all attempts
    Column("computed_s", Float, nullable=False, server_default="0"),
)

# finished searches of a refinement or a design, from which a killed one continues
job_starts = Table(
    "job_starts",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", LargeBinary, nullable=False),
)

job_events = Table(
    "job_events",
    METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", Text, nullable=False),
)

answers = Table(
    "answers",
    METADATA,
    Column("owner", String(80), primary_key=True),
    Column("key", String(255), primary_key=True),
    Column("request_digest", String(64), nullable=False),
    Column("status", Integer, nullable=False),
    Column("headers", Text, nullable=False),
    Column("body", Text, nullable=False),
    Column("created_at", String(27), nullable=False),
    Index("answers_by_age", "created_at"),
)

executors = Table(
    "executors",
    METADATA,
    Column("id", String(64), primary_key=True),
    Column("beats", Integer, nullable=False),
    # of its syncplan; None for one before schema version 2
    Column("version", String(40)),
    # its last heartbeat, by the database's clock
    Column("seen_at", String(27)),
)

# bytes that an owner keeps of a kind, as `api.storage.owner_bytes` counts them: the sum of its rows
owner_bytes = Table(
    "owner_bytes",
    METADATA,
    Column("owner", String(80), primary_key=True),
    Column("kind", String(16), primary_key=True),
    Column("slot", Integer, primary_key=True),
    Column("bytes", BigInteger, nullable=False),
)

# when a worker of a version was last alive, by the database's clock
versions = Table(
    "versions",
    METADATA,
    Column("version", String(40), primary_key=True),
    Column("seen_at", String(27), nullable=False),
)
