"""Check the simple model of flight against somebody else's vehicles, under the same noise.

    python -m tests.crosschecks.check_plants [TRIALS [SEED]] [--plants NAME ...]
        [--courses NAME ...] [--air NAME ...] [--readings NAME ...]

Part of `make check-all`. A plan is flown in closed loop twice under the same noise, for more than
a period: by the simple model of syncplan.flight, and by a plant. Fails where errors differ by more
than 10 %, the least separation after the first period by more than a tenth of the radius, sightings
by more than 3 %, or not as many trials are lost. Commanded readings show what it costs that a lag
is not quite the model's, and the plant that droops what it costs that speeds are not those
commanded: of both, nothing fails.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from tests.crosschecks.closed_loop import fly
from tests.crosschecks.comparisons import HEAD, compared, summary_of, summary_of_kernels
from tests.crosschecks.courses import AIRS, COURSES, READINGS, Flying, run_of
from tests.crosschecks.known_plants import PLANTS
from tests.tools.flown_trials import flown_of

HELD_TO = "measured"
"""The readings with which a plant has to agree with the model."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which flights are compared, and how many trials of each."""

    trials: int
    seed: int
    courses: Sequence[str]
    airs: Sequence[str]
    readings: Sequence[str]


def check(name: str, wanted: Wanted) -> bool:
    """Print how a plant compares with the model; return whether it agrees, if it should."""
    known, agree = PLANTS[name], True
    make = known.make()
    for course in (one for one in known.courses if one in wanted.courses):
        made = COURSES[course].plan()
        print(f"{name} on {course}, the simple model first\n{HEAD}", flush=True)
        for air, readings in product(wanted.airs, wanted.readings):
            how = Flying(air, readings, known.lag, wanted.trials, wanted.seed)
            run, begun = run_of(COURSES[course], made, how), time.monotonic()
            model = summary_of_kernels(flown_of(run, range(wanted.trials)))
            flight = fly(run, wanted.trials, make)
            plant = summary_of(flight, made.orbits, known.sample)
            found = compared(model, plant, float(made.orbits.radii.mean()))
            agree &= found.agrees or readings != HELD_TO
            took = time.monotonic() - begun
            print(f"{found.line()}  {air}, {readings}, {took:.0f} s", flush=True)
    return agree or not known.aligned


def main(plants: list[str], wanted: Wanted) -> bool:
    """Print how plants compare with the model; return whether those that should do agree."""
    agree = [check(name, wanted) for name in plants]
    return all(agree)


def _arguments() -> tuple[list[str], Wanted]:
    said = argparse.ArgumentParser(description=__doc__)
    said.add_argument("trials", nargs="?", type=int, default=2)
    said.add_argument("seed", nargs="?", type=int, default=0)
    aligned = [name for name, known in PLANTS.items() if known.aligned]
    said.add_argument("--plants", nargs="+", choices=list(PLANTS), default=aligned)
    said.add_argument("--courses", nargs="+", choices=list(COURSES), default=list(COURSES))
    said.add_argument("--air", dest="airs", nargs="+", choices=AIRS, default=AIRS)
    said.add_argument("--readings", nargs="+", choices=READINGS, default=READINGS)
    given = vars(said.parse_args())
    return given.pop("plants"), Wanted(**given)


if __name__ == "__main__":
    sys.exit(not main(*_arguments()))
