"""The team: vehicles on their circles with their sensors and noise, and the landmarks they know."""

from dataclasses import dataclass, replace

from syncplan.arrays import Array, Index, short_repr
from syncplan.orbits.circles import Orbits
from syncplan.orbits.error_states import NO_ERRORS, ErrorSigmas
from syncplan.orbits.noise import Noise
from syncplan.orbits.sensors import Sensors


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
    """Whatever has a `team` offers the parts of the team as its own."""

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
