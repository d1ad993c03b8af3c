"""Run two versions of the service side by side, kill both, and look for a job that suffers.

    python -m tests.searches.search_upgrade [ROUNDS [SEED]]

ROUNDS rounds on SQLite and as many on PostgreSQL. A server and a worker of this checkout take jobs;
then a server and a worker of a copy that calls itself another version start beside them and take
jobs as well. Each of the four is killed in turn, at a random moment, and started anew in its own
version. At last the older two are killed for good, as at the end of an upgrade. Every job must
succeed with the bytes that one of the versions makes undisturbed. Part of `make check-all`.
"""

import random
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from syncplan import __version__
from tests.tools.rounds import Round, lost_in
from tests.tools.serving import ROOT, Process
from tests.tools.survival import (
    Order,
    Site,
    another_version,
    refinement,
    sweep_of_ranges,
    validation,
)

NEWER = "99.0.0"
LONGEST_WAIT_S = 4.0
GRACE_S = 3.0
"""After so long without a worker of its version, a job moves to the other."""


def orders_of(number: int) -> list[Order]:
    """Return the jobs that each version is given in a round."""
    refined = [refinement(0)] if number % 2 == 0 else []
    return [validation(1200, 1), *refined, sweep_of_ranges(200, 3)]


def upgraded(site: Site, newer: Path, number: int, generator: random.Random) -> str:
    """Upgrade a site, see that nothing is lost, and return how long the end took."""
    site.versions = {__version__, NEWER}
    living: list[tuple[Path, Process, Callable[[], Process]]] = []

    def start(checkout: Path, begin: Callable[[], Process]) -> None:
        site.checkout = checkout
        living.append((checkout, begin(), begin))

    for checkout in (ROOT, newer):
        start(checkout, lambda: site.serve("--no-worker", beside=True))
        start(checkout, site.work)
        for order in orders_of(number):
            site.hand_in(order)
    for checkout, victim, begin in generator.sample(living, len(living)):
        time.sleep(generator.uniform(0.0, LONGEST_WAIT_S))
        living.remove((checkout, victim, begin))
        site.kill(victim)
        start(checkout, begin)
    time.sleep(generator.uniform(0.0, LONGEST_WAIT_S))
    for checkout, process, _ in living:
        if checkout == ROOT:
            site.kill(process)
    killed = time.monotonic()
    # whoever serves now is of the newer version
    site.checkout = newer
    site.serve("--no-worker", beside=True)
    site.wait_for_all()
    site.see_all_done()
    return f"all done {time.monotonic() - killed:.1f} s after the last kill"


def main(rounds: int = 5, seed: int = 0) -> list[str]:
    """Return and print the rounds in which something was lost; print each as it ends."""
    generator = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        newer = another_version(Path(folder), NEWER)

        def round_of(number: int) -> Round:
            return "upgraded", lambda site: upgraded(site, newer, number // 2, generator)

        return lost_in(2 * rounds, round_of, SYNCPLAN_VERSION_GRACE_S=f"{GRACE_S:g}")


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
