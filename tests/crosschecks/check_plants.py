"""Check the simple model of flight against somebody else's vehicles, under the same noise.

    python -m tests.crosschecks.check_plants [TRIALS [SEED]] [--plants NAME ...] [--air NAME ...]
        [--readings NAME ...] [--duration S]

Part of `make check-all`. A plan is flown in closed loop twice under the same noise: by the simple
model, and by a plant. Fails where errors differ by more than 10 %, the least separation by more
than 2 m or the sightings by more than 3 %. A plant that is not aligned with its commands shows what
that costs: it is flown where it is named, and nothing fails.
"""

import argparse
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import get_args

import numpy as np

from syncplan.flight.flight_limits import FlightLimits
from syncplan.orbits.error_states import ErrorSigmas
from syncplan.orbits.team import Team
from syncplan.planning.planner import plan
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import load_scenario
from tests.crosschecks.closed_loop import FlightCase, Readings, fly, noise_of
from tests.crosschecks.comparisons import Comparison, compared, summary_of
from tests.crosschecks.jsbsim_planes import planes
from tests.crosschecks.plants import MakePlant
from tests.crosschecks.responses import Step, answer_to, steady_errors
from tests.crosschecks.rotorpy_team import hummingbirds
from tests.crosschecks.unicycle_team import Lag, unicycles
from tests.crosschecks.velocity_loop import ALIGNED, DROOPING, LoopGains

__all__ = [
    "AIRS",
    "COURSES",
    "PLANTS",
    "Course",
    "Known",
    "Wanted",
    "compare",
    "course_of",
    "main",
    "show_responses",
]

HERE, EXAMPLES = Path(__file__).parent, Path("examples/scenarios")

AIRS = ("still", "wind", "gusts")
"""The last one has wind too; both are states of the filter."""


@dataclass(frozen=True, slots=True)
class Course:
    """What is flown: a scenario, in winds of these standard deviations in m/s, for so many s."""

    scenario: Path
    wind: float
    gust: float
    duration: float
    refined: bool = False

    def errors(self, air: str) -> ErrorSigmas:
        """Return the wind of one of AIRS."""
        if air == "still":
            return ErrorSigmas()
        gust = self.gust if air == "gusts" else 0.0
        return ErrorSigmas(self.wind, gust, 10.0, estimated=("wind", "gusts"))


COURSES: Mapping[str, Course] = MappingProxyType(
    {
        "grid": Course(EXAMPLES / "paper-grid-same.yaml", 1.0, 0.2, 400.0),
        "refined": Course(EXAMPLES / "paper-grid-alternate.yaml", 1.0, 0.2, 400.0, refined=True),
        "planes": Course(HERE / "planes.yaml", 3.0, 0.6, 820.0),
    }
)
"""By name."""


@dataclass(frozen=True, slots=True)
class Known:
    """A plant that can be flown.

    Attributes
    ----------
    make : returns what makes it; raises MissingPlantError where its package is missing
    courses : names of those that it flies
    lag : of the simple model beside it, as found by `responses`
    circles : m/s, rad/s at which its steady errors are looked at
    steps : of commands, whose lags are looked for
    settled : s after which a circle is steady
    sample : s
    aligned : whether it is expected to agree with the model
    """

    make: Callable[[], MakePlant]
    courses: tuple[str, ...]
    lag: Lag
    circles: tuple[tuple[float, float], ...]
    steps: tuple[Step, ...]
    settled: float
    sample: float
    aligned: bool = True


def _multirotor(gains: LoopGains, lag: Lag, *, aligned: bool = True) -> Known:
    return Known(
        make=lambda: hummingbirds(gains),
        courses=("grid", "refined"),
        lag=lag,
        circles=((4.0, 0.2), (3.0, -0.2), (5.0, 0.3)),
        steps=(
            Step((4.0, 0.2), (4.5, 0.2), 20.0, 5.0),
            Step((4.0, 0.2), (3.5, 0.2), 20.0, 5.0),
            Step((4.0, 0.2), (4.0, 0.4), 20.0, 5.0),
            Step((4.0, 0.2), (4.0, 0.0), 20.0, 5.0),
        ),
        settled=30.0,
        sample=0.1,
        aligned=aligned,
    )


