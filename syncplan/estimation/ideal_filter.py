"""The ideal filter: the extended Kalman filter, linearised at the truth instead of at its estimate.

No filter can do this, as the truth is what it looks for. It is the reference of what is attainable:
its errors are those of the posterior Cramer-Rao bound, and its covariance holds, however uncertain
the start. With the state (poses and further states) off the truth by d, F, G and rows h taken at
the truth:

    predict   d = F d + G (readings - true readings) + (truth moved by true readings - truth)
    update    nu = z - h(truth) - h' d,   d += gain nu
    P         as of `augmented_filter`, at the truth

True readings are those that lead from each true pose to the next through the true air. The last
term of the prediction is what a sample's arc misses of the true way, next to nothing, and all that
errors do which are not among the states. Errors that change gain noise there. d is not wrapped: a
heading may be off by more than half a turn, as the normal distribution has it.

Each step must be a sample, at which the truth is known. Lanes are as in `batched_filter`.

Source: Taylor (1979), The Cramer-Rao estimation error lower bound computation for deterministic
nonlinear systems, IEEE Transactions on Automatic Control 24.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_correction import AT_ONCE, correct_augmented
from syncplan.estimation.augmented_frame import (
    GUST,
    OWN,
    SCALE,
    TURN,
    WIND,
    Frame,
    bring_to_now,
    frame_of,
)
from syncplan.estimation.augmented_prediction import (
    add_reading_noise,
    error_of,
    kept,
    move,
    pass_sample,
)
from syncplan.estimation.augmented_rows import MOST_ENTRIES
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.augmented_statistics import is_wanted_now, record_augmented
from syncplan.estimation.batched_filter import motion_in, shortening
from syncplan.estimation.lane_filter import LaneFilter, Lanes, augmented_specimen, compiled

State = tuple[Array, Array]
"""Poses (n, 3, lanes) in m, m, rad and further states (e, lanes), true or off the truth."""


@compiled
def _fill_truth(
    true: State, setup: AugmentedSetup, readings: AugmentedReadings, step: int, lanes: Lanes
) -> None:
    """Fill in the true state after a step."""
    poses, errors = true
    constants = len(readings.constants)
    for i in range(len(poses)):
        for lane in range(len(lanes)):
            poses[i, 0, lane] = setup.poses.truth[step, i, 0]
            poses[i, 1, lane] = setup.poses.truth[step, i, 1]
            poses[i, 2, lane] = readings.headings[step, i, lane]
    errors[:constants] = readings.constants
    errors[constants:] = readings.changing[step]


@compiled
def _read_truly(
    i: int,
    time: float,
    true: State,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    step: int,
    read: tuple[Array, Array],
    lanes: Lanes,
) -> None:
    """Fill in the true readings (n, lanes) of vehicle i, in m/s and rad/s, of the step to `step`.

    `true` is the state before it.
    """
    poses, errors = true
    after, own, n = setup.poses.truth[step, i], setup.columns[i], len(poses)
    for lane in range(len(lanes)):
        x, y = poses[i, 0, lane], poses[i, 1, lane]
        dx = after[0] - x - time * error_of(errors, n, own[WIND], lane)
        dy = after[1] - y - time * error_of(errors, n, own[WIND + 1], lane)
        dx -= time * error_of(errors, n, own[GUST], lane)
        dy -= time * error_of(errors, n, own[GUST + 1], lane)
        turn = readings.headings[step, i, lane] - poses[i, 2, lane]
        turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
        ahead = poses[i, 2, lane] + 0.5 * turn
        path = (dx * math.cos(ahead) + dy * math.sin(ahead)) / shortening(0.5 * turn, 0)[0]
        read[0][i, lane] = path / (time * (1.0 + error_of(errors, n, own[SCALE], lane)))
        read[1][i, lane] = turn / time - error_of(errors, n, own[TURN], lane)


@compiled
def _carry(
    i: int,
    time: float,
    off: State,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    step: int,
    read: tuple[Array, Array],
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Carry what vehicle i is off the truth, but for what its arc misses of the true way."""
    x, errors = off
    own, n = setup.columns[i], len(x)
    for lane in range(len(lanes)):
        v = readings.speeds[step - 1, i, lane] - read[0][i, lane]
        w = readings.turn_rates[step - 1, i, lane] - read[1][i, lane]
        w += error_of(errors, n, own[TURN], lane)
        scale, psi = error_of(errors, n, own[SCALE], lane), x[i, 2, lane]
        dx = slopes[2, lane] * v + slopes[4, lane] * w + slopes[6, lane] * scale
        dy = slopes[3, lane] * v + slopes[5, lane] * w + slopes[7, lane] * scale
        blown_x = error_of(errors, n, own[WIND], lane) + error_of(errors, n, own[GUST], lane)
        blown_y = error_of(errors, n, own[WIND + 1], lane) + error_of(
            errors, n, own[GUST + 1], lane
        )
        x[i, 0, lane] += dx - slopes[1, lane] * psi + time * blown_x
        x[i, 1, lane] += dy + slopes[0, lane] * psi + time * blown_y
        x[i, 2, lane] += time * w


