"""Losses: vehicles, sensors and landmarks that a team no longer has, and what is left of it.

Orbits stay as they are. A vehicle that is lost sees nobody and is seen by nobody; one whose sensor
is lost flies on and is seen by others; a landmark that is lost is seen by nobody. So what is left
needs no new contact windows: those of the whole team are selected from.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team

__all__ = ["BLIND_RANGE_M", "Loss", "Remainder", "remainder_of", "single_losses"]

BLIND_RANGE_M = 1e-6
"""Range of a sensor that is lost: the smallest length that a scenario may state."""


@dataclass(frozen=True, slots=True)
class Loss:
    """What is lost together, by index.

    Attributes
    ----------
    vehicles : that are gone
    sensors : of vehicles that fly on
    landmarks : from 0
    """

    vehicles: tuple[int, ...] = ()
    sensors: tuple[int, ...] = ()
    landmarks: tuple[int, ...] = ()

    def joined(self, other: "Loss") -> "Loss":
        """Return both losses together."""
        return Loss(
            self.vehicles + other.vehicles,
            self.sensors + other.sensors,
            self.landmarks + other.landmarks,
        )


@dataclass(frozen=True, slots=True)
class Remainder:
    """What a loss leaves of a team of n vehicles and m landmarks.

    Attributes
    ----------
    team : of the k vehicles left, on their orbits
    vehicles : (k,) the numbers they had
    numbers : (n + m,) each body's new number, -1 for those that are lost
    blind : (n,) whether a vehicle sees nothing any more, but what it measures of itself
    """

    team: Team
    vehicles: Index
    numbers: Index
    blind: Flags

    def still_seen(self, observers: Index, targets: Index) -> Flags:
        """Return (p,) whether sightings of `targets` by `observers`, old numbers, remain.

        A vehicle that is lost is blind; what others measure of themselves has no lost target.
        """
        sees = ~self.blind[observers] | (observers == targets)
        return np.asarray(sees & (self.numbers[targets] >= 0))

    def windows(self, before: Windows) -> Windows:
        """Return the contact windows that remain, in their order."""
        kept = self.still_seen(before.observers, before.targets)
        number = np.diff(before.first)
        each = np.repeat(kept, number)
        return Windows(
            self.numbers[before.observers[kept]],
            self.numbers[before.targets[kept]],
            np.concatenate([[0], np.cumsum(number[kept])]),
            before.starts[each],
            before.ends[each],
        )

    def sightings(self, before: Sightings) -> tuple[Sightings, Flags]:
        """Return the sightings that remain, in their order, and (s,) which of the old they are."""
        kept = self.still_seen(before.observers, before.targets)
        left = Sightings(
            before.steps[kept],
            self.numbers[before.observers[kept]],
            self.numbers[before.targets[kept]],
            before.kinds[kept],
        )
        return left, kept

    def pairs(self, before: Index) -> Index:
        """Return those of the (e, 2) vehicle pairs whose vehicles are both left."""
        left = self.numbers[before]
        return np.asarray(left[(left >= 0).all(axis=1)])


def remainder_of(team: Team, loss: Loss) -> Remainder:
    """Return what a loss leaves of a team; at least one vehicle has to be left."""
    count, places = team.count, len(team.landmarks)
    lost = np.zeros(count + places, dtype=bool)
    lost[list(loss.vehicles)] = True
    lost[[count + k for k in loss.landmarks]] = True
    vehicles = np.flatnonzero(~lost[:count])
    numbers = np.where(lost, -1, np.cumsum(~lost) - 1)
    blind = lost[:count].copy()
    blind[list(loss.sensors)] = True
    left = replace(team, landmarks=team.landmarks[~lost[count:]], sensors=_blinded(team, loss))
    return Remainder(left.only(vehicles), vehicles, numbers, blind)


def single_losses(team: Team) -> list[Loss]:
    """Return the loss of each vehicle, unless it is the only one, each sensor and each landmark."""
    vehicles = [Loss(vehicles=(k,)) for k in range(team.count)] if team.count > 1 else []
    sensors = [Loss(sensors=(k,)) for k in range(team.count)]
    return vehicles + sensors + [Loss(landmarks=(k,)) for k in range(len(team.landmarks))]


def _blinded(team: Team, loss: Loss) -> Sensors:
    ranges: Array = team.sensors.ranges.copy()
    ranges[list(loss.sensors)] = BLIND_RANGE_M
    return replace(team.sensors, ranges=ranges)
