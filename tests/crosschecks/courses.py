"""What is flown in cross-checks: plans, the air, and what the filter takes for motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from syncplan.flight.flying import flight_run
from syncplan.planning.plan_flights import FlightRun
from syncplan.planning.planner import judge
from syncplan.planning.plans import Plan
from syncplan.scenario.loading import load_scenario, scenario_from
from tests.tools.on_paper import plan, refine

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
        return refine(made, workers=1, time_limit_s=3600.0) if self.refined else made

    def blows(self, air: str) -> dict[str, float]:
        """Return the wind of one of AIRS, as a scenario has it."""
        if air == "still":
            return {}
        gusts = {"gust_sigma_mps": self.gust, "gust_time_s": 10.0}
        return {"sigma_mps": self.wind, **(gusts if air == "gusts" else {})}


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
    """How a course is flown: air and readings by name, s of lag, and the noise."""

    air: str
    readings: str
    lag: float
    trials: int
    seed: int


def run_of(course: Course, made: Plan, how: Flying) -> FlightRun:
    """Return the set-up of flights of a course's plan."""
    keys = made.scenario.model_dump(exclude_none=True)
    motion = {**keys["motion"], "lag_s": how.lag, "readings": how.readings}
    scenario = scenario_from({**keys, "motion": motion, "wind": course.blows(how.air)})
    disturbed = judge(scenario, made.orbits, bound="never", single_points=False)
    return flight_run(
        disturbed, trials=how.trials, seed=how.seed, duration=course.duration, filter="ekf"
    )
