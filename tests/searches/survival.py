"""Kill servers, workers and children at random moments, and look for a job that does not survive.

A case is a round, on SQLite and on PostgreSQL in turn. In one the server is killed, in the next a
worker, at a moment from the last acceptance of a job to well after the end of an undisturbed run;
in the third six children of two workers, one after the other. The clock of the second worker is
eight days ahead, or behind. Fails where a job is lost, does not end once, or comes to other bytes
than undisturbed.
"""

import contextlib
import os
import random
import signal
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from tests.searches import Search
from tests.tools.kept_values import once_a_run
from tests.tools.rounds import print_rounds, site_of
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
VICTIMS = ("server", "worker", "children")
KINDS = 3
"""Of rounds, by their jobs: in nine rounds in a row, each victim meets each."""
CHILDREN = 6
"""Children killed in a round, evenly over an undisturbed run's time on average."""


def orders_of(kind: int) -> list[Order]:
    """Return the jobs of a kind of round; some have a refinement and a design, or a flight."""
    refined = [refinement(0), designed()] if kind == 0 else []
    flown = [flight(320, 4, 60.0)] if kind < 2 else []
    return [validation(1200, 1), *refined, *flown, sweep_of_ranges(200, 3), validation(600, 2)]


@once_a_run
def undisturbed(kind: int) -> float:
    """Return the seconds that a round takes from the last acceptance on if nobody is killed."""
    with tempfile.TemporaryDirectory() as folder, quick(Path(folder)) as site:
        site.serve()
        for order in orders_of(kind):
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


def survived(
    site: Site, victim: str, ahead_s: float, orders: Sequence[Order], waits_s: Sequence[float]
) -> str:
    """Hand in jobs, kill after each wait, and see that nothing is lost.

    What was killed is started anew at once, but for children. Returns how it went.
    """
    if victim == "server":
        living: list[Process] = [site.serve()]
    else:
        site.serve("--no-worker")
        living = [site.work(), site.work(ahead_s)]
    for order in orders:
        site.hand_in(order)
    killed = 0
    for k, wait_s in enumerate(waits_s):
        time.sleep(wait_s)
        if victim == "children":
            children = sorted(site.family(living[k % 2]))
            # the newest, the oldest, the newest ...; none where none lives at the moment
            for child in children[-1:] if k % 4 < 2 else children[:1]:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
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


def draw(number: int) -> tuple[list[str], str]:
    """Return how a round went, on a database by the number."""
    victim, kind = VICTIMS[number % len(VICTIMS)], (number + number // len(VICTIMS)) % KINDS
    generator, whole_s = random.Random(number), undisturbed(kind)
    waits_s = [moment(generator, whole_s)]
    if victim == "children":
        longest_s = 2.0 * whole_s / CHILDREN
        waits_s = [generator.uniform(0.0, longest_s) for _ in range(CHILDREN)]
    shown = ", ".join(f"{wait_s:.2f}" for wait_s in waits_s)
    reported = f"{victim} killed after {shown} s of {whole_s:.1f} s"
    ahead_s = (AHEAD_S, -AHEAD_S)[number // 2 % 2]
    try:
        with site_of(number) as site:
            outcome = survived(site, victim, ahead_s, orders_of(kind), waits_s)
    except Exception as error:
        error.add_note(reported)
        raise
    return [], f"{reported}: {outcome}"


SEARCH = Search(draw, print_rounds, draws=3)
