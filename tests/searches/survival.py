"""Kill servers, workers and children at random moments, and look for a job that does not survive.

A case is a round, on SQLite and on PostgreSQL in turn. In one the server is killed, in the next a
worker, when a drawn share of the jobs' work is done, from none to all; in the third six children of
two workers, one after the other. The clock of the second worker is eight days ahead, or behind.
Fails where a job is lost, does not end once, or comes to other bytes than undisturbed.
"""

import contextlib
import os
import random
import signal
import time
from collections.abc import Sequence

from tests.searches import Search
from tests.tools.processes import wait_until
from tests.tools.rounds import print_rounds, site_of
from tests.tools.serving import Process
from tests.tools.survival import (
    Order,
    Site,
    designed,
    flight,
    refinement,
    sweep_of_ranges,
    validation,
)
from tests.tools.wrong_clock import AHEAD_S

AT_FIRST, AT_LAST = 0.1, 0.1
"""Shares of the kills right after acceptance, and around the end of the last job."""
LONGEST_PAUSE_S = 0.5
"""Until the kill once the share of the work is done: about what a part of a job takes."""
VICTIMS = ("server", "worker", "children")
KINDS = 3
"""Of rounds, by their jobs: in nine rounds in a row, each victim meets each."""
CHILDREN = 6
"""Children killed in a round."""


def orders_of(kind: int) -> list[Order]:
    """Return the jobs of a kind of round; some have a refinement and a design, or a flight."""
    refined = [refinement(0), designed()] if kind == 0 else []
    flown = [flight(80, 4, 60.0)] if kind < 2 else []
    return [validation(300, 1), *refined, *flown, sweep_of_ranges(50, 3), validation(150, 2)]


def moment(generator: random.Random) -> tuple[float, float]:
    """Return when to kill: the share of the work that is done, and how many seconds later."""
    kind = generator.random()
    if kind < AT_FIRST:
        return 0.0, generator.uniform(0.0, 0.05)
    share = generator.uniform(0.9 if kind > 1.0 - AT_LAST else 0.0, 1.0)
    return share, generator.uniform(0.0, LONGEST_PAUSE_S)


def wait_for_share(site: Site, share: float) -> None:
    """Wait until a share of the work of all jobs is done."""

    def reached() -> bool:
        jobs = site.ask("GET", "/v1/jobs").json()["items"]
        done = sum(job["progress"]["done"] / job["progress"]["total"] for job in jobs)
        return bool(done >= share * len(jobs))

    wait_until(reached, otherwise=site.logs, every_s=0.1)


def survived(
    site: Site,
    victim: str,
    ahead_s: float,
    orders: Sequence[Order],
    moments: Sequence[tuple[float, float]],
) -> str:
    """Hand in jobs, kill at each moment, and see that nothing is lost.

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
    for k, (share, pause_s) in enumerate(moments):
        wait_for_share(site, share)
        time.sleep(pause_s)
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
    generator = random.Random(number)
    moments = sorted(moment(generator) for _ in range(CHILDREN if victim == "children" else 1))
    shown = ", ".join(f"{100.0 * share:.0f} % and {pause_s:.2f} s" for share, pause_s in moments)
    reported = f"{victim} killed after {shown}"
    ahead_s = (AHEAD_S, -AHEAD_S)[number // 2 % 2]
    try:
        with site_of(number) as site:
            outcome = survived(site, victim, ahead_s, orders_of(kind), moments)
    except Exception as error:
        error.add_note(reported)
        raise
    return [], f"{reported}: {outcome}"


SEARCH = Search(draw, print_rounds, draws=3)
