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

On the way, the recursion holds what a filter knows just before it takes in a row:
syncplan.estimation.foreseen_sightings.
"""

from collections.abc import Callable

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.foreseen_sightings import Asked, Foreseen, Groups
from syncplan.estimation.referred_run import GROUP_ROWS, SYMMETRIC, UPPER, Run, grouped

GROUPED_VEHICLES = 20
"""Up to this many vehicles, rows are processed by groups, above by samples."""

GROUPED_INNOVATION = 1e8
"""Up to this variance of an innovation, in whitened units, rows are processed by groups.

A group's rounding grows with it, since all its rows use the covariance from before the first.
"""

GROUPS_AT_ONCE = 24
"""Groups that are prepared together, as many as fit into the processor's cache."""


def variances_along(run: Run, covariance: Array) -> Array:
    """Return (4, n, steps + 1) of each vehicle's block after each sample's sightings.

    The four are xx + yy, x psi, y psi and psi psi. `covariance` is (3 n, 3 n) at time 0. Raises
    LinAlgError where an innovation covariance is not positive definite in floating point.
    """
    return _method(run, covariance)(run, covariance.copy(), None)


def foreseen_along(
    run: Run, covariance: Array, functions: Array, weights: Array
) -> tuple[Array, Foreseen]:
    """Return the same as variances_along, and what is known before each row of two functions.

    `functions` is (2, s, 6), of the states that the first s rows concern, s whole samples. Rows
    that cannot have the largest moment of the two, over the innovation's variance and times their
    `weights` (s,), are passed over.
    """
    asked = Asked(functions, weights, _sum_of_variances(run, covariance))
    return _method(run, covariance)(run, covariance.copy(), asked), asked.found


def _method(run: Run, covariance: Array) -> Callable[[Run, Array, Asked | None], Array]:
    return _by_groups if _suits_groups(run, covariance) else _by_samples


def _suits_groups(run: Run, covariance: Array) -> bool:
    """Whether groups are faster without loss of accuracy."""
    if run.count > GROUPED_VEHICLES:
        return False
    steepest = float(np.max(np.einsum("sc,sc->s", run.rows, run.rows), initial=0.0))
    return steepest * _sum_of_variances(run, covariance) <= GROUPED_INNOVATION


def _sum_of_variances(run: Run, covariance: Array) -> float:
    """Return what no variance along the run is above: those at the start with all noise."""
    return float(np.trace(covariance) + run.noise[[0, 3, 5]].sum())


def _four(blocks: Array) -> Array:
    """(4, ...) xx + yy, x psi, y psi and psi psi of (6, ...) blocks."""
    return np.stack([blocks[0] + blocks[3], blocks[2], blocks[4], blocks[5]])


def _blocks(count: int) -> tuple[Index, Index]:
    """(3, 3, n) rows and columns of all vehicles' blocks in the covariance."""
    first, axis = 3 * np.arange(count), np.arange(3)
    rows, columns = np.broadcast_arrays(first + axis[:, None, None], first + axis[:, None])
    return rows, columns


# --- sample by sample ---------------------------------------------------------------------------


def _by_samples(run: Run, covariance: Array, asked: Asked | None) -> Array:
    noise, columns, first = run.noise_blocks, run.columns, run.first.tolist()
    # a view: each vehicle's own block
    own = np.einsum("iaib->iab", covariance.reshape(run.count, 3, run.count, 3))
    vehicles = np.column_stack([run.observers, run.targets])
    found = np.empty_like(noise)
    for k in range(len(noise)):
        own += noise[k]
        begin, end = first[k], first[k + 1]
        if asked is not None and begin < asked.size:
            asked.look_ahead(run, own, k)
        if begin < end:
            sighted = slice(begin, end)
            factors = _factors(covariance, run.rows[sighted], vehicles[sighted], columns[sighted])
            if asked is not None and begin < asked.size:
                asked.of_sample(begin, columns[sighted], covariance, factors)
            half = factors[1]
            covariance -= half.T @ half
        found[k] = own
    four = np.empty((4, *found.shape[:2]))
    np.add(found[..., 0, 0], found[..., 1, 1], out=four[0])
    four[1], four[2], four[3] = found[..., 0, 2], found[..., 1, 2], found[..., 2, 2]
    return np.swapaxes(four, 1, 2)


def _factors(
    covariance: Array, rows: Array, vehicles: Index, columns: Index
) -> tuple[Array, Array]:
    """The factor of the innovation of m rows, (m, m), and their halves, (m, 3 n)."""
    number, width = len(rows), len(covariance)
    # whole blocks of three lines each
    lines = covariance.reshape(-1, 3 * width).take(vehicles, axis=0).reshape(number, 6, width)
    gain = np.matmul(rows[:, None, :], lines)[:, 0]
    innovation = np.einsum("mc,mcl->ml", rows, gain.T.take(columns, axis=0))
    innovation.reshape(-1)[:: number + 1] += 1.0
    factor = np.linalg.cholesky(innovation)
    return factor, np.linalg.solve(factor, gain)


# --- group by group -----------------------------------------------------------------------------


def _by_groups(run: Run, covariance: Array, asked: Asked | None) -> Array:
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
        # added since `start`, the sample whose noise `covariance` has
        noise = run.noise[..., start : max(until, sample[end - 1] + 1)].copy()
        noise[..., 0] = 0.0
        noise = np.cumsum(noise, axis=-1)
        own = slice(begin, end)
        since = sample[own] - start
        rows, noisy = grouped(run, np.arange(begin, end), run.rows[own], noise, since)
        ceiling = float(np.trace(covariance) + noise[[0, 3, 5], :, -1].sum())
        groups = _brought_in(covariance, rows, noisy, ceiling)
        if asked is not None:
            asked.of_groups(run, noise, since, begin, groups)
        row = until_sample[done:until] - 1 - begin
        found[..., done:until] = _four(noise[..., done - start : until - start])
        four = _four(groups.own)[..., row // GROUP_ROWS]
        found[..., done:until] += four - _reductions(groups.halves, row)
        covariance[blocks] += noise[..., sample[end - 1] - start][SYMMETRIC]
        start, done = sample[end - 1], until
    return found


def _brought_in(covariance: Array, rows: Array, noisy: Array, ceiling: float) -> Groups:
    """Bring groups of rows into the covariance, in place, leaving out all noise since the first.

    `ceiling` is above the trace of the covariance with its noise.
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
    return Groups(before, _own_blocks(before), halves, variances * variances)


def _own_blocks(covariances: Array) -> Array:
    """(6, n, g) each vehicle's block of covariances (g, 3 n, 3 n)."""
    lines, columns = _blocks(covariances.shape[-1] // 3)
    return np.moveaxis(covariances[:, lines[UPPER], columns[UPPER]], 0, -1)


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
