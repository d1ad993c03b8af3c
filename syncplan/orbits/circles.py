"""Circular orbits: where every vehicle is, where it heads, and how an initial error is carried."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from syncplan.arrays import Array, Index, short_repr


@dataclass(frozen=True, slots=True, repr=False)
class Orbits:
    """Synchronised circular orbits of n vehicles.

    Attributes
    ----------
    centers : (n, 2) m
    radii : (n,) m
    senses : (n,) +1 counter-clockwise, -1 clockwise
    phases : (n,) rad, angle from +x about the centre at time 0
    rate : rad/s, common to all
    """

    centers: Array
    radii: Array
    senses: Array
    phases: Array
    rate: float

    __repr__ = short_repr

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return len(self.radii)

    @property
    def period(self) -> float:
        """Time of one turn in seconds, 2 pi / rate."""
        return 2.0 * np.pi / self.rate

    @property
    def speeds(self) -> Array:
        """(n,) speed of each vehicle in m/s, rate times radius."""
        return self.rate * self.radii

    @property
    def turn_rates(self) -> Array:
        """(n,) signed turn rate of each vehicle in rad/s."""
        return self.rate * self.senses

    def only(self, vehicles: Index) -> "Orbits":
        """Return the orbits of the vehicles (k,), in that order; a vehicle may stand twice."""
        names = ("centers", "radii", "senses", "phases")
        return replace(self, **{name: getattr(self, name)[vehicles] for name in names})


def unit(angle: ArrayLike) -> Array:
    """Return the unit vectors e(angle), shape (..., 2)."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def perpendicular(vector: Array) -> Array:
    """Return the vectors turned a quarter turn counter-clockwise, shape (..., 2)."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products (...) of vectors (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1])


def cross(a: Array, b: Array) -> Array:
    """Return (...) how far vectors b turn counter-clockwise from a, |a| |b| sin; both (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def turned(vectors: Array, angle: float) -> Array:
    """Return the vectors (..., 2) turned counter-clockwise by `angle` rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(vectors @ np.array([[c, s], [-s, c]]))


def wrap(angle: ArrayLike) -> Array:
    """Return the angles brought into [-pi, pi), in rad."""
    return np.asarray((np.asarray(angle, dtype=float) + np.pi) % (2.0 * np.pi) - np.pi)


def phase(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n) phase angles in rad at `time` s, phi_i + d_i omega t."""
    t = np.asarray(time, dtype=float)[..., None]
    return np.asarray(orbits.phases + orbits.senses * orbits.rate * t)


def position(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n, 2) positions in m at `time` s."""
    return np.asarray(orbits.centers + orbits.radii[:, None] * unit(phase(orbits, time)))


def heading(orbits: Orbits, time: ArrayLike) -> Array:
    """Return the (..., n) headings in rad at `time` s: phase plus a quarter turn in the sense."""
    return np.asarray(phase(orbits, time) + orbits.senses * np.pi / 2.0)


def transition(orbits: Orbits, time: float, start: float = 0.0) -> Array:
    """Return the (n, 3, 3) error transition matrices of (x, y, heading) from `start` to `time`.

    An initial heading error turns the path about its start, so the matrix is
    [[1, 0, -(y(t) - y(t0))], [0, 1, x(t) - x(t0)], [0, 0, 1]]: closed form, no products.
    """
    matrices = np.tile(np.eye(3), (orbits.count, 1, 1))
    moved = position(orbits, time) - position(orbits, start)
    matrices[:, :2, 2] = perpendicular(moved)
    return matrices
