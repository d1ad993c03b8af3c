"""Covariance along a run with all errors referred to time 0, where prediction only adds noise.

Noise is block diagonal, one 3 x 3 block a vehicle, and a whitened row h of a sighting is wide as
the state, with six non-zeros. Rows come in by groups of consecutive rows: let P be the covariance
where a group starts and N_j the noise added since, up to the sample of its row j. Then

    g_j  = (P + N_j) h_j                     of the state with row j: noise after j is not in it
    S_kj = h_k . g_j + (1 if j = k)          of the rows, for j <= k; S = L L^T
    half = L^-1 G^T
    P_s  = P + N_s - sum of half_k half_k^T over the rows k up to sample s

which is the recursion sample by sample (Tichavsky, Muravchik, Nehorai 1998, Proposition 1), term by
term, in a few matrix operations a group. Only P + N_j matters, so N is summed from the start of a
batch of groups, and P is kept without it. The factor of S bordered by G has `half` in its border,
so no triangular system is solved; its corner is not used and only has to be large enough for the
whole to be positive definite:

    [ S    ]   [ L      ] [ L^T  half^T ]
    [ G  c ] = [ half . ] [      .      ]

The border is as long as the state. In larger teams it costs more than it saves: there, and where
the sigmas span many orders of magnitude, rows are processed sample by sample.

On the way, the recursion holds what a filter knows just before it takes in a row. Of two further
linear functions a, b of the same six states it gives, at hardly any cost,

    cov(a_k, b_k) = a_k . (P + N_k) b_k - sum over the rows j < k of (half_j . a_k) (half_j . b_k)
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index

__all__ = ["Foreseen", "Run", "foreseen_along", "variances_along"]


GROUPED_VEHICLES = 20
"""Up to this many vehicles, rows are processed by groups, above by samples."""

GROUPED_INNOVATION = 1e8
"""Up to this variance of an innovation, in whitened units, rows are processed by groups.

A group's rounding grows with it, since all its rows use the covariance from before the first.
"""

GROUP_ROWS = 64
GROUPS_AT_ONCE = 24
"""Groups that are prepared together, as many as fit into the processor's cache."""

_SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the elements of a symmetric block are among its (xx, xy, x psi, yy, y psi, psi psi)."""

_UPPER = np.triu_indices(3)


@dataclass(frozen=True, slots=True)
class Run:
    """Noise and sightings along a run of n vehicles, referred to time 0.

    Attributes
    ----------
    noise : (6, n, steps + 1) of the step that ends at k, nothing at 0: the upper triangle of each
        vehicle's block, (xx, xy, x psi, yy, y psi, psi psi)
    rows : (s, 6) whitened rows in order of time, observer's three, target's three
    observers, targets : (s,) vehicles; any for a landmark, whose three are zero
    first : (steps + 2,) rows of sample k are first[k] to first[k + 1]
    """

    noise: Array
    rows: Array
    observers: Index
    targets: Index
    first: Index

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return int(self.noise.shape[1])

    @property
    def columns(self) -> Index:
        """(s, 6) columns of the rows' elements in the team's state."""
        vehicles = np.column_stack([self.observers, self.targets])
        return (3 * vehicles[:, :, None] + np.arange(3)).reshape(-1, 6)

    @property
    def noise_blocks(self) -> Array:
        """(steps + 1, n, 3, 3) the noise as blocks."""
        return np.ascontiguousarray(np.moveaxis(self.noise[_SYMMETRIC], (3, 2), (0, 1)))


@dataclass(frozen=True, slots=True)
class Foreseen:
    """What is known just before each of the first s rows, all earlier ones taken in.

    Attributes
    ----------
    pairs : (2, 2, s) covariances of the two functions asked for
    innovation : (s,) variance of the row's own innovation, in whitened units
    """

    pairs: Array
    innovation: Array


def variances_along(run: Run, covariance: Array) -> Array:
    """Return (4, n, steps + 1) of each vehicle's block after each sample's sightings.

    The four are xx + yy, x psi, y psi and psi psi. `covariance` is (3 n, 3 n) at time 0. Raises
    LinAlgError where an innovation covariance is not positive definite in floating point.
    """
    return _method(run, covariance)(run, covariance.copy(), None)


def foreseen_along(run: Run, covariance: Array, functions: Array) -> tuple[Array, Foreseen]:
    """Return the same as variances_along, and what is known before each row of two functions.

    `functions` is (2, s, 6), of the states that the first s rows concern, s whole samples.
    """
    size = functions.shape[1]
    asked = _Asked(functions, Foreseen(np.empty((2, 2, size)), np.empty(size)))
    return _method(run, covariance)(run, covariance.copy(), asked), asked.found


@dataclass(frozen=True, slots=True)
class _Asked:
    """Two functions of the states that rows concern, (2, s, 6), and where the answers go."""

    functions: Array
    found: Foreseen

    def answer(
        self, run: Run, noise: Array, sample: Index, begin: int, groups: tuple[Array, Array, Array]
    ) -> None:
        """Fill in what the groups of rows from `begin` on say, as _brought_in returns them."""
        before, halves, innovation = groups
        own = slice(begin, min(begin + len(sample), len(self.found.innovation)))
        size = own.stop - begin
        used = -(-size // GROUP_ROWS)
        probes = [_dense(run, one[own], noise, sample[:size], begin) for one in self.functions]
        known = _known_before(before[:used], halves[:, :used], probes)
        self.found.pairs[..., own] = known.reshape(2, 2, -1)[..., :size]
        self.found.innovation[own] = innovation.reshape(-1)[:size]


def _method(run: Run, covariance: Array) -> Callable[[Run, Array, _Asked | None], Array]:
    return _by_groups if _suits_groups(run, covariance) else _by_samples


def _suits_groups(run: Run, covariance: Array) -> bool:
    """Whether groups are faster without loss of accuracy."""
    if run.count > GROUPED_VEHICLES:
        return False
    steepest = float(np.max(np.einsum("sc,sc->s", run.rows, run.rows), initial=0.0))
    largest = float(np.trace(covariance) + run.noise[[0, 3, 5]].sum())
    return steepest * largest <= GROUPED_INNOVATION


def _four(blocks: Array) -> Array:
    """(4, ...) xx + yy, x psi, y psi and psi psi of (6, ...) blocks."""
    return np.stack([blocks[0] + blocks[3], blocks[2], blocks[4], blocks[5]])


def _blocks(count: int) -> tuple[Index, Index]:
    """(3, 3, n) rows and columns of all vehicles' blocks in the covariance."""
    first, axis = 3 * np.arange(count), np.arange(3)
    rows, columns = np.broadcast_arrays(first + axis[:, None, None], first + axis[:, None])
    return rows, columns


