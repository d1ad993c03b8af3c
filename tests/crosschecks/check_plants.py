"""Check the simple model of flight against somebody else's vehicles, under the same noise.

    python -m tests.crosschecks.check_plants [TRIALS [SEED]] [--plants NAME ...]
        [--courses NAME ...] [--air NAME ...] [--readings NAME ...] [--duration S]

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
from dataclasses import dataclass
from itertools import product

import numpy as np

from tests.crosschecks.closed_loop import fly
from tests.crosschecks.comparisons import HEAD, compared, summary_of
from tests.crosschecks.courses import AIRS, COURSES, READINGS, Flying, flown_of
from tests.crosschecks.kernel_flights import summary_of_kernels
from tests.crosschecks.known_plants import PLANTS, Known
from tests.crosschecks.plants import MakePlant
from tests.crosschecks.responses import answer_to, steady_errors

__all__ = ["Wanted", "check", "main", "show_responses"]

HELD_TO = "measured"
"""The readings with which a plant has to agree with the model."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which flights are compared, and how many trials of each; for how many s, if not all."""

    trials: int
    seed: int
    courses: tuple[str, ...]
    airs: tuple[str, ...]
    readings: tuple[str, ...]
    duration: float | None


def show_responses(known: Known, make: MakePlant) -> None:
    """Print systematic errors and lags of a plant."""
    for speed, turn_rate in known.circles:
        for wind in (0.0, 0.25 * speed):
            air, settled = np.array([wind, 0.0]), known.settled
            found = steady_errors(make, (speed, turn_rate), air, known.sample, settled)
            print(
                f"  {speed:g} m/s, {turn_rate:g} rad/s in wind of {wind:g} m/s: "
                f"{found.speed:+.4f} m/s, {found.turn_rate:+.6f} rad/s, slips {found.slip:.3f} m/s"
            )
    for step in known.steps:
        answer = answer_to(make, step, known.sample)
        print(
            f"  {step.before} to {step.after}: lag {answer.lag:.2f} s, off by {answer.misfit:.2f} "
            f"of the step, overshoot {answer.overshoot:.2f}"
        )


def check(name: str, wanted: Wanted) -> bool:
    """Print how a plant compares with the model; return whether it agrees, if it should."""
    known, agree = PLANTS[name], True
    make = known.make()
    print(f"{name}: mean errors on circles, responses to steps", flush=True)
    show_responses(known, make)
    for course in (one for one in known.courses if one in wanted.courses):
        made = COURSES[course].plan()
        print(f"{name} on {course}, the simple model first\n{HEAD}", flush=True)
        for air, readings in product(wanted.airs, wanted.readings):
            duration = wanted.duration or COURSES[course].duration
            how = Flying(air, readings, known.lag, duration, wanted.trials, wanted.seed)
            flown, begun = flown_of(COURSES[course], made, how), time.monotonic()
            model = summary_of_kernels(flown, wanted.trials)
            flight = fly(flown, wanted.trials, known.lag, make)
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
    said.add_argument("--air", nargs="+", choices=AIRS, default=AIRS)
    said.add_argument("--readings", nargs="+", choices=READINGS, default=READINGS)
    said.add_argument("--duration", type=float)
    given = said.parse_args()
    return given.plants, Wanted(
        trials=given.trials,
        seed=given.seed,
        courses=tuple(given.courses),
        airs=tuple(given.air),
        readings=tuple(given.readings),
        duration=given.duration,
    )


if __name__ == "__main__":
    sys.exit(not main(*_arguments()))
