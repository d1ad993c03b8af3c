"""The extended Kalman filter with further states: wind, scales, biases and gusts beside the poses.

The state stacks the poses of `batched_filter` and the errors c of a layout. Each sample:

    predict   v = (1 + scale) read speed,  w = read turn rate + bias
              pose += (displacement(v, w) + T (wind + gust), T w),    gust = decay gust
              P = F P F' + G Q G',   gusts' variances grow by their noise
    update    as there; a bearing expects its bias too, whose entry of the row is 1

F is exact along the arc. Rows of a vehicle's x and y have the columns

    heading (-dy, dx)    wind, gust T    scale displacement(read speed, w)    bias d(dx, dy) / dw

and its heading has T for the bias; (dx, dy) is the way through the air. A sighting that is NaN is
missed: its lane's state, covariance and statistics stay as they are.

`reference_states` does this in NumPy for one trial and is the one to read. Lanes are as in
`batched_filter`, and of P only the lower triangle is maintained. Errors follow the poses, so each
row of P that is not one of a pose changes by columns of the poses alone.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3, and 11.4 (state augmentation).
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.batched_filter import BEARING_KIND, shortening, sighting_lanes
from syncplan.estimation.filter_setup import MotionModel
from syncplan.estimation.lane_filter import LaneFilter, Lanes, augmented_specimen, compiled
from syncplan.estimation.lane_statistics import record_errors, subtract_outer

__all__ = ["AUGMENTED", "correct_augmented", "predict_augmented"]

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


@compiled
def _expect_bias(errors: Array, bias: int, innovation: Array, lanes: Lanes) -> None:
    """Take the bearing bias that is expected off the innovations (lanes,)."""
    for lane in range(len(lanes)):
        off = innovation[lane] - errors[bias, lane]
        innovation[lane] = off - 2.0 * math.pi * math.floor((off + math.pi) / (2.0 * math.pi))


@compiled
def _product(P: Array, row: Array, o: int, t: int, bias: int, u: Array, lanes: Lanes) -> None:
    """u = P h; t and bias are -1 without a target among the states, or without a bias."""
    for k in range(len(P)):
        a0, b0 = max(k, o), min(k, o)
        a1, b1 = max(k, o + 1), min(k, o + 1)
        a2, b2 = max(k, o + 2), min(k, o + 2)
        for lane in range(len(lanes)):
            u[k, lane] = (
                row[0, lane] * P[a0, b0, lane]
                + row[1, lane] * P[a1, b1, lane]
                + row[2, lane] * P[a2, b2, lane]
            )
        if t >= 0:
            a0, b0 = max(k, t), min(k, t)
            a1, b1 = max(k, t + 1), min(k, t + 1)
            for lane in range(len(lanes)):
                u[k, lane] -= row[0, lane] * P[a0, b0, lane] + row[1, lane] * P[a1, b1, lane]
        if bias >= 0:
            a0, b0 = max(k, bias), min(k, bias)
            for lane in range(len(lanes)):
                u[k, lane] += P[a0, b0, lane]


@compiled
def _weigh(
    o: int,
    t: int,
    bias: int,
    variance: float,
    setup: AugmentedSetup,
    row: Array,
    innovation: Array,
    u: Array,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Put into row[0] what turns u into the gain: 0 where the sighting is missed, or rejected."""
    counted = statistics.poses
    for lane in range(len(lanes)):
        a, b = row[0, lane], row[1, lane]
        spread = a * u[o, lane] + b * u[o + 1, lane] + row[2, lane] * u[o + 2, lane]
        if t >= 0:
            spread -= a * u[t, lane] + b * u[t + 1, lane]
        if bias >= 0:
            spread += u[bias, lane]
        total = max(spread, 0.0) + variance
        made = 0.0 if math.isnan(innovation[lane]) else 1.0
        off = 0.0 if math.isnan(innovation[lane]) else innovation[lane]
        square = off * off
        accepted = made if square <= setup.poses.gate * total else 0.0
        counted.nis[lane] += accepted * (square / total)
        counted.accepted[lane] += accepted
        counted.gated[lane] += made - accepted
        innovation[lane] = off
        row[0, lane] = accepted / total