@compiled
def _predict(
    true: State,
    off: State,
    P: Array,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    step: int,
    frame: Frame,
    read: tuple[Array, Array],
    slopes: Array,
    before: Array,
    lanes: Lanes,
) -> None:
    """Advance truth, what is off it, and P by a step; `read`, `slopes`, `before` are scratch."""
    motion, (x, errors) = motion_in(setup.poses, step), true
    for i in range(len(x)):
        _read_truly(i, motion.time, true, setup, readings, step, read, lanes)
        move(x, errors, i, read[0], read[1], motion, setup.columns[i], slopes, lanes)
        _carry(i, motion.time, off, setup, readings, step, read, slopes, lanes)
        for c in range(2):
            for lane in range(len(lanes)):
                off[0][i, c, lane] += x[i, c, lane] - setup.poses.truth[step, i, c]
        add_reading_noise(P, i, motion, frame, slopes, lanes)
    pass_sample(P, off[1], setup, motion.time, frame, before, lanes)
    constants = len(readings.constants)
    for k in range(constants, len(errors)):
        decay = kept(setup, k, motion.time)
        for lane in range(len(lanes)):
            gained = readings.changing[step, k - constants, lane] - decay * errors[k, lane]
            off[1][k, lane] -= gained
    _fill_truth(true, setup, readings, step, lanes)


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
    true, off = (np.empty_like(x), np.empty_like(errors)), (x, errors)
    read = (np.empty((n, width)), np.empty((n, width)))
    slopes, before = np.empty((12, width)), np.empty((OWN, 3, width))
    halves = (np.empty((AT_ONCE, size, width)), np.empty((AT_ONCE, size, width)))
    row = (np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros((MOST_ENTRIES, width)))
    seen = (np.empty((4, width)), np.empty(width), np.zeros(width))
    frame = frame_of(setup, lanes)
    block = np.empty((3 * n, 3 * n, width))
    scratch = (np.empty((3 * n, width)), np.empty_like(block), halves[0][0], halves[1][0])
    # the kernel takes and leaves a whole state, and holds what it is off the truth meanwhile
    _fill_truth(true, setup, readings, begin, lanes)
    x -= true[0]
    errors -= true[1]
    about = true[0], true[1], True
    compared = errors, scratch, block
    if begin == 0:
        scratch[0][:] = x.reshape(3 * n, width)
        record_augmented(P, poses, 0, compared, statistics, lanes)
    for step in range(begin + 1, end + 1):
        _predict(true, off, P, setup, readings, step, frame, read, slopes, before, lanes)
        correct_augmented(
            x, errors, P, step, setup, readings, about, frame, seen, row, halves, statistics, lanes
        )
        if step == end or is_wanted_now(poses, step, statistics):
            bring_to_now(P, setup, frame, before, lanes)
        scratch[0][:] = x.reshape(3 * n, width)
        record_augmented(P, poses, step, compared, statistics, lanes)
    x += true[0]
    errors += true[1]


IDEAL = LaneFilter(_filter, augmented_specimen)
"""The filter that is linearised at the truth."""
