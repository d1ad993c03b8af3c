"""Smooth constraints of a refinement over the whole turn: contacts, distances, areas, purpose.

Each concerns one vehicle or one pair, so its Jacobian is sparse. Two vehicles of one sense move
relative to each other on a circle of radius m = |R_b e(phi_b) - R_a e(phi_a)| about the offset D of
their centres, so their least distance is |D - m|: closed form. For opposite senses the relative
path is an ellipse. There the constraint takes a soft minimum of |q|^2 at many samples, which is
never above the smallest sample, less the most that |q|^2 can fall between two samples. So it never
exceeds the true least distance.

A circle passes a landmark at ||c - L| - R|. It clears a keep-out by the distances of its edges less
R or, going round it, by R less those of its corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import relative_motion
from syncplan.refinement.problem import (
    RefineProblem,
    SampleTimes,
    Stage,
    circles_of,
    samples_in,
)
from syncplan.refinement.smooth_sightings import (
    ALL_ROUND,
    ROUNDED_ANGLE,
    ConvexPiece,
    convex_pieces,
    sight_gap,
)
from syncplan.scenario.purposes import PurposeMeasure

# --- blocks ---------------------------------------------------------------------------------------
#
# The function of one block is differentiated once and mapped over all blocks; its derivatives by
# the block's own circles are then put in their places. Colouring the whole Jacobian instead would
# take a sweep over all constraints for each variable of the vehicle with the most neighbours.


@dataclass(frozen=True, slots=True)
class Blocks:
    """Constraints on circles (4, n), each bounded from below.

    Attributes
    ----------
    values : (g,)
    jacobian : (g, 4 n) sparse, with respect to the circles, column by column
    lower : (g,) lower bounds of the values
    labels : (g,) name of each constraint
    """

    values: ca.MX
    jacobian: ca.MX
    lower: Array
    labels: tuple[str, ...]


def blocks_of(
    function: ca.Function,
    circles: ca.MX,
    owners: Index,
    parameters: Sequence[ca.DM | ca.MX],
    lower: Array,
    labels: list[str],
) -> Blocks:
    """Return the blocks of a function of one or more of the circles (4, n), then of parameters.

    `owners` (e, k) are the k vehicles of each block; parameters have a column per block.
    """
    number, each = owners.shape
    inputs = [*(circles[:, own.tolist()] for own in owners.T), *parameters]
    values = function.map(number)(*inputs)
    output = function.name_out(0)
    names = [f"jac:{output}:{function.name_in(k)}" for k in range(each)]
    derivative = function.factory(f"{function.name()}_jacobian", function.name_in(), names)
    found = derivative.map(number)(*inputs)
    parts = [ca.vec(part) for part in (found if isinstance(found, tuple | list) else [found])]
    row = np.tile(np.repeat(np.arange(number), 4), each)
    column = (4 * owners.T[:, :, None] + np.arange(4)).ravel()
    order = np.lexsort((row, column))
    sparsity = ca.Sparsity.triplet(number, circles.numel(), row.tolist(), column.tolist())
    entries = ca.vertcat(*(ca.densify(part) for part in parts))
    return Blocks(ca.vec(values), ca.MX(sparsity, entries[order.tolist()]), lower, tuple(labels))


def stacked_blocks(blocks: list[Blocks], count: int) -> Blocks:
    """Return blocks on `count` vehicles stacked into one; without any, values are (0,)."""
    return Blocks(
        ca.vertcat(ca.MX(0, 1), *(block.values for block in blocks)),
        ca.vertcat(ca.MX(0, 4 * count), *(block.jacobian for block in blocks)),
        np.concatenate([np.zeros(0), *(block.lower for block in blocks)]),
        tuple(label for block in blocks for label in block.labels),
    )


# --- sides ----------------------------------------------------------------------------------------
#
# A landmark lies outside a circle or within it. So does a keep-out, which the path must not cross
# but may go round. The two sides are different constraints, so the side is fixed while a stage is
# solved, and every start has its own.
#
#       (   x   )    within: the circle goes round it
#       (       )  x    outside


_SAFETY = 1e-4
"""Share of a clearance that the solver keeps in addition to it."""

_LEAST_SHARE = 1e-3
"""Share of a clearance that is required even where bounds allow less."""


def kept_landmarks(problem: RefineProblem) -> Index:
    """Return the (g, 2) vehicles and landmarks whose clearance the solver keeps."""
    guarded = problem.guarded_landmarks()
    moves = np.any(problem.freedom.free[:3, guarded[:, 0]], axis=0)
    return np.asarray(guarded[moves])


def side_count(problem: RefineProblem) -> int:
    """Return the number of values of `sides_of`."""
    return len(kept_landmarks(problem)) + len(problem.area.outside) * problem.orbits.count


def sides_of(problem: RefineProblem, circles: Array) -> Array:
    """Return the sides of circles (4, n) in m on which landmarks kept, then keep-outs, lie.

    Positive outside, negative within. Landmarks: in 1 / m, +-1 over the clearance to be kept;
    keep-outs: +-1, polygon by polygon for all vehicles.
    """
    return np.concatenate([_of_landmarks(problem, circles), _of_keep_outs(problem, circles)])


def _of_landmarks(problem: RefineProblem, circles: Array) -> Array:
    """Sides of landmarks: those at the start, unless bounds allow too little room there.

    Then the side with more room is taken. Where both have too little, what bounds allow is kept.
    """
    k, landmark = kept_landmarks(problem).T
    places = problem.landmarks[landmark]
    asked = problem.guarded_clearance * (1.0 + _SAFETY)
    nearest, furthest = problem.freedom.reaches(k, places)
    least, most = problem.freedom.lower[2, k], problem.freedom.upper[2, k]
    outside, within = furthest - least, most - nearest
    beyond = np.hypot(*(circles[:2, k].T - places).T) >= circles[2, k]
    own, other = np.where(beyond, outside, within), np.where(beyond, within, outside)
    swapped = (own < asked) & (other > own)
    kept = np.clip(np.where(swapped, other, own), _LEAST_SHARE * asked, asked)
    return np.asarray(np.where(beyond != swapped, 1.0, -1.0) / kept)


def _of_keep_outs(problem: RefineProblem, circles: Array) -> Array:
    centers, radii = circles[:2].T, circles[2]
    round_them = [
        problem.area.goes_round(number, centers, radii)
        for number in range(len(problem.area.outside))
    ]
    return np.where(np.concatenate([np.zeros(0, dtype=bool), *round_them]), -1.0, 1.0)


# --- clearances -----------------------------------------------------------------------------------


_SAMPLES = 120
_SHARPNESS = 200.0
"""Sharpness of the soft minimum, relative to the square of the separation."""

_TINY = 1e-12


def separations(problem: RefineProblem, circles: ca.MX) -> Blocks:
    """Return the distances of guarded pairs over the least separation; met at 1 or more.

    `circles` are (4, n), scaled. A pair of one sense whose relative circle leaves the origin
    outside keeps it outside, and one that goes round it keeps it inside.
    """
    pairs = problem.guarded_pairs()
    floor = problem.guarded_separation / problem.scale
    senses = problem.orbits.senses
    alike = senses[pairs[:, 0]] == senses[pairs[:, 1]]
    blocks = []
    if alike.any():
        chosen = pairs[alike]
        side = ca.DM(_sides(problem, chosen)).T
        blocks.append(_apart(problem, _same_sense(floor), circles, chosen, side))
    if (~alike).any():
        chosen = pairs[~alike]
        turns = ca.DM(senses[chosen].T)
        blocks.append(_apart(problem, _opposite_sense(floor), circles, chosen, turns))
    return stacked_blocks(blocks, problem.orbits.count)


def landmark_clearances(problem: RefineProblem, circles: ca.MX, sides: ca.MX) -> Blocks:
    """Return the distances of circles from landmarks over the clearance kept; met at 1 or more.

    `sides` are all those of `sides_of`, of which the first are used.
    """
    kept, names, count = kept_landmarks(problem), problem.names, problem.orbits.count
    if len(kept) == 0:
        return stacked_blocks([], count)
    places = ca.DM(problem.landmarks[kept[:, 1]].T / problem.scale)
    labels = [
        f"clearance of {names[k]} from {names[count + landmark]} ({problem.guarded_clearance:g} m)"
        for k, landmark in kept.tolist()
    ]
    side = sides[: len(kept)].T * problem.scale
    return blocks_of(_passing(), circles, kept[:, :1], [places, side], np.ones(len(kept)), labels)


def area_clearances(problem: RefineProblem, circles: ca.MX, sides: ca.MX) -> Blocks:
    """Return the clearance of each circle from each edge of the polygons, scaled; met at 0 or more.

    `sides` are all those of `sides_of`, of which the last are used.
    """
    area, scale, count = problem.area, problem.scale, problem.orbits.count
    last = sides[sides.numel() - len(area.outside) * count :]
    blocks = []
    for name, corners, outer in area.polygons():
        parameters: list[ca.MX] = []
        if outer and _is_convex(corners):
            function, edges = _half_plane(), _half_planes(corners / scale)
        elif outer:
            function, edges = _segment(), _segments(corners / scale)
        else:
            function, edges = _edge_kept_out(), _segments(corners / scale)
            parameters, last = [last[:count].T], last[count:]
        blocks += [_clear(problem, function, circles, edge, parameters, name) for edge in edges]
    return stacked_blocks(blocks, count)


# --- purpose --------------------------------------------------------------------------------------
#
# The strip along a circle covers a point as far as a logistic step of the point's distance from its
# edge says. A point is open as far as it is open for each circle: the product of these.


_STEP_OF_GRID = 0.5
"""Width of the step between covered and open, as a share of the distance of grid points."""

_SPARE = 0.002
"""Share of the area that is covered in addition, for the error of grid and step."""


def purpose_served(problem: RefineProblem, circles: ca.MX) -> Blocks:
    """Return how far circles serve their purpose, with the bounds that meet it.

    Each point to visit is left to the vehicle that passes it nearest in the plan. The grid's share
    that is covered has to change by no less than the exact share may, or must.
    """
    measure, orbits, scale = problem.purpose, problem.orbits, problem.scale
    if measure is None:
        return stacked_blocks([], orbits.count)
    parameters: list[ca.DM | ca.MX] = []
    purpose, given = measure.purpose, (orbits.centers, orbits.radii)
    if purpose.cover is not None:
        owners = np.arange(orbits.count)[None]
        function = _covering(measure, purpose.cover.swath_m, orbits.count, scale)
        now = np.vsplit((circles_of(orbits) / [[scale], [scale], [scale], [1.0]]).T, orbits.count)
        lower = np.array(function(*now)) - measure.room(*given) + _SPARE
        return blocks_of(function, circles, owners, parameters, lower[0], ["purpose"])
    if purpose.visit_m is not None:
        owners, points = measure.nearest(*given)[:, None], np.array(purpose.visit_m).T / scale
        function, parameters = _visiting(purpose.within_m / scale), [ca.DM(points)]
    else:
        assert purpose.keep is not None
        owners = measure.kept_pairs()
        if not len(owners):
            return stacked_blocks([], orbits.count)
        function = _keeping_apart(purpose.keep.spread_m / scale)
    names, lower = ["purpose"] * len(owners), np.full(len(owners), 1.0 + _SAFETY)
    return blocks_of(function, circles, owners, parameters, lower, names)


def _covering(measure: PurposeMeasure, swath: float, count: int, scale: float) -> ca.Function:
    """Smooth share of the grid within half a swath of circles; inputs are the circles, scaled."""
    circles = [ca.SX.sym(f"a{k}", 4) for k in range(count)]
    points, width = ca.DM(measure.field / scale), _STEP_OF_GRID * measure.spacing / scale
    log_open = ca.SX(points.size1(), 1)
    for a in circles:
        away = ca.sqrt((points[:, 0] - a[0]) ** 2 + (points[:, 1] - a[1]) ** 2 + _TINY)
        off = ca.sqrt((away - a[2]) ** 2 + _TINY)
        log_open += _log_logistic((off - 0.5 * swath / scale) / width)
    return ca.Function("covering", circles, [1.0 - ca.sum1(ca.exp(log_open)) / points.size1()])


def _visiting(within: float) -> ca.Function:
    """Room of a circle's pass of a place."""
    a, place = ca.SX.sym("a", 4), ca.SX.sym("place", 2)
    off = (_length(a[:2] - place) - a[2]) / within
    return ca.Function("visiting", [a, place], [2.0 - off**2])


