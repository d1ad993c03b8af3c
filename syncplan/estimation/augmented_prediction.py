"""Prediction with further states: how errors move poses, and the covariance with them.

The kernels are those of `augmented_filter`, whose docstring has the model. F is exact along the
arc. Rows of a vehicle's x and y have the columns

    heading (-dy, dx)    wind, gust T    scale displacement(read speed, w)    bias d(dx, dy) / dw

and its heading has T for the bias; (dx, dy) is the way through the air. Constants do not move, so
of P only rows and columns of poses change, one vehicle after another.
"""

import math

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batched_filter import shortening
from syncplan.estimation.filter_setup import MotionModel
from syncplan.estimation.lane_filter import Lanes, compiled

__all__ = ["BIAS", "predict_augmented"]

WIND, SCALE, TURN, BIAS, GUST = 0, 2, 3, 4, 5
"""Places in a row of AugmentedSetup.columns; wind and gusts take two each."""


@compiled
def predict_augmented(
    x: Array,
    errors: Array,
    P: Array,
    speeds: Array,
    turn_rates: Array,
    setup: AugmentedSetup,
    slopes: Array,
    before: Array,
    lanes: Lanes,
) -> None:
    """Advance x (n, 3, lanes), errors (e, lanes) and P by one sample of readings (n, lanes).

    `slopes` (8, lanes) is scratch: the way through the air, and its derivatives by read speed, turn
    rate and scale; `before` (7, 3, lanes) is scratch too.
    """
    motion = setup.poses.motion
    for i in range(len(x)):
        own = setup.columns[i]
        _move(x, errors, i, speeds, turn_rates, motion, own, slopes, lanes)
        _carry(P, 3 * i, own, motion.time, slopes, before, lanes)
        _add_noise(P, 3 * i, slopes, motion, lanes)
    if setup.first_gust < len(P):
        _let_gusts_decay(P, errors, setup, lanes)


@compiled
def _error_of(errors: Array, count: int, column: int, lane: int) -> float:
    """The error in a column of the state; 0 where the column is -1."""
    return errors[column - 3 * count, lane] if column >= 0 else 0.0


