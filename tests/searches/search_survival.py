"""Kill servers and workers at random moments, and look for a job that does not survive.

    python -m tests.searches.search_survival [ROUNDS [SEED]]

ROUNDS kills on SQLite and as many on PostgreSQL, the server's and a worker's in turn, at moments
from the last acceptance of a job to well after the end of an undisturbed run. Part of
`make check-all`; the suite does the same at a few moments.
"""

import random
import sys
import tempfile
import time
from pathlib import Path
from typing import Literal

from tests.tools.serving import Postgres
from tests.tools.survival import (
    Order,
    Site,
    kill_at,
    new_database,
    quick,
    refinement,
    sweep_of_ranges,
    validation,
)

AT_FIRST, AT_LAST = 0.1, 0.1
"""Shares of the kills right after acceptance, and around the undisturbed end."""


def orders_of(number: int) -> list[Order]:
    """Return the jobs of a round; every third holds a refinement too, which takes longer."""
    refined = [refinement(0)] if number % 3 == 0 else []
    return [validation(1200, 1), *refined, sweep_of_ranges(200, 3), validation(600, 2)]


def undisturbed(site: Site, number: int) -> float:
    """Return the seconds that a round takes from the last acceptance on if nobody is killed."""
    site.serve()
    for order in orders_of(number):
        site.hand_in(order)
    began = time.monotonic()
    site.see_all_done()
    return time.monotonic() - began


def moment(generator: random.Random, whole_s: float) -> float:
    """Return when to kill: anywhere, and more often right at the beginning and around the end."""
    kind = generator.random()
    if kind < AT_FIRST:
        return generator.uniform(0.0, 0.05)
    if kind > 1.0 - AT_LAST:
        return whole_s * generator.uniform(0.9, 1.1)
    return generator.uniform(0.0, whole_s)


def main(rounds: int = 20, seed: int = 0) -> list[str]:
    """Return and print the rounds in which something was lost; print each as it ends."""
    generator = random.Random(seed)
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        postgres = Postgres(folder / "postgres")
        try:
            wholes = []
            for number in range(3):
                with quick(folder / f"undisturbed-{number}") as site:
                    wholes.append(undisturbed(site, number))
            print("undisturbed:", ", ".join(f"{one:.1f} s" for one in wholes), flush=True)
            for number in range(2 * rounds):
                kind = ("SQLite", "PostgreSQL")[number % 2]
                victim: Literal["server", "worker"] = ("server", "worker")[number // 2 % 2]
                wait_s = moment(generator, wholes[number % 3])
                told = f"{number}: {kind}, {victim} killed after {wait_s:.2f} s"
                address = new_database(postgres) if kind == "PostgreSQL" else None
                try:
                    with quick(folder / str(number), address) as site:
                        recovered = kill_at(site, orders_of(number), [wait_s], victim)
                except Exception as error:
                    failures.append(told)
                    print(f"{told}: {type(error).__name__}: {error}", flush=True)
                else:
                    print(f"{told}: all done {recovered:.1f} s later", flush=True)
        finally:
            postgres.stop()
    print(f"{2 * rounds} kills, {len(failures)} with a loss {failures}")
    return failures


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
