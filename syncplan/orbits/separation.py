"""Least distances: of two circles, of two vehicles on them, and of the nearest pair of a team."""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import Orbits
from syncplan.orbits.contacts import (
    DENSE_LIMIT,
    range_polynomial,
    reachable_pairs,
)
from syncplan.orbits.paths import RelativeMotion, relative_motion
from syncplan.orbits.trigonometric_polynomials import derivative, real_roots


def outer_gaps(centers: Array, radii: Array, pairs: Index) -> Array:
    """Return (p,) m: D - R_a - R_b of each pair, negative where they cross or one holds the other.

    `centers` are (n, 2) m, `radii` (n,) m.
    """
    a, b = pairs[:, 0], pairs[:, 1]
    return np.asarray(np.hypot(*(centers[a] - centers[b]).T) - radii[a] - radii[b])


def circle_gaps(centers: Array, radii: Array, pairs: Index) -> Array:
    """Return (p,) m: the least distance of points on the two circles; negative where they cross.

    The larger of D - R_a - R_b, side by side, and |R_a - R_b| - D, one within the other.
    """
    distance = np.hypot(*(centers[pairs[:, 0]] - centers[pairs[:, 1]]).T)
    return least_circle_gaps((distance, distance), (radii, radii), pairs)


def least_circle_gaps(
    distances: tuple[Array, Array], radii: tuple[Array, Array], pairs: Index
) -> Array:
    """Return (p,) m that no gap is below while distances and radii stay within their limits.

    `distances` are the least and largest (p,) m of the centres of each pair, `radii` the least
    and largest (n,) m of the circles.
    """
    (near, far), (small, large), (a, b) = distances, radii, pairs.T
    within = np.maximum(small[a] - large[b], small[b] - large[a]) - far
    return np.asarray(np.maximum(near - large[a] - large[b], within))


def landmark_gaps(centers: Array, radii: Array, landmarks: Array) -> Array:
    """Return (n, m) m: how near each circle's path comes to each of (m, 2) landmarks.

    ||c - L| - R|, once in every turn, whether the landmark lies within the circle or outside.
    """
    away = np.hypot(*(centers[:, None] - landmarks[None]).T).T
    return np.asarray(np.abs(away - radii[:, None]))


@dataclass(frozen=True, slots=True)
class Approach:
    """The nearest meeting of a pair: `distance` m at `time` s, between vehicles `a` and `b`."""

    a: int
    b: int
    distance: float
    time: float


def least_distances(motion: RelativeMotion) -> tuple[Array, Array]:
    """Return the least distance (p,) in m of each pair over a turn, and the angle tau (p,) of it.

    The candidates are the roots of d|q|^2/dtau; a pair at constant distance has none and is
    read at tau = 0.
    """
    slope = derivative(range_polynomial(motion))
    tau = np.concatenate([real_roots(slope), np.zeros((len(slope), 1))], axis=1)
    tau = np.where(np.isnan(tau), 0.0, tau)
    q = motion.at(tau)
    distance = np.hypot(q[..., 0], q[..., 1])
    nearest = np.argmin(distance, axis=1)
    rows = np.arange(len(tau))
    return distance[rows, nearest], tau[rows, nearest]


def closest_approach(orbits: Orbits) -> Approach | None:
    """Return the closest approach over all pairs of vehicles, or None for a single vehicle.

    Exact without trying all pairs: the neighbours' least distance bounds the answer, and only
    pairs whose circles come nearer than that can beat it.
    """
    if orbits.count < 2:
        return None
    a, b = _neighbour_pairs(orbits)
    a, b = np.minimum(a, b), np.maximum(a, b)
    bound, tau = least_distances(relative_motion(orbits, a, b))
    nearest = int(np.argmin(bound))
    rivals = pairs_nearer_than(orbits, float(bound[nearest]))
    if rivals:
        return rivals[0]
    return Approach(
        int(a[nearest]), int(b[nearest]), float(bound[nearest]), float(tau[nearest] / orbits.rate)
    )


def pairs_nearer_than(orbits: Orbits, distance: float) -> list[Approach]:
    """Return every pair of vehicles that comes as near as `distance` m, nearest first."""
    a, b = reachable_pairs(orbits, np.full(orbits.count, distance))
    a, b = a[a < b], b[a < b]
    least, tau = least_distances(relative_motion(orbits, a, b))
    order = np.argsort(least, kind="stable")
    return [
        Approach(int(a[k]), int(b[k]), float(least[k]), float(tau[k] / orbits.rate))
        for k in order
        if least[k] <= distance
    ]


def _neighbour_pairs(orbits: Orbits) -> tuple[Index, Index]:
    """Each vehicle with the one whose centre is nearest."""
    if orbits.count <= DENSE_LIMIT:
        distance = np.hypot(*(orbits.centers[:, None] - orbits.centers[None]).T)
        np.fill_diagonal(distance, np.inf)
        return np.arange(orbits.count), np.argmin(distance, axis=1)
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(orbits.centers).query(orbits.centers, k=2)
    own = np.arange(orbits.count)
    return own, np.where(nearest[:, 0] == own, nearest[:, 1], nearest[:, 0])
