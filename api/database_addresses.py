"""Addresses of databases, as SQLAlchemy takes them: of a file of SQLite, or PostgreSQL's."""

import os
from pathlib import Path

from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

_POSTGRES = {"postgres", "postgresql", "postgresql+psycopg"}


def checked_address(value: str) -> str:
    """Return the address that an operator gave, PostgreSQL's through psycopg 3.

    Raises ValueError if it is none of a database that can serve.
    """
    try:
        url = make_url(value)
    except (ArgumentError, ValueError):
        raise ValueError(_allowed("can't be read as an address")) from None
    if url.drivername in _POSTGRES:
        if not url.database:
            raise ValueError(_allowed("names no database"))
        return url.set(drivername="postgresql+psycopg").render_as_string(hide_password=False)
    if url.drivername != "sqlite":
        raise ValueError(_allowed("is neither SQLite nor PostgreSQL"))
    if url.host or url.query or not url.database or url.database == ":memory:":
        raise ValueError(_allowed("names no file, or more than a file"))
    return sqlite_address(Path(os.path.abspath(os.path.expanduser(url.database))))


def _allowed(problem: str) -> str:
    return f"{problem}; allowed are sqlite:///FILE and postgresql://USER:PASSWORD@HOST:PORT/NAME"


def sqlite_address(path: Path) -> str:
    """Return the address of a file of SQLite."""
    return URL.create("sqlite", database=str(path)).render_as_string(hide_password=False)
