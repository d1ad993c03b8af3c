"""The extended Kalman filter with further states: wind, scales, biases and gusts beside the poses.

The state stacks the poses of `batched_filter` and the errors c of a layout. Each sample:

    predict   v = (1 + scale) read speed,  w = read turn rate + bias
              pose += (displacement(v, w) + T (wind + gust), T w),    gust = decay gust
              P = F P F' + G Q G',   gusts' variances grow by their noise
    update    as there; a bearing expects its bias too, whose entry of the row is 1

A sighting that is NaN is missed: its lane's state, covariance and statistics stay as they are.

`reference_states` does this in NumPy for one trial and is the one to read. Lanes are as in
`batched_filter`, and of P only the lower triangle is maintained. Errors follow the poses, so each
row of P that is not one of a pose changes by columns of the poses alone.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3, and 11.4 (state augmentation).
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_prediction import BIAS, predict_augmented
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.batched_filter import BEARING_KIND, sighting_lanes
from syncplan.estimation.lane_filter import LaneFilter, Lanes, augmented_specimen, compiled
from syncplan.estimation.lane_statistics import record_errors, subtract_outer

__all__ = ["AUGMENTED", "correct_augmented"]


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
