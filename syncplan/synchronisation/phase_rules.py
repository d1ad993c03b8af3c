"""Synchronisation rules: phase difference that each link requires, and the cost of a residual.

In the time-phase theta_i = d_i phi_i both rules of the paper fix a difference:

    same sense (Theorem 4.1)      phi_b - phi_a = pi              theta_a - theta_b = pi
    opposite sense (Theorem 4.2)  phi_a + phi_b = 2 beta + pi
                                                  theta_a - theta_b = d_a (2 beta + pi)

The residual is the deviation from that difference. A link's least distance depends only on the
size of its residual.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.orbits.circles import Orbits, RelativeMotion, perpendicular, unit, wrap
from syncplan.orbits.contacts import least_distances
from syncplan.orbits.graphs import traversal


@dataclass(frozen=True, slots=True)
class Rules:
    """The rules of e links.

    Attributes
    ----------
    a, b : (e,) vehicles, a < b
    offset : (e,) rad, the theta_a - theta_b that the rule requires
    bearing : (e,) rad, beta, from the centre of a to that of b
    same : (e,) whether the two turn the same way
    distance, radius_a, radius_b : (e,) m, of the centres and the circles
    reach : (e,) m, the larger range of the two sensors
    """

    a: Index
    b: Index
    offset: Array
    bearing: Array
    same: Flags
    distance: Array
    radius_a: Array
    radius_b: Array
    reach: Array

    def __len__(self) -> int:
        return len(self.a)

    def only(self, chosen: Flags | Index) -> "Rules":
        """Return the rules of the chosen links."""
        return Rules(*(getattr(self, name)[chosen] for name in Rules.__slots__))

    def joined(self, others: "Rules") -> "Rules":
        """Return these rules followed by the others."""
        names = Rules.__slots__
        return Rules(*(np.concatenate([getattr(self, n), getattr(others, n)]) for n in names))

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Pairs (a, b)."""
        return list(zip(self.a.tolist(), self.b.tolist(), strict=True))


def rules_of(circles: Orbits, reach: Array, pairs: Index) -> Rules:
    """Return the rules of `pairs` (e, 2) at sensor ranges `reach` (n,) m, whatever the phases."""
    centers, radii, senses = circles.centers, circles.radii, circles.senses
    a, b = pairs.min(axis=1), pairs.max(axis=1)
    between = centers[b] - centers[a]
    bearing = np.arctan2(between[:, 1], between[:, 0])
    same = senses[a] == senses[b]
    return Rules(
        a=a,
        b=b,
        offset=np.where(same, np.pi, senses[a] * (2.0 * bearing + np.pi)),
        bearing=bearing,
        same=same,
        distance=np.hypot(between[:, 0], between[:, 1]),
        radius_a=radii[a],
        radius_b=radii[b],
        reach=np.maximum(reach[a], reach[b]),
    )


def residuals(rules: Rules, theta: Array) -> Array:
    """Return (e,) residuals in [-pi, pi) rad of time-phases theta (n,)."""
    return wrap(theta[rules.a] - theta[rules.b] - rules.offset)


def phase_residuals(rules: Rules, phases: Array) -> Array:
    """Return (e,) residuals in [-pi, pi) rad of phases (n,), as the theorems write them.

    phi_b - phi_a - pi for the same sense, phi_a + phi_b - 2 beta - pi for opposite senses.
    """
    first, second = phases[rules.a], phases[rules.b]
    asked = np.where(rules.same, second - first, first + second - 2.0 * rules.bearing)
    return wrap(asked - np.pi)


def along_tree(rules: Rules, count: int, residual: Array | float = 0.0) -> Array:
    """Return time-phases (n,) with given residuals (e,) along a breadth-first spanning forest."""
    forest = traversal(count, rules.edges)
    return wrap(along_forest(count, forest, rules.a, rules.offset + residual))


def along_forest(
    count: int, forest: Sequence[tuple[int, int, int]], first: Index, differences: Array
) -> Array:
    """Return time-phases (count,) with given theta_a - theta_b (e,) along a forest of links.

    `forest` is that of syncplan.orbits.graphs.traversal; `first` (e,) is the a of each link.
    """
    theta = np.zeros(count)
    for parent, child, k in forest:
        step = differences[k]
        theta[child] = theta[parent] + (-step if first[k] == parent else step)
    return theta


def closest_distance(rules: Rules, residual: Array) -> Array:
    """Return the least distances in m for residuals (e,) or (e, k) rad.

    Same sense: |D - m| with m = sqrt(Ra^2 + Rb^2 + 2 Ra Rb cos(residual)) (design of Theorem 4.1,
    with the rule at residual zero). Opposite sense and equal radii: the relative path is a
    segment through the centre, D |sin(residual / 2)| or the distance to its end. Otherwise it is
    an ellipse, and the roots of d|q|^2/dt give the least distance.
    """
    shape = residual.shape
    if len(rules) == 0:
        return residual.copy()
    table = residual.reshape(len(rules), -1)
    column = (len(rules), 1)
    distance = rules.distance.reshape(column)
    ra, rb = rules.radius_a.reshape(column), rules.radius_b.reshape(column)
    cos = np.cos(table)
    result = np.abs(distance - np.sqrt(np.maximum(ra**2 + rb**2 + 2.0 * ra * rb * cos, 0.0)))
    mirrored = ~rules.same & (rules.radius_a == rules.radius_b)
    if mirrored.any():
        result[mirrored] = _segment_distance(distance[mirrored], ra[mirrored], table[mirrored])
    oval = ~rules.same & ~mirrored
    if oval.any():
        result[oval] = _ellipse_distance(rules.only(oval), table[oval])
    return np.asarray(result.reshape(shape))


def _segment_distance(distance: Array, radius: Array, residual: Array) -> Array:
    cos, sin = np.abs(np.cos(residual / 2.0)), np.abs(np.sin(residual / 2.0))
    end = np.sqrt(distance**2 + 4.0 * radius**2 - 4.0 * radius * distance * cos)
    return np.where(distance * cos <= 2.0 * radius, distance * sin, end)


def _ellipse_distance(rules: Rules, residual: Array) -> Array:
    links, count = residual.shape
    arm_b = np.repeat(rules.radius_b, count)[:, None] * unit(np.pi + residual.ravel())
    arm_a = np.repeat(rules.radius_a, count)[:, None] * unit(np.zeros(links * count))
    distance = np.repeat(rules.distance, count)
    motion = RelativeMotion(
        offset=np.column_stack([distance, np.zeros(links * count)]),
        cosine=arm_b - arm_a,
        sine=-perpendicular(arm_b) - perpendicular(arm_a),
        circular=np.zeros(links * count, dtype=bool),
    )
    return least_distances(motion)[0].reshape(links, count)
