"""The schema's versions: an older database gets the tables and columns that it lacks.

Nothing is changed or removed, so that processes of the version before go on. A column that is added
to `api.storage.tables` is null or has a default of the server, for rows that are there.
tests/service/test_migrations.py upgrades a database that version 1 has left and compares.
"""

from sqlalchemy import Connection, delete, insert, inspect, select
from sqlalchemy.schema import CreateColumn

from api.storage.tables import METADATA, schema_version
from syncplan.errors import InputError

NEWEST = 3
"""The version of `api.storage.tables`: raised with every addition to them."""

USABLE_FROM = 1
"""The oldest version whose processes can work on the newest one."""


def needs_upgrade(connection: Connection) -> bool:
    """Return whether a database is older than this syncplan; reads, and writes nothing.

    A newer one stays as it is where it says that this syncplan can work on it, so that an older
    process can be started anew while others are upgraded. Raises InputError for any other that a
    newer syncplan has written.
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

    Raises what `needs_upgrade` raises.
    """
    if not needs_upgrade(connection):
        return
    METADATA.create_all(connection)
    for table in METADATA.sorted_tables:
        there = {column["name"] for column in inspect(connection).get_columns(table.name)}
        for column in table.columns:
            if column.name not in there:
                specified = CreateColumn(column).compile(dialect=connection.dialect)
                connection.exec_driver_sql(f"ALTER TABLE {table.name} ADD COLUMN {specified}")
    connection.execute(delete(schema_version))
    newest = {"version": NEWEST, "usable_from": USABLE_FROM}
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
