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
            own = (_observers(problem, vehicles, views) for vehicles in kept.T)
            inputs = [*own, _shares(problem, kept), step]
            lower = np.log(needed + 1.0 / problem.sensors.every[kept].max(axis=1))
        else:
            owners, function = kept[:, :1], anchor_contact(times, views, pieces)
            places = problem.landmarks[kept[:, 1] - count].T / problem.scale
            inputs = [places, _observers(problem, kept[:, 0], views), step]
            # counted at all samples: the fewest that hold so many at which the sensor is ready
            lower = np.log(needed * problem.sensors.every[kept[:, 0]] + 1.0)
        blocks.append(blocks_of(function, circles, owners, [*map(ca.DM, inputs)], lower, labels))
    return stacked_blocks(blocks, count)


def _observers(problem: RefineProblem, vehicles: Index, views: bool) -> Array:
    """(2 or 4, e) senses, scaled ranges, and with `views` half views and boresights of vehicles."""
    sensors = problem.sensors
    rows = [problem.orbits.senses[vehicles], sensors.ranges[vehicles] / problem.scale]
    if views:
        half = 0.5 * sensors.fields_of_view[vehicles]
        rows += [np.where(half >= np.pi, ALL_ROUND, half), sensors.boresights[vehicles]]
    return np.array(rows, dtype=float).reshape(len(rows), len(vehicles))


def _shares(problem: RefineProblem, pairs: Index) -> Array:
    """(2, e) shares of both directions of sight: half each, or all for the longer range.

    A sensor that is not ready at every sample makes the fewer sightings.
    """
    ranges, every = problem.sensors.ranges, problem.sensors.every
    a, b = ranges[pairs[:, 0]], ranges[pairs[:, 1]]
    alike = np.isclose(a, b)
    return np.where(alike, 0.5, [a > b, b > a]) / every[pairs].T


def pair_contact(
    times: SampleTimes, views: bool, pieces: tuple[ConvexPiece, ...] = ()
) -> ca.Function:
    """Return the function (a, b, own_a, own_b, shares, step) -> log samples in contact.

    `a`, `b` are circles (x, y, R, phi), scaled; `own_a`, `own_b` as `_observers` has them, and
    `shares` of the two directions of sight in the contact as `_shares` has them. `step` holds the
    step's width, as a share of the range, and the margin by which contact stays within the range.
    Scaled `pieces` block sight.
    """
    circles = [ca.SX.sym(name, 4) for name in "ab"]
    owns = [ca.SX.sym(f"own_{name}", 4 if views else 2) for name in "ab"]
    shares, step = ca.SX.sym("shares", 2), ca.SX.sym("step", 2)
    arm_a, arm_b = (_arms(one, own[0], times) for one, own in zip(circles, owns, strict=True))
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
    arm = _arms(a, own[0], times)
    q = ca.repmat(place - a[:2], 1, len(times.angles)) - arm
    here = ca.repmat(a[:2], 1, len(times.angles)) + arm
    gap = _gap(pieces, here, here + q, to_landmark=True)
    contact = _log_count(arm, q, ca.sum1(q * q), gap, own, step, times)
    return ca.Function("anchor_contact", [a, place, own, step], [contact])


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

    The view's step is as wide in rad as the range's share, that of obstacles as wide as the range's
    own.
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
