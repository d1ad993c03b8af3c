"""Databases that earlier versions have left; `tests.tools.record_database` has made them.

Folders: version-1, and before-flights, of the last version whose verdicts do not rest on flights.
"""

import gzip
import json
from pathlib import Path
from typing import Any

import psycopg

from tests.tools.serving import ROOT

__all__ = ["answers_of", "restore_postgresql", "restore_sqlite"]

KEPT = ROOT / "tests" / "data"


def _kept(folder: str, name: str) -> bytes:
    return gzip.decompress((KEPT / folder / name).read_bytes())


def answers_of(folder: str, kind: str) -> Any:
    """Return what was answered beside a database, "sqlite" or "postgresql"."""
    return json.loads(_kept(folder, f"{kind}.json.gz"))


def restore_sqlite(folder: str, path: Path) -> None:
    """Write a database to a file of SQLite."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(_kept(folder, "sqlite.db.gz"))


def restore_postgresql(folder: str, address: str) -> None:
    """Fill an empty database of PostgreSQL."""
    lines = _kept(folder, "postgresql.sql.gz").decode().splitlines()
    with psycopg.connect(address, autocommit=True) as connection:
        # those that begin so are for psql
        connection.execute("\n".join(one for one in lines if not one.startswith("\\")).encode())
