"""Information of all sightings as a smooth function of the circles, for derivatives.

Each sighting has a weight between 0 and 1 instead of counting or not: a logistic step in the
distance (and, for limited views, in the angle off boresight), which the solver narrows from stage
to stage. All pairs and samples are computed at once, as matrices with a row for each sample and a
column for each pair.

With t = q / |q|^2 and each vehicle's displacement g since time 0, the two rows of a mutual sighting
differ only in the headings (see syncplan.observability.rank), so a pair's information consists of
ten sums over its samples:

    c = (t_y, -t_x)       row of a seeing b:   ( c, -t.g_a - 1,   -c, t.g_b     )
                          row of b seeing a:   ( c, -t.g_a,       -c, t.g_b - 1 )
    sums: c c^T (3), c h_a (2), c h_b (2), h_a h_a, h_b h_b, h_a h_b

A distance is measured where the bearing is, and has the same row both ways: with u = q / |q|,

    c = -u                row of a seeing b:   ( c, u x g_a,      -c, -u x g_b    )

A compass needs no target: it adds a number for each sample, whatever the circles.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import TypeVar, cast

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.sighting_kinds import BEARING, DISTANCE, SightingKind
from syncplan.orbits.team import Sensors, Team
from syncplan.refinement.problem import SampleTimes
from syncplan.scenario.areas import convex_parts

# --- sight lines past obstacles -------------------------------------------------------------------
#
# Two convex sets are disjoint if and only if the normal of an edge of one of them separates them.
# For a sight line and a convex polygon these are the outward normals of the polygon's edges, along
# which the nearer end of the sight line counts, and the sight line's own normals, along which the
# nearest corner counts. The largest of these gaps is positive where sight is free. Where it is
# blocked, the gap is minus the depth: the distance that the sight line has to move. A concave
# polygon is cut into triangles once.
#
# A landmark on a polygon's boundary does not count as the end of its sight line: walls do not hide
# landmarks on them.


_ON_EDGE = 1e-9
"""Distance in mean radii up to which a landmark is on an edge."""

_FAR = 1e3
"""Distance in mean radii, larger than any gap that matters."""

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
    offsets : (k,) offset of each edge along its normal
    """

    corners: Array
    normals: Array
    offsets: Array

    @classmethod
    def of(cls, corners: Array) -> "ConvexPiece":
        """Return the piece of a convex polygon (k, 2), its corners in either direction."""
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
    """Return the clearance of sight lines past all pieces, shaped as `line`; negative if blocked.

    `to_landmark` states that the second end is a landmark. At least one piece is required.
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


# --- sightings ------------------------------------------------------------------------------------


PAIR_SUMS = 10
ANCHOR_SUMS = 6
"""Sums of a landmark, which has no heading: c c^T (3), c h (2), h h."""

_NEAREST_SQUARED = 1e-6
"""Square of referred_rows.NEAREST: keeps bearings from turning infinitely fast."""

ROUNDED_ANGLE = 1e-6
"""Term in rad^2, added to the square of an angle to make its absolute value smooth."""

ALL_ROUND = 1e3
"""Half view in rad that stands for an unlimited one: no bearing comes near its edge."""


@dataclass(frozen=True, slots=True)
class Paths:
    """Positions of n vehicles at k samples, as (k, n) expressions, scaled.

    Attributes
    ----------
    times : the samples
    sensors : of the vehicles, with scaled lengths
    pieces : convex pieces of obstacles, scaled
    x, y : positions
    arm_x, arm_y : from the centre
    gone_x, gone_y : displacement since time 0
    senses : (n,)
    """

    times: SampleTimes
    sensors: Sensors
    pieces: tuple[ConvexPiece, ...]
    x: ca.MX
    y: ca.MX
    arm_x: ca.MX
    arm_y: ca.MX
    gone_x: ca.MX
    gone_y: ca.MX
    senses: Array

    @classmethod
    def of(cls, circles: ca.MX, team: Team, times: SampleTimes, scale: float) -> "Paths":
        """Return the paths of circles (x, y, R, phi), (4, n), all lengths in units of `scale` m."""
        senses = team.orbits.senses
        arm_x = circles[2, :] * ca.cos(circles[3, :])
        arm_y = circles[2, :] * ca.sin(circles[3, :])
        turn = ca.DM(senses).T
        cos, sin = ca.DM(np.cos(times.angles)), ca.DM(np.sin(times.angles))
        ones = ca.DM.ones(len(times.angles), 1)
        arms_x = cos @ arm_x - sin @ (turn * arm_y)
        arms_y = cos @ arm_y + sin @ (turn * arm_x)
        return cls(
            times,
            team.sensors.scaled(scale),
            convex_pieces(team.obstacles, scale),
            arms_x + ones @ circles[0, :],
            arms_y + ones @ circles[1, :],
            arms_x,
            arms_y,
            arms_x - ones @ arm_x,
            arms_y - ones @ arm_y,
            senses,
        )

    def begun_at_each(self) -> "Paths":
        """Return the same paths with time 0 at each sample: sightings refer to the poses then."""
        still = ca.MX(*self.gone_x.shape)
        return replace(self, gone_x=still, gone_y=still)


def pair_information(paths: Paths, pairs: Index, width: float, each: bool) -> ca.MX:
    """Return the ten sums of (e, 2) pairs, (10 e, 1), or (10 e, k) sample by sample with `each`.

    Sum s of pair p stands at s e + p. `width` is the step's, as a share of the range.
    """
    a, b = pairs[:, 0].tolist(), pairs[:, 1].tolist()
    qx, qy = paths.x[:, b] - paths.x[:, a], paths.y[:, b] - paths.y[:, a]
    squared = qx * qx + qy * qy
    seen_a = _weight(paths, pairs[:, 0], squared, qx, qy, width)
    if _alike(paths.sensors):
        seen_b = seen_a
    else:
        seen_b = _weight(paths, pairs[:, 1], squared, -qx, -qy, width)
    if paths.pieces:
        ends = paths.x[:, a], paths.y[:, a], paths.x[:, b], paths.y[:, b]
        free = _unobstructed(paths, ends, width)
        seen_a, seen_b = seen_a * free, seen_b * free
    weight_a = seen_a * _certainty(paths, BEARING, pairs[:, 0])
    weight_b = seen_b * _certainty(paths, BEARING, pairs[:, 1])
    share = 1.0 / (squared + _NEAREST_SQUARED)
    tx, ty = qx * share, qy * share
    along_a = tx * paths.gone_x[:, a] + ty * paths.gone_y[:, a]
    along_b = tx * paths.gone_x[:, b] + ty * paths.gone_y[:, b]
    both = weight_a + weight_b
    both_x, both_y = both * ty, -both * tx
    left, right = both * along_a + weight_a, both * along_b - weight_b
    sums = [
        both_x * ty,
        -both_x * tx,
        -both_y * tx,
        -ty * left,
        tx * left,
        ty * right,
        -tx * right,
        left * (along_a + 1.0) - weight_b * along_a,
        right * (along_b - 1.0) + weight_a * along_b,
        -left * along_b + weight_b * along_a,
    ]
    if _measure_distance(paths, pairs):
        known = seen_a * _certainty(paths, DISTANCE, pairs[:, 0])
        known += seen_b * _certainty(paths, DISTANCE, pairs[:, 1])
        for k, one in enumerate(_distance_sums(paths, pairs, qx, qy, known * share)):
            sums[k] += one
    return _stacked(sums, each)


def anchor_information(
    paths: Paths, anchors: Index, places: Array, width: float, each: bool
) -> ca.MX:
    """Return the six sums of vehicles `anchors` (k,) that see landmarks at `places` (k, 2), scaled.

    Shapes are as in `pair_information`.
    """
    a = anchors.tolist()
    ones = ca.DM.ones(len(paths.times.angles), 1)
    place_x, place_y = ones @ ca.DM(places[:, 0]).T, ones @ ca.DM(places[:, 1]).T
    qx, qy = place_x - paths.x[:, a], place_y - paths.y[:, a]
    squared = qx * qx + qy * qy
    seen = _weight(paths, anchors, squared, qx, qy, width)
    if paths.pieces:
        ends = paths.x[:, a], paths.y[:, a], ca.MX(place_x), ca.MX(place_y)
        seen *= _unobstructed(paths, ends, width, to_landmark=True)
    weight = seen * _certainty(paths, BEARING, anchors)
    share = 1.0 / (squared + _NEAREST_SQUARED)
    tx, ty = qx * share, qy * share
    turned = -(tx * paths.gone_x[:, a] + ty * paths.gone_y[:, a]) - 1.0
    weight_x, weight_y, weight_turned = weight * ty, -weight * tx, weight * turned
    sums = [
        weight_x * ty,
        -weight_x * tx,
        -weight_y * tx,
        ty * weight_turned,
        -tx * weight_turned,
        weight_turned * turned,
    ]
    if _measure_distance(paths, anchors):
        known = seen * _certainty(paths, DISTANCE, anchors) * share
        turn = qx * paths.gone_y[:, a] - qy * paths.gone_x[:, a]
        known_x, known_y = known * qx, known * qy
        distances = [
            known_x * qx,
            known_x * qy,
            known_y * qy,
            -known_x * turn,
            -known_y * turn,
            known * turn * turn,
        ]
        sums = [one + other for one, other in zip(sums, distances, strict=True)]
    return _stacked(sums, each)


def compass_information(paths: Paths) -> ca.DM:
    """Return the information (n, 1) of each vehicle's compass on its heading."""
    inverse = 1.0 / paths.sensors.compass_sigmas_each_sample**2
    return ca.DM(inverse * paths.times.counts.sum())


