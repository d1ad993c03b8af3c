"""Paths as trigonometric polynomials in time: all that contacts need to know of a circle.

A body is at center + cosine cos(tau) + sine sin(tau), with tau = omega t; a landmark stands still.
A direction fixed to a vehicle is along ray cos(tau) + turned sin(tau): on a circle the heading
turns at the rate itself. An ellipse has both too, the second along its velocity.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import Orbits, heading, perpendicular, unit

NO_LANDMARKS: Array = np.zeros((0, 2))
"""Of a team that is looked at by itself."""


@dataclass(frozen=True, slots=True)
class RelativeMotion:
    """Position of targets relative to observers, offset + cosine cos(tau) + sine sin(tau), in m.

    Attributes
    ----------
    offset, cosine, sine : (p, 2) m
    circular : (p,) whether cosine and sine are equally long and square to each other, exactly:
        vehicles of one sense, and landmarks
    """

    offset: Array
    cosine: Array
    sine: Array
    circular: Flags

    def only(self, pairs: Index) -> "RelativeMotion":
        """Return the motion of the pairs (k,), in that order."""
        return RelativeMotion(
            self.offset[pairs], self.cosine[pairs], self.sine[pairs], self.circular[pairs]
        )

    def at(self, tau: Array) -> Array:
        """Return the relative positions (p, k, 2) at tau (p, k) or (k,) rad."""
        cos, sin = np.cos(tau)[..., None], np.sin(tau)[..., None]
        return np.asarray(
            self.offset[:, None] + self.cosine[:, None] * cos + self.sine[:, None] * sin
        )


def body_paths(orbits: Orbits, landmarks: Array = NO_LANDMARKS) -> tuple[Array, Array, Array]:
    """Return (center, cosine, sine), each (n + m, 2) in m: vehicles, then landmarks.

    A body's position is center + cosine cos(tau) + sine sin(tau), with tau = omega t.
    """
    still = np.zeros((len(landmarks), 2))
    arm = orbits.radii[:, None] * unit(orbits.phases)
    return (
        np.concatenate([orbits.centers, landmarks.reshape(-1, 2)]),
        np.concatenate([arm, still]),
        np.concatenate([orbits.senses[:, None] * perpendicular(arm), still]),
    )


def relative_motion(
    orbits: Orbits, a: Index, b: Index, landmarks: Array = NO_LANDMARKS
) -> RelativeMotion:
    """Return the motion of bodies `b` relative to vehicles `a`; bodies from n on are landmarks."""
    center, cosine, sine = body_paths(orbits, landmarks)
    senses = np.concatenate([orbits.senses, np.zeros(len(landmarks))])
    return RelativeMotion(
        offset=center[b] - center[a],
        cosine=cosine[b] - cosine[a],
        sine=sine[b] - sine[a],
        circular=(b >= orbits.count) | (senses[a] == senses[b]),
    )


def rays(orbits: Orbits, vehicles: Index, boresights: Array, offsets: Array) -> tuple[Array, Array]:
    """Return (ray, turned), each (p, 2): the direction `offsets` rad off the boresight of a sensor.

    At tau it is along ray cos(tau) + turned sin(tau); `boresights` are (p,) rad from the heading.
    """
    ray = unit(_axes(orbits, vehicles, boresights) + offsets)
    return ray, orbits.senses[vehicles][:, None] * perpendicular(ray)


def directions_at(orbits: Orbits, vehicles: Index, boresights: Array, tau: Array) -> Array:
    """Return the unit vectors (p, k, 2) along the boresights (p,) rad at tau (p, k) rad."""
    axes, senses = _axes(orbits, vehicles, boresights), orbits.senses[vehicles]
    return unit(axes[:, None] + senses[:, None] * tau)


def _axes(orbits: Orbits, vehicles: Index, boresights: Array) -> Array:
    """(p,) rad: where the sensors look at time 0."""
    return np.asarray(heading(orbits, 0.0)[vehicles] + boresights)
