"""Sightings: samples k Ts at which contacts are measured, and the remainder after losses.

A team may lose vehicles, sensors, landmarks and links. Orbits stay as they are. A lost vehicle
neither sees nor is seen. A vehicle that loses its sensor flies on and is seen by others. A lost
landmark is not seen. A vehicle may also lose the sensor of one kind of sighting alone: its compass
or its distance sensor. On a lost link, neither end sees the other. The remainder therefore needs no
new contact windows, only a selection from those of the whole team.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits import sighting_kinds
from syncplan.orbits.contacts import Windows
from syncplan.orbits.team import Sensors, Team

_ROUNDING = 1e-9
"""Share of a sample time by which an edge or a duration may miss a sample and still include it."""


@dataclass(frozen=True, slots=True)
class Sightings:
    """Sightings ordered by step, then observer, then target, then kind.

    Attributes
    ----------
    steps : (s,) sample number k, taken at k Ts
    observers : (s,) index of the vehicle that measures
    targets : (s,) index of the body measured; n and above are landmarks, the observer itself where
        a kind has no target
    kinds : (s,) place of the kind in SIGHTING_KINDS
    """

    steps: Index
    observers: Index
    targets: Index
    kinds: Index

    def until(self, last_step: int) -> "Sightings":
        """Return the sightings up to step `last_step`, included."""
        end = int(np.searchsorted(self.steps, last_step, side="right"))
        return self.only(slice(end))

    def only(self, chosen: Flags | slice) -> "Sightings":
        """Return the chosen sightings."""
        return Sightings(
            self.steps[chosen], self.observers[chosen], self.targets[chosen], self.kinds[chosen]
        )

    def first_of_steps(self, last_step: int) -> Index:
        """Return (last_step + 2,) offsets: step k's sightings are first[k] to first[k + 1]."""
        return np.searchsorted(self.steps, np.arange(last_step + 2)).astype(np.int64)


def steps_within(duration: float, sample_time: float) -> int:
    """Return the number of whole samples in `duration` s."""
    return int(np.floor(duration / sample_time + _ROUNDING))


def samples_before(duration: float, sample_time: float) -> int:
    """Return the number of samples k Ts with k >= 0 in [0, duration) s."""
    return int(np.ceil(duration / sample_time - _ROUNDING))


def sightings_over(team: Team, windows: Windows, span: float) -> Sightings:
    """Return the sightings of a team at the samples k Ts with k >= 0 in [0, span) s."""
    last = samples_before(span, team.sensors.sample_time) - 1
    return sample_sightings(windows, team.orbits.period, team.sensors, 0, last)


def sample_sightings(
    windows: Windows, period: float, sensors: Sensors, first_step: int, last_step: int
) -> Sightings:
    """Return the sightings at k Ts for k from `first_step` to `last_step`, both included.

    Windows repeat with the period; a sample exactly at a window's edge belongs to it. At each
    sample in a window there is one sighting of each kind that the observer's sensor measures and
    is ready for. Sightings that a vehicle makes of itself need no window.
    """
    sample_time = sensors.sample_time
    pair = np.repeat(np.arange(len(windows.observers)), np.diff(windows.first))
    permanent = windows.ends - windows.starts >= period
    turns = np.arange(
        np.floor(first_step * sample_time / period) - 1.0,
        np.floor(last_step * sample_time / period) + 2.0,
    )
    start = (windows.starts[:, None] + period * turns) / sample_time
    end = (windows.ends[:, None] + period * turns) / sample_time
    low = np.maximum(np.ceil(start - _ROUNDING), first_step)
    high = np.minimum(np.floor(end + _ROUNDING), last_step)
    low[permanent], high[permanent] = first_step, first_step - 1
    low[permanent, 0], high[permanent, 0] = first_step, last_step
    count = np.maximum(high - low + 1.0, 0.0).astype(np.int64).ravel()
    begin = np.repeat(low.ravel().astype(np.int64), count)
    within = np.arange(len(begin)) - np.repeat(np.cumsum(count) - count, count)
    pair_of = np.repeat(np.repeat(pair, len(turns)), count)
    steps = begin + within
    observers, targets = windows.observers[pair_of], windows.targets[pair_of]
    measured = sighting_kinds.kinds_measured(sensors)
    alone = ~sighting_kinds.of_targets(np.arange(measured.shape[1]))
    own = np.flatnonzero(measured[:, alone].any(axis=1))
    if len(own):
        all_steps = np.arange(first_step, last_step + 1)
        steps = np.concatenate([steps, np.repeat(all_steps, len(own))])
        observers, targets = (
            np.concatenate([of, np.tile(own, len(all_steps))]) for of in (observers, targets)
        )
    order = np.lexsort((targets, observers, steps))
    itself = observers[order] == targets[order]
    # kinds that each vehicle measures of others, then of itself: a table is gathered fast
    table = np.stack([measured & ~alone, measured & alone], axis=1).reshape(-1, len(alone))
    made = np.flatnonzero(table.take(2 * observers[order] + itself, axis=0))
    which, kinds = np.divmod(made, len(alone))
    order = order[which]
    every = sighting_kinds.samples_between(sensors)
    if np.any(every > 1):
        ready = steps[order] % every[kinds, observers[order]] == 0
        order, kinds = order[ready], kinds[ready]
    return Sightings(steps[order], observers[order], targets[order], kinds)


