"""Kinds of sighting: measured value, standard deviation, and slopes by the two poses.

With q the target's position relative to the observer, rho its length and psi the observer's
heading, a sighting z depends on the poses through q and psi alone:

    kind       z                  dz / dq                dz / dpsi
    bearing    atan2(q) - psi     (-q_y, q_x) / rho^2    -1
    distance   rho                q / rho                 0
    compass    psi                0                       1

A compass has no target: its sightings name the observer as their target.

Let a and b be errors of the target's relative place along and across the line of sight, at distance
rho. The second-order term of a sighting, which its slopes leave out, is a product:

    bearing    -(a / rho) (b / rho)
    distance   rho / 2 (b / rho)^2
    compass    nothing

A new kind goes at the end of SIGHTING_KINDS: sightings refer to kinds by their place in the table.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.team import Sensors

ALONG, ACROSS = 0, 1
"""Directions of an error relative to the line of sight."""


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """Second-order term of a sighting: a product of two errors over the distance.

    Attributes
    ----------
    ways : directions of the two errors, ALONG or ACROSS the line of sight
    size : of distances (...) m, the product's factor, in the sighting's unit
    """

    ways: tuple[int, int]
    size: Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class OwnSensor:
    """Sensor of one kind of sighting alone; a vehicle may lack or lose it.

    Attributes
    ----------
    words : its name in messages
    key : key of the scenario with its standard deviation; without it there is no sensor
    """

    words: str
    key: str


@dataclass(frozen=True, slots=True)
class SightingKind:
    """Kind of sighting.

    Attributes
    ----------
    sigma_name : attribute of Sensors that holds its standard deviations, (n,) by observer;
        infinite where a vehicle's sensor does not measure this kind
    unit : of the sighting and its standard deviation
    measured : of q (2, ...) m and psi (...) rad, the noiseless sighting; angles are not wrapped
    slopes : of q (2, ...) m and weights (...), each weight times dz / dq, (2, ...); 0 at q = 0
    by_heading : dz / dpsi
    of_target : whether it measures a target within range and view; otherwise a vehicle measures
        itself
    every_name : attribute of Sensors that holds the samples from one to the next, (n,)
    second_order : second-order term that the slopes leave out; None if there is none
    own_sensor : its own sensor; None where every vehicle's sensor measures it
    """

    sigma_name: str
    unit: str
    measured: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], Array]
    by_heading: float
    of_target: bool = True
    every_name: str = "every"
    second_order: SecondOrder | None = None
    own_sensor: OwnSensor | None = None

    def sigmas(self, sensors: Sensors) -> Array:
        """Return (n,) standard deviations by observer; infinite where there is no such sensor."""
        found: Array = getattr(sensors, self.sigma_name)
        return found


# --- bearings, distances, compasses -------------------------------------------------------------


def _bearings(q: Array, heading: Array) -> Array:
    return np.asarray(np.arctan2(q[1], q[0]) - heading)


def _bearing_slopes(q: Array, weights: Array) -> Array:
    squared = q[0] * q[0] + q[1] * q[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        toward = q * (weights / squared)
    toward[:, squared == 0.0] = 0.0
    return np.stack([-toward[1], toward[0]])


BEARING = SightingKind(
    "bearing_sigmas",
    "rad",
    _bearings,
    _bearing_slopes,
    by_heading=-1.0,
    second_order=SecondOrder((ALONG, ACROSS), np.ones_like),
)
"""Direction in which the target appears, from the observer's heading, in rad."""


def _distances(q: Array, heading: Array) -> Array:
    return np.asarray(np.hypot(q[0], q[1]))


def _distance_slopes(q: Array, weights: Array) -> Array:
    rho = np.hypot(q[0], q[1])
    with np.errstate(divide="ignore", invalid="ignore"):
        toward = q * (weights / rho)
    toward[:, rho == 0.0] = 0.0
    return np.asarray(toward)


def _half(distances: Array) -> Array:
    return 0.5 * distances


DISTANCE = SightingKind(
    "range_sigmas",
    "m",
    _distances,
    _distance_slopes,
    by_heading=0.0,
    second_order=SecondOrder((ACROSS, ACROSS), _half),
    own_sensor=OwnSensor("distance sensor", "sensor.range_sigma_m"),
)
"""Distance from the observer to the target, in m."""


def _headings(q: Array, heading: Array) -> Array:
    return np.array(heading, dtype=float)


def _no_slopes(q: Array, weights: Array) -> Array:
    return np.zeros_like(q)


COMPASS = SightingKind(
    "compass_sigmas",
    "rad",
    _headings,
    _no_slopes,
    by_heading=1.0,
    of_target=False,
    every_name="compass_every",
    own_sensor=OwnSensor("compass", "heading_sigma_rad"),
)
"""The vehicle's own heading, in rad."""


# --- the table ----------------------------------------------------------------------------------


SIGHTING_KINDS = {"bearing": BEARING, "distance": DISTANCE, "compass": COMPASS}
"""Kinds of sighting by name."""


def place_of(kind: SightingKind) -> int:
    """Return the place of a kind in SIGHTING_KINDS."""
    return list(SIGHTING_KINDS.values()).index(kind)


def kinds_measured(sensors: Sensors) -> Flags:
    """Return (n, K) whether each vehicle's sensor measures each of the K kinds."""
    return np.stack([kind.sigmas(sensors) != np.inf for kind in SIGHTING_KINDS.values()], axis=1)


def of_targets(kinds: Index) -> Flags:
    """Return (s,) whether each sighting is one of a target, not of the vehicle itself."""
    return np.array([kind.of_target for kind in SIGHTING_KINDS.values()])[kinds]


def samples_between(sensors: Sensors) -> Index:
    """Return the samples (K, n) from one sighting of each of K kinds to the next, by vehicle."""
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
    """Kinds that occur, with their sightings; a slice if there is only one."""
    table = list(SIGHTING_KINDS.values())
    if len(kinds) == 0:
        return []
    if np.all(kinds == kinds[0]):
        return [(table[int(kinds[0])], slice(None))]
    return [(table[k], np.flatnonzero(kinds == k)) for k in np.unique(kinds).tolist()]
