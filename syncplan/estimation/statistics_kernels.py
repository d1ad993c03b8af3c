"""Comparison with the truth: errors, coverage, NEES and series of lanes.

Any filter of lanes calls `record` at step 0 and after each step that is compared with the truth.
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.correction_kernels import Correction, fill_variance
from syncplan.estimation.filter_setup import (
    ERROR,
    SQUARE,
    VARIANCE,
    FilterSetup,
    FilterStatistics,
    Truth,
)
from syncplan.estimation.kernels import Lanes, inner, linked, part
from syncplan.estimation.motion_kernels import Frame

SMALLEST_PIVOT = 1e-13
"""Share of a variance below which its pivot in the factorisation is rounding."""


class Comparison(NamedTuple):
    """Scratch arrays of a comparison with the truth.

    Fields
    ------
    true, errors : (3n + e, lanes) true states, and errors of the estimate
    block : (3n, 3n, lanes) covariance of poses, to be factorised
    column, factor : (3n, lanes) of the factorisation
    total, valid : (lanes,) NEES, and whether it counts
    """

    true: Array
    errors: Array
    block: Array
    column: Array
    factor: Array
    total: Array
    valid: Array


def comparison_of(n: int, size: int, width: int) -> Comparison:
    """Return scratch arrays for n vehicles, `size` state entries and `width` lanes."""
    return Comparison(
        np.empty((size, width)),
        np.empty((size, width)),
        np.empty((3 * n, 3 * n, width)),
        np.empty((3 * n, width)),
        np.empty((3 * n, width)),
        np.empty(width),
        np.empty(width),
    )


@inner
def fill_truth(true: Array, truth: Truth, sample: int, lanes: Lanes) -> None:
    """Fill in the true state (3n + e, lanes) at a sample."""
    poses = truth.poses[sample]
    n, constants = len(poses), len(truth.constants)
    for i in range(n):
        for c in range(3):
            if poses.shape[2] == len(lanes):
                for lane in range(len(lanes)):
                    true[3 * i + c, lane] = poses[i, c, lane]
            else:
                for lane in range(len(lanes)):
                    true[3 * i + c, lane] = poses[i, c, 0]
    for k in range(constants):
        for lane in range(len(lanes)):
            true[3 * n + k, lane] = truth.constants[k, lane]
    for k in range(truth.changing.shape[1]):
        for lane in range(len(lanes)):
            true[3 * n + constants + k, lane] = truth.changing[sample, k, lane]


@inner
def fill_errors(x: Array, true: Array, n: int, errors: Array, lanes: Lanes) -> None:
    """Fill in errors (3n + e, lanes) of a state, headings wrapped."""
    for k in range(len(x)):
        for lane in range(len(lanes)):
            errors[k, lane] = x[k, lane] - true[k, lane]
    for i in range(n):
        for lane in range(len(lanes)):
            off = errors[3 * i + 2, lane]
            turns = np.floor((off + math.pi) / (2.0 * math.pi))
            errors[3 * i + 2, lane] = off - 2.0 * math.pi * turns


@part
def is_sampled(setup: FilterSetup, sample: int) -> bool:
    """Return whether NEES and coverage are taken at a sample."""
    taken = sample % setup.sample_every == 0 or sample == setup.samples
    return bool(taken and sample > setup.judged_from)


@linked
def record(
    P: Array,
    setup: FilterSetup,
    sample: int,
    frame: Frame,
    correction: Correction,
    work: Comparison,
    statistics: FilterStatistics,
    lanes: Lanes,
) -> None:
    """Add the errors at a sample to the statistics; sample 0 counts in the series alone.

    P (3n + e, 3n + e, lanes) must be the present one if `is_sampled`.
    """
    errors = work.errors
    share = 1.0 if sample else 0.0
    late = 1.0 if 2 * sample > setup.samples else 0.0
    for k in range(len(errors)):
        for lane in range(len(lanes)):
            e = errors[k, lane]
            statistics.final[k, lane] = e
            statistics.squares[k, lane] += share * e * e
            statistics.late_squares[k, lane] += late * e * e
    if len(statistics.series):
        for k in range(len(errors)):
            sums = statistics.series[sample, k]
            fill_variance(k, P, setup.states, frame, correction, lanes)
            for lane in range(len(lanes)):
                e = errors[k, lane]
                sums[ERROR] += e
                sums[SQUARE] += e * e
                sums[VARIANCE] += correction.sums[0, lane]
    if is_sampled(setup, sample):
        for k in range(len(errors)):
            for lane in range(len(lanes)):
                e = errors[k, lane]
                statistics.covered[k, lane] += 1.0 if e * e <= 9.0 * P[k, k, lane] else 0.0
        _add_nees(P, work, statistics, lanes)


@inner
def _add_nees(P: Array, work: Comparison, sums: FilterStatistics, lanes: Lanes) -> None:
    """Add e' P^-1 e of the poses by a square-root-free Cholesky factorisation of a copy of P.

    Lanes whose covariance is not positive definite (to rounding) are left out of sum and count. The
    errors of the poses are overwritten.
    """
    _, error, A, u, factor, total, valid = work
    size = len(A)
    for lane in range(len(lanes)):
        total[lane], valid[lane] = 0.0, 1.0
    for i in range(size):
        for j in range(i + 1):
            for lane in range(len(lanes)):
                A[i, j, lane] = P[i, j, lane]
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
        for i in range(j + 1, size):
            for k in range(j + 1, i + 1):
                for lane in range(len(lanes)):
                    A[i, k, lane] -= factor[i, lane] * u[k, lane]
    for lane in range(len(lanes)):
        if valid[lane] > 0.0:
            sums.nees[lane] += total[lane]
            sums.nees_samples[lane] += 1.0
