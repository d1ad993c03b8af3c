"""Rank, null space and variances of a matrix of rows: dense for small teams, sparse for large ones.

Small matrices are decomposed into singular values. Large ones are factored, M = Q R, by
syncplan.observability.multifrontal, and only what is needed of their singular values is computed:

    the largest            Lanczos iteration on M^T M
    null space             one vector z for each column of R without a pivot, and right singular
                           vectors of values below the tolerance
    the smallest counted   Lanczos iteration on B^T B with B = (I - Z Z^+) R^-1: without the part in
                           the null space, R^-1 is the pseudo-inverse
    variances              selected inversion of R

Iterations start from fixed vectors, and values below the tolerance are removed from the operator
until the largest that is left is above it. So none is missed, however many coincide.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.multifrontal import Block, Factor, factored

RANK_TOLERANCE = 1e-8
"""Share of the whole matrix's largest singular value above which a singular value counts."""

DENSE_STATES = 450
"""State dimension up to which all singular values are computed."""

MOST_NULL_VECTORS = 600
"""Number of null vectors of large teams that are kept: those of the first vehicles."""

LONG = 1e4
"""Largest element of a null vector beside the 1 of its own column before others are chosen."""

LOST = 1e-8
"""Share of the smallest singular value that counts below which another is lost in rounding."""

_ACCURACY = 1e-13
"""Relative accuracy of squared singular values that are iterated for."""

_BASIS = 40
"""Number of vectors of an iteration before it restarts."""


@dataclass(frozen=True, slots=True)
class Observability:
    """Rank and conditioning of a windowed matrix, scaled columns.

    Attributes
    ----------
    rank : number of singular values above RANK_TOLERANCE times the largest
    singular_values : (state_dim,) descending; above DENSE_STATES only the largest, the last that
        counts and those that do not, the others being NaN
    null_space : (state_dim - rank, state_dim) orthonormal unobservable directions; above
        DENSE_STATES at most MOST_NULL_VECTORS of them
    moved : (state_dim,) squared length of each coordinate's part in the null space; where
        directions are left out, positive for the same coordinates
    variances : (state_dim,) diagonal of the information's pseudo-inverse: after one window, the
        variance at time 0 of each coordinate that the null space does not move
    scale : m, unit of positions: the mean radius unless stated otherwise
    """

    rank: int
    singular_values: Array
    null_space: Array
    moved: Array
    variances: Array
    scale: float

    @property
    def state_dim(self) -> int:
        """Number of columns: three per vehicle, and any errors."""
        return len(self.singular_values)

    @property
    def observable(self) -> bool:
        """Whether every state is determined."""
        return self.rank == self.state_dim

    @property
    def gap(self) -> float:
        """Ratio of the last singular value that counts to the first that does not.

        Infinite where all count or the rest is exactly zero.
        """
        values = self.singular_values
        below = values[self.rank] if self.rank < len(values) else 0.0
        return float(values[self.rank - 1] / below) if self.rank and below > 0.0 else float("inf")

    @property
    def condition_number(self) -> float:
        """Ratio of the largest to the smallest singular value; infinite if unobservable."""
        if not self.observable:
            return float("inf")
        return float(self.singular_values[0] / self.singular_values[-1])

    @property
    def min_eigenvalue(self) -> float:
        """Smallest eigenvalue of the windowed information; 0 if unobservable."""
        return float(self.singular_values[-1] ** 2) if self.observable else 0.0


def matrix_rank(values: Array, tolerance: float) -> int:
    """Return the number of `values`, descending, above `tolerance` times the largest."""
    if len(values) == 0 or values[0] == 0.0:
        return 0
    return int(np.sum(values > tolerance * values[0]))


def observability_of(
    blocks: Sequence[Block], size: int, scale: float, parts: Sequence[Index] | None = None
) -> Observability:
    """Return the observability of the rows of all blocks.

    `parts` holds the columns of each part of a dissection, see multifrontal.factored. Without it,
    the matrix is decomposed as a dense one.
    """
    if parts is None:
        return dense_observability(dense_matrix(blocks, size), scale)
    return _sparse_observability(blocks, size, scale, parts)


# --- small teams ----------------------------------------------------------------------------------