PLANTS: Mapping[str, Known] = MappingProxyType(
    {
        "multirotor": _multirotor(ALIGNED, Lag(0.19, 0.14)),
        "drooping": _multirotor(DROOPING, Lag(0.05, 0.14), aligned=False),
        "plane": Known(
            make=planes,
            courses=("planes",),
            lag=Lag(1.8, 0.75),
            circles=((46.0, 0.0767), (42.0, -0.0767), (50.0, 0.09)),
            steps=(
                Step((46.0, 0.0767), (48.0, 0.0767), 80.0, 40.0),
                Step((46.0, 0.0767), (44.0, 0.0767), 80.0, 40.0),
                Step((46.0, 0.0767), (46.0, 0.11), 80.0, 20.0),
                Step((46.0, 0.0767), (46.0, 0.03), 80.0, 20.0),
            ),
            settled=80.0,
            sample=0.25,
        ),
    }
)
"""By name."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which flights are compared, and how many trials of each."""

    trials: int
    seed: int
    airs: tuple[str, ...]
    readings: tuple[Readings, ...]
    duration: float | None


def course_of(name: str) -> tuple[Team, FlightLimits]:
    """Return the team and the limits of a course in COURSES, in still air."""
    course = COURSES[name]
    made = plan(load_scenario(course.scenario), pilot=False, single_points=False)
    if course.refined:
        made = refine(made, workers=1)
    return made.team, FlightLimits.of(made.scenario, made.orbits)


def show_responses(known: Known, make: MakePlant) -> None:
    """Print systematic errors and lags of a plant."""
    for speed, turn_rate in known.circles:
        for wind in (0.0, 0.25 * speed):
            found = steady_errors(
                make, (speed, turn_rate), np.array([wind, 0.0]), known.sample, (known.settled,) * 2
            )
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


def compare(name: str, wanted: Wanted) -> bool:
    """Print how a plant of PLANTS compares with the model; return whether it agrees."""
    known, agree = PLANTS[name], True
    make = known.make()
    print(f"{name}: mean errors on circles, responses to steps", flush=True)
    show_responses(known, make)
    for course in known.courses:
        team, limits = course_of(course)
        print(f"{name} on {course}, the simple model first\n{Comparison.HEAD}", flush=True)
        for air, readings in product(wanted.airs, wanted.readings):
            case = FlightCase(
                team=replace(team, errors=COURSES[course].errors(air)),
                limits=limits,
                duration=wanted.duration or COURSES[course].duration,
                trials=wanted.trials,
                seed=wanted.seed,
                readings=readings,
                lag=known.lag,
            )
            noise, begun = noise_of(case), time.monotonic()
            flights = [fly(case, one, noise) for one in (unicycles(known.lag), make)]
            found = compared(*(summary_of(flight) for flight in flights))
            agree &= found.agrees
            print(
                f"{found.line()}  {air}, {readings}, {time.monotonic() - begun:.0f} s", flush=True
            )
    return agree or not known.aligned


def main(plants: list[str], wanted: Wanted) -> bool:
    """Print how plants compare with the model; return whether those that should do agree."""
    agree = [compare(name, wanted) for name in plants]
    return all(agree)


def _arguments() -> tuple[list[str], Wanted]:
    said = argparse.ArgumentParser(description=__doc__)
    said.add_argument("trials", nargs="?", type=int, default=2)
    said.add_argument("seed", nargs="?", type=int, default=0)
    said.add_argument("--plants", nargs="+", choices=list(PLANTS), default=["multirotor", "plane"])
    said.add_argument("--air", nargs="+", choices=AIRS, default=AIRS)
    readings = get_args(Readings)
    said.add_argument("--readings", nargs="+", choices=readings, default=readings)
    said.add_argument("--duration", type=float)
    given = said.parse_args()
    return given.plants, Wanted(
        given.trials, given.seed, tuple(given.air), tuple(given.readings), given.duration
    )


if __name__ == "__main__":
    sys.exit(not main(*_arguments()))