def _distance_sums(
    paths: Paths, pairs: Index, qx: ca.MX, qy: ca.MX, known: ca.MX
) -> tuple[ca.MX, ...]:
    """Ten sums of distances, sample by sample, with weights `known` over |q|^2."""
    a, b = pairs[:, 0].tolist(), pairs[:, 1].tolist()
    turn_a = qx * paths.gone_y[:, a] - qy * paths.gone_x[:, a]
    turn_b = qx * paths.gone_y[:, b] - qy * paths.gone_x[:, b]
    known_x, known_y, known_a, known_b = (known * one for one in (qx, qy, turn_a, turn_b))
    return (
        known_x * qx,
        known_x * qy,
        known_y * qy,
        -known_x * turn_a,
        -known_y * turn_a,
        known_x * turn_b,
        known_y * turn_b,
        known_a * turn_a,
        known_b * turn_b,
        -known_a * turn_b,
    )


def _measure_distance(paths: Paths, observers: Index) -> bool:
    return bool(np.any(DISTANCE.sigmas(paths.sensors)[observers] < np.inf))


def _alike(sensors: Sensors) -> bool:
    """Whether two vehicles always see each other at the same time."""
    ranges, views = sensors.ranges, sensors.fields_of_view
    return bool(np.all(ranges == ranges[0]) and np.all(views >= 2.0 * np.pi))


