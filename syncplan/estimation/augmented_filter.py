"""The extended Kalman filter with further states: lasting errors beside the poses.

The state stacks the poses of `batched_filter` and the errors c of a layout. Each sample:

    predict   v = (1 + scale) read speed,  w = read turn rate + bias
              pose += (displacement(v, w) + T (wind + gust), T w),    errors *= decays
              P = F P F' + G Q G',   errors that decay gain what keeps their variance
    update    as there; a bearing expects its bias and walk too, whose entries of the row are 1

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
from syncplan.estimation.augmented_frame import OWN, bring_to_now, frame_of
from syncplan.estimation.augmented_prediction import predict_augmented
from syncplan.estimation.augmented_rows import MOST_ENTRIES
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.augmented_statistics import is_wanted_now, record_augmented
from syncplan.estimation.lane_filter import LaneFilter, Lanes, augmented_specimen, compiled, inner


@inner
def _compare(
    x: Array,
    errors: Array,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    step: int,
    offs: Array,
    error_offs: Array,
    lanes: Lanes,
) -> None:
    """Fill in errors of poses (3n, lanes), headings wrapped, and of further states (e, lanes)."""
    truth, constants = setup.poses.truth, len(readings.constants)
    for i in range(len(x)):
        for lane in range(len(lanes)):
            offs[3 * i, lane] = x[i, 0, lane] - truth[step, i, 0]
            offs[3 * i + 1, lane] = x[i, 1, lane] - truth[step, i, 1]
            off = x[i, 2, lane] - readings.headings[step, i, lane]
            turns = np.floor((off + math.pi) / (2.0 * math.pi))
            offs[3 * i + 2, lane] = off - 2.0 * math.pi * turns
    for k in range(len(errors)):
        true = readings.constants[k] if k < constants else readings.changing[step, k - constants]
        for lane in range(len(lanes)):
            error_offs[k, lane] = errors[k, lane] - true[lane]


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
    slopes, before = np.empty((12, width)), np.empty((OWN, 3, width))
    halves = (np.empty((AT_ONCE, size, width)), np.empty((AT_ONCE, size, width)))
    row = (np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros((MOST_ENTRIES, width)))
    seen = (np.empty((4, width)), np.empty(width), np.zeros(width))
    frame = frame_of(setup, lanes)
    error_offs = np.empty_like(errors)
    block = np.empty((3 * n, 3 * n, width))
    scratch = (np.empty((3 * n, width)), np.empty_like(block), halves[0][0], halves[1][0])
    about = x, errors, False
    compared = error_offs, scratch, block
    if begin == 0:
        _compare(x, errors, setup, readings, 0, scratch[0], error_offs, lanes)
        record_augmented(P, poses, 0, compared, statistics, lanes)
    for step in range(begin + 1, end + 1):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(
            x, errors, P, speeds, turn_rates, setup, step, frame, slopes, before, lanes
        )
        correct_augmented(
            x, errors, P, step, setup, readings, about, frame, seen, row, halves, statistics, lanes
        )
        at = poses.compared[step]
        if step == end or (at >= 0 and is_wanted_now(poses, at, statistics)):
            bring_to_now(P, setup, frame, before, lanes)
        if at >= 0:
            _compare(x, errors, setup, readings, at, scratch[0], error_offs, lanes)
            record_augmented(P, poses, at, compared, statistics, lanes)


AUGMENTED = LaneFilter(_filter, augmented_specimen)
"""The extended Kalman filter with further states."""
