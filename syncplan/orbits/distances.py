"""Distances: how far the target is from the observer, in m, where a sensor measures that too."""

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.sighting_kind import ACROSS, OwnSensor, SecondOrder, SightingKind


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
