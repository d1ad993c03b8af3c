"""The extended Kalman filter with further states: wind, scales, biases and gusts beside the poses.

The state stacks the poses of `batched_filter` and the errors c of a layout. Each sample:

    predict   v = (1 + scale) read speed,  w = read turn rate + bias
              pose += (displacement(v, w) + T (wind + gust), T w),    gust = decay gust
              P = F P F' + G Q G',   gusts' variances grow by their noise
    update    as there; a bearing expects its bias too, whose entry of the row is 1

A sighting that is NaN is missed: its lane's state, covariance and statistics stay as they are.

`reference_states` does this in NumPy for one trial and is the one to read. Lanes are as in
`batched_filter`, and of P only the lower triangle is maintained. It stays in the frame of an
earlier sample, see `augmented_prediction`, until NEES, coverage or a series ask for it.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3, and 11.4 (state augmentation).
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_correction import AT_ONCE, correct_augmented
from syncplan.estimation.augmented_frame import bring_to_now
from syncplan.estimation.augmented_prediction import predict_augmented
from syncplan.estimation.augmented_rows import MOST_ENTRIES
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.lane_filter import LaneFilter, Lanes, augmented_specimen, compiled
from syncplan.estimation.lane_statistics import record_errors

__all__ = ["AUGMENTED"]


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
    sampled = _is_sampled(poses, step)
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
def _is_sampled(poses: FilterSetup, step: int) -> bool:
    taken = step % poses.sample_every == 0 or step == len(poses.truth) - 1
    return taken and step > poses.judged_from


@compiled
def _filter(
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    statistics: AugmentedStatistics,
    lanes: Lanes,
    x: Array,
    errors: Array,
    P: Array,
    begin: int,
    end: int,
) -> None:
    """Take x, errors and P, lower triangle, from sample `begin` to sample `end`."""
    poses, n, size, width = setup.poses, len(x), len(P), len(lanes)
    slopes, before = np.empty((12, width)), np.empty((7, 3, width))
    halves = (np.empty((AT_ONCE, size, width)), np.empty((AT_ONCE, size, width)))
    row = (np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros((MOST_ENTRIES, width)))
    seen = (np.empty((3, width)), np.empty(width), np.zeros(width))
    frame = (np.zeros((n, 6, width)), np.array([0.0, 0.0, 1.0]))
    block = np.empty((3 * n, 3 * n, width))
    scratch = (np.empty((3 * n, width)), np.empty_like(block), halves[0][0], halves[1][0])
    if begin == 0:
        _record(x, errors, P, setup, readings, 0, scratch, block, statistics, lanes)
    for step in range(begin + 1, end + 1):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(
            x, errors, P, speeds, turn_rates, setup, step, frame, slopes, before, lanes
        )
        correct_augmented(
            x, errors, P, step, setup, readings, frame, seen, row, halves, statistics, lanes
        )
        at = poses.compared[step]
        if step == end or (at >= 0 and (_is_sampled(poses, at) or len(statistics.poses.series))):
            bring_to_now(P, setup, frame, before, lanes)
        if at >= 0:
            _record(x, errors, P, setup, readings, at, scratch, block, statistics, lanes)


AUGMENTED = LaneFilter(_filter, augmented_specimen)
"""The extended Kalman filter with further states."""
