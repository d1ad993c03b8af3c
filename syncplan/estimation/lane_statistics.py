"""Kernels that compare the filter's lanes with the truth: errors, coverage, NEES, series.

Any filter of lanes calls `record_lanes` at time 0 and after each step.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.filter_statistics import FilterStatistics
from syncplan.estimation.lane_filter import Lanes, compiled, inner

Scratch = tuple[Array, Array, Array, Array]

SMALLEST_PIVOT = 1e-13
"""Share of a variance below which its remainder, given the other states, is rounding."""


@compiled
def record_lanes(
    x: Array,
    P: Array,
    setup: FilterSetup,
    step: int,
    scratch: Scratch,
    statistics: FilterStatistics,
    lanes: Lanes,
) -> None:
    """Add the errors after a step to the statistics; step 0 counts in the series alone.

    `scratch` is of shapes (3n, lanes), (3n, 3n, lanes), (3n, lanes), (3n, lanes).
    """
    steps = len(setup.truth) - 1
    squares = statistics.squares if step else np.zeros(x.shape)
    _add_errors(x, setup.truth[step], scratch[0], squares, 2 * step > steps, statistics, lanes)
    record_errors(P, setup, step, scratch, statistics, lanes)


@compiled
def record_errors(
    P: Array,
    setup: FilterSetup,
    step: int,
    scratch: Scratch,
    statistics: FilterStatistics,
    lanes: Lanes,
) -> None:
    """Add what errors and covariance of the poses come to; `scratch` begins with the errors."""
    error, A, u, factor = scratch
    steps = len(setup.truth) - 1
    if len(statistics.series):
        _add_series(P, error, statistics.series[step], lanes)
    taken = step % setup.sample_every == 0 or step == steps
    if taken and step > setup.judged_from:
        _add_coverage(P, error, statistics, lanes)
        _add_nees(P, error, A, u, factor, statistics, lanes)


@inner
def subtract_outer(P: Array, factor: Array, u: Array, start: int, lanes: Lanes) -> None:
    """P -= factor u' on the lower triangle, rows and columns from `start` on."""
    for i in range(start, len(P)):
        for j in range(start, i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= factor[i, lane] * u[j, lane]


@compiled
def _add_nees(
    P: Array, error: Array, A: Array, u: Array, factor: Array, sums: FilterStatistics, lanes: Lanes
) -> None:
    """Add e' P^-1 e by a square-root-free Cholesky factorisation of a copy of P.

    Lanes whose covariance is not positive definite (to rounding) are left out of sum and count.
    """
    size = len(P)
    total, valid = np.zeros(len(lanes)), np.ones(len(lanes))
    for i in range(size):
        A[i, : i + 1] = P[i, : i + 1]
    for j in range(size):
        for lane in range(len(lanes)):
            if not A[j, j, lane] > SMALLEST_PIVOT * P[j, j, lane]:
                valid[lane] = 0.0
                A[j, j, lane] = np.inf
            total[lane] += error[j, lane] * error[j, lane] / A[j, j, lane]
        for k in range(j + 1, size):
            for lane in range(len(lanes)):
                u[k, lane] = A[k, j, lane]
                factor[k, lane] = A[k, j, lane] / A[j, j, lane]
                error[k, lane] -= factor[k, lane] * error[j, lane]
        subtract_outer(A, factor, u, j + 1, lanes)
    for lane in range(len(lanes)):
        if valid[lane] > 0.0:
            sums.nees[lane] += total[lane]
            sums.nees_samples[lane] += 1.0


@inner
def _add_errors(
    x: Array,
    truth: Array,
    error: Array,
    squares: Array,
    late: bool,
    statistics: FilterStatistics,
    lanes: Lanes,
) -> None:
    """Fill in the errors (3n, lanes), heading wrapped, and add their squares."""
    for i in range(len(x)):
        for c in range(3):
            for lane in range(len(lanes)):
                e = x[i, c, lane] - truth[i, c]
                if c == 2:
                    e -= 2.0 * math.pi * math.floor((e + math.pi) / (2.0 * math.pi))
                error[3 * i + c, lane] = e
                statistics.final[i, c, lane] = e
                squares[i, c, lane] += e * e
                if late:
                    statistics.late_squares[i, c, lane] += e * e


@inner
def _add_coverage(P: Array, error: Array, statistics: FilterStatistics, lanes: Lanes) -> None:
    """Count the coordinates within three of the filter's own sigmas."""
    for k in range(len(P)):
        for lane in range(len(lanes)):
            inside = error[k, lane] * error[k, lane] <= 9.0 * P[k, k, lane]
            statistics.covered[k // 3, lane] += 1.0 if inside else 0.0


@inner
def _add_series(P: Array, error: Array, sums: Array, lanes: Lanes) -> None:
    """Add one step's errors and variances, lane after lane, to (n, 11)."""
    for i in range(len(sums)):
        r = 3 * i
        for lane in range(len(lanes)):
            ex, ey, eh = error[r, lane], error[r + 1, lane], error[r + 2, lane]
            sums[i, 0] += ex
            sums[i, 1] += ey
            sums[i, 2] += eh
            sums[i, 3] += ex * ex + ey * ey
            sums[i, 4] += eh * eh
            sums[i, 5] += P[r, r, lane] + P[r + 1, r + 1, lane]
            sums[i, 6] += P[r + 2, r + 2, lane]
            sums[i, 7] += ex * ex
            sums[i, 8] += ey * ey
            sums[i, 9] += P[r, r, lane]
            sums[i, 10] += P[r + 1, r + 1, lane]
