"""Team: vehicles on their circles with their sensors and noise, and the landmarks they know.

The last part converts a scenario to arrays, and with its circles to a team.
"""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from syncplan.arrays import Array, Index, short_repr
from syncplan.orbits.circles import Orbits
from syncplan.orbits.noise import NO_ERRORS, ErrorSigmas, Noise
from syncplan.scenario.disturbances import ESTIMABLE, Wind
from syncplan.scenario.specification import Scenario, per_vehicle

# --- sensors --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, repr=False)
class Sensors:
    """Sensors of n vehicles: range, view, sample times and standard deviations.

    Fields beyond those of a plain camera have defaults. One value may stand for all vehicles.

    Attributes
    ----------
    ranges : (n,) m
    fields_of_view : (n,) rad, full angle; 2 pi or more sees all round
    boresights : (n,) rad, from the heading, counter-clockwise
    bearing_sigmas : (n,) rad
    sample_time : s, common to all
    range_sigmas : (n,) m, of distances; infinite where none are measured
    compass_sigmas : (n,) rad, of the vehicle's own heading; infinite without a compass
    compass_every : (n,) samples from one reading of the compass to the next
    every : (n,) samples from one sighting of a target to the next
    detection : (n,) share of the sightings within range and view that are made
    false_bearings : (n,) share of the bearings that are false, anywhere in view
    bearing_bias_sigmas : (n,) rad, of a bearing error that is constant in a run
    bearing_walk_sigmas, bearing_walk_times : (n,) rad, s, of one that is a first-order Gauss-Markov
        process: its standard deviation, and the time over which its correlation falls to 1/e
    """

    ranges: Array
    fields_of_view: Array
    boresights: Array
    bearing_sigmas: Array
    sample_time: float
    range_sigmas: Array = field(default_factory=lambda: np.array(np.inf))
    compass_sigmas: Array = field(default_factory=lambda: np.array(np.inf))
    compass_every: Index = field(default_factory=lambda: np.array(1))
    every: Index = field(default_factory=lambda: np.array(1))
    detection: Array = field(default_factory=lambda: np.array(1.0))
    false_bearings: Array = field(default_factory=lambda: np.array(0.0))
    bearing_bias_sigmas: Array = field(default_factory=lambda: np.array(0.0))
    bearing_walk_sigmas: Array = field(default_factory=lambda: np.array(0.0))
    bearing_walk_times: Array = field(default_factory=lambda: np.array(np.inf))

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Expand single values to one for each vehicle."""
        for name in self._names():
            value = np.asarray(getattr(self, name))
            if value.ndim == 0:
                object.__setattr__(self, name, np.full(len(self.ranges), value))

    @classmethod
    def _names(cls) -> list[str]:
        """Names of the attributes that are arrays."""
        return [one.name for one in fields(cls) if one.name != "sample_time"]

    def only(self, vehicles: Index) -> "Sensors":
        """Return the sensors of the vehicles (k,), in that order; a vehicle may occur twice."""
        return replace(self, **{name: getattr(self, name)[vehicles] for name in self._names()})

    @property
    def compass_sigmas_each_sample(self) -> Array:
        """(n,) rad, of readings at every sample that carry as much information as those made."""
        return np.asarray(self.compass_sigmas * np.sqrt(self.compass_every))

    def scaled(self, unit: float) -> "Sensors":
        """Return the same sensors with all lengths in units of `unit` m."""
        return replace(self, ranges=self.ranges / unit, range_sigmas=self.range_sigmas / unit)


@dataclass(frozen=True, slots=True, repr=False)
class Team:
    """n vehicles and m landmarks; bodies from n on are landmarks.

    Attributes
    ----------
    orbits : of the vehicles
    landmarks : (m, 2) m
    sensors, noise, errors : of the vehicles
    obstacles : polygons that block sight, each (k, 2) m, corners in order, not closed
    """

    orbits: Orbits
    landmarks: Array
    sensors: Sensors
    noise: Noise
    errors: ErrorSigmas = NO_ERRORS
    obstacles: tuple[Array, ...] = ()

    __repr__ = short_repr

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return self.orbits.count

    def only(self, vehicles: Index) -> "Team":
        """Return the team of the vehicles (k,), in that order, with all landmarks."""
        return replace(self, orbits=self.orbits.only(vehicles), sensors=self.sensors.only(vehicles))

    def on(self, orbits: Orbits) -> "Team":
        """Return the same team on other orbits."""
        return replace(self, orbits=orbits)


class WithTeam:
    """Base of classes that offer the parts of their `team` as their own."""

    __slots__ = ()

    team: Team

    @property
    def orbits(self) -> Orbits:
        """The team's orbits."""
        return self.team.orbits

    @property
    def landmarks(self) -> Array:
        """(m, 2) m: the landmarks that the team knows."""
        return self.team.landmarks

    @property
    def sensors(self) -> Sensors:
        """The team's sensors."""
        return self.team.sensors

    @property
    def noise(self) -> Noise:
        """The team's noise."""
        return self.team.noise

    @property
    def errors(self) -> ErrorSigmas:
        """The team's lasting errors."""
        return self.team.errors