def _keeping_apart(spread: float) -> ca.Function:
    """Distance of two centres, in that asked for."""
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 4)
    return ca.Function("keeping_apart", [a, b], [_length(b[:2] - a[:2]) / spread])


# --- pieces ---------------------------------------------------------------------------------------


def _apart(
    problem: RefineProblem, function: ca.Function, circles: ca.MX, pairs: Index, parameter: ca.DM
) -> Blocks:
    labels = [
        f"separation of {problem.names[a]} and {problem.names[b]} "
        f"({problem.guarded_separation:g} m)"
        for a, b in pairs.tolist()
    ]
    return blocks_of(function, circles, pairs, [parameter], np.ones(len(pairs)), labels)


def _clear(
    problem: RefineProblem,
    function: ca.Function,
    circles: ca.MX,
    edge: Array,
    sides: list[ca.MX],
    name: str,
) -> Blocks:
    count = problem.orbits.count
    labels = [f"{problem.names[k]} clear of {name}" for k in range(count)]
    edges = ca.repmat(ca.DM(edge), 1, count)
    owners = np.arange(count)[:, None]
    return blocks_of(function, circles, owners, [edges, *sides], np.zeros(count), labels)


def _sides(problem: RefineProblem, pairs: Index) -> Array:
    """+1 where the relative circle leaves the origin outside, -1 where it goes round it."""
    motion = relative_motion(problem.orbits, pairs[:, 0], pairs[:, 1])
    return np.where(np.hypot(*motion.offset.T) >= np.hypot(*motion.cosine.T), 1.0, -1.0)


