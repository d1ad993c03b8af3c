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

AT_ONCE = 8
"""Sightings that P is corrected by in one sweep: it is large, and each sweep reads all of it."""


@compiled
def _expect_bias(errors: Array, bias: int, innovation: Array, lanes: Lanes) -> None:
    """Take the bearing bias that is expected off the innovations (lanes,)."""
    for lane in range(len(lanes)):
        off = innovation[lane] - errors[bias, lane]
        innovation[lane] = off - 2.0 * math.pi * math.floor((off + math.pi) / (2.0 * math.pi))


@compiled
def _product(P: Array, row: Array, o: int, t: int, bias: int, u: Array, lanes: Lanes) -> None:
    """u = P h; t and bias are -1 without a target among the states, or without a bias.

    What there is none of counts nothing, but is read all the same: one loop does it all.
    """
    target, shift = (t if t >= 0 else o), (bias if bias >= 0 else o)
    of_target, of_bias = (-1.0 if t >= 0 else 0.0), (1.0 if bias >= 0 else 0.0)
    for k in range(len(P)):
        a0, b0, a1, b1 = max(k, o), min(k, o), max(k, o + 1), min(k, o + 1)
        a2, b2, a3, b3 = max(k, o + 2), min(k, o + 2), max(k, target), min(k, target)
        a4, b4 = max(k, target + 1), min(k, target + 1)
        a5, b5 = max(k, shift), min(k, shift)
        for lane in range(len(lanes)):
            u[k, lane] = (
                row[0, lane] * (P[a0, b0, lane] + of_target * P[a3, b3, lane])
                + row[1, lane] * (P[a1, b1, lane] + of_target * P[a4, b4, lane])
                + row[2, lane] * P[a2, b2, lane]
                + of_bias * P[a5, b5, lane]
            )


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
    pending: int,
    halves: tuple[Array, Array],
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Correct the state by sighting s, whose innovation and row are filled in; count it.

    The covariance is corrected later: `halves` are u and gain, (AT_ONCE, 3n + e, lanes) each, of
    the `pending` sightings since P was last, and this one's are added to them.
    """
    n, poses = len(x), setup.poses
    us, gains = halves
    o, t, bias = 3 * poses.observers[s], 3 * poses.targets[s], -1
    if t >= 3 * n:
        t = -1
    if poses.kinds[s] == BEARING_KIND:
        bias = setup.columns[poses.observers[s], BIAS]
        if bias >= 0:
            _expect_bias(errors, bias - 3 * n, innovation, lanes)
    u, gain = us[pending], gains[pending]
    _product(P, row, o, t, bias, u, lanes)
    for j in range(pending):
        _take_off(row, o, t, bias, us[j], gains[j], u, gain[0], lanes)
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


@compiled
def _take_off(
    row: Array,
    o: int,
    t: int,
    bias: int,
    before: Array,
    gain: Array,
    u: Array,
    shares: Array,
    lanes: Lanes,
) -> None:
    """u -= gain (before . h): the correction by a sighting that P has not had yet."""
    for lane in range(len(lanes)):
        a, b = row[0, lane], row[1, lane]
        share = a * before[o, lane] + b * before[o + 1, lane] + row[2, lane] * before[o + 2, lane]
        if t >= 0:
            share -= a * before[t, lane] + b * before[t + 1, lane]
        if bias >= 0:
            share += before[bias, lane]
        shares[lane] = share
    for k in range(len(u)):
        for lane in range(len(lanes)):
            u[k, lane] -= gain[k, lane] * shares[lane]


@compiled
def _correct_covariance(P: Array, pending: int, halves: tuple[Array, Array], lanes: Lanes) -> None:
    """P -= sum of gain u' over the pending sightings, on the lower triangle."""
    us, gains = halves
    done = 0
    while pending - done >= 4:
        _subtract_four(P, gains[done : done + 4], us[done : done + 4], lanes)
        done += 4
    while pending - done >= 2:
        _subtract_two(P, gains[done : done + 2], us[done : done + 2], lanes)
        done += 2
    if done < pending:
        subtract_outer(P, gains[done], us[done], 0, lanes)


