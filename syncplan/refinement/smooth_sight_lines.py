"""Sight lines past obstacles, smooth: how far they clear the polygons that block sight.

Two convex sets are apart exactly if the normal of an edge of one of them separates them. For a
sight line and a convex polygon these are the outward normals of the polygon's edges, along which
the nearer end of the sight line counts, and the sight line's own, along which the nearest corner
does. The largest of these gaps is positive where sight is free. Where it is blocked, minus that is
the depth: how far the sight line has to move. A concave polygon is cut into triangles once.

A landmark on a polygon's boundary does not count as its end: walls do not hide what hangs on them.
"""

from dataclasses import dataclass
from functools import reduce
from typing import TypeVar, cast

import casadi as ca
import numpy as np

from syncplan.arrays import Array
from syncplan.scenario.areas import convex_parts

_ON_EDGE = 1e-9
"""Nearer than this, in mean radii, a landmark is on an edge."""

_FAR = 1e3
"""Mean radii: further than any gap that matters."""

Expression = TypeVar("Expression", ca.MX, ca.SX)

SightLine = tuple[Expression, Expression, Expression, Expression]
"""x and y of both ends of sight lines, of one shape."""


@dataclass(frozen=True, slots=True)
class ConvexPiece:
    """A convex part of an obstacle, with k corners.

    Attributes
    ----------
    corners : (k, 2)
    normals : (k, 2) unit vectors out of each edge
    offsets : (k,) of each edge along its normal
    """

    corners: Array
    normals: Array
    offsets: Array

    @classmethod
    def of(cls, corners: Array) -> "ConvexPiece":
        """Return the piece of a convex polygon (k, 2), its corners either way round."""
        along = np.roll(corners, -1, axis=0) - corners
        kept = np.hypot(*along.T) > 0.0
        corners, along = corners[kept], along[kept]
        along = along / np.hypot(*along.T)[:, None]
        following = np.roll(corners, -1, axis=0)
        turn = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
        normals = np.column_stack([along[:, 1], -along[:, 0]]) * np.sign(turn)
        return cls(corners, normals, np.sum(normals * corners, axis=1))


def convex_pieces(obstacles: tuple[Array, ...], scale: float) -> tuple[ConvexPiece, ...]:
    """Return the convex pieces of polygons (k, 2) m, in units of `scale` m."""
    pieces = []
    for corners in obstacles:
        pieces += [ConvexPiece.of(one / scale) for one in convex_parts(corners)]
    return tuple(pieces)


def sight_gap(
    pieces: tuple[ConvexPiece, ...], line: SightLine[Expression], *, to_landmark: bool = False
) -> Expression:
    """Return how far sight lines clear all pieces, negative where they are blocked, as `line`.

    `to_landmark` says that the second end is a landmark's. There must be a piece.
    """
    gaps = [_gap(piece, line, to_landmark) for piece in pieces]
    return reduce(ca.fmin, gaps)


def _gap(piece: ConvexPiece, line: SightLine[Expression], to_landmark: bool) -> Expression:
    ax, ay, bx, by = line
    dx, dy = bx - ax, by - ay
    length = ca.sqrt(dx * dx + dy * dy + _ON_EDGE**2)
    aside = [dx * (y - ay) - dy * (x - ax) for x, y in piece.corners.tolist()]
    gaps = [reduce(ca.fmin, aside) / length, -reduce(ca.fmax, aside) / length]
    for (x, y), offset in zip(piece.normals.tolist(), piece.offsets.tolist(), strict=True):
        begin, end = x * ax + y * ay - offset, x * bx + y * by - offset
        if to_landmark:
            end += _FAR * (ca.fabs(end) <= _ON_EDGE)
        gaps.append(ca.fmin(begin, end))
    return cast(Expression, reduce(ca.fmax, gaps))