def _arms(a: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
    return tuple(one[2] * ca.vertcat(ca.cos(one[3]), ca.sin(one[3])) for one in (a, b))  # type: ignore[return-value]


def _same_sense(floor: float) -> ca.Function:
    a, b, side = ca.SX.sym("a", 4), ca.SX.sym("b", 4), ca.SX.sym("side")
    arm_a, arm_b = _arms(a, b)
    offset, radius = _length(b[:2] - a[:2]), _length(arm_b - arm_a)
    return ca.Function("same_sense", [a, b, side], [side * (offset - radius) / floor])


def _opposite_sense(floor: float) -> ca.Function:
    a, b, senses = ca.SX.sym("a", 4), ca.SX.sym("b", 4), ca.SX.sym("senses", 2)
    arms = _arms(a, b)
    swings = [
        sense * ca.vertcat(-arm[1], arm[0])
        for arm, sense in zip(arms, ca.vertsplit(senses), strict=True)
    ]
    tau = 2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    q = (
        ca.repmat(b[:2] - a[:2], 1, _SAMPLES)
        + (arms[1] - arms[0]) @ ca.DM(np.cos(tau)).T
        + (swings[1] - swings[0]) @ ca.DM(np.sin(tau)).T
    )
    ratio = ca.sum1(q * q) / floor**2
    least = -ca.logsumexp(-_SHARPNESS * ratio.T) / _SHARPNESS
    # near the floor, (|q|^2)'' is at most 2 (|q'|^2 + |q| |q''|), with |q'|, |q''| <= R_a + R_b
    swing = (a[2] + b[2]) / floor
    fall = (swing**2 + swing) * (np.pi / _SAMPLES) ** 2
    return ca.Function("opposite_sense", [a, b, senses], [least - fall])


def _half_plane() -> ca.Function:
    a, edge = ca.SX.sym("a", 4), ca.SX.sym("edge", 3)
    return ca.Function("half_plane", [a, edge], [edge[2] - edge[0] * a[0] - edge[1] * a[1] - a[2]])


def _segment() -> ca.Function:
    a, edge = ca.SX.sym("a", 4), ca.SX.sym("edge", 4)
    return ca.Function("segment", [a, edge], [_from_segment(a, edge) - a[2]])


def _edge_kept_out() -> ca.Function:
    """Clearance of an edge outside the circle, or of its start within one round the polygon."""
    a, edge, side = ca.SX.sym("a", 4), ca.SX.sym("edge", 4), ca.SX.sym("side")
    outside, within = _from_segment(a, edge) - a[2], a[2] - _length(a[:2] - edge[:2])
    clear = ca.if_else(side > 0.0, outside, within)
    return ca.Function("edge_kept_out", [a, edge, side], [clear])


def _passing() -> ca.Function:
    a, place, side = ca.SX.sym("a", 4), ca.SX.sym("place", 2), ca.SX.sym("side")
    return ca.Function("passing", [a, place, side], [side * (_length(a[:2] - place) - a[2])])


def _from_segment(a: ca.SX, edge: ca.SX) -> ca.SX:
    along = edge[2:] - edge[:2]
    share = ca.dot(a[:2] - edge[:2], along) / ca.sumsqr(along)
    nearest = edge[:2] + ca.fmin(ca.fmax(share, 0.0), 1.0) * along
    return _length(a[:2] - nearest)


def _length(vector: ca.SX) -> ca.SX:
    return ca.sqrt(ca.sumsqr(vector) + _TINY)


def _half_planes(corners: Array) -> list[Array]:
    """Outward unit normal and offset of each edge of a convex polygon."""
    along = np.roll(corners, -1, axis=0) - corners
    along = along / np.hypot(*along.T)[:, None]
    normals = np.column_stack([along[:, 1], -along[:, 0]]) * np.sign(_doubled_area(corners))
    return [np.append(one, one @ corner) for one, corner in zip(normals, corners, strict=True)]


def _segments(corners: Array) -> list[Array]:
    """Start and end of each edge."""
    return list(np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1))