# --- of a scenario ------------------------------------------------------------------------------


def radii_of(scenario: Scenario) -> Array:
    """Return (n,) m: the radius of each vehicle's circle."""
    return np.array(per_vehicle(scenario.orbit.radius_m, scenario.size), dtype=float)


def obstacles_of(scenario: Scenario) -> tuple[Array, ...]:
    """Return the polygons that block sight, each (k, 2) m."""
    return tuple(np.array(corners, dtype=float) for corners in scenario.obstacles_m or [])


def sensors_of(scenario: Scenario) -> Sensors:
    """Return the sensors of a scenario's vehicles."""
    sensors = scenario.sensors
    return Sensors(
        ranges=np.array([sensor.range_m for sensor in sensors]),
        fields_of_view=np.radians([sensor.fov_deg for sensor in sensors]),
        boresights=np.radians([sensor.boresight_deg for sensor in sensors]),
        bearing_sigmas=np.array([sensor.bearing_sigma_rad for sensor in sensors]),
        sample_time=scenario.sample_time,
        range_sigmas=np.array([sensor.range_sigma_m or np.inf for sensor in sensors]),
        compass_sigmas=_compass_sigmas(scenario),
        compass_every=np.array(scenario.samples_in(scenario.heading_interval_s)),
        every=np.array([scenario.samples_in(one.interval_s) for one in sensors]),
        detection=np.array([sensor.detection_probability or 1.0 for sensor in sensors]),
        bearing_bias_sigmas=np.array([one.bearing_bias_sigma_rad or 0.0 for one in sensors]),
        bearing_walk_sigmas=np.array([one.bearing_walk_sigma for one in sensors]),
        bearing_walk_times=np.array(
            [one.bearing_walk.time_s if one.bearing_walk else np.inf for one in sensors]
        ),
    )


def team_of(scenario: Scenario, orbits: Orbits) -> Team:
    """Return the team of a scenario's vehicles on the orbits given."""
    return Team(
        orbits=orbits,
        landmarks=np.array(scenario.landmarks, dtype=float).reshape(-1, 2),
        sensors=sensors_of(scenario),
        noise=Noise(
            speed_sigma=scenario.motion.speed_sigma(scenario.sample_time),
            turn_rate_sigma=scenario.motion.turn_rate_sigma(scenario.sample_time),
            position_sigma=scenario.initial_sigma.position_m,
            heading_sigma=scenario.initial_sigma.heading_rad,
        ),
        errors=_errors_of(scenario),
        obstacles=obstacles_of(scenario),
    )


def true_team_of(scenario: Scenario, team: Team) -> Team:
    """Return the team of a scenario's simulated world; `team` is the scenario's own."""
    if scenario.truth is None:
        return team
    true = team_of(scenario.in_truth, team.orbits)
    false = np.full(team.count, scenario.truth.false_bearings or 0.0)
    return replace(
        true,
        sensors=replace(true.sensors, false_bearings=false),
        errors=replace(true.errors, estimated=team.errors.estimated),
    )


def _compass_sigmas(scenario: Scenario) -> Array:
    given = per_vehicle(scenario.heading_sigma_rad, scenario.size)
    return np.array([np.inf if one is None else one for one in given])


def _errors_of(scenario: Scenario) -> ErrorSigmas:
    sigmas = scenario.error_sigmas
    # sensors may differ from vehicle to vehicle: Sensors has the sigmas of their errors
    own = {name: sigmas[name] for name in sigmas if not ESTIMABLE[name].startswith("sensor.")}
    return ErrorSigmas(
        own,
        gust_time=(scenario.wind or Wind()).gust_time_s,
        estimated=tuple(scenario.estimated),
    )