@compiled
def correct_augmented(
    x: Array,
    errors: Array,
    P: Array,
    s: int,
    setup: AugmentedSetup,
    row: Array,
    innovation: Array,
    u: Array,
    gain: Array,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Correct state and P by sighting s, whose innovation and row are filled in; count it.

    The arrays are as in `correct_lanes`; u and gain are (3n + e, lanes).
    """
    n, poses = len(x), setup.poses
    o, t, bias = 3 * poses.observers[s], 3 * poses.targets[s], -1
    if t >= 3 * n:
        t = -1
    if poses.kinds[s] == BEARING_KIND:
        bias = setup.columns[poses.observers[s], BIAS]
        if bias >= 0:
            _expect_bias(errors, bias - 3 * n, innovation, lanes)
    _product(P, row, o, t, bias, u, lanes)
    _weigh(o, t, bias, poses.variances[s], setup, row, innovation, u, statistics, lanes)
    for k in range(len(P)):
        for lane in range(len(lanes)):
            gain[k, lane] = u[k, lane] * row[0, lane]
    for i in range(n):
        for c in range(3):
            for lane in range(len(lanes)):
                x[i, c, lane] += gain[3 * i + c, lane] * innovation[lane]
    for k in range(len(errors)):
        for lane in range(len(lanes)):
            errors[k, lane] += gain[3 * n + k, lane] * innovation[lane]
    subtract_outer(P, gain, u, 0, lanes)


@compiled
def _record(
    x: Array,
    errors: Array,
    P: Array,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    step: int,
    scratch: tuple[Array, Array, Array, Array],
    block: Array,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Add the errors after a step to the statistics; step 0 counts in the series alone."""
    poses, steps = setup.poses, len(setup.poses.truth) - 1
    late, counted = 2 * step > steps, statistics.poses
    for i in range(len(x)):
        for c in range(3):
            for lane in range(len(lanes)):
                if c == 2:
                    e = x[i, c, lane] - readings.headings[step, i, lane]
                    e -= 2.0 * math.pi * math.floor((e + math.pi) / (2.0 * math.pi))
                else:
                    e = x[i, c, lane] - poses.truth[step, i, c]
                scratch[0][3 * i + c, lane] = e
                counted.final[i, c, lane] = e
                if step:
                    counted.squares[i, c, lane] += e * e
                if late:
                    counted.late_squares[i, c, lane] += e * e
    sampled = step > 0 and (step % poses.sample_every == 0 or step == steps)
    if sampled or len(counted.series):
        for i in range(len(block)):
            block[i, : i + 1] = P[i, : i + 1]
        record_errors(block, poses, step, scratch, counted, lanes)
    for k in range(len(errors)):
        _record_error(errors, P, readings, step, k, sampled, late, statistics, lanes)


@compiled
def _record_error(
    errors: Array,
    P: Array,
    readings: AugmentedReadings,
    step: int,
    k: int,
    sampled: bool,
    late: bool,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Add what further state k is off to the statistics."""
    counted, place = statistics.errors, len(P) - len(errors) + k
    constants = len(readings.constants)
    for lane in range(len(lanes)):
        if k < constants:
            true = readings.constants[k, lane]
        else:
            true = readings.gusts[step, k - constants, lane]
        e, variance = errors[k, lane] - true, P[place, place, lane]
        if step:
            counted.squares[k, lane] += e * e
        if late:
            counted.late_squares[k, lane] += e * e
        if sampled and e * e <= 9.0 * variance:
            counted.covered[k, lane] += 1.0
        if len(counted.series):
            counted.series[step, k, 0] += e
            counted.series[step, k, 1] += e * e
            counted.series[step, k, 2] += variance


@compiled
def _filter(
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> tuple[Array, Array, Array]:
    poses = setup.poses
    n, e, width = len(poses.initial_variances), len(setup.variances), len(lanes)
    size = 3 * n + e
    x, errors, P = readings.initial.copy(), np.zeros((e, width)), np.zeros((size, size, width))
    slopes, before = np.empty((8, width)), np.empty((7, 3, width))
    u, gain, row = np.empty((size, width)), np.empty((size, width)), np.empty((3, width))
    innovation, block = np.empty(width), np.empty((3 * n, 3 * n, width))
    scratch = (np.empty((3 * n, width)), np.empty((3 * n, 3 * n, width)), u, gain)
    for k in range(3 * n):
        P[k, k] = poses.initial_variances[k // 3, k % 3]
    for k in range(e):
        P[3 * n + k, 3 * n + k] = setup.variances[k]
    _record(x, errors, P, setup, readings, 0, scratch, block, statistics, lanes)
    for step in range(1, len(poses.truth)):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(x, errors, P, speeds, turn_rates, setup, slopes, before, lanes)
        for s in range(poses.first[step], poses.first[step + 1]):
            o, t, z = poses.observers[s], poses.targets[s], readings.sightings[s]
            sighting_lanes(poses.kinds[s], x, o, t, poses.landmarks, z, row, innovation, lanes)
            correct_augmented(x, errors, P, s, setup, row, innovation, u, gain, statistics, lanes)
        _record(x, errors, P, setup, readings, step, scratch, block, statistics, lanes)
    return x, errors, P


AUGMENTED = LaneFilter(_filter, augmented_specimen)
"""The extended Kalman filter with further states."""
