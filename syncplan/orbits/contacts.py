"""Contacts: exact windows in which vehicles see vehicles or landmarks, and least distances.

The position of a target relative to its observer is D + a cos tau + b sin tau with tau = omega t,
so "within range" and "inside the field of view" change sign only at roots of trigonometric
polynomials of degree two. Between two neighbouring roots nothing changes, so one look at the
midpoint classifies each interval: that settles fields of view over 180 degrees, contact that
never ends, and polynomials that vanish identically.

    range                 |q|^2 - r^2 = 0
    edge of the view      q x e(heading + boresight +- fov / 2) = 0
    obstacles             see sight_lines

For two vehicles of one sense, and for landmarks, second harmonics vanish identically. The least
distance of two bodies lies at a root of the derivative of the first.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index, short_repr
from syncplan.orbits.circles import (
    NO_LANDMARKS,
    Orbits,
    RelativeMotion,
    cross,
    derivative,
    directions_at,
    dot,
    rays,
    real_roots,
    relative_motion,
)
from syncplan.orbits.sight_lines import SightLines
from syncplan.orbits.team import Team

SMALLEST_STEP_RAD = 1e-11
"""Angle below which two roots count as one."""

BOUNDARY_SLACK = 1e-12
"""Relative slack of range and field of view, so that a contact exactly at its limit counts."""

_BESIDE = 0.618
"""Share of an interval, from its end, at which obstacles are checked besides at its middle."""

DENSE_LIMIT = 500
"""Most bodies for which all pairs are tried; above that, a k-d tree proposes them."""


@dataclass(frozen=True, slots=True, repr=False)
class Windows:
    """Contact windows of p directed pairs over one period T.

    Attributes
    ----------
    observers : (p,) index of the vehicle that sees
    targets : (p,) index of the body that it sees; n and above are landmarks
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
    |R_i - R_j| - D where one contains the other; landmarks are circles of radius zero.
    """
    n = orbits.count
    centers = np.concatenate([orbits.centers, landmarks.reshape(-1, 2)])
    radii = np.concatenate([orbits.radii, np.zeros(len(landmarks))])
    if len(centers) <= DENSE_LIMIT:
        a, b = (index.ravel() for index in np.indices((n, len(centers))))
    else:
        furthest = (reach + radii[:n] + radii.max()) * (1.0 + BOUNDARY_SLACK)
        a, b = _neighbours(centers, furthest)
    distance = np.hypot(*(centers[b] - centers[a]).T)
    gap = np.maximum(distance - radii[a] - radii[b], np.abs(radii[a] - radii[b]) - distance)
    near = (a != b) & (gap <= reach[a] * (1.0 + BOUNDARY_SLACK))
    return a[near], b[near]


def _neighbours(centers: Array, furthest: Array) -> tuple[Index, Index]:
    """Pairs of each of the first n centres, itself included, with those within `furthest` (n,)."""
    from scipy.spatial import cKDTree

    n = len(furthest)
    near = cKDTree(centers).query_ball_point(centers[:n], furthest, return_sorted=True)
    return np.repeat(np.arange(n), [len(one) for one in near]), np.concatenate(near).astype(int)


@dataclass(frozen=True, slots=True)
class _DirectedPairs:
    """Directed pairs (p,) whose contacts are requested, with their motion and sight lines."""

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
        """(p, k) whether each observer sees its target in intervals that contain no root.

        `tau` and `beside`, both (p, k) rad, lie within the interval. An end that touches a wall
        from inside is free for that instant, so sight has to be free at both.
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
    """Return a team's exact contact windows, by default of all pairs that can come within range.

    `pairs` restricts the search to given (observers, targets). Boundaries are accurate to about
    1e-15 times the polynomial's size over its slope there: below 1e-9 s unless the crossing is
    nearly tangent. A window shorter than about 1e-7 of a period, opened by such a near-tangency,
    may be absent. The same holds for boundaries due to obstacles.
    """
    if pairs is None:
        pairs = reachable_pairs(team.orbits, team.sensors.ranges, team.landmarks)
    asked = _DirectedPairs.of(team, *pairs)
    return _classified(asked, _splits(asked))


