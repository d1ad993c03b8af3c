"""The posterior Cramer-Rao bound along the paths that vehicles truly took, by what they truly saw.

The covariance of the filter's state, with F, G and rows of sightings at the truth: that of
`ideal_filter`. Each trial has its own, as paths and sightings differ. A false sighting counts here
as a true one.

The variance of a place now, while P is in an earlier frame, is h' P h with h the row in that frame
of the place itself: `augmented_rows.refer` of the slopes (1, 0, 0) and (0, 1, 0).

Source: Tichavsky, Muravchik, Nehorai (1998), Posterior Cramer-Rao bounds for discrete-time
nonlinear filtering; Taylor (1979).
"""

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.augmented_correction import AT_ONCE, correct_augmented
from syncplan.estimation.augmented_frame import OWN, frame_of
from syncplan.estimation.augmented_prediction import predict_augmented
from syncplan.estimation.augmented_rows import MOST_ENTRIES, Sparse, refer
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
)
from syncplan.estimation.lane_filter import Lanes, compiled, inner
from syncplan.flight.flight_setup import Flown


@inner
def _variance(P: Array, row: Sparse, entries: int, sums: Array, lanes: Lanes) -> None:
    """Add h' P h of a row to `sums` (lanes,)."""
    columns, h = row
    for a in range(entries):
        for b in range(entries):
            i, j = max(columns[a], columns[b]), min(columns[a], columns[b])
            for lane in range(len(lanes)):
                sums[lane] += h[a, lane] * h[b, lane] * P[i, j, lane]


@compiled
def bound_lanes(
    flown: Flown,
    setup: AugmentedSetup,
    readings: AugmentedReadings,
    statistics: AugmentedStatistics,
    squares: Array,
    state_squares: Array,
    counted: Flags,
    along: Array,
    every: int,
    lanes: Lanes,
    x: Array,
    errors: Array,
    P: Array,
) -> None:
    """Add each place's variance, m^2, to `squares` (n, lanes), at steps `counted` (steps + 1, n).

    Those of further states go to `state_squares` (e, lanes), over the second half of the run. Every
    few steps, from step 0 on, each place's variance goes to `along` (k, n, lanes), if k > 0.

    x, errors and P are the state at the start, and scratch; `statistics` is scratch.
    """
    n, size, width, steps = len(x), len(P), len(lanes), len(readings.speeds)
    slopes, before = np.empty((12, width)), np.empty((OWN, 3, width))
    halves = (np.empty((AT_ONCE, size, width)), np.empty((AT_ONCE, size, width)))
    row = (np.zeros(MOST_ENTRIES, dtype=np.int64), np.zeros((MOST_ENTRIES, width)))
    seen = (np.empty((4, width)), np.empty(width), np.zeros(width))
    frame = frame_of(setup, lanes)
    true, true_errors = np.empty_like(x), np.empty_like(errors)
    about, constants = (true, true_errors, True), len(readings.constants)
    here = np.empty(width)
    for i in range(n if len(along) else 0):
        for lane in range(width):
            along[0, i, lane] = P[3 * i, 3 * i, lane] + P[3 * i + 1, 3 * i + 1, lane]
    for step in range(1, steps + 1):
        true_errors[:constants] = readings.constants
        true_errors[constants:] = readings.changing[step - 1]
        true[:] = flown.path[step - 1]
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_augmented(
            true, true_errors, P, speeds, turn_rates, setup, step, frame, slopes, before, lanes
        )
        true[:] = flown.path[step]
        true_errors[constants:] = readings.changing[step]
        x[:], errors[:] = 0.0, 0.0
        correct_augmented(
            x, errors, P, step, setup, readings, about, frame, seen, row, halves, statistics, lanes
        )
        kept = len(along) > 0 and step % every == 0
        for i in range(n):
            if counted[step, i] or kept:
                here[:] = 0.0
                for axis in range(2):
                    slopes[:3] = 0.0
                    slopes[axis] = 1.0
                    entries = refer(slopes, i, i, -1, setup, frame, row, lanes)
                    _variance(P, row, entries, here, lanes)
                if counted[step, i]:
                    squares[i] += here
                if kept:
                    along[step // every, i] = here
        if 2 * step > steps:
            for k in range(3 * n, size):
                # a constant is the same in any frame, what changes has decayed since
                left = frame[2][k - 3 * n]
                for lane in range(len(lanes)):
                    state_squares[k - 3 * n, lane] += left * left * P[k, k, lane]