def _is_convex(corners: Array) -> bool:
    along = np.roll(corners, -1, axis=0) - corners
    following = np.roll(along, -1, axis=0)
    turn = along[:, 0] * following[:, 1] - along[:, 1] * following[:, 0]
    return bool(np.all(turn >= 0.0) or np.all(turn <= 0.0))


def _doubled_area(corners: Array) -> float:
    following = np.roll(corners, -1, axis=0)
    return float(np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]))


# --- contacts -------------------------------------------------------------------------------------
#
# Each sample's weight is a logistic step in the distance and, for limited views, in the angle off
# boresight. The function is the logarithm of their sum (log-sum-exp of the weights' logarithms):
# its slope stays large far from contact, where that of the sum itself vanishes.


def contacts_kept(
    problem: RefineProblem, circles: ca.MX, times: SampleTimes, width: float, safety: float
) -> Blocks:
    """Return the logarithm of the number of `times` in contact, of each contact to be kept.

    `width` is the step's, as a share of the range; `safety` in m is added to the margins.
    """
    count, names = problem.orbits.count, problem.names
    views = bool(np.any(problem.sensors.fields_of_view < 2.0 * np.pi))
    pieces = convex_pieces(problem.team.obstacles, problem.scale)
    to_landmark = problem.kept[:, 1] >= count
    blocks = []
    for chosen in (np.flatnonzero(~to_landmark), np.flatnonzero(to_landmark)):
        if not len(chosen):
            continue
        kept, margins = problem.kept[chosen], problem.kept_margins[chosen]
        needed = problem.kept_samples[chosen] - 1.0
        step = np.stack([np.full(len(kept), width), (margins + safety) / problem.scale])
        labels = [
            f"contact of {names[a]}-{names[b]} (margin {margin:.3g} m)"
            for (a, b), margin in zip(kept.tolist(), margins, strict=True)
        ]
        if kept[0, 1] < count:
            owners, function = kept, pair_contact(times, views, pieces)
            own = (_observers(problem, vehicles, views) for vehicles in kept.T)
            inputs = [*own, _shares(problem, kept), step]
            lower = np.log(needed + 1.0 / problem.sensors.every[kept].max(axis=1))
        else:
            owners, function = kept[:, :1], anchor_contact(times, views, pieces)
            places = problem.landmarks[kept[:, 1] - count].T / problem.scale
            inputs = [places, _observers(problem, kept[:, 0], views), step]
            # counted at all samples: the fewest that include so many with the sensor ready
            lower = np.log(needed * problem.sensors.every[kept[:, 0]] + 1.0)
        blocks.append(blocks_of(function, circles, owners, [*map(ca.DM, inputs)], lower, labels))
    return stacked_blocks(blocks, count)