def dense_matrix(blocks: Sequence[Block], size: int) -> Array:
    """Return the rows (r, size) of all blocks, one block after another."""
    matrix = np.zeros((sum(len(rows) for _, rows in blocks), size))
    begin = 0
    for columns, rows in blocks:
        matrix[begin : begin + len(rows), columns] = rows
        begin += len(rows)
    return matrix


def dense_observability(matrix: Array, scale: float) -> Observability:
    """Return the observability of rows (r, size) from their singular value decomposition."""
    size = matrix.shape[1]
    if len(matrix) > size:
        matrix = np.asarray(np.linalg.qr(matrix, mode="r"))
    _, found, vectors = np.linalg.svd(matrix, full_matrices=True)
    right = np.asarray(vectors, dtype=float)
    values = np.concatenate([found, np.zeros(size - len(found))]).astype(float)
    rank = matrix_rank(values, RANK_TOLERANCE)
    variances = np.sum((right[:rank] / values[:rank, None]) ** 2, axis=0)
    null_space = right[rank:]
    moved = np.sum(null_space**2, axis=0)
    return Observability(rank, values, null_space, moved, variances, scale)


# --- large teams ----------------------------------------------------------------------------------


def _sparse_observability(
    blocks: Sequence[Block], size: int, scale: float, parts: Sequence[Index]
) -> Observability:
    factor = factored(blocks, parts, size)
    rows = sparse_matrix(blocks, size)
    values = np.full(size, np.nan)
    values[0] = np.sqrt(_greatest(lambda vector: rows.T @ (rows @ vector), size, 1)[0][0])
    null = _NullRows(factor)
    if null.longest > LONG and null.count <= MOST_NULL_VECTORS:
        # vectors that are nearly parallel: other columns set them apart
        nothing = np.zeros((0, size))
        factor = _set_aside(blocks, parts, size, factor.order[null.pivots(nothing)])
        null = _NullRows(factor)
    weakest, near, levels = _smallest(factor, null, RANK_TOLERANCE * float(values[0]))
    lost = near[levels < LOST * weakest]
    if len(lost) and null.count + len(lost) <= MOST_NULL_VECTORS:
        # beside pivots that are nearly lost, the weakest value would drown in rounding
        factor = _set_aside(blocks, parts, size, factor.order[null.pivots(lost)])
        null = _NullRows(factor)
        weakest, near, _ = _smallest(factor, null, RANK_TOLERANCE * float(values[0]))
    rank = size - null.count - len(near)
    if rank > 1:
        values[rank - 1] = weakest
    kept, moved = null.with_others(near)
    if len(kept) == size - rank:
        values[rank:] = 0.0
        mapped = rows[:, factor.order] @ kept.T
        seen = np.linalg.svd(mapped, compute_uv=False) if len(kept) else values[rank:]
        values[rank : rank + len(seen)] = seen
    found = np.stack([moved, *kept])
    found[:, factor.order] = found.copy()
    if len(near):
        factor = _set_aside(blocks, parts, size, factor.order[null.pivots(near)])
    variances = np.empty(size)
    variances[factor.order] = factor.variances()
    return Observability(rank, values, found[1:], found[0], variances, scale)


def _set_aside(
    blocks: Sequence[Block], parts: Sequence[Index], size: int, columns: Index
) -> Factor:
    """The factor with some columns last and without a pivot."""
    others = [part[~np.isin(part, columns)] for part in parts]
    return factored(blocks, [*others, columns], size, columns.tolist())


def sparse_matrix(blocks: Sequence[Block], size: int) -> Any:
    """Return the rows (r, size) of all blocks as a sparse matrix."""
    from scipy.sparse import csr_array

    none = np.zeros(0, dtype=np.int64)
    entries = np.concatenate([none, *(rows.ravel() for _, rows in blocks)])
    columns = np.concatenate([none, *(np.tile(own, len(rows)) for own, rows in blocks)])
    number = np.concatenate([none, *(np.full(len(rows), len(own)) for own, rows in blocks)])
    first = np.concatenate([[0], np.cumsum(number)])
    return csr_array((entries, columns, first), shape=(len(number), size), dtype=float)


