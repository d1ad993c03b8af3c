"""The posterior Cramer-Rao bound along the paths that vehicles truly took, by what they truly saw.

The covariance of the filter's state, with F, G and rows of sightings at the truth: that of the
ideal filter of `lane_filter`. Each trial has its own, as paths and sightings differ. A false
sighting counts here as a true one.

The variance of a place now, while P is in an earlier frame, is h' P h with h the row in that frame
of the place itself: `correction_kernels.refer_place`.

Source: Tichavsky, Muravchik, Nehorai (1998), Posterior Cramer-Rao bounds for discrete-time
nonlinear filtering; Taylor (1979).
"""

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.correction_kernels import (
    OFF,
    correct,
    correction_of,
    refer_place,
    spread,
)
from syncplan.estimation.filter_statistics import FilterRun
from syncplan.estimation.kernels import Lanes, kernel
from syncplan.estimation.motion_kernels import frame_of, predict
from syncplan.estimation.statistics_kernels import fill_truth


@kernel
def bound_lanes(
    run: FilterRun,
    squares: Array,
    state_squares: Array,
    counted: Flags,
    along: Array,
    every: int,
    lanes: Lanes,
    x: Array,
    P: Array,
) -> None:
    """Add each place's variance, m^2, to `squares` (n, lanes), at steps `counted` (steps + 1, n).

    Those of bias states go to `state_squares` (e, lanes), over the second half of the run. Every
    few steps, from step 0 on, each place's variance goes to `along` (k, n, lanes), if k > 0.

    x and P are the state at the start, and scratch; so are the run's statistics.
    """
    setup, readings, truth = run.setup, run.readings, run.truth
    n, size, width, steps = len(squares), len(P), len(lanes), len(readings.speeds)
    frame, work = frame_of(setup.states, width), correction_of(setup.states, size, width)
    states, true, sums = setup.states, np.empty_like(x), work.sums
    for i in range(n if len(along) else 0):
        for lane in range(width):
            along[0, i, lane] = P[3 * i, 3 * i, lane] + P[3 * i + 1, 3 * i + 1, lane]
    for step in range(1, steps + 1):
        fill_truth(true, truth, step - 1, lanes)
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict(true, P, speeds, turn_rates, setup, step, frame, work.slopes, lanes)
        fill_truth(true, truth, step, lanes)
        x[:] = 0.0
        correct(x, P, step, run, true, OFF, frame, work, lanes)
        kept = len(along) > 0 and step % every == 0
        for i in range(n):
            if counted[step, i] or kept:
                for axis in range(2):
                    work.counts[axis] = 0
                    refer_place(i, axis, 1.0, True, states, frame, work, lanes)
                    spread(P, axis, axis, work, axis, lanes)
                for lane in range(width):
                    here = sums[0, lane] + sums[1, lane]
                    if counted[step, i]:
                        squares[i, lane] += here
                    if kept:
                        along[step // every, i, lane] = here
        if 2 * step > steps:
            for k in range(3 * n, size):
                # a constant is the same in any frame, what changes has decayed since
                left = frame.left[k - 3 * n]
                for lane in range(len(lanes)):
                    state_squares[k - 3 * n, lane] += left * left * P[k, k, lane]