def _observers(problem: RefineProblem, vehicles: Index, views: bool) -> Array:
    """Senses and scaled ranges of vehicles, with `views` half views and boresights: (2 or 4, e)."""
    sensors = problem.sensors
    rows = [problem.orbits.senses[vehicles], sensors.ranges[vehicles] / problem.scale]
    if views:
        half = 0.5 * sensors.fields_of_view[vehicles]
        rows += [np.where(half >= np.pi, ALL_ROUND, half), sensors.boresights[vehicles]]
    return np.array(rows, dtype=float).reshape(len(rows), len(vehicles))


def _shares(problem: RefineProblem, pairs: Index) -> Array:
    """Shares (2, e) of both directions of sight: half each, or all for the longer range.

    Each is divided by the samples from one sighting of its sensor to the next.
    """
    ranges, every = problem.sensors.ranges, problem.sensors.every
    a, b = ranges[pairs[:, 0]], ranges[pairs[:, 1]]
    alike = np.isclose(a, b)
    return np.where(alike, 0.5, [a > b, b > a]) / every[pairs].T


def pair_contact(
    times: SampleTimes, views: bool, pieces: tuple[ConvexPiece, ...] = ()
) -> ca.Function:
    """Return the function (a, b, own_a, own_b, shares, step) -> log samples in contact.

    `a`, `b` are circles (x, y, R, phi), scaled; `own_a`, `own_b` are columns of `_observers`, and
    `shares`, of the two directions of sight in the contact, one of `_shares`. `step` holds the
    step's width, as a share of the range, and the margin by which contact stays within the range.
    Scaled `pieces` block sight.
    """
    circles = [ca.SX.sym(name, 4) for name in "ab"]
    owns = [ca.SX.sym(f"own_{name}", 4 if views else 2) for name in "ab"]
    shares, step = ca.SX.sym("shares", 2), ca.SX.sym("step", 2)
    arm_a, arm_b = (_arms_at(one, own[0], times) for one, own in zip(circles, owns, strict=True))
    a, b = circles
    q = ca.repmat(b[:2] - a[:2], 1, len(times.angles)) + arm_b - arm_a
    here = ca.repmat(a[:2], 1, len(times.angles)) + arm_a
    squared, gap = ca.sum1(q * q), _gap(pieces, here, here + q)
    one = _log_count(arm_a, q, squared, gap, owns[0], step, times)
    other = _log_count(arm_b, -q, squared, gap, owns[1], step, times)
    contact = ca.logsumexp(ca.vertcat(one + ca.log(shares[0]), other + ca.log(shares[1])))
    return ca.Function("pair_contact", [*circles, *owns, shares, step], [contact])


