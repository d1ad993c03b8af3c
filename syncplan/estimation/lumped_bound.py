"""Posterior bound of large teams, with each pair's sightings lumped over part of a period.

Over a sixteenth of a period the rows of a pair, referred to time 0, span few directions: their
singular value decomposition leaves three or four of some forty. A contact is cut into equal lumps,
and what a lump determines is processed at its mean sample:

    P <- P + N                                          each sample
    S  = H P H^T + 1 = L L^T,  half = L^-1 H P          its rows, some hundred at a time
    P <- P - half^T half

This leaves out the motion noise between the sightings of a lump. With sharp bearings a lump would
determine more than that noise allows, so a lump is cut further until the noise is small:

    sum of h N h^T over its rows h < MOST_NOISE,  N: noise of both vehicles over its samples

Of a scalar state, the left side is (length / time constant of the filter)^2. What remains is of
first or second order in the length: all lumps are halved until the bound changes little. Where
lumps save less than half of the rows, the exact recursion is used. Of P, BLAS keeps and updates the
lower triangle.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from math import ceil
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import SYMMETRIC, Run
from syncplan.estimation.referred_system import PosteriorBound, ReferredSystem
from syncplan.observability.referred_rows import SightingRows
from syncplan.runtime.machine import blas_threads, usable_cores

LUMPS_PER_PERIOD = 8
"""Smallest number of lumps that a pair seen for a whole period has, before they are halved."""

MOST_NOISE = 0.4
"""Variance of a lump's rows by its motion noise, in whitened units, before lumps are halved."""

CHANGE_MARGIN = 2.0
"""Stated error over the change by the last halving. An error of first order equals the change, one
of second order is a third of it; where they cancel in part, it is larger."""

MOST_ERROR, LEAST_ERROR = 0.05, 1e-3
"""Stated error at which halving ends, and the least, for directions that are left out."""

ROWS_AT_ONCE = 256
"""Number of rows that share a triangular solve and a pass over the covariance."""

THREADED_STATES = 1000
"""Size of the state above which BLAS gains by further threads."""

NEGLIGIBLE = 1e-5
"""Variance that a direction of a lump has at the start, in whitened units, to be left out."""


def lumped_bound(
    system: ReferredSystem, start: Array, exact: Callable[[Array], PosteriorBound]
) -> PosteriorBound:
    """Return the bound along a run by lumps, with its accuracy, or `exact` where lumps save little.

    The state may hold constant errors, but none that changes. Raises LinAlgError where the
    covariance of an innovation is not positive definite.
    """
    sample_time = system.team.sensors.sample_time
    length = max(int(system.team.orbits.period / sample_time / LUMPS_PER_PERIOD), 2)
    variance, coarse = float(np.diagonal(start).max()), np.array(np.inf)
    for halvings in count():
        run = lumped(system.run, length, halvings, variance)
        if 2 * len(run.rows.entries) > len(system.run.rows.entries):
            break
        with blas_threads(usable_cores() if run.size > THREADED_STATES else 1):
            fine = system.carried(system.known(covariance) for covariance in _along(run, start))
        rms = fine.rms_second_half()
        accuracy = max(CHANGE_MARGIN * float(np.max(np.abs(coarse / rms - 1.0))), LEAST_ERROR)
        if accuracy <= MOST_ERROR:
            longest = sample_time * ceil(length / 2**halvings)
            return replace(fine, accuracy=accuracy, longest_lump=longest)
        coarse = rms
    return exact(start)


