"""The schema's versions: each migration takes a database from one version to the next.

Every database begins with the tables of version 1, a copy frozen on purpose: tables shared with
`api.storage.tables` would change with those of today, and a new database would then differ from one
that was upgraded.
"""

from collections.abc import Callable
from typing import Any

from sqlalchemy import (
    Boolean,
    Column,
    Connection,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    delete,
    insert,
    inspect,
    select,
)
from sqlalchemy.schema import CreateColumn

from api.storage.tables import schema_version
from syncplan.errors import InputError

# --- the first version ----------------------------------------------------------------------------


FIRST_METADATA = MetaData()


def _job_id() -> "Column[str]":
    return Column("job_id", String(36), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)


Table(
    "syncplan_schema",
    FIRST_METADATA,
    Column("version", Integer, primary_key=True, autoincrement=False),
)
Table(
    "plans",
    FIRST_METADATA,
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
    Index("plans_of_owner", "owner", "id"),
)
Table(
    "jobs",
    FIRST_METADATA,
    Column("id", String(36), primary_key=True),
    Column("owner", String(80), nullable=False),
    Column("kind", String(16), nullable=False),
    Column("state", String(16), nullable=False),
    Column("request", Text, nullable=False),
    Column("plan_id", String(36)),
    Column("plan_text", Text),
    Column("done", Integer, nullable=False),
    Column("total", Integer, nullable=False),
    Column("created_at", String(27), nullable=False),
    Column("started_at", String(27)),
    Column("ended_at", String(27)),
    Column("result_plan_id", String(36)),
    Column("error", Text),
    Column("events", Integer, nullable=False),
    Index("jobs_of_owner", "owner", "id"),
    Index("jobs_by_state", "state", "ended_at"),
)
Table(
    "job_results",
    FIRST_METADATA,
    _job_id(),
    Column("text", Text, nullable=False),
    Column("trials", LargeBinary),
)
Table(
    "job_parts",
    FIRST_METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("run", Integer, nullable=False),
    Column("first_trial", Integer, nullable=False),
    Column("trials", Integer, nullable=False),
    Column("done", Integer, nullable=False),
    Column("data", LargeBinary),
)
Table(
    "job_events",
    FIRST_METADATA,
    _job_id(),
    Column("number", Integer, primary_key=True),
    Column("data", Text, nullable=False),
)
Table(
    "answers",
    FIRST_METADATA,
    Column("owner", String(80), primary_key=True),
    Column("key", String(255), primary_key=True),
    Column("request_digest", String(64), nullable=False),
    Column("status", Integer, nullable=False),
    Column("headers", Text, nullable=False),
    Column("body", Text, nullable=False),
    Column("created_at", String(27), nullable=False),
    Index("answers_by_age", "created_at"),
)
Table(
    "executors",
    FIRST_METADATA,
    Column("id", String(64), primary_key=True),
    Column("beats", Integer, nullable=False),
)


# --- migrations -----------------------------------------------------------------------------------


def _first(connection: Connection) -> None:
    FIRST_METADATA.create_all(connection)


def _second(connection: Connection) -> None:
    _add(connection, "syncplan_schema", Column("usable_from", Integer))
    _add(connection, "executors", Column("version", String(40)))
    _add(connection, "executors", Column("seen_at", String(27)))
    _add(connection, "jobs", Column("version", String(40)))
    _add(connection, "jobs", Column("begun", Integer, nullable=False, server_default="0"))
    _add(connection, "jobs", Column("computed_s", Float, nullable=False, server_default="0"))
    _add(connection, "jobs", Column("traceparent", String(55)))
    _add(connection, "job_parts", Column("attempts", Integer, nullable=False, server_default="0"))
    _add(connection, "job_parts", Column("deaths", Integer, nullable=False, server_default="0"))
    _add(connection, "job_parts", Column("computed_s", Float, nullable=False, server_default="0"))
    tables = MetaData()
    Table("jobs", tables, Column("id", String(36), primary_key=True))
    job = Column("job_id", String(36), ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True)
    Table(
        "job_starts",
        tables,
        job,
        Column("number", Integer, primary_key=True),
        Column("data", LargeBinary, nullable=False),
    ).create(connection)
    Table(
        "versions",
        tables,
        Column("version", String(40), primary_key=True),
        Column("seen_at", String(27), nullable=False),
    ).create(connection)


def _third(connection: Connection) -> None:
    _add(connection, "jobs", Column("recording_id", String(36)))
    Table(
        "recordings",
        MetaData(),
        Column("id", String(36), primary_key=True),
        Column("owner", String(80), nullable=False),
        Column("created_at", String(27), nullable=False),
        Column("size", Integer, nullable=False),
        Column("overview", Text, nullable=False),
        Column("data", LargeBinary, nullable=False),
        Index("recordings_of_owner", "owner", "id"),
    ).create(connection)


MIGRATIONS: tuple[Callable[[Connection], None], ...] = (_first, _second, _third)
"""Migration k takes version k to k + 1, and only adds: processes of the version before go on.

Once released, one is not changed; none refers to `api.storage.tables`, which change.
"""

USABLE_FROM = 1
"""The oldest version whose processes can work on the newest one."""


def needs_upgrade(connection: Connection) -> bool:
    """Return whether a database is older than this syncplan; reads, and writes nothing.

    A newer one stays as it is where it says that this syncplan can work on it, so that an older
    process can be started anew while others are upgraded. Raises InputError for any other that a
    newer syncplan has written.
    """
    version, usable_from = _version(connection)
    if version > len(MIGRATIONS) and usable_from > len(MIGRATIONS):
        raise InputError(
            f"holds schema version {version}, this syncplan knows up to {len(MIGRATIONS)}; "
            "update syncplan",
            source="the database",
        )
    return version < len(MIGRATIONS)


def upgrade(connection: Connection) -> None:
    """Bring a database to the newest version, if it is older, inside the caller's transaction.

    Raises what `needs_upgrade` raises.
    """
    if not needs_upgrade(connection):
        return
    version, _ = _version(connection)
    for migration in MIGRATIONS[version:]:
        migration(connection)
    connection.execute(delete(schema_version))
    newest = {"version": len(MIGRATIONS), "usable_from": USABLE_FROM}
    connection.execute(insert(schema_version).values(newest))


def _version(connection: Connection) -> tuple[int, int]:
    """The version of a database, 0 for an empty one, and the oldest that can work on it."""
    if not inspect(connection).has_table(schema_version.name):
        return 0, 0
    if not any(
        column["name"] == "usable_from"
        for column in inspect(connection).get_columns(schema_version.name)
    ):
        version = connection.execute(select(schema_version.c.version)).scalar() or 0
        return version, version
    row = connection.execute(select(schema_version)).first()
    return (0, 0) if row is None else (row.version, row.usable_from)


def _add(connection: Connection, table: str, column: "Column[Any]") -> None:
    """Add a column, which is null or has a default in rows that are there."""
    Table(table, MetaData(), column)
    specified = CreateColumn(column).compile(dialect=connection.dialect)
    connection.exec_driver_sql(f"ALTER TABLE {table} ADD COLUMN {specified}")