class _NullRows:
    """Vectors z, one for each column without a pivot, as sparse rows."""

    def __init__(self, factor: Factor) -> None:
        from scipy.sparse import csr_array, vstack

        size = len(factor.order)
        found = [csr_array((0, size))]
        for columns, vectors in factor.null_vectors():
            one = csr_array(vectors.T)
            one.eliminate_zeros()
            whole = (one.data, one.indices + columns.start, one.indptr)
            found.append(csr_array(whole, shape=(len(one.indptr) - 1, size)))
        self.rows = vstack(found, format="csr")
        self.count = int(self.rows.shape[0])
        self.longest = float(np.max(np.abs(self.rows.data), initial=0.0))
        if self.count:
            from scipy.sparse.linalg import splu

            self._gram = splu((self.rows @ self.rows.T).tocsc())
        # those of the first vehicles come first
        lowest = [factor.order[row.indices].min() for row in _each(self.rows)]
        self._order = np.argsort(lowest, kind="stable")

    def removed(self, vector: Array) -> Array:
        """Return a vector (size,) without its part in the null space."""
        if not self.count:
            return vector
        for _ in range(2):
            vector = vector - self.rows.T @ self._gram.solve(self.rows @ vector)
        return vector

    def with_others(self, others: Array) -> tuple[Array, Array]:
        """Return an orthonormal basis of these vectors and `others` (k, size), and what it moves.

        `others` are orthonormal, and orthogonal to these.
        """
        room = max(MOST_NULL_VECTORS - len(others), 0)
        chosen = self.rows[self._order[:room]].toarray()
        basis = np.concatenate([np.linalg.qr(chosen.T)[0].T, others[:MOST_NULL_VECTORS]])
        if len(chosen) == self.count:
            return basis, np.sum(basis**2, axis=0)
        all_ = np.asarray(self.rows.power(2).sum(axis=0)).ravel()
        return basis, all_ + np.sum(others**2, axis=0)

    def pivots(self, others: Array) -> Index:
        """Return the columns (k,) in which these vectors and `others` are most independent."""
        from scipy.linalg import qr

        basis, _ = self.with_others(others)
        return np.asarray(qr(basis, mode="r", pivoting=True)[1][: len(basis)])


def _each(rows: Any) -> Any:
    return (rows[[k]] for k in range(rows.shape[0]))


def _smallest(factor: Factor, null: _NullRows, least: float) -> tuple[float, Array, Array]:
    """Smallest singular value above `least`, right singular vectors of those up to it, and these.

    The null space of the columns without a pivot is left out.
    """
    size = len(factor.order)
    found, weak, levels = np.zeros((0, size)), np.zeros((0, size)), np.zeros(0)
    if null.count == size:
        return 0.0, weak, levels

    def apart(vector: Array) -> Array:
        return vector - found.T @ (found @ vector)

    def squared(vector: Array) -> Array:
        back = null.removed(factor.solve(apart(vector)[:, None])[:, 0])
        return apart(factor.solve_transposed(null.removed(back)[:, None])[:, 0])

    count = 2
    while True:
        values, vectors = _greatest(squared, size, count)
        below = values * least**2 >= 1.0
        if not below.any():
            return float(1.0 / np.sqrt(values[0])), weak, levels
        found = np.linalg.qr(np.concatenate([found, vectors[below]]).T)[0].T
        levels = np.append(levels, 1.0 / np.sqrt(values[below]))
        weak = np.array([null.removed(factor.solve(one[:, None])[:, 0]) for one in found])
        weak = np.linalg.qr(weak.T)[0].T
        count *= 2


def _greatest(operator: Callable[[Array], Array], size: int, count: int) -> tuple[Array, Array]:
    """Greatest eigenvalues (count,) of a symmetric operator, descending, and eigenvectors."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    start = operator(np.random.default_rng(0).standard_normal(size))
    if not np.any(start):
        return np.zeros(count), np.zeros((count, size))
    matrix = LinearOperator((size, size), matvec=operator, dtype=float)
    count = min(count, size - 1)
    ncv = min(max(_BASIS, 3 * count), size)
    values, vectors = eigsh(matrix, count, v0=start, tol=_ACCURACY, ncv=ncv, maxiter=100 * size)
    order = np.argsort(-values)
    return np.maximum(values[order], 0.0), vectors.T[order]