def anchor_contact(
    times: SampleTimes, views: bool, pieces: tuple[ConvexPiece, ...] = ()
) -> ca.Function:
    """Return the function (a, place, own, step) -> log samples in contact.

    As `pair_contact`, for a landmark at `place` (2,).
    """
    a, place = ca.SX.sym("a", 4), ca.SX.sym("place", 2)
    own, step = ca.SX.sym("own", 4 if views else 2), ca.SX.sym("step", 2)
    arm = _arms_at(a, own[0], times)
    q = ca.repmat(place - a[:2], 1, len(times.angles)) - arm
    here = ca.repmat(a[:2], 1, len(times.angles)) + arm
    gap = _gap(pieces, here, here + q, to_landmark=True)
    contact = _log_count(arm, q, ca.sum1(q * q), gap, own, step, times)
    return ca.Function("anchor_contact", [a, place, own, step], [contact])


def _arms_at(circle: ca.SX, sense: ca.SX, times: SampleTimes) -> ca.SX:
    """Vectors (2, k) from the centre to the vehicle at each sample."""
    arm = circle[2] * ca.vertcat(ca.cos(circle[3]), ca.sin(circle[3]))
    swing = sense * ca.vertcat(-arm[1], arm[0])
    return arm @ ca.DM(np.cos(times.angles)).T + swing @ ca.DM(np.sin(times.angles)).T


