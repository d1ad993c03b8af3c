"""Losses: vehicles, sensors, landmarks and links that a team no longer has, and what is left of it.

Orbits stay as they are. A vehicle that is lost sees nobody and is seen by nobody; one whose sensor
is lost flies on and is seen by others; a landmark that is lost is seen by nobody. A vehicle may
also lose the sensor of one kind of sighting alone: its compass, or what measures distances. Of a
link that is lost, neither end sees the other. So what is left needs no new contact windows: those
of the whole team are selected from.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS, kinds_measured, of_targets
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team

BLIND_RANGE_M = 1e-6
"""Range of a sensor that is lost: the smallest length that a scenario may state."""


@dataclass(frozen=True, slots=True)
class Loss:
    """What is lost together, by index.

    Attributes
    ----------
    vehicles : that are gone
    sensors : of vehicles that fly on, with all that they measure of targets
    landmarks : from 0
    kinds : of sighting, by place in SIGHTING_KINDS, each with the vehicle that no longer makes them
    links : pairs a < b that no longer sight each other; b is a landmark from the number of vehicles
        on
    """

    vehicles: tuple[int, ...] = ()
    sensors: tuple[int, ...] = ()
    landmarks: tuple[int, ...] = ()
    kinds: tuple[tuple[int, int], ...] = ()
    links: tuple[tuple[int, int], ...] = ()

    def joined(self, other: "Loss") -> "Loss":
        """Return both losses together."""
        return Loss(
            self.vehicles + other.vehicles,
            self.sensors + other.sensors,
            self.landmarks + other.landmarks,
            self.kinds + other.kinds,
            self.links + other.links,
        )

    def parts(self, observers: Index, targets: Index) -> Flags:
        """Return (p,) whether sightings of `targets` by `observers` are of a link that is lost."""
        lost = np.zeros(len(observers), dtype=bool)
        for a, b in self.links:
            lost |= (observers == a) & (targets == b)
            lost |= (observers == b) & (targets == a)
        return lost

    @property
    def repeats(self) -> tuple[tuple[int, int], ...]:
        """Kinds of sighting that are lost with a vehicle or a sensor anyhow."""
        targeted = of_targets(np.arange(len(SIGHTING_KINDS)))
        return tuple(
            (place, k)
            for place, k in self.kinds
            if k in self.vehicles or (k in self.sensors and targeted[place])
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
    lacking : (n, K) which of the K kinds of sighting it alone no longer makes
    loss : what is lost
    """

    team: Team
    vehicles: Index
    numbers: Index
    blind: Flags
    lacking: Flags
    loss: Loss

    def still_seen(self, observers: Index, targets: Index) -> Flags:
        """Return (p,) whether sightings of `targets` by `observers`, old numbers, remain.

        A vehicle that is lost is blind; what others measure of themselves has no lost target.
        """
        sees = ~self.blind[observers] | (observers == targets)
        return np.asarray(
            sees & (self.numbers[targets] >= 0) & ~self.loss.parts(observers, targets)
        )

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
        kept &= ~self.lacking[before.observers, before.kinds]
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
    lacking = np.zeros((count, len(SIGHTING_KINDS)), dtype=bool)
    for place, k in loss.kinds:
        lacking[k, place] = True
    left = replace(team, landmarks=team.landmarks[~lost[count:]], sensors=_sensors_left(team, loss))
    return Remainder(left.only(vehicles), vehicles, numbers, blind, lacking, loss)


def single_losses(team: Team) -> list[Loss]:
    """Return the loss of each vehicle, unless it is the only one, each sensor and each landmark.

    After the sensors come those that measure one kind of sighting and nothing else.
    """
    vehicles = [Loss(vehicles=(k,)) for k in range(team.count)] if team.count > 1 else []
    sensors = [Loss(sensors=(k,)) for k in range(team.count)]
    measured = kinds_measured(team.sensors)
    sensors += [
        Loss(kinds=((place, k),))
        for place, kind in enumerate(SIGHTING_KINDS.values())
        for k in range(team.count)
        if kind.own_sensor is not None and measured[k, place]
    ]
    return vehicles + sensors + [Loss(landmarks=(k,)) for k in range(len(team.landmarks))]


def _sensors_left(team: Team, loss: Loss) -> Sensors:
    ranges: Array = team.sensors.ranges.copy()
    ranges[list(loss.sensors)] = BLIND_RANGE_M
    left = replace(team.sensors, ranges=ranges)
    table = list(SIGHTING_KINDS.values())
    for place, k in loss.kinds:
        sigmas = table[place].sigmas(left).copy()
        sigmas[k] = np.inf
        changed: dict[str, Any] = {table[place].sigma_name: sigmas}
        left = replace(left, **changed)
    return left
