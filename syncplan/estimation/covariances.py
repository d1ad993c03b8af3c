"""Covariance along a run with all errors referred to time 0, where prediction only adds noise.

The recursion goes sample by sample (Tichavsky, Muravchik, Nehorai 1998, Proposition 1). The rows H
of a sample are full, since BLAS processes them faster than elements can be gathered:

    P <- P + N, and what changes (syncplan.estimation.referred_run)
    S  = H P H^T + 1 = L L^T,  half = L^-1 H P
    P <- P - half^T half

Where poses are the only states, rows of several samples are processed together. Noise is then block
diagonal, one 3 x 3 block a vehicle, and a whitened row h has six non-zeros. A group holds
consecutive rows. Let P be the covariance at its start and N_j the noise added since, up to the
sample of its row j. Then

    g_j  = (P + N_j) h_j                     of the state with row j: noise after j is not in it
    S_kj = h_k . g_j + (1 if j = k)          of the rows, for j <= k; S = L L^T
    half = L^-1 G^T
    P_s  = P + N_s - sum of half_k half_k^T over the rows k up to sample s

which is the same recursion, term by term, in a few matrix operations a group. Only P + N_j matters,
so N is summed from the start of a batch of groups, and P is kept without it. The factor of S
bordered by G has `half` in its border, so no triangular system is solved; its corner is not used
and only has to be large enough for the whole to be positive definite:

    [ S    ]   [ L      ] [ L^T  half^T ]
    [ G  c ] = [ half . ] [      .      ]

The border is as long as the state. In larger teams it costs more than it saves, and where the
sigmas span many orders of magnitude, rounding grows.

The recursion also gives a filter's covariance of two functions a, b of the six states of a
sighting, just before row k:

    cov(a_k, b_k) = a_k . (P + N_k) b_k - sum over the rows j < k of (half_j . a_k) (half_j . b_k)

In the recursion by samples, P already includes all noise.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import GROUP_ROWS, SYMMETRIC, UPPER, Run, grouped
from syncplan.observability.referred_rows import SightingRows, dense_rows

GROUPED_VEHICLES = 20
"""Largest number of vehicles for which rows of poses are processed by groups."""

GROUPED_INNOVATION = 1e8
"""Largest variance of an innovation, in whitened units, at which rows are processed by groups.

A group's rounding grows with it, since all its rows use the covariance from before the first.
"""

GROUPS_AT_ONCE = 24
"""Groups prepared together: as many as fit into the processor's cache."""


