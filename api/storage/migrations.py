"""The schema's versions: each migration takes a database from one version to the next."""

from collections.abc import Callable

from sqlalchemy import Connection, delete, insert, inspect, select

from api.storage.tables import METADATA, schema_version
from syncplan.errors import InputError

__all__ = ["MIGRATIONS", "upgrade"]


def _first(connection: Connection) -> None:
    METADATA.create_all(connection)


MIGRATIONS: tuple[Callable[[Connection], None], ...] = (_first,)
"""Migration k takes version k to k + 1. Once released, one is not changed: add another, and let
`_first` create the tables as they were in version 1."""


def upgrade(connection: Connection) -> None:
    """Bring a database to the newest version, inside the caller's transaction.

    Raises InputError for a database that a newer syncplan has written.
    """
    version = _version(connection)
    if version > len(MIGRATIONS):
        raise InputError(
            f"holds schema version {version}, this syncplan knows up to {len(MIGRATIONS)}; "
            "update syncplan",
            source="the database",
        )
    if version == len(MIGRATIONS):
        return
    for migration in MIGRATIONS[version:]:
        migration(connection)
    connection.execute(delete(schema_version))
    connection.execute(insert(schema_version).values(version=len(MIGRATIONS)))


def _version(connection: Connection) -> int:
    if not inspect(connection).has_table(schema_version.name):
        return 0
    return connection.execute(select(schema_version.c.version)).scalar() or 0
