"""Rounds of a search in which processes are killed, on two databases in turn."""

import contextlib
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from tests.tools.serving import own_postgres
from tests.tools.survival import Site, quick

__all__ = ["database_of", "print_rounds", "site_of"]


def database_of(number: int) -> str:
    """Return the database of a round: SQLite for an even number, PostgreSQL for an odd one."""
    return ("SQLite", "PostgreSQL")[number % 2]


@contextlib.contextmanager
def site_of(number: int, **settings: str) -> Iterator[Site]:
    """Yield the site of a round, on a database of its own."""
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        address = None
        if database_of(number) == "PostgreSQL":
            address = stack.enter_context(own_postgres()).new_database()
        yield stack.enter_context(quick(Path(folder), address, **settings))


def print_rounds(rounds: Mapping[int, str], chance: float) -> list[str]:
    """Print how rounds went; each is judged by itself."""
    for number, outcome in rounds.items():
        print(f"{number}: {database_of(number)}, {outcome}")
    return []
