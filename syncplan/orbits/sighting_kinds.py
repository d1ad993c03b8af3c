"""Kinds of sighting: what each measures, how well, and how it changes with the two poses.

With q the target's position relative to the observer, rho its length and psi the observer's
heading, a sighting z depends on the poses through q and psi alone:

    kind       z                  dz / dq                dz / dpsi
    bearing    atan2(q) - psi     (-q_y, q_x) / rho^2    -1

A further kind, such as the distance rho with slope q / rho, is a further member of SIGHTING_KINDS,
at its end. Sightings refer to kinds by their place in the table.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.sensors import Sensors

__all__ = [
    "BEARING",
    "SIGHTING_KINDS",
    "SightingKind",
    "kinds_measured",
    "measured_by_kind",
    "place_of",
    "sigmas_by_kind",
    "slopes_by_kind",
    "turns_by_kind",
]


@dataclass(frozen=True, slots=True)
class SightingKind:
    """What one kind of sighting measures.

    Attributes
    ----------
    sigma_name : attribute of Sensors that holds its standard deviations, (n,) by observer;
        infinite where a vehicle's sensor does not measure this kind
    unit : of the sighting and its standard deviation
    measured : of q (2, ...) m and psi (...) rad, the noiseless sighting; angles are not wrapped
    slopes : of q (2, ...) m and weights (...), each weight times dz / dq, (2, ...); 0 at q = 0
    by_heading : dz / dpsi
    """

    sigma_name: str
    unit: str
    measured: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], Array]
    by_heading: float

    def sigmas(self, sensors: Sensors) -> Array:
        """Return (n,) standard deviations by observer; infinite where there is no such sensor."""
        found: Array = getattr(sensors, self.sigma_name)
        return found


def _bearings(q: Array, heading: Array) -> Array:
    return np.asarray(np.arctan2(q[1], q[0]) - heading)


def _bearing_slopes(q: Array, weights: Array) -> Array:
    squared = q[0] * q[0] + q[1] * q[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        toward = q * (weights / squared)
    toward[:, squared == 0.0] = 0.0
    return np.stack([-toward[1], toward[0]])


BEARING = SightingKind("bearing_sigmas", "rad", _bearings, _bearing_slopes, by_heading=-1.0)
"""Direction in which the target appears, from the observer's heading, in rad."""

SIGHTING_KINDS = {"bearing": BEARING}
"""By name."""


def place_of(kind: SightingKind) -> int:
    """Return the place of a kind in SIGHTING_KINDS."""
    return list(SIGHTING_KINDS.values()).index(kind)


def kinds_measured(sensors: Sensors) -> Flags:
    """Return (n, K): whether each vehicle's sensor measures each of the K kinds."""
    return np.stack([kind.sigmas(sensors) != np.inf for kind in SIGHTING_KINDS.values()], axis=1)


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
