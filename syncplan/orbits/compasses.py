"""Compasses: a vehicle's own heading from +x, in rad, which needs nobody in sight."""

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.sighting_kind import OwnSensor, SightingKind


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
