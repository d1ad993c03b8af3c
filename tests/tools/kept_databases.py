"""Databases that released versions have left; `tests.tools.record_database` has made them."""

import gzip
from pathlib import Path

import psycopg

from tests.tools.serving import ROOT

__all__ = ["kept", "restore_postgresql", "restore_sqlite"]

KEPT = ROOT / "tests" / "data" / "version-1"


def kept(name: str) -> bytes:
    """Return a file that was kept."""
    return gzip.decompress((KEPT / name).read_bytes())


def restore_sqlite(path: Path) -> None:
    """Write the database of version 1 to a file of SQLite."""
    path.write_bytes(kept("sqlite.db.gz"))


def restore_postgresql(address: str) -> None:
    """Fill an empty database of PostgreSQL as version 1 has left it."""
    lines = kept("postgresql.sql.gz").decode().splitlines()
    with psycopg.connect(address, autocommit=True) as connection:
        # those that begin so are for psql
        connection.execute("\n".join(one for one in lines if not one.startswith("\\")).encode())
