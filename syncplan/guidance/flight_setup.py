"""Limits of vehicles, and inputs and state of the closed loop.

Kernels take vehicles, circles, sensors and mishaps as arrays. Trials are lanes, the last axis,
as in the filter's kernels.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Index, short_repr
from syncplan.guidance.anchors import Anchors
from syncplan.orbits.circles import Orbits
from syncplan.orbits.team import Team
from syncplan.scenario.specification import Scenario

DEFAULT_SPEEDS = (0.0, 2.0)
"""Least and largest airspeed as multiples of the plan's, where the scenario has no limit."""

DEFAULT_TURNS = 4.0
"""Largest turn rate as a multiple of the plan's, where the scenario has no limit."""


@dataclass(frozen=True, slots=True, repr=False)
class FlightLimits:
    """Limits of n vehicles in flight.

    Attributes
    ----------
    least_speeds, most_speeds : (n,) m/s, through the air
    most_turn_rates : (n,) rad/s
    separation : m, least distance that any two vehicles keep; 0 for none
    """

    least_speeds: Array
    most_speeds: Array
    most_turn_rates: Array
    separation: float

    __repr__ = short_repr

    @classmethod
    def of(cls, scenario: Scenario, orbits: Orbits) -> "FlightLimits":
        """Return the limits of a scenario, by default from DEFAULT_SPEEDS and DEFAULT_TURNS."""
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
    """True team, and its response to commands.

    Attributes
    ----------
    team, limits : the true vehicles and their limits
    lag : s, time constant of their response to commands
    measured : whether motion readings are measured
    """

    team: Team
    limits: FlightLimits
    lag: float
    measured: bool

    def mean_left(self, time: float) -> float:
        """Return the share of a difference that remains on average over a sample of `time` s."""
        return self.lag / time * -math.expm1(-time / self.lag) if self.lag > 0.0 else 0.0


# --- for kernels ----------------------------------------------------------------------------------


class Circles(NamedTuple):
    """Circles of the plan that is flown.

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
    """Response of vehicles to commands.

    Fields
    ------
    least_speeds, most_speeds : (n,) m/s, of commands
    most_turn_rates : (n,) rad/s, of commands
    left : share of a difference between response and command that remains after a sample
    mean_left : its mean over a sample
    measured : whether readings are measured, with the noise, instead of commanded
    speed_sigma, turn_rate_sigma : m/s, rad/s, of readings if measured, else of the motion
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
    """True sensors of n vehicles, and the obstacles that block their view.

    Fields
    ------
    ranges : (n,) m
    half_views, boresights : (n,) rad
    every : (K, n) samples from one sighting of a kind to the next
    sigmas : (K, n) of each kind, infinite where it is not measured
    taken : (K, n) values of `sigmas` that the filter assumes
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
    gone_from : (n + m,) step from which a vehicle or landmark takes no further part
    blind_from : (K, n) step from which a vehicle makes no sightings of a kind
    held_from, held_until : (n, h) steps between which a vehicle stands still in the air
    dropout : share of sightings that are lost on their way
    outliers : share of bearings that are false, anywhere in view
    mistaken : share of sightings whose true target is a vehicle in sight other than the assumed one
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
    """Source and gains of commands; see `tracking_law`.

    Fields
    ------
    mode : OPEN_LOOP, TRACKING or AS_COMMANDED
    place_gain, heading_gain : 1/s
    closing_speeds : (n,) m/s, largest speed at which a vehicle closes in on its place
    """

    mode: int
    place_gain: float
    heading_gain: float
    closing_speeds: Array


class Contact(NamedTuple):
    """Rules by which vehicles keep in contact; see `tracking_law`.

    Fields
    ------
    anchors : of the vehicles
    patience : steps without a sighting after which a vehicle looks for its anchor
    look_every : steps between updates of the shifts of circles
    sigmas : standard deviations within which a place is assumed to be
    lead : s, look-ahead at which the uncertainty of places counts
    gust_lead : s, in which a constant gust would carry as far as a decaying one does in `lead`
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
    """Truth and records of trials, a lane each.

    Fields
    ------
    path : (steps + 1, n, 3, lanes) m, m, rad, as truly flown up to the present step
    drift : (1 or steps + 1, 1 or n, 2, lanes) m/s, velocity of the air, held over a sample
    scales, turn_biases, clock_offsets : (n, lanes) true lasting errors
    shifts : (1 or steps + 1, n, lanes) for each kind of sighting, the error added, in its unit
    speed_noise, turn_noise : (steps, n, lanes) standard normal
    keys : (lanes, 2) unsigned, of the noise of sightings
    commands, responses : (n, 2, lanes) m/s, rad/s, at present
    moved : (n, 2, lanes) m, present shift of each circle towards its anchor
    seen : (n, lanes) step of the last sighting of, or by, each vehicle
    heard : (n, lanes) step of the last one that the filter has processed; earlier if they are late
    longest : (n, lanes) most steps between two sightings so far
    slowest, fastest : (n, lanes) m/s, of the speeds commanded in the second half, outside holds
    saturated : (n, lanes) number of steps outside holds with a command at a limit
    sought : (n, lanes) number of steps at which a vehicle was not sure to meet its anchor
    places : (2,) steps flown, and sightings recorded so far
    ahead : (3n + e, lanes) estimate to steer by, away : (3, lanes) way to a target; scratch
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
