"""Run two versions of the service side by side, kill both, and look for a job that suffers.

A case is a round, on SQLite and on PostgreSQL in turn. A server and a worker of this checkout take
jobs; then a server and a worker of a copy that calls itself another version start beside them and
take jobs as well. Two of the four are killed, at random moments, and started anew in their own
version. At last the older two are killed for good, as at the end of an upgrade. Fails where a
job does not succeed with the bytes that one of the versions makes undisturbed.
"""

import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from syncplan import __version__
from tests.searches import Search
from tests.tools.rounds import print_rounds, site_of
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
KILLED = 2
"""Of the four processes, before the older two are killed for good."""
LONGEST_WAIT_S = 4.0
GRACE_S = 3.0
"""After so long without a worker of its version, a job moves to the other."""


def orders_of(number: int) -> list[Order]:
    """Return the jobs that each version is given in a round."""
    refined = [refinement(0)] if number // 2 % 2 == 0 else []
    return [validation(300, 1, upgraded=True), *refined, sweep_of_ranges(50, 3)]


def upgraded(site: Site, newer: Path, number: int) -> str:
    """Upgrade a site, see that nothing is lost, and return how long the end took."""
    generator = random.Random(number)
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
    for checkout, victim, begin in generator.sample(living, KILLED):
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


def draw(number: int) -> tuple[list[str], str]:
    """Return how a round went, on a database by the number."""
    settings = {"SYNCPLAN_VERSION_GRACE_S": f"{GRACE_S:g}"}
    with tempfile.TemporaryDirectory() as folder, site_of(number, **settings) as site:
        return [], upgraded(site, another_version(Path(folder), NEWER), number)


SEARCH = Search(draw, print_rounds, draws=2)
