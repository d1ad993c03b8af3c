"""The number of samples at which a pair is in contact, as a smooth function of its two circles.

Each sample's weight is a logistic step in the distance and, for limited views, in the angle off
boresight. The function is the logarithm of their sum (log-sum-exp of the weights' logarithms): its
slope stays large far from contact, where that of the number itself vanishes.
"""

import casadi as ca
import numpy as np

from syncplan.arrays import Array, Index
from syncplan.refinement.clearances import Blocks, blocks_of, stacked_blocks
from syncplan.refinement.problem import RefineProblem, SampleTimes
from syncplan.refinement.smooth_sightings import (
    ALL_ROUND,
    ROUNDED_ANGLE,
    ConvexPiece,
    convex_pieces,
    sight_gap,
)

_Seen = tuple[ca.SX | None, ca.SX | None]
"""How far targets are within the view, and sight lines clear of obstacles, where there are such."""


def contacts_kept(
    problem: RefineProblem, circles: ca.MX, times: SampleTimes, width: float, safety: float
) -> Blocks:
    """Return the logarithm of the samples in contact, out of `times`, of contacts to be kept.

    `width` is that of the step; `safety` in m is added to the margins.
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
            inputs = [_pair_parameters(problem, kept, views), step]
            lower = np.log(needed + 1.0 / problem.sensors.every[kept].max(axis=1))
        else:
            owners, function = kept[:, :1], anchor_contact(times, views, pieces)
            places = problem.landmarks[kept[:, 1] - count].T / problem.scale
            inputs = [places, _anchor_parameters(problem, kept[:, 0], views), step]
            # counted at all samples: the fewest that hold so many at which the sensor is ready
            lower = np.log(needed * problem.sensors.every[kept[:, 0]] + 1.0)
        blocks.append(blocks_of(function, circles, owners, [*map(ca.DM, inputs)], lower, labels))
    return stacked_blocks(blocks, count)


def _pair_parameters(problem: RefineProblem, pairs: Index, views: bool) -> Array:
    """(6 or 10, e) parameters of `pair_contact`."""
    sensors, senses = problem.sensors, problem.orbits.senses
    a, b = pairs[:, 0], pairs[:, 1]
    ranges = sensors.ranges / problem.scale
    rows = [senses[a], senses[b], ranges[a], ranges[b], *_shares(problem, pairs)]
    if views:
        half, boresights = 0.5 * sensors.fields_of_view, sensors.boresights
        half = np.where(half >= np.pi, ALL_ROUND, half)
        rows += [half[a], half[b], boresights[a], boresights[b]]
    return np.array(rows, dtype=float).reshape(len(rows), len(pairs))


def _shares(problem: RefineProblem, pairs: Index) -> tuple[Array, Array]:
    """Shares of both directions of sight in a contact: half each, or all for the longer range.

    A sensor that is not ready at every sample makes the fewer sightings.
    """
    ranges, every = problem.sensors.ranges, problem.sensors.every
    a, b = ranges[pairs[:, 0]], ranges[pairs[:, 1]]
    alike = np.isclose(a, b)
    shares = np.where(alike, 0.5, a > b), np.where(alike, 0.5, b > a)
    return shares[0] / every[pairs[:, 0]], shares[1] / every[pairs[:, 1]]


def _anchor_parameters(problem: RefineProblem, vehicles: Index, views: bool) -> Array:
    """(2 or 4, k) parameters of `anchor_contact`."""
    sensors = problem.sensors
    rows = [problem.orbits.senses[vehicles], sensors.ranges[vehicles] / problem.scale]
    if views:
        half = 0.5 * sensors.fields_of_view[vehicles]
        rows += [np.where(half >= np.pi, ALL_ROUND, half), sensors.boresights[vehicles]]
    return np.array(rows, dtype=float).reshape(len(rows), len(vehicles))


def pair_contact(
    times: SampleTimes, views: bool, pieces: tuple[ConvexPiece, ...] = ()
) -> ca.Function:
    """Return the function (a, b, parameters, step) -> log samples in contact.

    `a`, `b` are circles (x, y, R, phi), scaled. Parameters are the senses of a and b, their ranges,
    the shares of the two directions of sight in the contact, and with `views` the half views and
    boresights of both in rad. `step` holds the step's width, as a share of the range, and the
    margin by which contact stays within the range. Scaled `pieces` block sight.
    """
    a, b = ca.SX.sym("a", 4), ca.SX.sym("b", 4)
    parameters = ca.SX.sym("parameters", 10 if views else 6)
    step = ca.SX.sym("step", 2)
    sense_a, sense_b, range_a, range_b, share_a, share_b = ca.vertsplit(parameters[:6])
    arm_a, arm_b = _arms(a, sense_a, times), _arms(b, sense_b, times)
    q = ca.repmat(b[:2] - a[:2], 1, len(times.angles)) + arm_b - arm_a
    squared = ca.sum1(q * q)
    view_a = view_b = None
    if views:
        view_a = _view(arm_a, sense_a, q, parameters[6], parameters[8])
        view_b = _view(arm_b, sense_b, -q, parameters[7], parameters[9])
    here = ca.repmat(a[:2], 1, len(times.angles)) + arm_a
    gap = _gap(pieces, here, here + q)
    one = _log_count(squared, range_a - step[1], (view_a, gap), step[0], times)
    other = _log_count(squared, range_b - step[1], (view_b, gap), step[0], times)
    contact = ca.logsumexp(ca.vertcat(one + ca.log(share_a), other + ca.log(share_b)))
    return ca.Function("pair_contact", [a, b, parameters, step], [contact])


def anchor_contact(
    times: SampleTimes, views: bool, pieces: tuple[ConvexPiece, ...] = ()
) -> ca.Function:
    """Return the function (a, place, parameters, step) -> log samples in contact.

    As `pair_contact` for a landmark at `place` (2,); parameters are a's sense and range, and with
    `views` its half view and boresight.
    """
    a, place = ca.SX.sym("a", 4), ca.SX.sym("place", 2)
    parameters = ca.SX.sym("parameters", 4 if views else 2)
    step = ca.SX.sym("step", 2)
    sense, reach = parameters[0], parameters[1]
    arm = _arms(a, sense, times)
    q = ca.repmat(place - a[:2], 1, len(times.angles)) - arm
    view = _view(arm, sense, q, parameters[2], parameters[3]) if views else None
    here = ca.repmat(a[:2], 1, len(times.angles)) + arm
    gap = _gap(pieces, here, here + q, to_landmark=True)
    contact = _log_count(ca.sum1(q * q), reach - step[1], (view, gap), step[0], times)
    return ca.Function("anchor_contact", [a, place, parameters, step], [contact])


def _arms(circle: ca.SX, sense: ca.SX, times: SampleTimes) -> ca.SX:
    """(2, k) from the centre to the vehicle at each sample."""
    arm = circle[2] * ca.vertcat(ca.cos(circle[3]), ca.sin(circle[3]))
    swing = sense * ca.vertcat(-arm[1], arm[0])
    return arm @ ca.DM(np.cos(times.angles)).T + swing @ ca.DM(np.sin(times.angles)).T


def _view(arms: ca.SX, sense: ca.SX, q: ca.SX, half: ca.SX, boresight: ca.SX) -> ca.SX:
    """(1, k) rad between the direction of q and the edge of the view; negative outside it."""
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
    """(1, k) by which sight lines from (2, k) to (2, k) clear what blocks sight, where it is."""
    if not pieces:
        return None
    ends = here[0, :], here[1, :], there[0, :], there[1, :]
    return sight_gap(pieces, ends, to_landmark=to_landmark)


def _log_weight(squared: ca.SX, reach: ca.SX, seen: _Seen, width: ca.SX) -> ca.SX:
    """Logarithm of a sighting's weight.

    The view's step is as wide in rad as the range's share, that of obstacles as wide as the range's
    own.
    """
    log = _log_logistic((reach**2 - squared) / (2.0 * width * reach**2))
    view, gap = seen
    if view is not None:
        log += _log_logistic(view / width)
    return log if gap is None else log + _log_logistic(gap / (width * reach))


def _log_count(
    squared: ca.SX, reach: ca.SX, seen: _Seen, width: ca.SX, times: SampleTimes
) -> ca.SX:
    """Logarithm of the number of samples in contact."""
    log = _log_weight(squared, reach, seen, width) + ca.DM(np.log(times.counts)).T
    return ca.logsumexp(log.T)


def _log_logistic(x: ca.SX) -> ca.SX:
    return ca.fmin(x, 0.0) - ca.log1p(ca.exp(-ca.fabs(x)))
