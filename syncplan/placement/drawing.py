"""A drawing of circles, measured: what it attains of its demands, and what it misses.

    gap = D - R_a - R_b             of two circles: the least distance their vehicles can come to
    off = |D - R|                   of a circle and a landmark
    clearance                       of a circle in an area, see syncplan.scenario.areas

All is computed here in NumPy from the centres; nothing rests on a solver's word.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index, as_pairs
from syncplan.orbits.contacts import outer_gaps
from syncplan.placement.demands import Demands


@dataclass(frozen=True, slots=True)
class Shortfalls:
    """By how much a drawing misses its demands, in m; zero where it meets them.

    Attributes
    ----------
    links : (e,) gap beyond the largest
    pairs : (p, 2) circles nearer than the least gap
    gaps : (p,) m, how much nearer
    landmarks : (k,) of each row of the drawing's `sightings`
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


@dataclass(frozen=True, slots=True)
class Drawing:
    """Centres of n circles, and what they attain.

    Attributes
    ----------
    demands : on the drawing
    centers : (n, 2) m
    link_gaps : (e,) m, gap of the circles of each link
    sightings : (k, 2) vehicle and landmark: for each component the two it sights most easily
    sighted_from : (k,) m, distance of that vehicle's centre from the landmark
    missed : by how much the demands are missed
    starts, rounds : layouts tried and convex problems solved for it; 0 for closed forms
    """

    demands: Demands
    centers: Array
    link_gaps: Array
    sightings: Index
    sighted_from: Array
    missed: Shortfalls
    starts: int = 0
    rounds: int = 0


def draw(demands: Demands, centers: Array) -> Drawing:
    """Return the drawing with these (n, 2) centres in m."""
    a, b = np.triu_indices(demands.count, 1)
    every = np.column_stack([a, b])
    missing = demands.least - outer_gaps(centers, demands.radii, every)
    near = missing > 0.0
    sightings = _sightings(demands, centers)
    vehicle, landmark = sightings.T
    away = np.hypot(*(centers[vehicle] - demands.landmarks[landmark]).T)
    off = np.abs(away - demands.radii[vehicle])
    gaps = outer_gaps(centers, demands.radii, demands.links)
    clear = demands.area.clearances(centers, demands.radii) if demands.area.limited else None
    missed = Shortfalls(
        links=np.maximum(gaps - demands.most, 0.0),
        pairs=every[near],
        gaps=missing[near],
        landmarks=np.maximum(off - demands.sight[vehicle], 0.0),
        area=np.zeros(demands.count) if clear is None else np.maximum(-clear, 0.0),
    )
    return Drawing(demands, centers, gaps, sightings, away, missed)


def _sightings(demands: Demands, centers: Array) -> Index:
    """(k, 2) of vehicle and landmark: for each component the two it sights most easily."""
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
