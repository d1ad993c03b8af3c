"""Compiled covariance along a run, for the bounds of many runs.

The recursion of syncplan.estimation.covariances, sample by sample, rows in blocks:

    H <- P h of each row of the block, S = h P h + 1
    H <- L^-1 H with S = L L^T
    P <- P - H^T H

This is several times as fast as there, at the cost of loading numba. BLAS computes the products.
Longer blocks would not pay, since S grows with them.
"""

import numpy as np
import scipy.linalg.cython_blas  # noqa: F401 - what np.dot calls in a kernel
from numpy.typing import NDArray

from syncplan.arrays import Array, Index
from syncplan.estimation.kernels import kernel
from syncplan.estimation.referred_run import Run

BLOCK = 24


def compiled_variances_along(run: Run, covariance: Array) -> Array:
    """Return the same as syncplan.estimation.covariances.variances_by_groups, to rounding.

    Raises LinAlgError where an innovation covariance is not positive definite.
    """
    noise = np.ascontiguousarray(np.moveaxis(run.noise, (2, 1), (0, 1)))
    found = np.empty((4, run.count, len(noise)))
    positive = _along(
        noise,
        np.ascontiguousarray(run.rows.entries),
        np.ascontiguousarray(run.rows.columns[:, 0]),
        np.ascontiguousarray(run.rows.columns[:, 3]),
        np.ascontiguousarray(run.first),
        covariance.copy(),
        found,
    )
    if not positive:
        raise np.linalg.LinAlgError("an innovation covariance is not positive definite")
    return found


@kernel
def _grow(covariance: Array, noise: Array) -> None:
    """Add a step's noise, (n, 6), to the vehicles' blocks."""
    for k in range(len(noise)):
        x, y, turn = 3 * k, 3 * k + 1, 3 * k + 2
        xx, xy, xp, yy, yp, pp = noise[k]
        covariance[x, x] += xx
        covariance[x, y] += xy
        covariance[y, x] += xy
        covariance[x, turn] += xp
        covariance[turn, x] += xp
        covariance[y, y] += yy
        covariance[y, turn] += yp
        covariance[turn, y] += yp
        covariance[turn, turn] += pp


@kernel
def _project(
    covariance: Array, rows: Array, observers: Index, targets: Index, halves: Array, inner: Array
) -> None:
    """Fill `halves` with P h of each row, and the lower triangle of `inner` with S."""
    for r in range(len(rows)):
        o, t = observers[r], targets[r]
        h0, h1, h2, h3, h4, h5 = rows[r]
        for j in range(len(covariance)):
            halves[r, j] = (
                h0 * covariance[o, j]
                + h1 * covariance[o + 1, j]
                + h2 * covariance[o + 2, j]
                + h3 * covariance[t, j]
                + h4 * covariance[t + 1, j]
                + h5 * covariance[t + 2, j]
            )
        for q in range(r + 1):
            o, t, total = observers[q], targets[q], 0.0
            for axis in range(3):
                total += rows[q, axis] * halves[r, o + axis]
                total += rows[q, 3 + axis] * halves[r, t + axis]
            inner[r, q] = total
        inner[r, r] += 1.0


@kernel
def _factor(inner: Array, halves: Array, size: int) -> bool:
    """Multiply `halves` by L^-1 in place; return False where S is not positive definite."""
    for r in range(size):
        for q in range(r):
            for p in range(q):
                inner[r, q] -= inner[r, p] * inner[q, p]
            inner[r, q] /= inner[q, q]
            inner[r, r] -= inner[r, q] * inner[r, q]
        if not inner[r, r] > 0.0:
            return False
        inner[r, r] = np.sqrt(inner[r, r])
        for q in range(r):
            for j in range(halves.shape[1]):
                halves[r, j] -= inner[r, q] * halves[q, j]
        for j in range(halves.shape[1]):
            halves[r, j] /= inner[r, r]
    return True


@kernel
def _reduce(covariance: Array, halves: Array, taken: Array) -> None:
    """Subtract H^T H of a block's halves H (m, 3 n) from the covariance; `taken` is scratch."""
    np.dot(halves.T, halves, taken)
    for i in range(len(covariance)):
        for j in range(len(covariance)):
            covariance[i, j] -= taken[i, j]


@kernel
def _along(
    noise: Array,
    rows: Array,
    observers: Index,
    targets: Index,
    first: Index,
    covariance: Array,
    found: NDArray[np.float64],
) -> bool:
    halves = np.zeros((BLOCK, len(covariance)))
    inner = np.zeros((BLOCK, BLOCK))
    taken = np.empty_like(covariance)
    for k in range(len(noise)):
        _grow(covariance, noise[k])
        for begin in range(first[k], first[k + 1], BLOCK):
            end = min(begin + BLOCK, first[k + 1])
            _project(
                covariance, rows[begin:end], observers[begin:end], targets[begin:end], halves, inner
            )
            if not _factor(inner, halves[: end - begin], end - begin):
                return False
            _reduce(covariance, halves[: end - begin], taken)
        for v in range(noise.shape[1]):
            x = 3 * v
            found[0, v, k] = covariance[x, x] + covariance[x + 1, x + 1]
            found[1, v, k] = covariance[x, x + 2]
            found[2, v, k] = covariance[x + 1, x + 2]
            found[3, v, k] = covariance[x + 2, x + 2]
    return True
