"""Schema migrations: an older database gets the tables and columns that it lacks.

Nothing is changed or removed, so that processes of the previous version keep working. A column
added to `api.storage.tables` is nullable or has a server default, for existing rows.
tests/service/test_migrations.py upgrades a database written by version 1 and compares.
"""

from sqlalchemy import Connection, Table, delete, insert, inspect, select
from sqlalchemy.schema import CreateColumn

from api.storage.owner_bytes import count_bytes
from api.storage.tables import METADATA, schema_version
from syncplan.errors import InputError

NEWEST = 7
"""Version of `api.storage.tables`, incremented with every addition to them."""

USABLE_FROM = 1
"""Oldest version whose processes can work on the newest one."""


def needs_upgrade(connection: Connection) -> bool:
    """Return whether a database is older than this syncplan; reads only.

    A newer one stays as it is if it states that this syncplan can work on it, so that an older
    process can be restarted while others are upgraded. Raises InputError for any other newer
    database.
    """
    version, usable_from = _version(connection)
    if version > NEWEST and usable_from > NEWEST:
        raise InputError(
            f"holds schema version {version}, this syncplan knows up to {NEWEST}; update syncplan",
            source="the database",
        )
    return version < NEWEST


def upgrade(connection: Connection) -> None:
    """Bring a database to the newest version, if it is older, inside the caller's transaction.

    Raises the errors of `needs_upgrade`.
    """
    if not needs_upgrade(connection):
        return
    METADATA.create_all(connection)
    for table in METADATA.sorted_tables:
        there = _columns(connection, table)
        for column in table.columns:
            if column.name not in there:
                specified = CreateColumn(column).compile(dialect=connection.dialect)
                connection.exec_driver_sql(f"ALTER TABLE {table.name} ADD COLUMN {specified}")
    count_bytes(connection)
    connection.execute(delete(schema_version))
    newest = {"version": NEWEST, "usable_from": USABLE_FROM}
    connection.execute(insert(schema_version).values(newest))


def _columns(connection: Connection, table: Table) -> set[str]:
    """Names of the columns that a table has in the database."""
    return {column["name"] for column in inspect(connection).get_columns(table.name)}


def _version(connection: Connection) -> tuple[int, int]:
    """Version of a database, 0 for an empty one, and the oldest that can work on it."""
    if not inspect(connection).has_table(schema_version.name):
        return 0, 0
    if "usable_from" not in _columns(connection, schema_version):
        version = connection.execute(select(schema_version.c.version)).scalar() or 0
        return version, version
    row = connection.execute(select(schema_version)).first()
    return (0, 0) if row is None else (row.version, row.usable_from)