@compiled
def _move(
    x: Array,
    errors: Array,
    i: int,
    speeds: Array,
    turn_rates: Array,
    motion: MotionModel,
    own: Index,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Move vehicle i and fill in the slopes of its way."""
    n, time, substeps = len(x), motion.time, motion.substeps
    share = 0.5 * (substeps - 1) / substeps if substeps else 0.5
    for lane in range(len(lanes)):
        grown = 1.0 + _error_of(errors, n, own[SCALE], lane)
        speed = speeds[i, lane]
        turn = (turn_rates[i, lane] + _error_of(errors, n, own[TURN], lane)) * time
        ratio, slope = shortening(0.5 * turn, substeps)
        direction = x[i, 2, lane] + share * turn
        cos, sin = math.cos(direction), math.sin(direction)
        path = speed * grown * time
        slopes[0, lane], slopes[1, lane] = path * ratio * cos, path * ratio * sin
        chord = grown * time * ratio
        slopes[2, lane], slopes[3, lane] = chord * cos, chord * sin
        along, across = 0.5 * path * time * slope, path * time * share * ratio
        slopes[4, lane] = along * cos - across * sin
        slopes[5, lane] = along * sin + across * cos
        chord = speed * time * ratio
        slopes[6, lane], slopes[7, lane] = chord * cos, chord * sin
        x[i, 2, lane] += turn
        for axis in range(2):
            drift = _error_of(errors, n, own[WIND + axis], lane)
            drift += _error_of(errors, n, own[GUST + axis], lane)
            x[i, axis, lane] += slopes[axis, lane] + time * drift


@compiled
def _add_times(
    P: Array, into: int, k: int, column: int, factor: Array, sign: float, lanes: Lanes
) -> None:
    """P[into, k] += sign * factor * P[column, k], by the lower triangle."""
    a, b, c, d = max(into, k), min(into, k), max(column, k), min(column, k)
    for lane in range(len(lanes)):
        P[a, b, lane] += sign * factor[lane] * P[c, d, lane]


@compiled
def _add_share(P: Array, into: int, k: int, column: int, share: float, lanes: Lanes) -> None:
    """P[into, k] += share * P[column, k], by the lower triangle."""
    a, b, c, d = max(into, k), min(into, k), max(column, k), min(column, k)
    for lane in range(len(lanes)):
        P[a, b, lane] += share * P[c, d, lane]


@compiled
def _carry_column(
    P: Array, r: int, k: int, own: Index, time: float, slopes: Array, lanes: Lanes
) -> None:
    """P[r : r + 3, k] = F P[:, k] for the vehicle at row r and a column k of another state."""
    _add_times(P, r, k, r + 2, slopes[1], -1.0, lanes)
    _add_times(P, r + 1, k, r + 2, slopes[0], 1.0, lanes)
    for axis in range(2):
        if own[WIND + axis] >= 0:
            _add_share(P, r + axis, k, own[WIND + axis], time, lanes)
        if own[GUST + axis] >= 0:
            _add_share(P, r + axis, k, own[GUST + axis], time, lanes)
        if own[SCALE] >= 0:
            _add_times(P, r + axis, k, own[SCALE], slopes[6 + axis], 1.0, lanes)
        if own[TURN] >= 0:
            _add_times(P, r + axis, k, own[TURN], slopes[4 + axis], 1.0, lanes)
    if own[TURN] >= 0:
        _add_share(P, r + 2, k, own[TURN], time, lanes)


@compiled
def _carry(
    P: Array, r: int, own: Index, time: float, slopes: Array, before: Array, lanes: Lanes
) -> None:
    """P = F P F' for the vehicle at rows r, r + 1, r + 2; its errors' columns are `own`.

    With A = F's block of the pose, E that of its errors, C their covariance with the pose before
    and C* after, the pose's own block is (A B + E C) A' + C*' E'.
    """
    for s in range(len(own)):
        if own[s] >= 0:
            for c in range(3):
                before[s, c] = P[own[s], r + c]
    for k in range(r):
        _carry_column(P, r, k, own, time, slopes, lanes)
    for k in range(r + 3, len(P)):
        _carry_column(P, r, k, own, time, slopes, lanes)
    _turn_block(P, r, slopes, lanes)
    for s in range(len(own)):
        if own[s] >= 0 and s != BIAS:
            _add_errors_part(P, r, s, own[s], time, slopes, before[s], lanes)


@compiled
def _turn_block(P: Array, r: int, slopes: Array, lanes: Lanes) -> None:
    """A B A' of the pose at row r."""
    for lane in range(len(lanes)):
        a, b = -slopes[1, lane], slopes[0, lane]
        hx, hy, hh = P[r + 2, r, lane], P[r + 2, r + 1, lane], P[r + 2, r + 2, lane]
        P[r, r, lane] += a * (2.0 * hx + a * hh)
        P[r + 1, r, lane] += a * hy + b * (hx + a * hh)
        P[r + 1, r + 1, lane] += b * (2.0 * hy + b * hh)
        P[r + 2, r, lane] = hx + a * hh
        P[r + 2, r + 1, lane] = hy + b * hh


@compiled
def _add_errors_part(
    P: Array, r: int, s: int, column: int, time: float, slopes: Array, old: Array, lanes: Lanes
) -> None:
    """E C A' + C*' E' of the error in a column: `old` (3, lanes) is its covariance before."""
    for lane in range(len(lanes)):
        ex, ey, eh = 0.0, 0.0, 0.0
        if s == SCALE:
            ex, ey = slopes[6, lane], slopes[7, lane]
        elif s == TURN:
            ex, ey, eh = slopes[4, lane], slopes[5, lane], time
        elif s in (WIND, GUST):
            ex = time
        else:
            ey = time
        hx, hy, hh = old[0, lane], old[1, lane], old[2, lane]
        ax, ay = hx - slopes[1, lane] * hh, hy + slopes[0, lane] * hh
        nx, ny, nh = P[column, r, lane], P[column, r + 1, lane], P[column, r + 2, lane]
        P[r, r, lane] += ex * (ax + nx)
        P[r + 1, r, lane] += ey * ax + ex * ny
        P[r + 1, r + 1, lane] += ey * (ay + ny)
        P[r + 2, r, lane] += eh * ax + ex * nh
        P[r + 2, r + 1, lane] += eh * ay + ey * nh
        P[r + 2, r + 2, lane] += eh * (hh + nh)


@compiled
def _add_noise(P: Array, r: int, slopes: Array, motion: MotionModel, lanes: Lanes) -> None:
    """P += G Q G' for the vehicle at row r: slopes[2:4] is G by speed, slopes[4:6] by turn rate."""
    time, speed_variance = motion.time, motion.speed_variance
    turn_variance = motion.turn_rate_variance
    for lane in range(len(lanes)):
        vx, vy = slopes[2, lane], slopes[3, lane]
        wx, wy = slopes[4, lane], slopes[5, lane]
        P[r, r, lane] += speed_variance * vx * vx + turn_variance * wx * wx
        P[r + 1, r, lane] += speed_variance * vx * vy + turn_variance * wx * wy
        P[r + 1, r + 1, lane] += speed_variance * vy * vy + turn_variance * wy * wy
        P[r + 2, r, lane] += turn_variance * wx * time
        P[r + 2, r + 1, lane] += turn_variance * wy * time
        P[r + 2, r + 2, lane] += turn_variance * time * time


@compiled
def _let_gusts_decay(P: Array, errors: Array, setup: AugmentedSetup, lanes: Lanes) -> None:
    decay, size, begin = setup.decay, len(P), setup.first_gust
    for c in range(begin, size):
        for k in range(begin):
            for lane in range(len(lanes)):
                P[c, k, lane] *= decay
        for k in range(begin, c + 1):
            for lane in range(len(lanes)):
                P[c, k, lane] *= decay * decay
        for lane in range(len(lanes)):
            P[c, c, lane] += setup.gust_noise
            errors[c - size + len(errors), lane] *= decay
