"""Rounds of a search in which processes are killed: one site after the other, on two databases."""

import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.tools.serving import own_postgres
from tests.tools.survival import Site, quick

__all__ = ["Round", "lost_in"]

Round = tuple[str, Callable[[Site], str]]
"""What is done to a site, in words, and what does it; that returns how it went, or fails."""


def lost_in(rounds: int, round_of: Callable[[int], Round], **settings: str) -> list[str]:
    """Play rounds, on SQLite and on PostgreSQL in turn; return those in which something was lost.

    `round_of` makes the round of a number once that has its turn; prints each as it ends.
    """
    failures: list[str] = []
    with own_postgres() as postgres, tempfile.TemporaryDirectory() as folder:
        for number in range(rounds):
            kind = ("SQLite", "PostgreSQL")[number % 2]
            done, play = round_of(number)
            reported = f"{number}: {kind}, {done}"
            address = postgres.new_database() if kind == "PostgreSQL" else None
            try:
                with quick(Path(folder) / str(number), address, **settings) as site:
                    outcome = play(site)
            except Exception as error:
                failures.append(reported)
                outcome = f"{type(error).__name__}: {error}"
            print(f"{reported}: {outcome}", flush=True)
    print(f"{rounds} rounds, {len(failures)} with a loss {failures}")
    return failures