# --- sample by sample ---------------------------------------------------------------------------


def _by_samples(run: Run, covariance: Array, asked: _Asked | None) -> Array:
    noise, columns = run.noise_blocks, run.columns
    vehicles = np.arange(run.count)
    view = covariance.reshape(run.count, 3, run.count, 3)
    found = np.empty_like(noise)
    for k in range(len(noise)):
        view[vehicles, :, vehicles, :] += noise[k]
        begin, end = run.first[k], run.first[k + 1]
        if begin < end:
            _update(covariance, run.rows[begin:end], columns[begin:end], asked, begin)
        found[k] = view[vehicles, :, vehicles, :]
    upper = found[:, :, _UPPER[0], _UPPER[1]]
    return _four(np.moveaxis(upper, (2, 1), (0, 1)))


def _update(
    covariance: Array, rows: Array, columns: Index, asked: _Asked | None, begin: int
) -> None:
    """Bring m whitened bearings, from row `begin` on, into the covariance, in place."""
    gain = np.matmul(rows[:, None, :], covariance[columns])[:, 0]
    innovation = np.einsum("mc,mcl->ml", rows, gain.T[columns])
    innovation[np.diag_indices_from(innovation)] += 1.0
    factor = np.linalg.cholesky(innovation)
    half = np.linalg.solve(factor, gain)
    if asked is not None and begin < len(asked.found.innovation):
        own = slice(begin, begin + len(rows))
        functions = asked.functions[:, own]
        blocks = covariance[columns[:, :, None], columns[:, None, :]]
        earlier = np.tril(np.ones((len(rows), len(rows))), -1)
        # of each function, by how much each earlier row of the sample reduced it
        told = np.einsum("amc,jmc->amj", functions, half[:, columns]) * earlier
        asked.found.pairs[..., own] = np.einsum(
            "amc,mcd,bmd->abm", functions, blocks, functions
        ) - np.einsum("amj,bmj->abm", told, told)
        asked.found.innovation[own] = np.diag(factor) ** 2
    covariance -= half.T @ half


# --- group by group -----------------------------------------------------------------------------