def _view(arms: ca.SX, sense: ca.SX, q: ca.SX, half: ca.SX, boresight: ca.SX) -> ca.SX:
    """Angle (1, k) in rad from the direction of q to the edge of the view; negative outside it."""
    ahead = sense * ca.vertcat(-arms[1, :], arms[0, :])
    cos, sin = ca.cos(boresight), ca.sin(boresight)
    axis = ca.vertcat(cos * ahead[0, :] - sin * ahead[1, :], sin * ahead[0, :] + cos * ahead[1, :])
    off = ca.atan2(
        axis[0, :] * q[1, :] - axis[1, :] * q[0, :], axis[0, :] * q[0, :] + axis[1, :] * q[1, :]
    )
    return half - ca.sqrt(off**2 + ROUNDED_ANGLE)


def _gap(
    pieces: tuple[ConvexPiece, ...], here: ca.SX, there: ca.SX, *, to_landmark: bool = False
) -> ca.SX | None:
    """Clearance (1, k) of sight lines from (2, k) to (2, k) past `pieces`; None without pieces."""
    if not pieces:
        return None
    ends = here[0, :], here[1, :], there[0, :], there[1, :]
    return sight_gap(pieces, ends, to_landmark=to_landmark)


def _log_count(
    arms: ca.SX,
    q: ca.SX,
    squared: ca.SX,
    gap: ca.SX | None,
    own: ca.SX,
    step: ca.SX,
    times: SampleTimes,
) -> ca.SX:
    """Logarithm of the number of samples at which targets at q, (2, k), are in contact.

    If the step in range is w times the range wide, so is the step past obstacles, and the step in
    view is w rad wide.
    """
    reach, width = own[1] - step[1], step[0]
    log = _log_logistic((reach**2 - squared) / (2.0 * width * reach**2))
    if own.numel() > 2:
        log += _log_logistic(_view(arms, own[0], q, own[2], own[3]) / width)
    if gap is not None:
        log += _log_logistic(gap / (width * reach))
    return ca.logsumexp((log + ca.DM(np.log(times.counts)).T).T)


def _log_logistic(x: ca.SX) -> ca.SX:
    return ca.fmin(x, 0.0) - ca.log1p(ca.exp(-ca.fabs(x)))


# --- all of them ----------------------------------------------------------------------------------


_CONTACT_WIDTH = 0.25
"""Width of the step of contact, as a share of that of information."""

_SAFETY_WIDTHS = 3.0
"""Widths of contact's step by which kept links stay inside their margin in the last stage."""

CONTACT_SAMPLES = 96
"""Most samples for contact: near its minimum the distance hardly changes between them."""


def constraints_of(problem: RefineProblem, stage: Stage, circles: ca.MX, sides: ca.MX) -> Blocks:
    """Return the constraints of a stage: contacts, separations, clearances, areas, the purpose.

    `circles` are (4, n), scaled; `sides` are those of `sides_of`.
    """
    width = _CONTACT_WIDTH * stage.width
    safety = _SAFETY_WIDTHS * width * float(problem.sensors.ranges.mean())
    most = min(stage.samples, CONTACT_SAMPLES)
    times = samples_in(problem, problem.contact_span, most)
    contacts = contacts_kept(problem, circles, times, width, safety if stage.last else 0.0)
    distances = [
        separations(problem, circles),
        landmark_clearances(problem, circles, sides),
        area_clearances(problem, circles, sides),
        purpose_served(problem, circles),
    ]
    return stacked_blocks([contacts, *distances], problem.orbits.count)
