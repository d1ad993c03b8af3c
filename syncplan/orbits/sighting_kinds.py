"""Kinds of sighting: what each measures, how well, and how it changes with the two poses.

With q the target's position relative to the observer, rho its length and psi the observer's
heading, a sighting z depends on the poses through q and psi alone:

    kind       z                  dz / dq                dz / dpsi
    bearing    atan2(q) - psi     (-q_y, q_x) / rho^2    -1
    distance   rho                q / rho                 0
    compass    psi                0                       1

A compass has no target: its sightings name the observer as their target.

A further kind is a module beside `bearings` and a further member of SIGHTING_KINDS, at its end.
Sightings refer to kinds by their place in the table.
"""

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.bearings import BEARING
from syncplan.orbits.compasses import COMPASS
from syncplan.orbits.distances import DISTANCE
from syncplan.orbits.sensors import Sensors
from syncplan.orbits.sighting_kind import SightingKind

SIGHTING_KINDS = {"bearing": BEARING, "distance": DISTANCE, "compass": COMPASS}
"""By name."""


def place_of(kind: SightingKind) -> int:
    """Return the place of a kind in SIGHTING_KINDS."""
    return list(SIGHTING_KINDS.values()).index(kind)


def kinds_measured(sensors: Sensors) -> Flags:
    """Return (n, K): whether each vehicle's sensor measures each of the K kinds."""
    return np.stack([kind.sigmas(sensors) != np.inf for kind in SIGHTING_KINDS.values()], axis=1)


def of_targets(kinds: Index) -> Flags:
    """Return (s,) whether each sighting is one of a target, not of the vehicle itself."""
    return np.array([kind.of_target for kind in SIGHTING_KINDS.values()])[kinds]


def samples_between(sensors: Sensors) -> Index:
    """Return (K, n): from how many samples each vehicle makes one sighting of each of K kinds."""
    every: list[Index] = [getattr(sensors, one.every_name) for one in SIGHTING_KINDS.values()]
    return np.stack(every)


def sigmas_by_kind(sensors: Sensors, kinds: Index, observers: Index) -> Array:
    """Return (s,) the standard deviation of each sighting, in its kind's unit."""
    table = np.stack([kind.sigmas(sensors) for kind in SIGHTING_KINDS.values()])
    return np.asarray(table[kinds, observers])


def measured_by_kind(kinds: Index, q: Array, heading: Array) -> Array:
    """Return (s,) noiseless sightings at q (2, s) m by observers heading (s,) rad."""
    found = np.empty(len(kinds))
    for kind, chosen in _by_kind(kinds):
        found[chosen] = kind.measured(q[:, chosen], heading[chosen])
    return found


def slopes_by_kind(kinds: Index, q: Array, weights: Array) -> Array:
    """Return (2, s): the weight (s,) of each sighting times its dz / dq at q (2, s) m."""
    found = np.empty((2, len(kinds)))
    for kind, chosen in _by_kind(kinds):
        found[:, chosen] = kind.slopes(q[:, chosen], weights[chosen])
    return found


def turns_by_kind(kinds: Index) -> Array:
    """Return (s,) dz / dpsi of each sighting."""
    return np.array([kind.by_heading for kind in SIGHTING_KINDS.values()])[kinds]


def _by_kind(kinds: Index) -> list[tuple[SightingKind, Index | slice]]:
    """Each kind that occurs, and its sightings; a slice where there is but one."""
    table = list(SIGHTING_KINDS.values())
    if len(kinds) == 0:
        return []
    if np.all(kinds == kinds[0]):
        return [(table[int(kinds[0])], slice(None))]
    return [(table[k], np.flatnonzero(kinds == k)) for k in np.unique(kinds).tolist()]
