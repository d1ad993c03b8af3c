"""Sight lines, and the polygons that stand between an observer and its target.

Both ends of a sight line are trigonometric polynomials of degree one in tau = omega t. Whether the
open segment between them meets the interior of a polygon can change only where a corner comes to
lie on the segment, or an end of the segment on an edge.

    a corner V on the line     (p_a - V) x (p_b - V) = 0      degree two
    an end p on an edge V W    (p - V) x (W - V) = 0          degree one

Nothing changes at a corner whose two edges lie on either side of the line, nor at a hollow corner:
the segment meets the interior before and after.

The second harmonics of the first polynomial vanish identically for two vehicles of one sense and
for landmarks. A whole polynomial vanishes identically for two vehicles whose line of sight turns
about a corner; sight then changes at another root, that of the edge's other corner or of an end on
the edge.

A segment that only touches the boundary is free: it may graze a corner, run along a wall or end at
a landmark mounted on it. A segment with an end in the interior is blocked. An end that touches a
wall from inside is free for that instant, which need not be a root, so each interval between roots
is checked at two points.

Polygons are simple, concave or not. The edges cut a line into pieces, each of them inside or
outside. Crossings are counted for the line moved a hair to its left and to its right: a piece runs
through the interior where both do, which needs no special case for corners and edges on the line.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index, short_repr
from syncplan.orbits.circles import body_paths, cross, dot, real_roots
from syncplan.orbits.team import Team

BOUNDARY_SLACK = 1e-12
"""Share of the largest coordinate within which a point counts as on the boundary."""

_ROOM = 1e-6
"""Relative tolerance of roots at the end of a segment, an edge or a range."""

_MOST_AT_ONCE = 100_000
"""Most corners times sight lines that are processed together."""


@dataclass(frozen=True, slots=True, repr=False)
class SightLines:
    """Sight lines of p directed pairs of bodies, u of them regardless of direction.

    Attributes
    ----------
    line : (p,) the sight line of each pair; both directions of a pair share one
    start, end : (3, u, 2) m: offset, cosine and sine of the bodies at either end
    reach : (u,) m, the larger range of its observers
    obstacles : polygons (k, 2) m, corners in order, not closed
    near : (u, q) whether each of the q obstacles may stand in the way
    """

    line: Index
    start: Array
    end: Array
    reach: Array
    obstacles: tuple[Array, ...]
    near: Flags

    __repr__ = short_repr

    @classmethod
    def of(cls, team: Team, a: Index, b: Index) -> "SightLines":
        """Return the sight lines from vehicles a (p,) to bodies b (p,)."""
        bodies = team.count + len(team.landmarks)
        key, line = np.unique(np.minimum(a, b) * bodies + np.maximum(a, b), return_inverse=True)
        first, second = np.divmod(key, bodies)
        reach = np.zeros(len(key))
        np.maximum.at(reach, line, team.sensors.ranges[a])
        paths = np.stack(body_paths(team.orbits, team.landmarks))
        start, end = paths[:, first], paths[:, second]
        near = [_may_cross(corners, start, end) for corners in team.obstacles]
        return cls(line, start, end, reach, team.obstacles, np.array(near).T)

    def roots(self) -> Array:
        """Return (p, k) rad at which sight may be lost or regained; NaN where there are fewer."""
        rows, found = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
        for corners, near in zip(self.obstacles, self.near.T, strict=True):
            chosen = np.flatnonzero(near)
            for part in _parts(chosen, corners):
                line, tau = self._roots_at(corners, chosen[part])
                rows.append(line)
                found.append(tau)
        row, root = np.concatenate(rows), np.concatenate(found)
        order = np.argsort(row, kind="stable")
        row, root = row[order], root[order]
        count = np.bincount(row, minlength=len(self.reach))
        column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        padded = np.full((len(self.reach), int(count.max(initial=0))), np.nan)
        padded[row, column] = root
        return np.asarray(padded[self.line])

    def blocked(self, tau: Array, asked: Flags) -> Flags:
        """Return (p, k) whether an obstacle is in the way at tau (p, k) rad, where `asked`."""
        found = np.zeros(asked.shape, dtype=bool)
        for corners, near in zip(self.obstacles, self.near[self.line].T, strict=True):
            pair, column = np.nonzero(asked & near[:, None] & ~found)
            if len(pair):
                line, at = self.line[pair], tau[pair, column]
                ends = _at(self.start[:, line], at), _at(self.end[:, line], at)
                found[pair, column] = crosses_interior(corners, *ends)
        return found

    def _roots_at(self, corners: Array, lines: Index) -> tuple[Index, Array]:
        """Lines (r,) and their roots (r,) rad at one polygon, where the ends are within reach."""
        start, end = self.start[:, lines], self.end[:, lines]
        each = [_corner_roots(corners, start, end)]
        each += [_edge_roots(corners, side) for side in (start, end)]
        row, tau = (np.concatenate(parts) for parts in zip(*each, strict=True))
        away = _at(end[:, row], tau) - _at(start[:, row], tau)
        line = lines[row]
        near = np.hypot(away[:, 0], away[:, 1]) <= self.reach[line] * (1.0 + _ROOM)
        return line[near], tau[near]


def obstructible(team: Team, a: Index, b: Index) -> Flags:
    """Return (p,) whether an obstacle may come between bodies a and b (p,) at any phases."""
    if not team.obstacles:
        return np.zeros(len(a), dtype=bool)
    lines = SightLines.of(team, a, b)
    return np.asarray(lines.near[lines.line].any(axis=1))


def hidden_landmarks(team: Team) -> dict[int, int]:
    """Return the landmarks inside an obstacle, which no vehicle can see, each with its obstacle."""
    found: dict[int, int] = {}
    for number, corners in enumerate(team.obstacles):
        inside = crosses_interior(corners, team.landmarks, team.landmarks)
        for landmark in np.flatnonzero(inside).tolist():
            found.setdefault(landmark, number)
    return dict(sorted(found.items()))


def hidden_paths(team: Team) -> dict[int, int]:
    """Return the vehicles whose whole path is inside an obstacle, each with its obstacle."""
    found: dict[int, int] = {}
    orbits = team.orbits
    for number, corners in enumerate(team.obstacles):
        within = crosses_interior(corners, orbits.centers, orbits.centers)
        within &= _boundary_distance(corners, orbits.centers) > orbits.radii
        for vehicle in np.flatnonzero(within).tolist():
            found.setdefault(vehicle, number)
    return dict(sorted(found.items()))


def crosses_interior(corners: Array, start: Array, end: Array) -> Flags:
    """Return (m,) whether open segments (m, 2) to (m, 2) m meet the interior of a polygon (k, 2).

    A segment of zero length does if its point is in the interior.
    """
    parts = [_some_cross(corners, start[part], end[part]) for part in _parts(start, corners)]
    return np.concatenate([np.zeros(0, dtype=bool), *parts])


def _some_cross(corners: Array, start: Array, end: Array) -> Flags:
    found = np.zeros(len(start), dtype=bool)
    largest = np.maximum(np.abs(start), np.abs(end)).max(axis=1, initial=np.abs(corners).max())
    slack = (BOUNDARY_SLACK * largest)[:, None]
    way = end - start
    length = np.hypot(way[:, 0], way[:, 1])
    still = length == 0.0
    ahead = np.where(still[:, None], [1.0, 0.0], way / np.where(still, 1.0, length)[:, None])
    away = corners - start[:, None]
    along, aside = dot(ahead[:, None], away), cross(ahead[:, None], away)
    aside[np.abs(aside) <= slack] = 0.0
    met = (aside.max(axis=1) > 0.0) & (aside.min(axis=1) < 0.0)
    met &= (along.max(axis=1) >= 0.0) & (along.min(axis=1) <= length)
    rows = np.flatnonzero(met)
    row, middle = _inner_pieces(along[rows], aside[rows], length[rows])
    row = rows[row]
    deep = _boundary_distance(corners, start[row] + ahead[row] * middle[:, None]) > slack[row, 0]
    found[row[deep]] = True
    return found


def _inner_pieces(along: Array, aside: Array, length: Array) -> tuple[Index, Array]:
    """Segments (r,), and the middles (r,) m along them of their pieces in the interior.

    `along` and `aside` (m, k) m are the corners from the start of segments of `length` (m,) m.
    """
    next_along, next_aside = np.roll(along, -1, axis=1), np.roll(aside, -1, axis=1)
    left = (aside > 0.0) != (next_aside > 0.0)
    right = (aside < 0.0) != (next_aside < 0.0)
    crossing = left | right
    apart = np.where(crossing, aside - next_aside, 1.0)
    at = np.where(crossing, along + (next_along - along) * (aside / apart), np.inf)
    order = np.argsort(at, axis=1, kind="stable")
    at = np.take_along_axis(at, order, axis=1)
    sides = np.take_along_axis(left + 2 * right, order, axis=1)
    low = np.maximum(at[:, :-1], 0.0)
    high = np.minimum(at[:, 1:], length[:, None])
    inner = np.bitwise_xor.accumulate(sides, axis=1)[:, :-1] == 3
    row, piece = np.nonzero(inner & (low <= high))
    return row, 0.5 * (low[row, piece] + high[row, piece])


def _boundary_distance(corners: Array, points: Array) -> Array:
    """(m,) m: distance of points (m, 2) from the nearest edge."""
    edges = np.roll(corners, -1, axis=0) - corners
    away = points[:, None] - corners
    share = np.clip(dot(away, edges) / _squared_lengths(edges), 0.0, 1.0)
    off = away - share[..., None] * edges
    return np.asarray(np.sqrt(dot(off, off).min(axis=1)))


def _may_cross(corners: Array, start: Array, end: Array) -> Flags:
    """(u,) whether the hull of the two circles comes near a polygon: no axis separates them."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = _ROOM * np.abs(corners).max()
    radii = [np.hypot(side[1, :, 0], side[1, :, 1])[:, None] for side in (start, end)]
    least = np.minimum(start[0] - radii[0], end[0] - radii[1])
    most = np.maximum(start[0] + radii[0], end[0] + radii[1])
    near = np.all((least <= high + room) & (most >= low - room), axis=1)
    rows = np.flatnonzero(near)
    way = end[0, rows] - start[0, rows]
    length = np.hypot(way[:, 0], way[:, 1])
    # for circles about one point any axis will do
    aside = cross(way[:, None], corners - start[0, rows][:, None])
    width = (np.maximum(*radii)[rows, 0] + room) * length
    near[rows] = (aside.min(axis=1) <= width) & (aside.max(axis=1) >= -width)
    return np.asarray(near)


