"""Contact windows: exactly when each vehicle sees which vehicle or landmark, over one period.

The position of a target relative to its observer is D + a cos tau + b sin tau with tau = omega t,
so "within range" and "inside the field of view" change sign only at roots of trigonometric
polynomials of degree two. Between two neighbouring roots nothing changes, so one look at the
midpoint classifies each interval: that settles fields of view over 180 degrees, contact that
never ends, and polynomials that vanish identically.

    range                 |q|^2 - r^2 = 0
    edge of the view      q x e(heading + boresight +- fov / 2) = 0
    obstacles             see sight_lines

For two vehicles of one sense, and for landmarks, second harmonics vanish identically.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index, short_repr
from syncplan.orbits.circles import Orbits, cross, dot
from syncplan.orbits.paths import NO_LANDMARKS, RelativeMotion, directions_at, rays, relative_motion
from syncplan.orbits.sight_lines import SightLines
from syncplan.orbits.team import Team
from syncplan.orbits.trigonometric_polynomials import real_roots

SMALLEST_STEP_RAD = 1e-11
"""Roots nearer than this count as one."""

BOUNDARY_SLACK = 1e-12
"""Relative slack of range and field of view, so that a contact exactly at its limit counts."""

_BESIDE = 0.618
"""Share of an interval at which obstacles are looked at besides its middle."""

DENSE_LIMIT = 500
"""Up to this many bodies all pairs are tried; above, a k-d tree proposes them."""


@dataclass(frozen=True, slots=True, repr=False)
class Windows:
    """When each of p directed pairs is in contact, over one period T.

    Attributes
    ----------
    observers : (p,) index of the vehicle that sees
    targets : (p,) index of what it sees; n and above are landmarks
    first : (p + 1,) windows of pair k are first[k] to first[k + 1]
    starts, ends : (w,) s; starts in [0, T), ends may pass T, permanent contact is [0, T]
    """

    observers: Index
    targets: Index
    first: Index
    starts: Array
    ends: Array

    __repr__ = short_repr

    def of(self, pair: int) -> Array:
        """Return the (k, 2) windows in s of one pair."""
        chosen = slice(self.first[pair], self.first[pair + 1])
        return np.column_stack([self.starts[chosen], self.ends[chosen]])


def range_polynomial(motion: RelativeMotion, ranges: Array | float = 0.0) -> Array:
    """Return the (p, 5) coefficients of |q|^2 - range^2 in m^2."""
    offset, cosine, sine = motion.offset, motion.cosine, motion.sine
    cosine2, sine2 = dot(cosine, cosine), dot(sine, sine)
    harmonic = ~motion.circular
    return np.column_stack(
        [
            dot(offset, offset) + 0.5 * (cosine2 + sine2) - np.square(ranges),
            2.0 * dot(offset, cosine),
            2.0 * dot(offset, sine),
            0.5 * (cosine2 - sine2) * harmonic,
            dot(cosine, sine) * harmonic,
        ]
    )


def _edge_polynomial(motion: RelativeMotion, ray: Array, turned: Array) -> Array:
    """(p, 5) coefficients of q x (ray cos tau + turned sin tau): zero where q is on that line."""
    cosine_ray, sine_turned = cross(motion.cosine, ray), cross(motion.sine, turned)
    harmonic = ~motion.circular
    return np.column_stack(
        [
            0.5 * (cosine_ray + sine_turned),
            cross(motion.offset, ray),
            cross(motion.offset, turned),
            0.5 * (cosine_ray - sine_turned) * harmonic,
            0.5 * (cross(motion.cosine, turned) + cross(motion.sine, ray)) * harmonic,
        ]
    )


def reachable_pairs(
    orbits: Orbits, reach: Array, landmarks: Array = NO_LANDMARKS
) -> tuple[Index, Index]:
    """Return directed pairs (observer, target) whose circles come within the observer's reach.

    `reach` is (n,) in m. The circles' least distance is D - R_i - R_j outside each other and
    |R_i - R_j| - D where one holds the other; landmarks are circles of radius zero.
    """
    n = orbits.count
    centers = np.concatenate([orbits.centers, landmarks.reshape(-1, 2)])
    radii = np.concatenate([orbits.radii, np.zeros(len(landmarks))])
    if len(centers) <= DENSE_LIMIT:
        a, b = (index.ravel() for index in np.indices((n, len(centers))))
    else:
        furthest = float(np.max(reach + radii[:n]) + radii.max())
        a, b = _neighbours(orbits, centers, furthest * (1.0 + BOUNDARY_SLACK))
    distance = np.hypot(*(centers[b] - centers[a]).T)
    gap = np.maximum(distance - radii[a] - radii[b], np.abs(radii[a] - radii[b]) - distance)
    near = (a != b) & (gap <= reach[a] * (1.0 + BOUNDARY_SLACK))
    return a[near], b[near]


def _neighbours(orbits: Orbits, centers: Array, radius: float) -> tuple[Index, Index]:
    from scipy.spatial import cKDTree

    tree = cKDTree(centers)
    pairs = tree.query_pairs(radius, output_type="ndarray").astype(np.int64)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    both = both[both[:, 0] < orbits.count]
    order = np.lexsort((both[:, 1], both[:, 0]))
    return both[order, 0], both[order, 1]


@dataclass(frozen=True, slots=True)
class _DirectedPairs:
    """The directed pairs (p,) whose contact is asked for, how they move and what may be between."""

    team: Team
    observers: Index
    targets: Index
    motion: RelativeMotion
    lines: SightLines | None

    @classmethod
    def of(cls, team: Team, observers: Index, targets: Index) -> "_DirectedPairs":
        motion = relative_motion(team.orbits, observers, targets, team.landmarks)
        lines = SightLines.of(team, observers, targets) if team.obstacles else None
        return cls(team, observers, targets, motion, lines)

    def seen_between(self, tau: Array, beside: Array) -> Flags:
        """(p, k) whether each observer sees its target in intervals that hold no root.

        Both (p, k) rad are within the interval. An end that touches a wall from inside is free for
        that instant, so sight has to be free at both.
        """
        sensors, observers = self.team.sensors, self.observers
        q = self.motion.at(tau)
        distance = np.hypot(q[..., 0], q[..., 1])
        seen = distance <= sensors.ranges[observers, None] * (1.0 + BOUNDARY_SLACK)
        half = 0.5 * sensors.fields_of_view[observers]
        limited = half < np.pi
        if limited.any():
            view = directions_at(self.team.orbits, observers, sensors.boresights[observers], tau)
            within = dot(q, view) >= (np.cos(half)[:, None] - BOUNDARY_SLACK) * distance
            seen &= ~limited[:, None] | within
        if self.lines is not None:
            seen &= ~self.lines.blocked(tau, seen)
            seen &= ~self.lines.blocked(beside, seen)
        return np.asarray(seen)


def find_windows(team: Team, pairs: tuple[Index, Index] | None = None) -> Windows:
    """Return a team's exact contact windows: of all directed pairs that can come within range.

    `pairs` restricts the search to given (observers, targets). Boundaries are good to about
    1e-15 times the polynomial's size over its slope there: below 1e-9 s unless the crossing is
    nearly tangent. A window shorter than about 1e-7 of a period, opened by such a near-tangency,
    may be absent. The same holds for the edges that obstacles make.
    """
    if pairs is None:
        pairs = reachable_pairs(team.orbits, team.sensors.ranges, team.landmarks)
    asked = _DirectedPairs.of(team, *pairs)
    return _classified(asked, _splits(asked))


def _splits(asked: _DirectedPairs) -> Array:
    """(p, k) sorted angles where a contact may begin or end; infinite where there are fewer."""
    orbits, sensors, motion, a = (
        asked.team.orbits,
        asked.team.sensors,
        asked.motion,
        asked.observers,
    )
    columns = [_range_roots(motion, sensors.ranges, a, asked.targets)]
    half = 0.5 * sensors.fields_of_view[a]
    start = motion.offset + motion.cosine
    reached = np.isfinite(columns[0]).any(axis=1)
    reached |= np.hypot(start[:, 0], start[:, 1]) <= sensors.ranges[a] * (1.0 + BOUNDARY_SLACK)
    limited = np.flatnonzero((half < np.pi) & reached)
    if len(limited):
        part = motion.only(limited)
        who = a[limited]
        for side in (-1.0, 1.0):
            edges = np.full((len(a), 4), np.nan)
            edge = rays(orbits, who, sensors.boresights[who], side * half[limited])
            edges[limited] = real_roots(_edge_polynomial(part, *edge))
            columns.append(edges)
    if asked.lines is not None:
        columns.append(asked.lines.roots())
    splits = np.concatenate(columns, axis=1)
    splits[np.isnan(splits)] = np.inf
    splits.sort(axis=1)
    with np.errstate(invalid="ignore"):
        repeated = np.diff(splits, axis=1, prepend=-1.0) < SMALLEST_STEP_RAD
    repeated |= np.isfinite(splits) & (splits > splits[:, :1] + 2.0 * np.pi - SMALLEST_STEP_RAD)
    splits[repeated] = np.inf
    splits.sort(axis=1)
    return splits


def _range_roots(motion: RelativeMotion, ranges: Array, a: Index, b: Index) -> Array:
    """(p, 4) roots of the range polynomials, once for both ways of a pair of equal ranges."""
    count = len(ranges)
    vehicle = b < count
    shared = vehicle & (ranges[a] == ranges[np.where(vehicle, b, a)])
    both_ways = np.minimum(a, b) * count + np.maximum(a, b)
    key = np.where(shared, both_ways, -1 - np.arange(len(a)))
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    polynomials = range_polynomial(motion, ranges[a])[first]
    return real_roots(polynomials)[inverse]


def _classified(asked: _DirectedPairs, splits: Array) -> Windows:
    """Windows from the class of each interval between neighbouring splits (cyclic)."""
    rate = asked.team.orbits.rate
    rows, columns = splits.shape
    real = np.isfinite(splits)
    count = real.sum(axis=1)
    following = np.column_stack([splits[:, 1:], np.full(rows, np.inf)])
    last = np.arange(columns) == count[:, None] - 1
    following = np.where(last, splits[:, :1] + 2.0 * np.pi, following)
    begin = np.where(real, splits, 0.0)
    middle = np.where(real, 0.5 * (begin + following), 0.0)
    middle[~np.isfinite(middle)] = 0.0
    beside = np.where(real, _BESIDE * begin + (1.0 - _BESIDE) * following, _BESIDE)
    beside[~np.isfinite(beside)] = _BESIDE
    seen = asked.seen_between(middle, beside)
    always = (seen | ~real).all(axis=1) & np.where(count == 0, seen[:, 0], True)
    seen &= real
    before = np.column_stack([np.zeros(rows, dtype=bool), seen[:, :-1]])
    wrap_index = np.maximum(count - 1, 0)
    before[:, 0] = seen[np.arange(rows), wrap_index]
    opens = seen & ~before & ~always[:, None]
    closes = real & ~seen & before & ~always[:, None]
    number = opens.sum(axis=1)
    starts, ends = splits[opens], splits[closes]
    ends = _paired_ends(starts, ends, number)
    first = np.concatenate([[0], np.cumsum(number + always)])
    row = np.concatenate([np.repeat(np.arange(rows), number), np.flatnonzero(always)])
    order = np.argsort(row, kind="stable")
    starts = np.concatenate([starts, np.zeros(always.sum())])[order] / rate
    ends = np.concatenate([ends, np.full(always.sum(), 2.0 * np.pi)])[order] / rate
    return Windows(asked.observers, asked.targets, first, starts, ends)


def _paired_ends(starts: Array, ends: Array, number: Index) -> Array:
    """The end that follows each start: a pair's first end may belong to its last start."""
    first = np.concatenate([[0], np.cumsum(number)])[:-1]
    pair = np.repeat(np.arange(len(number)), number)
    occupied = number > 0
    rolls = np.zeros(len(number), dtype=bool)
    rolls[occupied] = ends[first[occupied]] < starts[first[occupied]]
    position = np.arange(len(starts)) - first[pair]
    shifted = position + rolls[pair]
    wraps = shifted >= number[pair]
    source = first[pair] + np.where(wraps, 0, shifted)
    return np.asarray(ends[source] + np.where(wraps, 2.0 * np.pi, 0.0))


def merge_windows(windows: Array, period: float) -> Array:
    """Return the union of (k, 2) cyclic windows as disjoint ones, starts in [0, period)."""
    if len(windows) == 0:
        return windows.reshape(0, 2)
    ordered = windows[np.argsort(windows[:, 0], kind="stable")]
    merged = [list(ordered[0])]
    for start, end in ordered[1:]:
        if start <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], end)
        else:
            merged.append([start, end])
    while len(merged) > 1 and merged[-1][1] >= merged[0][0] + period:
        merged[-1][1] = max(merged[-1][1], merged[0][1] + period)
        del merged[0]
    if len(merged) == 1 and merged[0][1] - merged[0][0] >= period:
        return np.array([[0.0, period]])
    return np.array(merged)
