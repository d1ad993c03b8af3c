"""Kinds of sighting: what each measures, how well, and how it changes with the two poses.

With q the target's position relative to the observer, rho its length and psi the observer's
heading, a sighting z depends on the poses through q and psi alone:

    kind       z                  dz / dq                dz / dpsi
    bearing    atan2(q) - psi     (-q_y, q_x) / rho^2    -1

A further kind, such as the distance rho with slope q / rho, is a further member of SIGHTING_KINDS.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.sensors import Sensors

__all__ = ["BEARING", "SIGHTING_KINDS", "SightingKind"]


@dataclass(frozen=True, slots=True)
class SightingKind:
    """What one kind of sighting measures.

    Attributes
    ----------
    sigmas : of the sensors, (n,) standard deviation by observer
    measured : of q (2, ...) m and psi (...) rad, the noiseless sighting; angles are not wrapped
    slopes : of q (2, ...) m and weights (...), each weight times dz / dq, (2, ...); 0 at q = 0
    by_heading : dz / dpsi
    """

    sigmas: Callable[[Sensors], Array]
    measured: Callable[[Array, Array], Array]
    slopes: Callable[[Array, Array], Array]
    by_heading: float


def _bearing_sigmas(sensors: Sensors) -> Array:
    return sensors.bearing_sigmas


def _bearings(q: Array, heading: Array) -> Array:
    return np.asarray(np.arctan2(q[1], q[0]) - heading)


def _bearing_slopes(q: Array, weights: Array) -> Array:
    squared = q[0] * q[0] + q[1] * q[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        toward = q * (weights / squared)
    toward[:, squared == 0.0] = 0.0
    return np.stack([-toward[1], toward[0]])


BEARING = SightingKind(_bearing_sigmas, _bearings, _bearing_slopes, by_heading=-1.0)
"""Direction in which the target appears, from the observer's heading, in rad."""

SIGHTING_KINDS = {"bearing": BEARING}
"""By name."""