# --- just before a row --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups of rows that have been processed into a covariance.

    Attributes
    ----------
    before : (g, 3 n, 3 n) the covariance before each group, without noise since the first
    halves : (m, g, 3 n)
    innovation : (g, m) variance of each row's innovation
    """

    before: Array
    halves: Array
    innovation: Array


@dataclass(frozen=True, slots=True)
class Foreseen:
    """Predictions just before each of the first s rows, after all earlier ones.

    Attributes
    ----------
    pairs : (2, 2, s) covariances of the two functions
    innovation : (s,) variance of the row's own innovation, in whitened units
    """

    pairs: Array
    innovation: Array

    @classmethod
    def of_rows(cls, size: int) -> "Foreseen":
        """Return empty predictions for `size` rows."""
        return cls(np.zeros((2, 2, size)), np.ones(size))

    def of_sample(
        self, rows: slice, functions: Array, before: Array, halves: Array, innovation: Array
    ) -> None:
        """Fill in the rows of a sample from their functions (2, m, size) of the whole state.

        `before` is the covariance before these rows, and `halves` (m, size) their L^-1 H P.
        """
        # reduction of each function by each earlier row of the sample
        reduced = (functions @ halves.T) * np.tril(np.ones((len(halves), len(halves))), -1)
        self.pairs[..., rows] = np.einsum("amc,bmc->abm", functions @ before, functions)
        self.pairs[..., rows] -= np.einsum("amj,bmj->abm", reduced, reduced)
        self.innovation[rows] = innovation

    def of_groups(
        self, run: Run, functions: Array, noise: Array, sample: Index, begin: int, groups: Groups
    ) -> None:
        """Fill in groups of rows from `begin` on from their functions (2, s, 6).

        `noise` (6, n, k) is that added since the batch began, `sample` (r,) each row's place in it.
        """
        rows = slice(begin, min(begin + len(sample), len(self.innovation)))
        size = rows.stop - begin
        if size <= 0:
            return
        which, number = np.arange(begin, rows.stop), -(-size // GROUP_ROWS)
        probes = [grouped(run, which, one[rows], noise, sample[:size]) for one in functions]
        known = _known_before(groups.before[:number], groups.halves[:, :number], probes)
        self.pairs[..., rows] = known.reshape(2, 2, -1)[..., :size]
        self.innovation[rows] = groups.innovation.reshape(-1)[:size]


def _known_before(before: Array, halves: Array, probes: list[tuple[Array, Array]]) -> Array:
    """(2, 2, g, m) covariances of two functions (g, 3n, m), with their noise, before each row."""
    earlier = np.triu(np.ones((len(halves), len(halves))), 1)
    # contiguous: products with a view take several times as long
    by_group = np.ascontiguousarray(np.swapaxes(halves, 0, 1))
    reduced = [by_group @ one * earlier for one, _ in probes]
    grown = [before @ one + noisy for one, noisy in probes]
    known = np.empty((2, 2, *probes[0][0].shape[::2]))
    for a, b in ((0, 0), (0, 1), (1, 1)):
        known[a, b] = known[b, a] = np.einsum("gkm,gkm->gm", probes[a][0], grown[b]) - np.einsum(
            "gjm,gjm->gm", reduced[a], reduced[b]
        )
    return known


# --- sample by sample ---------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Sample:
    """A sample of a run, after its rows.

    Attributes
    ----------
    rows : its rows among those of the run
    covariance : (size, size) after them, changed in place with the next sample
    before : (size, size) before them; None where it has no rows, or this was not requested
    halves : (m, size) L^-1 H P of its rows, S = L L^T; empty where it has none
    innovation : (m,) variance of each row's own innovation, after the earlier ones
    """

    rows: slice
    covariance: Array
    before: Array | None
    halves: Array
    innovation: Array


def carried_along(run: Run, covariance: Array, *, keep_until: int = -1) -> Iterator[Sample]:
    """Yield the samples of a run from 0 on, with `covariance` (size, size) at time 0.

    Samples up to `keep_until` include the covariance before their rows. Raises LinAlgError where an
    innovation covariance is not positive definite in floating point.
    """
    covariance = covariance.copy()
    none = np.zeros((0, run.size))
    for k, (own, rows, noise) in enumerate(run.samples()):
        if k:
            run.predict(covariance, noise)
        before, half, innovation = None, none, none[:, 0]
        if len(rows):
            before = covariance.copy() if k <= keep_until else None
            factor, gain = factored(rows, covariance)
            half = solved(factor, gain)
            covariance -= half.T @ half
            innovation = np.diagonal(factor) ** 2
        yield Sample(own, covariance, before, half, innovation)


def foreseen_along(
    run: Run, covariance: Array, functions: tuple[SightingRows, SightingRows], until: int
) -> tuple[Iterator[Array], Foreseen]:
    """Return the covariances of carried_along, and predictions of two functions before each row.

    `functions` belong to the first s rows, those up to sample `until`. The predictions are filled
    in as the covariances are iterated.
    """
    foreseen = Foreseen.of_rows(len(functions[0].entries))

    def covariances() -> Iterator[Array]:
        for sample in carried_along(run, covariance, keep_until=until):
            if sample.before is not None:
                both = [dense_rows(one.of(sample.rows), run.size) for one in functions]
                foreseen.of_sample(
                    sample.rows, np.stack(both), sample.before, sample.halves, sample.innovation
                )
            yield sample.covariance

    return covariances(), foreseen


def factored(rows: Array, covariance: Array) -> tuple[Array, Array]:
    """Return the Cholesky factor (m, m) of the innovation of m rows, and H P (m, size)."""
    gain = rows @ covariance
    innovation = gain @ rows.T
    innovation.reshape(-1)[:: len(rows) + 1] += 1.0
    return np.asarray(np.linalg.cholesky(innovation), dtype=float), gain


def solved(factor: Array, sides: Array, *, transposed: bool = False) -> Array:
    """Return L^-1 `sides`, or L^-T `sides`, for the lower factor L (m, m) of an innovation."""
    from scipy.linalg.blas import dtrsm

    # BLAS is column-major, so it takes the transposes as they lie in memory
    found = dtrsm(1.0, factor.T, sides.T, side=1, trans_a=transposed)
    return np.asarray(found, dtype=float).T


# --- group by group -----------------------------------------------------------------------------


def suits_groups(run: Run, covariance: Array) -> bool:
    """Return whether groups are possible, and faster without loss of accuracy."""
    if not run.poses_alone or run.count > GROUPED_VEHICLES:
        return False
    steepest = float(np.max(np.einsum("sc,sc->s", run.rows.entries, run.rows.entries), initial=0.0))
    # no variance along the run exceeds the initial ones plus all noise
    most = float(np.trace(covariance) + run.noise[[0, 3, 5]].sum())
    return steepest * most <= GROUPED_INNOVATION


def variances_by_groups(run: Run, covariance: Array) -> Array:
    """Return (4, n, steps + 1) elements of each vehicle's block after each sample's sightings.

    The four are xx + yy, x psi, y psi and psi psi. `covariance` is (3 n, 3 n) at time 0. Raises
    LinAlgError where an innovation covariance is not positive definite in floating point.
    """
    none = np.zeros((2, 0, 6))
    return _by_groups(run, covariance.copy(), none, Foreseen.of_rows(0))


def foreseen_by_groups(run: Run, covariance: Array, functions: Array) -> tuple[Array, Foreseen]:
    """Return variances_by_groups, and predictions of two functions before each row.

    `functions` (2, s, 6) are of the states of the first s rows, which make up whole samples.
    """
    foreseen = Foreseen.of_rows(functions.shape[1])
    return _by_groups(run, covariance.copy(), functions, foreseen), foreseen


def _by_groups(run: Run, covariance: Array, functions: Array, foreseen: Foreseen) -> Array:
    sample = np.repeat(np.arange(len(run.first) - 1), np.diff(run.first))
    blocks = _blocks(run.count)
    until_sample = run.first[1:]
    found = np.empty((4, run.count, len(until_sample)))
    # samples before any sighting
    done = int(np.searchsorted(until_sample, 1))
    found[..., :done] = _four(np.cumsum(run.noise[..., :done], axis=-1))
    found[..., :done] += _four(covariance[blocks][UPPER])[..., None]
    size = GROUPS_AT_ONCE * GROUP_ROWS
    start = 0
    for begin in range(0, len(sample), size):
        end = min(begin + size, len(sample))
        until = int(np.searchsorted(until_sample, end, side="right"))
        # noise since `start`, the last sample whose noise is in `covariance`
        noise = run.noise[..., start : max(until, sample[end - 1] + 1)].copy()
        noise[..., 0] = 0.0
        noise = np.cumsum(noise, axis=-1)
        own = slice(begin, end)
        since = sample[own] - start
        rows, noisy = grouped(run, np.arange(begin, end), run.rows.entries[own], noise, since)
        ceiling = float(np.trace(covariance) + noise[[0, 3, 5], :, -1].sum())
        groups = _brought_in(covariance, rows, noisy, ceiling)
        foreseen.of_groups(run, functions, noise, since, begin, groups)
        row = until_sample[done:until] - 1 - begin
        found[..., done:until] = _four(noise[..., done - start : until - start])
        four = _four(_own_blocks(groups.before))[..., row // GROUP_ROWS]
        found[..., done:until] += four - _reductions(groups.halves, row)
        covariance[blocks] += noise[..., sample[end - 1] - start][SYMMETRIC]
        start, done = sample[end - 1], until
    return found


def _brought_in(covariance: Array, rows: Array, noisy: Array, ceiling: float) -> Groups:
    """Process groups of rows into the covariance, in place, without the noise since the first.

    `ceiling` exceeds the trace of the covariance with its noise.
    """
    number, width, size = rows.shape
    before = np.empty((number, width, width))
    halves = np.empty((size, number, width))
    variances = np.empty((number, size))
    bordered = np.zeros((size + width, size + width))
    innovation, border = bordered[:size, :size], bordered[size:, :size]
    np.fill_diagonal(bordered, 1.0 + 2.0 * ceiling)
    diagonal = np.einsum("ii->i", innovation)
    for k in range(number):
        before[k] = covariance
        np.matmul(covariance, rows[k], out=border)
        border += noisy[k]
        np.matmul(rows[k].T, border, out=innovation)
        diagonal += 1.0
        factor = np.linalg.cholesky(bordered)
        half = factor[size:, :size]
        variances[k] = np.einsum("ii->i", factor)[:size]
        halves[:, k] = half.T
        covariance -= half @ half.T
    return Groups(before, halves, variances * variances)


def _own_blocks(covariances: Array) -> Array:
    """(6, n, g) each vehicle's block of covariances (g, 3 n, 3 n)."""
    lines, columns = _blocks(covariances.shape[-1] // 3)
    return np.moveaxis(covariances[:, lines[UPPER], columns[UPPER]], 0, -1)


def _reductions(halves: Array, row: Index) -> Array:
    """(4, n, k) reduction of each vehicle's four elements by its group's rows up to each `row`."""
    size, number, width = halves.shape
    x, y, turn = np.moveaxis(halves.reshape(size, number, width // 3, 3), 3, 0)
    taken = np.empty((size, 4, number, width // 3))
    for place, (one, other) in enumerate(((x, x), (x, turn), (y, turn), (turn, turn))):
        np.multiply(one, other, out=taken[:, place])
    taken[:, 0] += y * y
    # several times faster than a cumulative sum, which adds one number at a time
    for k in range(1, size):
        taken[k] += taken[k - 1]
    group, within = np.divmod(row, size)
    return np.moveaxis(taken[within, :, group], 0, -1)


def _four(blocks: Array) -> Array:
    """(4, ...) xx + yy, x psi, y psi and psi psi of (6, ...) blocks."""
    return np.stack([blocks[0] + blocks[3], blocks[2], blocks[4], blocks[5]])


def _blocks(count: int) -> tuple[Index, Index]:
    """(3, 3, n) rows and columns of all vehicles' blocks in the covariance."""
    first, axis = 3 * np.arange(count), np.arange(3)
    rows, columns = np.broadcast_arrays(first + axis[:, None, None], first + axis[:, None])
    return rows, columns