def _by_groups(run: Run, covariance: Array, asked: _Asked | None) -> Array:
    sample = np.repeat(np.arange(len(run.first) - 1), np.diff(run.first))
    blocks = _blocks(run.count)
    until_sample = run.first[1:]
    found = np.empty((4, run.count, len(until_sample)))
    # samples before any sighting
    done = int(np.searchsorted(until_sample, 1))
    found[..., :done] = _four(np.cumsum(run.noise[..., :done], axis=-1))
    found[..., :done] += _four(covariance[blocks][_UPPER])[..., None]
    size = GROUPS_AT_ONCE * GROUP_ROWS
    start = 0
    for begin in range(0, len(sample), size):
        end = min(begin + size, len(sample))
        until = int(np.searchsorted(until_sample, end, side="right"))
        # added since `start`, the sample whose noise `covariance` has
        noise = run.noise[..., start : max(until, sample[end - 1] + 1)].copy()
        noise[..., 0] = 0.0
        noise = np.cumsum(noise, axis=-1)
        own = slice(begin, end)
        rows, noisy = _dense(run, run.rows[own], noise, sample[own] - start, begin)
        ceiling = float(np.trace(covariance) + noise[[0, 3, 5], :, -1].sum())
        before, halves, innovation = _brought_in(covariance, rows, noisy, ceiling)
        if asked is not None and begin < len(asked.found.innovation):
            asked.answer(run, noise, sample[own] - start, begin, (before, halves, innovation))
        row = until_sample[done:until] - 1 - begin
        found[..., done:until] = _four(noise[..., done - start : until - start])
        four = _four(_own_blocks(before))[..., row // GROUP_ROWS]
        found[..., done:until] += four - _reductions(halves, row)
        covariance[blocks] += noise[..., sample[end - 1] - start][_SYMMETRIC]
        start, done = sample[end - 1], until
    return found


def _dense(run: Run, six: Array, noise: Array, sample: Index, begin: int) -> tuple[Array, Array]:
    """Rows from `begin` on, given as their `six`, in groups; and the noise up to each times it.

    Both (g, 3 n, m), each row a column; zeros fill up the last group.
    """
    number = -(-len(sample) // GROUP_ROWS)
    rows, noisy = np.zeros((2, number, 3 * run.count, GROUP_ROWS))
    index = np.arange(len(sample))
    group, within = np.divmod(index, GROUP_ROWS)
    place = group * (3 * run.count * GROUP_ROWS) + within
    axes = GROUP_ROWS * np.arange(3)[:, None]
    end = begin + len(sample)
    # targets first: in place of a landmark is a vehicle, which may be the observer itself
    for vehicles, columns in ((run.targets, slice(3, 6)), (run.observers, slice(0, 3))):
        who, own = vehicles[begin:end], six[:, columns].T
        at = place + 3 * GROUP_ROWS * who + axes
        grown = noise.reshape(6, -1).take(who * noise.shape[-1] + sample, axis=1)
        rows.reshape(-1)[at] = own
        noisy.reshape(-1)[at] = _times(grown, own)
    return rows, noisy


def _times(blocks: Array, vectors: Array) -> Array:
    """(3, s) symmetric blocks (6, s) times vectors (3, s)."""
    xx, xy, xp, yy, yp, pp = blocks
    x, y, p = vectors
    return np.stack([xx * x + xy * y + xp * p, xy * x + yy * y + yp * p, xp * x + yp * y + pp * p])


def _brought_in(
    covariance: Array, rows: Array, noisy: Array, ceiling: float
) -> tuple[Array, Array, Array]:
    """Bring groups of rows into the covariance, in place, leaving out all noise since the first.

    `ceiling` is above the trace of the covariance with its noise. Returns the covariance before
    each group, (g, 3 n, 3 n), the halves (m, g, 3 n) and each row's innovation variance (g, m).
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
    return before, halves, variances * variances


def _own_blocks(covariances: Array) -> Array:
    """(6, n, g) each vehicle's block of covariances (g, 3 n, 3 n)."""
    lines, columns = _blocks(covariances.shape[-1] // 3)
    return np.moveaxis(covariances[:, lines[_UPPER], columns[_UPPER]], 0, -1)


def _known_before(before: Array, halves: Array, probes: list[tuple[Array, Array]]) -> Array:
    """(2, 2, g, m) covariances of two functions (g, 3 n, m), with their noise, before each row."""
    earlier = np.triu(np.ones((len(halves), len(halves))), 1)
    # in one piece: of a mere view the products take several times as long
    by_group = np.ascontiguousarray(np.swapaxes(halves, 0, 1))
    told = [by_group @ one * earlier for one, _ in probes]
    grown = [before @ one + noisy for one, noisy in probes]
    known = np.empty((2, 2, *probes[0][0].shape[::2]))
    for a, b in ((0, 0), (0, 1), (1, 1)):
        known[a, b] = known[b, a] = np.einsum("gkm,gkm->gm", probes[a][0], grown[b]) - np.einsum(
            "gjm,gjm->gm", told[a], told[b]
        )
    return known


def _reductions(halves: Array, row: Index) -> Array:
    """(4, n, k) by how much the rows of its group up to each `row` reduced each vehicle's four."""
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
