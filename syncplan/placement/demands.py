"""Demands on a drawing of circles: who must come within range, who must keep clear, by how much.

    gap = D - R_a - R_b             of two circles: the least distance their vehicles can come to
    off = |D - R|                   of a circle and a landmark
    clearance                       of a circle in an area, see syncplan.scenario.areas

All is recomputed here in NumPy; nothing rests on a solver's word.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.orbits.separation import outer_gaps
from syncplan.scenario.areas import Area

__all__ = ["Demands", "Shortfalls", "others", "shortfalls", "sightings"]


@dataclass(frozen=True, slots=True)
class Demands:
    """What n circles must fulfil, and what they had better; lengths in m.

    Attributes
    ----------
    radii : (n,)
    links : (e, 2) pairs a < b that must come within range
    least : least gap of any two circles
    most : (e,) largest gap of each link
    wanted : (e,) gap of each link aimed for
    apart : gap of unlinked circles aimed for at least
    landmarks : (m, 2)
    sight : (n,) largest distance off its circle at which a vehicle serves a landmark
    groups : connected components of the links; each is to sight two landmarks, or the only one
    area : where the circles may lie
    """

    radii: Array
    links: Index
    least: float
    most: Array
    wanted: Array
    apart: float
    landmarks: Array
    sight: Array
    groups: tuple[Index, ...]
    area: Area

    @property
    def count(self) -> int:
        """Number of circles."""
        return len(self.radii)

    @property
    def unit(self) -> float:
        """Typical distance of two linked centres in m."""
        return 2.0 * float(np.mean(self.radii)) + float(
            np.mean(self.wanted) if len(self.wanted) else self.apart
        )


@dataclass(frozen=True, slots=True)
class Shortfalls:
    """By how much a drawing misses its demands, in m; zero where it meets them.

    Attributes
    ----------
    links : (e,) gap beyond the largest
    pairs : (p, 2) circles nearer than the least gap
    gaps : (p,) m, how much nearer
    landmarks : (k,) of each row of `sightings`
    area : (n,)
    """

    links: Array
    pairs: Index
    gaps: Array
    landmarks: Array
    area: Array

    @property
    def total(self) -> float:
        """Sum of all in m."""
        return float(self.links.sum() + self.gaps.sum() + self.landmarks.sum() + self.area.sum())


def others(count: int, links: Index) -> Index:
    """Return the (p, 2) pairs a < b that are not linked."""
    a, b = np.triu_indices(count, 1)
    linked = np.zeros((count, count), dtype=bool)
    linked[links[:, 0], links[:, 1]] = True
    free = ~linked[a, b]
    return np.column_stack([a[free], b[free]])


def sightings(demands: Demands, centers: Array) -> Index:
    """Return (k, 2) of vehicle and landmark: for each component the two it sights most easily."""
    chosen = []
    needed = min(2, len(demands.landmarks))
    for group in demands.groups if needed else ():
        away = np.hypot(*(centers[group][:, None] - demands.landmarks[None]).transpose(2, 0, 1))
        off = away - demands.radii[group][:, None]
        sight = demands.sight[group][:, None]
        cost = np.maximum(np.abs(off) - sight, 0.0) + 0.01 * np.abs(off - 0.5 * sight)
        nearest = np.argmin(cost, axis=0)
        best = cost[nearest, np.arange(len(demands.landmarks))]
        for landmark in np.sort(np.argsort(best, kind="stable")[:needed]):
            chosen.append((int(group[nearest[landmark]]), int(landmark)))
    return as_pairs(chosen)


def shortfalls(demands: Demands, centers: Array) -> Shortfalls:
    """Return by how much the drawing with these (n, 2) centres misses its demands."""
    a, b = np.triu_indices(demands.count, 1)
    every = np.column_stack([a, b])
    missing = demands.least - outer_gaps(centers, demands.radii, every)
    near = missing > 0.0
    vehicle, landmark = sightings(demands, centers).T
    away = np.hypot(*(centers[vehicle] - demands.landmarks[landmark]).T)
    off = np.abs(away - demands.radii[vehicle])
    clear = demands.area.clearances(centers, demands.radii) if demands.area.limited else None
    return Shortfalls(
        links=np.maximum(outer_gaps(centers, demands.radii, demands.links) - demands.most, 0.0),
        pairs=every[near],
        gaps=missing[near],
        landmarks=np.maximum(off - demands.sight[vehicle], 0.0),
        area=np.zeros(demands.count) if clear is None else np.maximum(-clear, 0.0),
    )