def _certainty(paths: Paths, kind: SightingKind, observers: Index) -> ca.DM:
    """Expected number (k, e) of sightings in each group, over the variance of the kind."""
    inverse = 1.0 / kind.sigmas(paths.sensors)[observers] ** 2
    inverse *= paths.sensors.detection[observers]
    return ca.DM(paths.times.sighted(observers) * inverse)


def _weight(
    paths: Paths, observers: Index, squared: ca.MX, qx: ca.MX, qy: ca.MX, width: float
) -> ca.MX:
    """Weights (k, e) of sightings at q; the step in view is `width` rad wide."""
    reach = paths.sensors.ranges[observers] ** 2
    slope = np.tile(1.0 / (4.0 * width * reach), (len(paths.times.angles), 1))
    weight = 0.5 + 0.5 * ca.tanh(0.25 / width - squared * ca.DM(slope))
    views = paths.sensors.fields_of_view[observers]
    limited = np.flatnonzero(views < 2.0 * np.pi)
    if len(limited) == 0:
        return weight
    turned = paths.sensors.boresights[observers] + 0.5 * np.pi * paths.senses[observers]
    shape = (len(paths.times.angles), 1)
    cos, sin = ca.DM(np.tile(np.cos(turned), shape)), ca.DM(np.tile(np.sin(turned), shape))
    chosen = observers.tolist()
    ax, ay = paths.arm_x[:, chosen], paths.arm_y[:, chosen]
    axis_x, axis_y = cos * ax - sin * ay, sin * ax + cos * ay
    off = ca.atan2(axis_x * qy - axis_y * qx, axis_x * qx + axis_y * qy)
    half = np.where(views < 2.0 * np.pi, 0.5 * views, ALL_ROUND)
    left = ca.DM(np.tile(half, shape)) - ca.sqrt(off * off + ROUNDED_ANGLE)
    return weight * (0.5 + 0.5 * ca.tanh(left * (0.5 / width)))


def _unobstructed(
    paths: Paths, ends: SightLine[ca.MX], width: float, *, to_landmark: bool = False
) -> ca.MX:
    """Weights (k, e) of sight lines by their clearance past obstacles.

    The step is as wide as that of the mean range.
    """
    gap = sight_gap(paths.pieces, ends, to_landmark=to_landmark)
    return 0.5 + 0.5 * ca.tanh(gap * (0.5 / (width * float(paths.sensors.ranges.mean()))))


def _stacked(sums: list[ca.MX], each: bool) -> ca.MX:
    if each:
        return ca.vertcat(*(one.T for one in sums))
    return ca.vertcat(*(ca.sum1(one).T for one in sums))