def _corner_roots(corners: Array, start: Array, end: Array) -> tuple[Index, Array]:
    """Lines (r,) and roots (r,) rad with a corner between the ends and its edges on one side.

    Elsewhere, and at hollow corners, the line runs through the interior before and after.
    """
    before, after = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    # the sum is twice the signed area
    way_round = np.sum(cross(corners - corners[0], after))
    salient = np.flatnonzero(cross(after, before) * way_round >= 0.0)
    a, b = (np.repeat(side[:, :, None], len(salient), axis=2) for side in (start, end))
    a[0] -= corners[salient]
    b[0] -= corners[salient]
    polynomials = _line_polynomial(a, b)
    c0, c1, s1, c2, s2 = np.moveaxis(polynomials, -1, 0)
    reached = np.abs(c0) <= (np.hypot(c1, s1) + np.hypot(c2, s2)) * (1.0 + _ROOM)
    (row, column), roots = np.nonzero(reached), real_roots(polynomials[reached])
    which, tau = np.nonzero(np.isfinite(roots))[0], roots[np.isfinite(roots)]
    row, corner = row[which], salient[column[which]]
    to_start = _at(start[:, row], tau) - corners[corner]
    to_end = _at(end[:, row], tau) - corners[corner]
    size = dot(to_start, to_start) + dot(to_end, to_end)
    sides = [cross(to_end - to_start, edges[corner]) for edges in (before, after)]
    room = size * np.sqrt(dot(before, before) * dot(after, after))[corner]
    kept = (dot(to_start, to_end) <= _ROOM * size) & (sides[0] * sides[1] >= -_ROOM * room)
    return row[kept], tau[kept]


