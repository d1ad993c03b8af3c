"""What vehicles can do; what the closed loop is given, and what it keeps of a flight.

Kernels are given vehicles, circles, sensors and mishaps as arrays. Trials are lanes, the last axis,
as in the filter's kernels.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Index, short_repr
from syncplan.flight.anchors import Anchors
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


# --- for kernels ----------------------------------------------------------------------------------


class Circles(NamedTuple):
    """The plan that is flown.

    Fields
    ------
    centers : (n, 2) m
    radii : (n,) m
    senses : (n,) +1 counter-clockwise, -1 clockwise
    phases : (n,) rad at time 0
    rate : rad/s
    """

    centers: Array
    radii: Array
    senses: Array
    phases: Array
    rate: float

    @classmethod
    def of(cls, orbits: Orbits) -> "Circles":
        """Return the circles of a plan."""
        parts = orbits.centers, orbits.radii, orbits.senses, orbits.phases
        centers, radii, senses, phases = (np.array(one, dtype=float) for one in parts)
        return cls(centers, radii, senses, phases, float(orbits.rate))


class Response(NamedTuple):
    """How vehicles obey commands.

    Fields
    ------
    least_speeds, most_speeds : (n,) m/s, of commands
    most_turn_rates : (n,) rad/s, of commands
    left : share of a difference between response and command that is left after a sample
    mean_left : its mean over a sample
    measured : whether readings are measured, with the noise, instead of commanded
    speed_sigma, turn_rate_sigma : m/s, rad/s, of what is read, or else of what is done
    """

    least_speeds: Array
    most_speeds: Array
    most_turn_rates: Array
    left: float
    mean_left: float
    measured: bool
    speed_sigma: float
    turn_rate_sigma: float


class Eyes(NamedTuple):
    """Sensors of n vehicles by true geometry, and the obstacles that hide bodies from them.

    Fields
    ------
    ranges : (n,) m
    half_views, boresights : (n,) rad
    every : (K, n) samples from one sighting of a kind to the next
    sigmas : (K, n) of each kind, infinite where it is not measured
    taken : (K, n) what the filter takes these for
    detection : (n,) share of sightings that are made
    landmarks : (m, 2) m
    corners : (c, 2) m, of all obstacles
    first_corner : (q + 1,) corners of obstacle k are first_corner[k] to first_corner[k + 1]
    """

    ranges: Array
    half_views: Array
    boresights: Array
    every: Index
    sigmas: Array
    taken: Array
    detection: Array
    landmarks: Array
    corners: Array
    first_corner: Index


class Mishaps(NamedTuple):
    """Losses, holds and faulty sightings, and when they occur, in steps.

    Fields
    ------
    gone_from : (n + m,) from which a vehicle or landmark takes no further part
    blind_from : (K, n) from which a vehicle makes no sightings of a kind
    held_from, held_until : (n, h) between which a vehicle stands still in the air
    dropout : share of sightings that are lost on their way
    outliers : share of bearings that are of nothing, anywhere in view
    mistaken : share of sightings that are of another vehicle in sight than the filter thinks
    late : samples after which sightings arrive
    """

    gone_from: Index
    blind_from: Index
    held_from: Index
    held_until: Index
    dropout: float
    outliers: float
    mistaken: float
    late: int


class Law(NamedTuple):
    """How commands are found; see `tracking_law`.

    Fields
    ------
    mode : OPEN_LOOP, TRACKING or AS_COMMANDED
    place_gain, heading_gain : 1/s
    closing_speeds : (n,) m/s, at most so fast a vehicle closes in on its place
    """

    mode: int
    place_gain: float
    heading_gain: float
    closing_speeds: Array


class Contact(NamedTuple):
    """How vehicles keep in contact; see `tracking_law`.

    Fields
    ------
    anchors : by whom, and how surely
    patience : steps without a sighting after which a vehicle looks for its anchor
    look_every : steps after which circles are moved
    sigmas : standard deviations within which a place is taken to be
    lead : s, how far ahead it is looked whether places will be known
    gust_lead : s, in which a gust that did not decay would blow as far as one does in `lead`
    """

    anchors: Anchors
    patience: int
    look_every: int
    sigmas: float
    lead: float
    gust_lead: float


class FlightSetup(NamedTuple):
    """Set-up that all trials of a flight share, beside that of the filter."""

    circles: Circles
    response: Response
    eyes: Eyes
    mishaps: Mishaps
    law: Law
    contact: Contact
    time: float
    steps: int


class Flown(NamedTuple):
    """Truth and record of some trials, a lane each.

    Fields
    ------
    path : (steps + 1, n, 3, lanes) m, m, rad, as truly flown up to the present step
    drift : (1 or steps + 1, 1 or n, 2, lanes) m/s, velocity of the air, held over a sample
    scales, turn_biases, clock_offsets : (n, lanes) true lasting errors
    shifts : (1 or steps + 1, n, lanes) for each kind of sighting, what is added to it, in its unit
    speed_noise, turn_noise : (steps, n, lanes) standard normal
    keys : (lanes, 2) unsigned, of the noise of sightings
    commands, responses : (n, 2, lanes) m/s, rad/s, at present
    moved : (n, 2, lanes) m, by how much each circle is moved at present to be seen again
    seen : (n, lanes) step of the last sighting of, or by, each vehicle
    heard : (n, lanes) step of the last one that the filter has taken in; behind where they are late
    longest : (n, lanes) most steps between two of them so far
    slowest, fastest : (n, lanes) m/s, of the speeds commanded in the second half, but for holds
    saturated : (n, lanes) steps at which a command was at a limit, none of them in a hold
    sought : (n, lanes) steps at which a vehicle was not sure to meet its anchor
    places : (2,) steps flown, and sightings recorded so far
    ahead : (3n + e, lanes) estimate that steers, away : (3, lanes) way to a target; scratch
    """

    path: Array
    drift: Array
    scales: Array
    turn_biases: Array
    clock_offsets: Array
    shifts: tuple[Array, ...]
    speed_noise: Array
    turn_noise: Array
    keys: NDArray[np.uint64]
    commands: Array
    responses: Array
    moved: Array
    seen: Index
    heard: Index
    longest: Index
    slowest: Array
    fastest: Array
    saturated: Index
    sought: Index
    places: Index
    ahead: Array
    away: Array