def lumped(run: Run, length: int, halvings: int, variance: float) -> Run:
    """Return a run with the rows of each pair in lumps of up to `length` samples, then halved.

    `variance` is the largest of the initial ones.
    """
    step = np.repeat(np.arange(run.steps + 1), np.diff(run.first))
    ends = np.sort(np.stack([run.rows.observers, run.rows.targets]), axis=0)
    pairs = ends[0] * run.count + ends[1]
    order = np.lexsort((step, pairs))
    noise = _noise_per_sample(run, step)[order]
    step, pairs = step[order], pairs[order]
    # a contact ends where the pair is not seen for the length of a lump
    starts = (np.diff(pairs, prepend=-1) != 0) | (np.diff(step, prepend=-1) > length)
    starts = _cut(starts, step, lambda _, lasted: np.ceil(lasted / length))

    def parts(begins: Index, lasted: Index) -> Array:
        # half as long, a lump has half of the rows and half of the noise
        variances = np.add.reduceat(noise, begins) * lasted
        return np.asarray(2**halvings * np.ceil(np.sqrt(variances / MOST_NOISE)))

    starts = _cut(starts, step, parts)
    begins = np.flatnonzero(starts)
    sizes = np.diff(np.append(begins, len(step)))
    middle = np.rint(np.add.reduceat(step, begins) / sizes).astype(np.int64)
    # both directions of a pair have the same columns, in another order
    sort = np.argsort(run.rows.columns, axis=1, kind="stable")
    columns = np.take_along_axis(run.rows.columns, sort, axis=1)[order]
    entries = np.take_along_axis(run.rows.entries, sort, axis=1)[order]
    found, lump = [], []
    for size in np.unique(sizes).tolist():
        own = np.flatnonzero(sizes == size)
        block = entries[begins[own, None] + np.arange(size)]
        if size > block.shape[2]:
            block = np.asarray(np.linalg.qr(block, mode="r"))
        _, values, vectors = np.linalg.svd(block, full_matrices=False)
        kept = values**2 * variance > NEGLIGIBLE
        found.append((values[..., None] * vectors)[kept])
        lump.append(np.repeat(own, kept.sum(axis=1)))
    of = np.concatenate(lump)
    sort = np.lexsort((of, middle[of]))
    of = of[sort]
    rows = SightingRows(np.concatenate(found)[sort], columns[begins[of]])
    first = np.searchsorted(middle[of], np.arange(run.steps + 2))
    return replace(run, rows=rows, first=first)


def _noise_per_sample(run: Run, step: Index) -> Array:
    """Return (s,) what a sample's motion noise adds to the variance of each row."""
    rows, added = run.rows, np.zeros(len(step))
    for vehicles, begin in ((rows.observers, 0), (rows.targets, 3)):
        own = rows.entries[:, begin : begin + 3]
        blocks = run.noise[:, vehicles, step][SYMMETRIC]
        added += np.einsum("sa,abs,sb->s", own, blocks, own)
    return added


def _cut(starts: Array, step: Index, parts_of: Callable[[Index, Index], Array]) -> Array:
    """Return where lumps start once each is cut into equal parts, of a sample at least.

    `parts_of` has the first row of each lump and the number of samples that it lasts.
    """
    begins = np.flatnonzero(starts)
    lump = np.cumsum(starts) - 1
    since = step - step[begins][lump]
    lasted = 1 + np.maximum.reduceat(since, begins)
    parts = np.clip(parts_of(begins, lasted), 1, lasted).astype(np.int64)
    part = since * parts[lump] // lasted[lump]
    return np.asarray(starts | (np.diff(part, prepend=-1) != 0))


def _along(run: Run, start: Array) -> Iterator[Array]:
    """Yield the lower triangle of the covariance after each sample, changed in place."""
    covariance = np.asfortranarray(start)
    vehicles = 3 * np.arange(run.count)
    high, low = np.tril_indices(3)
    places = vehicles + high[:, None], vehicles + low[:, None]
    for k in range(run.steps + 1):
        covariance[places] += run.noise[SYMMETRIC[high, low], :, k]
        for begin in range(run.first[k], run.first[k + 1], ROWS_AT_ONCE):
            own = slice(begin, min(begin + ROWS_AT_ONCE, run.first[k + 1]))
            covariance = _taken_in(covariance, run.rows.of(own))
        yield covariance


def _taken_in(covariance: Array, rows: SightingRows) -> Array:
    """The covariance's lower triangle after some rows, in place."""
    from scipy.linalg.blas import dsyrk, dtrsm
    from scipy.linalg.lapack import dpotrf
    from scipy.sparse import csr_array

    own, place = np.unique(rows.columns, return_inverse=True)
    many = len(rows.entries)
    first = np.arange(many + 1) * rows.columns.shape[1]
    table: Any = (rows.entries.ravel(), place.ravel(), first)
    sparse = csr_array(table, shape=(many, len(own)))
    columns = covariance.T[own]
    for column, number in zip(columns, own.tolist(), strict=True):
        column[:number] = covariance[number, :number]
    gain = sparse @ columns
    innovation = sparse @ gain[:, own].T
    innovation.reshape(-1)[:: many + 1] += 1.0
    # threads of NumPy's BLAS would contend with those of SciPy's
    factor, failed = dpotrf(innovation, lower=1)
    if failed:
        raise np.linalg.LinAlgError("an innovation covariance is not positive definite")
    half = dtrsm(1.0, factor, gain.T, side=1, lower=1, trans_a=1)
    return np.asarray(dsyrk(-1.0, half, beta=1.0, c=covariance, lower=1, overwrite_c=1))
