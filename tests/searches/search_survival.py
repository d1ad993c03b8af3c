"""Kill servers, workers and children at random moments, and look for a job that does not survive.

    python -m tests.searches.search_survival [ROUNDS [SEED]]

ROUNDS rounds on SQLite and as many on PostgreSQL; SEED / 100 says which is the first. In one the
server is killed, in the next a worker, at moments from the last acceptance of a job to well after
the end of an undisturbed run; in the third six children of two workers, one after the other. The
clock of the second worker is eight days ahead, or behind. Part of `make check-all`.
"""

import contextlib
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from tests.tools.rounds import Round, lost_in
from tests.tools.serving import Process
from tests.tools.survival import (
    Order,
    Site,
    designed,
    flight,
    quick,
    refinement,
    sweep_of_ranges,
    validation,
)
from tests.tools.wrong_clock import AHEAD_S

AT_FIRST, AT_LAST = 0.1, 0.1
"""Shares of the kills right after acceptance, and around the undisturbed end."""
VICTIMS: tuple[Literal["server", "worker", "children"], ...] = ("server", "worker", "children")
CHILDREN = 6
"""Children killed in a round, evenly over an undisturbed run's time on average."""


def orders_of(number: int) -> list[Order]:
    """Return the jobs of a round; some hold a refinement and a design, or a flight."""
    refined = [refinement(0), designed()] if number % 3 == 0 else []
    flown = [flight(320, 4, 60.0)] if number % 2 else []
    return [validation(1200, 1), *refined, *flown, sweep_of_ranges(200, 3), validation(600, 2)]


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


def survived(site: Site, number: int, waits_s: Sequence[float]) -> str:
    """Hand in the jobs of a round, kill after each wait, and see that nothing is lost.

    What was killed is started anew at once, but for children. Returns how it went.
    """
    victim, ahead_s = victim_of(number), (AHEAD_S, -AHEAD_S)[number // 2 % 2]
    if victim == "server":
        living: list[Process] = [site.serve()]
    else:
        site.serve("--no-worker")
        living = [site.work(), site.work(ahead_s)]
    for order in orders_of(number):
        site.hand_in(order)
    killed = 0
    for k, wait_s in enumerate(waits_s):
        time.sleep(wait_s)
        if victim == "children":
            children = sorted(site.family(living[k % 2]))
            # the newest, the oldest, the newest ...; none where none lives at the moment
            for one in children[-1:] if k % 4 < 2 else children[:1]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
                    killed += 1
        else:
            site.kill(living.pop(0))
            living.append(site.serve() if victim == "server" else site.work())
            killed += 1
    last = time.monotonic()
    site.wait_for_all()
    ended = time.monotonic()
    site.see_all_done()
    return f"{killed} killed, all done {ended - last:.1f} s later"


def victim_of(number: int) -> Literal["server", "worker", "children"]:
    """Return who is killed in a round: each in turn, on one database and then on the other."""
    return VICTIMS[number // 2 % len(VICTIMS)]


def main(rounds: int = 20, seed: int = 0) -> list[str]:
    """Return and print the rounds in which something was lost; print each as it ends."""
    generator = random.Random(seed)
    # the seeds of days are a hundred apart: who is killed first goes on from day to day
    first = 2 * (seed // 100)
    wholes = {}
    with tempfile.TemporaryDirectory() as folder:
        for kind in sorted({number % 3 for number in range(first, first + 2 * rounds)}):
            with quick(Path(folder) / str(kind)) as site:
                wholes[kind] = undisturbed(site, kind)
    print("undisturbed:", ", ".join(f"{one:.1f} s" for one in wholes.values()), flush=True)

    def round_of(later: int) -> Round:
        number = first + later
        victim, whole_s = victim_of(number), wholes[number % 3]
        waits_s = [moment(generator, whole_s)]
        if victim == "children":
            longest_s = 2.0 * whole_s / CHILDREN
            waits_s = [generator.uniform(0.0, longest_s) for _ in range(CHILDREN)]
        shown = ", ".join(f"{wait_s:.2f}" for wait_s in waits_s)
        return f"{victim} killed after {shown} s", lambda site: survived(site, number, waits_s)

    return lost_in(2 * rounds, round_of)


if __name__ == "__main__":
    sys.exit(bool(main(*(int(argument) for argument in sys.argv[1:]))))