@compiled
def _subtract_two(P: Array, g: Array, u: Array, lanes: Lanes) -> None:
    for i in range(len(P)):
        for j in range(i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= g[0, i, lane] * u[0, j, lane] + g[1, i, lane] * u[1, j, lane]


@compiled
def _subtract_four(P: Array, g: Array, u: Array, lanes: Lanes) -> None:
    for i in range(len(P)):
        for j in range(i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= (g[0, i, lane] * u[0, j, lane] + g[1, i, lane] * u[1, j, lane]) + (
                    g[2, i, lane] * u[2, j, lane] + g[3, i, lane] * u[3, j, lane]
                )


@compiled
def _correct_all(
    x: Array,
    errors: Array,
    P: Array,
    step: int,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    row: Array,
    innovation: Array,
    halves: tuple[Array, Array],
    statistics: AugmentedStatistics,
    lanes: Lanes,
) -> None:
    """Take in the sightings of a step, one after another."""
    poses, pending = setup.poses, 0
    for s in range(poses.first[step], poses.first[step + 1]):
        o, t, z = poses.observers[s], poses.targets[s], readings.sightings[s]
        sighting_lanes(poses.kinds[s], x, o, t, poses.landmarks, z, row, innovation, lanes)
        correct_augmented(
            x, errors, P, s, setup, row, innovation, pending, halves, statistics, lanes
        )
        pending += 1
        if pending == AT_ONCE:
            _correct_covariance(P, pending, halves, lanes)
            pending = 0
    _correct_covariance(P, pending, halves, lanes)


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
    share, late_share = (1.0 if step else 0.0), (1.0 if late else 0.0)
    for i in range(len(x)):
        for c in range(3):
            e = scratch[0][3 * i + c]
            if c < 2:
                for lane in range(len(lanes)):
                    e[lane] = x[i, c, lane] - poses.truth[step, i, c]
            else:
                for lane in range(len(lanes)):
                    off = x[i, c, lane] - readings.headings[step, i, lane]
                    e[lane] = off - 2.0 * math.pi * np.floor((off + math.pi) / (2.0 * math.pi))
            for lane in range(len(lanes)):
                counted.final[i, c, lane] = e[lane]
                counted.squares[i, c, lane] += share * e[lane] * e[lane]
                counted.late_squares[i, c, lane] += late_share * e[lane] * e[lane]
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
    true = readings.constants[k] if k < constants else readings.gusts[step, k - constants]
    share, late_share = (1.0 if step else 0.0), (1.0 if late else 0.0)
    for lane in range(len(lanes)):
        e = errors[k, lane] - true[lane]
        counted.squares[k, lane] += share * e * e
        counted.late_squares[k, lane] += late_share * e * e
    if sampled:
        for lane in range(len(lanes)):
            e = errors[k, lane] - true[lane]
            counted.covered[k, lane] += 1.0 if e * e <= 9.0 * P[place, place, lane] else 0.0
    if len(counted.series):
        for lane in range(len(lanes)):
            e = errors[k, lane] - true[lane]
            counted.series[step, k, 0] += e
            counted.series[step, k, 1] += e * e
            counted.series[step, k, 2] += P[place, place, lane]


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
    slopes, before = np.empty((12, width)), np.empty((7, 3, width))
    row, halves = (
        np.empty((3, width)),
        (
            np.empty((AT_ONCE, size, width)),
            np.empty((AT_ONCE, size, width)),
        ),
    )
    innovation, block = np.empty(width), np.empty((3 * n, 3 * n, width))
    scratch = (
        np.empty((3 * n, width)),
        np.empty((3 * n, 3 * n, width)),
        halves[0][0],
        halves[1][0],
    )
    for k in range(3 * n):
        P[k, k] = poses.initial_variances[k // 3, k % 3]
    for k in range(e):
        P[3 * n + k, 3 * n + k] = setup.variances[k]
    _record(x, errors, P, setup, readings, 0, scratch, block, statistics, lanes)
    for step in range(1, len(poses.truth)):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(x, errors, P, speeds, turn_rates, setup, slopes, before, lanes)
        _correct_all(
            x, errors, P, step, setup, readings, row, innovation, halves, statistics, lanes
        )
        _record(x, errors, P, setup, readings, step, scratch, block, statistics, lanes)
    return x, errors, P


AUGMENTED = LaneFilter(_filter, augmented_specimen)
"""The extended Kalman filter with further states."""