def met_pairs(team: Team, windows: Windows) -> set[tuple[int, int]]:
    """Return the vehicle pairs (a < b) in contact at some time, either way."""
    met = (np.diff(windows.first) > 0) & (windows.targets < team.count)
    a, b = windows.observers[met], windows.targets[met]
    return set(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist(), strict=True))


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
    """(p, 4) roots of the range polynomials, one set for both directions if ranges are equal."""
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
    """Ends that follow each start: a pair's first end may belong to its last start."""
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


# --- least distances ----------------------------------------------------------------------------


def outer_gaps(centers: Array, radii: Array, pairs: Index) -> Array:
    """Return D - R_a - R_b (p,) in m, negative where circles cross or one contains the other.

    `centers` are (n, 2) m, `radii` (n,) m.
    """
    a, b = pairs[:, 0], pairs[:, 1]
    return np.asarray(np.hypot(*(centers[a] - centers[b]).T) - radii[a] - radii[b])


def close_pairs(centers: Array, radii: Array, gap: float) -> Index:
    """Return pairs (p, 2), a < b, among them all whose outer gap is at most `gap` m, in order.

    Of up to DENSE_LIMIT circles, these are all pairs.
    """
    if len(centers) <= DENSE_LIMIT:
        return np.column_stack(np.triu_indices(len(centers), 1))
    furthest = np.maximum(gap + radii + radii.max(), 0.0) * (1.0 + BOUNDARY_SLACK)
    a, b = _neighbours(centers, furthest)
    return np.column_stack([a[a < b], b[a < b]])


def smallest_outer_gap(centers: Array, radii: Array) -> float:
    """Return the least D - R_a - R_b in m of any two circles; infinite for one circle."""
    if len(centers) < 2:
        return np.inf
    nearest = np.column_stack(_neighbour_pairs(centers))
    bound = float(outer_gaps(centers, radii, nearest).min())
    return float(outer_gaps(centers, radii, close_pairs(centers, radii, bound)).min(initial=bound))


def circle_gaps(centers: Array, radii: Array, pairs: Index) -> Array:
    """Return the least distance (p,) in m between the circles of each pair; negative if they cross.

    It is the larger of D - R_a - R_b, side by side, and |R_a - R_b| - D, one within the other.
    """
    distance = np.hypot(*(centers[pairs[:, 0]] - centers[pairs[:, 1]]).T)
    return least_circle_gaps((distance, distance), (radii, radii), pairs)


def least_circle_gaps(
    distances: tuple[Array, Array], radii: tuple[Array, Array], pairs: Index
) -> Array:
    """Return lower bounds (p,) in m of the gaps, for distances and radii within their limits.

    `distances` are the least and largest (p,) m of the centres of each pair, `radii` the least
    and largest (n,) m of the circles.
    """
    (near, far), (small, large), (a, b) = distances, radii, pairs.T
    within = np.maximum(small[a] - large[b], small[b] - large[a]) - far
    return np.asarray(np.maximum(near - large[a] - large[b], within))


def landmark_gaps(centers: Array, radii: Array, landmarks: Array) -> Array:
    """Return the least distance (n, m) in m of each circle to each of the landmarks (m, 2).

    It is ||c - L| - R|, reached once in every turn, whether the landmark lies within the circle or
    outside.
    """
    away = np.hypot(*(centers[:, None] - landmarks[None]).T).T
    return np.asarray(np.abs(away - radii[:, None]))


@dataclass(frozen=True, slots=True)
class Approach:
    """Closest approach of a pair: `distance` m at `time` s, between vehicles `a` and `b`."""

    a: int
    b: int
    distance: float
    time: float


def least_distances(motion: RelativeMotion) -> tuple[Array, Array]:
    """Return the least distance (p,) in m of each pair over a turn, and its angle tau (p,).

    The candidates are the roots of d|q|^2/dtau; a pair at constant distance has none and is
    evaluated at tau = 0.
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
    a, b = _neighbour_pairs(orbits.centers)
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


def _neighbour_pairs(centers: Array) -> tuple[Index, Index]:
    """Pairs of each vehicle with the one whose centre is nearest."""
    own = np.arange(len(centers))
    if len(centers) <= DENSE_LIMIT:
        distance = np.hypot(*(centers[:, None] - centers[None]).T)
        np.fill_diagonal(distance, np.inf)
        return own, np.argmin(distance, axis=1)
    from scipy.spatial import cKDTree

    _, nearest = cKDTree(centers).query(centers, k=2)
    return own, np.where(nearest[:, 0] == own, nearest[:, 1], nearest[:, 0])
