"""What is flown in cross-checks: plans, the air, and what the filter takes for motion."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from syncplan.flight.flight_events import FlightEvents
from syncplan.flight.flight_limits import FlightLimits, FlownWorld
from syncplan.flight.flight_options import FlightOptions
from syncplan.flight.flown_team import FlownTeam, team_in_flight
from syncplan.orbits.contacts import find_windows
from syncplan.orbits.noise import ErrorSigmas
from syncplan.planning.planner import Plan, plan
from syncplan.refinement.refiner import refine
from syncplan.scenario.loading import load_scenario

__all__ = ["AIRS", "COURSES", "READINGS", "Course", "Flying", "flown_of"]

HERE, EXAMPLES = Path(__file__).parent, Path(__file__).parents[2] / "examples" / "scenarios"

AIRS = ("still", "wind", "gusts")
"""The last one has wind too; both are states of the filter."""

READINGS = ("measured", "commanded")
"""What the filter takes for motion.

measured: what the vehicle did in the sample, with noise on the reading; it flies without noise
commanded: what a vehicle of the model's lag makes of the command; noise is on what it does
"""


@dataclass(frozen=True, slots=True)
class Course:
    """What is flown: a scenario, in winds of these standard deviations in m/s, for so many s."""

    scenario: Path
    wind: float
    gust: float
    duration: float
    refined: bool = False

    def plan(self) -> Plan:
        """Return the plan, refined if it is to be."""
        made = plan(load_scenario(self.scenario), pilot=False, single_points=False)
        return refine(made, workers=1) if self.refined else made

    def errors(self, air: str) -> ErrorSigmas:
        """Return the wind of one of AIRS."""
        if air == "still":
            return ErrorSigmas()
        gust = self.gust if air == "gusts" else 0.0
        return ErrorSigmas({"wind": self.wind, "gusts": gust}, estimated=("wind", "gusts"))


COURSES: Mapping[str, Course] = MappingProxyType(
    {
        "grid": Course(EXAMPLES / "paper-grid-same.yaml", 1.0, 0.2, 400.0),
        "refined": Course(EXAMPLES / "paper-grid-alternate.yaml", 1.0, 0.2, 400.0, refined=True),
        "planes": Course(HERE / "planes.yaml", 3.0, 0.6, 820.0),
    }
)
"""By name."""


@dataclass(frozen=True, slots=True)
class Flying:
    """How a course is flown: air and readings by name, s of lag, s, and the noise."""

    air: str
    readings: str
    lag: float
    duration: float
    trials: int
    seed: int


def flown_of(course: Course, made: Plan, how: Flying) -> FlownTeam:
    """Return the set-up of flights of a course's plan."""
    team = replace(made.team, errors=course.errors(how.air))
    limits = FlightLimits.of(made.scenario, made.orbits)
    return team_in_flight(
        team,
        find_windows(team),
        limits,
        FlownWorld(team, limits, how.lag, how.readings == "measured"),
        round(how.duration / team.sensors.sample_time),
        FlightOptions(trials=how.trials, seed=how.seed),
        FlightEvents(),
        how.lag,
    )
