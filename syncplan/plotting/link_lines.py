"""Where a map draws a link: from rim to rim, and never through a name.

( v1 )-------( v2 )        apart: along the line of centres
( v1 (=) v2 )              overlapping a little: the same, within the lens
( v1 X v2 )                overlapping so far that this would cross a centre: where the rims meet
( v1 ( v2 )-)              one inside the other: where the rims are nearest
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import Orbits, perpendicular
from syncplan.planning.planner import Plan

_LENS = 1.25
"""Least distance of centres, in radii of the larger circle, at which a line fits into the lens."""


def link_pairs(plan: Plan) -> Index:
    """Return the bodies (k, 2) that links join: listed, incidental, to landmarks, dropped."""
    met = [*plan.links, *plan.incidental_links, *plan.landmark_links]
    joined = [(item.a, item.b) for item in met]
    joined += [(item.a, item.b) for item in plan.dropped_links]
    return np.array(joined, dtype=np.int64).reshape(-1, 2)


def link_ends(orbits: Orbits, landmarks: Array, pairs: Index) -> tuple[Array, Array]:
    """Return both ends (k, 2) m of the lines of links between bodies (k, 2), on their rims.

    A landmark has no rim but itself. Where rims meet, the ends may be one point.
    """
    bodies = np.concatenate([orbits.centers, landmarks.reshape(-1, 2)])
    reach = np.concatenate([orbits.radii, np.zeros(len(bodies) - orbits.count)])
    a, b = pairs[:, 0], pairs[:, 1]
    away = bodies[b] - bodies[a]
    apart = np.hypot(away[:, 0], away[:, 1])
    one = apart > 1e-9 * np.maximum(np.maximum(reach[a], reach[b]), 1e-300)
    ahead = np.where(one[:, None], away / np.where(one, apart, 1.0)[:, None], [1.0, 0.0])
    start = bodies[a] + reach[a, None] * ahead
    end = bodies[b] - reach[b, None] * ahead
    larger = np.maximum(reach[a], reach[b])
    within = apart <= np.abs(reach[a] - reach[b])
    # inside each other: both rims on the side where they are nearest
    side = np.where(reach[a] >= reach[b], 1.0, -1.0)[:, None] * ahead
    start = np.where(within[:, None], bodies[a] + reach[a, None] * side, start)
    end = np.where(within[:, None], bodies[b] + reach[b, None] * side, end)
    crossing = ~within & (apart < np.minimum(_LENS * larger, reach[a] + reach[b]))
    meeting = bodies[a] + _rims_meet(apart, reach[a], reach[b], ahead)
    start = np.where(crossing[:, None], meeting, start)
    end = np.where(crossing[:, None], meeting, end)
    return start, end


def _rims_meet(apart: Array, own: Array, other: Array, ahead: Array) -> Array:
    """Where two circles cross, from the first's centre: left of the way to the second's."""
    far = np.where(apart > 0.0, apart, 1.0)
    along = (far**2 + own**2 - other**2) / (2.0 * far)
    across = np.sqrt(np.maximum(own**2 - along**2, 0.0))
    return np.asarray(along[:, None] * ahead + across[:, None] * perpendicular(ahead))
