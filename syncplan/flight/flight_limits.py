"""What vehicles can do in flight: least and largest airspeed, largest turn rate, separation."""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, short_repr
from syncplan.orbits.circles import Orbits
from syncplan.orbits.team import Team
from syncplan.scenario.specification import Scenario

DEFAULT_SPEEDS = (0.0, 2.0)
"""Least and largest airspeed, in times the plan's speed, where the scenario has no limit."""

DEFAULT_TURNS = 4.0
"""Largest turn rate, in times the plan's, where the scenario has no limit."""


@dataclass(frozen=True, slots=True, repr=False)
class FlightLimits:
    """Limits of n vehicles in flight.

    Attributes
    ----------
    least_speeds, most_speeds : (n,) m/s, through the air
    most_turn_rates : (n,) rad/s
    separation : m, that any two vehicles keep at least; 0 where none is asked for
    """

    least_speeds: Array
    most_speeds: Array
    most_turn_rates: Array
    separation: float

    __repr__ = short_repr

    @classmethod
    def of(cls, scenario: Scenario, orbits: Orbits) -> "FlightLimits":
        """Return the limits of a scenario; where it has none, those of DEFAULT_SPEEDS and TURNS."""
        given = scenario.limits
        ones = np.ones(orbits.count)
        least, most = (share * orbits.speeds for share in DEFAULT_SPEEDS)
        turns = DEFAULT_TURNS * orbits.rate
        if given is not None and given.speed_mps is not None:
            least, most = (speed * ones for speed in given.speed_mps)
        if given is not None and given.turn_rate_rad_s is not None:
            turns = given.turn_rate_rad_s
        return cls(least, most, turns * ones, scenario.separation)


@dataclass(frozen=True, slots=True)
class FlownWorld:
    """The true team, and how it obeys commands.

    Attributes
    ----------
    team, limits : of the vehicles
    lag : s, time constant of their response to commands
    measured : whether motion readings are measured
    """

    team: Team
    limits: FlightLimits
    lag: float
    measured: bool

    def mean_left(self, time: float) -> float:
        """Return the mean share of a difference that is left over a sample of `time` s."""
        return self.lag / time * -math.expm1(-time / self.lag) if self.lag > 0.0 else 0.0