def _line_polynomial(a: Array, b: Array) -> Array:
    """(..., 5) coefficients of a x b, of paths (3, ..., 2): zero if a line meets the origin."""
    (a0, ac, as_), (b0, bc, bs) = a, b
    both_cosine, both_sine = cross(ac, bc), cross(as_, bs)
    # of one sense: the arms' sines lie to the same side of their cosines
    harmonic = cross(ac, as_) * cross(bc, bs) < 0.0
    return np.stack(
        [
            cross(a0, b0) + 0.5 * (both_cosine + both_sine),
            cross(a0, bc) + cross(ac, b0),
            cross(a0, bs) + cross(as_, b0),
            0.5 * (both_cosine - both_sine) * harmonic,
            0.5 * (cross(ac, bs) + cross(as_, bc)) * harmonic,
        ],
        axis=-1,
    )


def _edge_roots(corners: Array, side: Array) -> tuple[Index, Array]:
    """Paths (r,) of bodies (3, l, 2), and roots (r,) rad at which they are on an edge."""
    edges = np.roll(corners, -1, axis=0) - corners
    path = np.repeat(side[:, :, None], len(corners), axis=2)
    path[0] -= corners
    c0, c1, s1 = cross(path, edges)
    row, edge = np.nonzero(np.abs(c0) <= np.hypot(c1, s1) * (1.0 + _ROOM))
    zero = np.zeros(len(row))
    first = np.column_stack([c0[row, edge], c1[row, edge], s1[row, edge], zero, zero])
    roots = real_roots(first)
    which, tau = np.nonzero(np.isfinite(roots))[0], roots[np.isfinite(roots)]
    row, edge = row[which], edge[which]
    away = _at(side[:, row], tau) - corners[edge]
    share = dot(away, edges[edge]) / _squared_lengths(edges)[edge]
    on_edge = (share >= -_ROOM) & (share <= 1.0 + _ROOM)
    return row[on_edge], tau[on_edge]


def _parts(rows: Array | Index, corners: Array) -> list[slice]:
    """Slices of rows, short enough that tables over all corners stay small."""
    number = max(1, _MOST_AT_ONCE // len(corners))
    return [slice(begin, begin + number) for begin in range(0, len(rows), number)]


def _squared_lengths(edges: Array) -> Array:
    """(k,) m^2; 1 where a corner is repeated."""
    squared = dot(edges, edges)
    return np.where(squared > 0.0, squared, 1.0)


def _at(path: Array, tau: Array) -> Array:
    """(..., 2) m: places at tau (...) rad on paths (3, ..., 2)."""
    cos, sin = np.cos(tau)[..., None], np.sin(tau)[..., None]
    return np.asarray(path[0] + path[1] * cos + path[2] * sin)
