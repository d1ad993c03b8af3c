"""Bearings: the direction in which the target appears, from the observer's heading, in rad."""

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.sighting_kind import ACROSS, ALONG, SecondOrder, SightingKind


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
