"""Sightings: the samples k Ts at which each contact is measured, from the exact windows."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Flags, Index
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sighting_kinds import kinds_measured, of_targets, samples_between
from syncplan.orbits.team import Team

_ROUNDING = 1e-9
"""Share of a sample time by which an edge or a duration may miss a sample and still meet it."""


@dataclass(frozen=True, slots=True)
class Sightings:
    """Everything measured, ordered by step, then observer, then target, then kind.

    Attributes
    ----------
    steps : (s,) sample number k, taken at k Ts
    observers : (s,) index of the vehicle that measures
    targets : (s,) index of what it measures; n and above are landmarks, the observer itself where
        a kind has no target
    kinds : (s,) place in SIGHTING_KINDS of what is measured of it
    """

    steps: Index
    observers: Index
    targets: Index
    kinds: Index

    def until(self, last_step: int) -> "Sightings":
        """Return the sightings up to step `last_step`, included."""
        end = int(np.searchsorted(self.steps, last_step, side="right"))
        return Sightings(
            self.steps[:end], self.observers[:end], self.targets[:end], self.kinds[:end]
        )

    def only(self, chosen: Flags) -> "Sightings":
        """Return the chosen sightings."""
        return Sightings(
            self.steps[chosen], self.observers[chosen], self.targets[chosen], self.kinds[chosen]
        )

    def first_of_steps(self, last_step: int) -> Index:
        """Return (last_step + 2,) offsets: step k's sightings are first[k] to first[k + 1]."""
        return np.searchsorted(self.steps, np.arange(last_step + 2)).astype(np.int64)


def steps_within(duration: float, sample_time: float) -> int:
    """Return how many whole samples fit into `duration` s."""
    return int(np.floor(duration / sample_time + _ROUNDING))


def samples_before(duration: float, sample_time: float) -> int:
    """Return how many samples k Ts with k >= 0 fall into [0, duration) s."""
    return int(np.ceil(duration / sample_time - _ROUNDING))


def sightings_over(team: Team, windows: Windows, span: float) -> Sightings:
    """Return what a team sees at the samples k Ts with k >= 0 in [0, span) s."""
    last = samples_before(span, team.sensors.sample_time) - 1
    return sample_sightings(windows, team.orbits.period, team.sensors, 0, last)


def sample_sightings(
    windows: Windows, period: float, sensors: Sensors, first_step: int, last_step: int
) -> Sightings:
    """Return the sightings at k Ts for k from `first_step` to `last_step`, both included.

    Windows repeat with the period; a sample exactly at a window's edge belongs to it. At each
    sample in a window there is one sighting for each kind that the observer's sensor measures,
    at every sample or as often as it is ready; what a vehicle measures of itself needs no window.
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
    measured = kinds_measured(sensors)
    alone = ~of_targets(np.arange(measured.shape[1]))
    own = np.flatnonzero(measured[:, alone].any(axis=1))
    if len(own):
        all_steps = np.arange(first_step, last_step + 1)
        steps = np.concatenate([steps, np.repeat(all_steps, len(own))])
        observers, targets = (
            np.concatenate([of, np.tile(own, len(all_steps))]) for of in (observers, targets)
        )
    order = np.lexsort((targets, observers, steps))
    itself = observers[order] == targets[order]
    which, kinds = np.nonzero(measured[observers[order]] & (itself[:, None] == alone))
    order = order[which]
    every = samples_between(sensors)
    if np.any(every > 1):
        ready = steps[order] % every[kinds, observers[order]] == 0
        order, kinds = order[ready], kinds[ready]
    return Sightings(steps[order], observers[order], targets[order], kinds)