# --- losses -------------------------------------------------------------------------------------


BLIND_RANGE_M = 1e-6
"""Range of a sensor that is lost: the smallest length that a scenario may state."""


@dataclass(frozen=True, slots=True)
class Loss:
    """Parts that are lost together, by index.

    Attributes
    ----------
    vehicles : lost vehicles
    sensors : vehicles that fly on, but make no sightings of targets
    landmarks : lost landmarks, numbered from 0
    kinds : kinds of sighting, by place in SIGHTING_KINDS, each with the vehicle that lost it
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
        """Return (p,) whether sightings of `targets` by `observers` are on a lost link."""
        lost = np.zeros(len(observers), dtype=bool)
        for a, b in self.links:
            lost |= (observers == a) & (targets == b)
            lost |= (observers == b) & (targets == a)
        return lost

    @property
    def repeats(self) -> tuple[tuple[int, int], ...]:
        """Members of `kinds` that are lost anyway, with a vehicle or a sensor."""
        targeted = sighting_kinds.of_targets(np.arange(len(sighting_kinds.SIGHTING_KINDS)))
        return tuple(
            (place, k)
            for place, k in self.kinds
            if k in self.vehicles or (k in self.sensors and targeted[place])
        )


@dataclass(frozen=True, slots=True)
class Remainder:
    """Remainder, after a loss, of a team of n vehicles and m landmarks.

    Attributes
    ----------
    team : of the k vehicles left, on their orbits
    vehicles : (k,) their old numbers
    numbers : (n + m,) each body's new number, -1 for those that are lost
    blind : (n,) whether a vehicle no longer sights any target
    lacking : (n, K) whether a vehicle lost each of the K kinds of sighting individually
    loss : the lost parts
    """

    team: Team
    vehicles: Index
    numbers: Index
    blind: Flags
    lacking: Flags
    loss: Loss

    def still_seen(self, observers: Index, targets: Index) -> Flags:
        """Return (p,) whether sightings of `targets` by `observers`, in old numbers, remain.

        A lost vehicle is blind; sightings that others make of themselves have no lost target.
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
        """Return the remaining sightings in their order, and (s,) whether each old one remains."""
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
        """Return the pairs of vehicles (e, 2) that both remain, in new numbers."""
        left = self.numbers[before]
        return np.asarray(left[(left >= 0).all(axis=1)])


def remainder_of(team: Team, loss: Loss) -> Remainder:
    """Return the remainder of a team after a loss; at least one vehicle has to be left."""
    count, places = team.count, len(team.landmarks)
    lost = np.zeros(count + places, dtype=bool)
    lost[list(loss.vehicles)] = True
    lost[[count + k for k in loss.landmarks]] = True
    vehicles = np.flatnonzero(~lost[:count])
    numbers = np.where(lost, -1, np.cumsum(~lost) - 1)
    blind = lost[:count].copy()
    blind[list(loss.sensors)] = True
    lacking = np.zeros((count, len(sighting_kinds.SIGHTING_KINDS)), dtype=bool)
    for place, k in loss.kinds:
        lacking[k, place] = True
    left = replace(team, landmarks=team.landmarks[~lost[count:]], sensors=_sensors_left(team, loss))
    return Remainder(left.only(vehicles), vehicles, numbers, blind, lacking, loss)


def single_losses(team: Team) -> list[Loss]:
    """Return the loss of each vehicle, unless it is the only one, each sensor and each landmark.

    After the sensors come those of one kind of sighting alone.
    """
    vehicles = [Loss(vehicles=(k,)) for k in range(team.count)] if team.count > 1 else []
    sensors = [Loss(sensors=(k,)) for k in range(team.count)]
    measured = sighting_kinds.kinds_measured(team.sensors)
    sensors += [
        Loss(kinds=((place, k),))
        for place, kind in enumerate(sighting_kinds.SIGHTING_KINDS.values())
        for k in range(team.count)
        if kind.own_sensor is not None and measured[k, place]
    ]
    return vehicles + sensors + [Loss(landmarks=(k,)) for k in range(len(team.landmarks))]


def _sensors_left(team: Team, loss: Loss) -> Sensors:
    ranges: Array = team.sensors.ranges.copy()
    ranges[list(loss.sensors)] = BLIND_RANGE_M
    left = replace(team.sensors, ranges=ranges)
    table = list(sighting_kinds.SIGHTING_KINDS.values())
    for place, k in loss.kinds:
        sigmas = table[place].sigmas(left).copy()
        sigmas[k] = np.inf
        changed: dict[str, Any] = {table[place].sigma_name: sigmas}
        left = replace(left, **changed)
    return left
