"""Rank with errors that last as states: what one window determines of poses and errors together.

The matrix is [P E]: P by the poses, as syncplan.observability.rank has it, E by the constant
errors, each column in units of the error's own sigma. What a filter knows of an error beforehand,
its prior, is left out.

Errors that change have no column. Each sample brings them something new, so to the window they are
noise, if a correlated one: gusts as that of the motion, bearing walks as that of the readings. A
noise whose covariance has full rank weighs the rows of [P E] but leaves their rank as it is. A walk
so slow that it is constant over the window is a bearing bias; give it as one to see what it hides.

The team's rank, `observable` and the certificate stay those of P. With the priors, rows of 1 for
each error below E, the matrix [P E; 0 I] has full rank exactly where P has: a prior is known of
every error, so a filter can do with what P determines. What rests on a prior, poses included, is
what the null space of [P E] moves.

Rows of one pair are first reduced to at most as many as the states that they depend on, by QR; this
leaves the singular values as they are.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import qr, solve_triangular

from syncplan.arrays import Array, Flags, Index
from syncplan.observability.referred_rows import WideRows, wide_rows
from syncplan.observability.singular_values import (
    RANK_TOLERANCE,
    VECTORS_LIMIT,
    decomposed,
    matrix_rank,
    rank_gap,
)
from syncplan.observability.window_assessment import Assessment
from syncplan.orbits.error_states import ERROR_STATES, StateLayout, layout_of
from syncplan.orbits.sightings import Sightings

MOVES = 1e-6
"""A state is determined when no null vector of length 1 moves it by more.

Null vectors are known to about 1e-15 / RANK_TOLERANCE.
"""


@dataclass(frozen=True, slots=True)
class ExtendedObservability:
    """Rank and null space of the windowed matrix by poses and constant errors.

    Attributes
    ----------
    layout : of its columns: three by vehicle, then the errors
    rank : of the matrix
    singular_values : (state_dim,) descending, scaled columns
    gap : ratio of the last singular value that counts to the first that does not; infinite
        where all count or the rest is exactly zero
    null_space : (state_dim - rank, state_dim) orthonormal, scaled columns
    """

    layout: StateLayout
    rank: int
    singular_values: Array
    gap: float
    null_space: Array

    @property
    def state_dim(self) -> int:
        """Number of poses' coordinates and errors."""
        return self.layout.size

    @property
    def determined(self) -> Flags:
        """(state_dim,) whether each state is determined, whatever the others are."""
        return np.asarray(np.linalg.norm(self.null_space, axis=0) <= MOVES)

    @property
    def poses_determined(self) -> bool:
        """Whether every position and heading is determined, whatever the errors are."""
        return bool(self.determined[: 3 * self.layout.count].all())

    def determined_of(self, name: str) -> Flags:
        """Return (n,) whether each vehicle's error is determined; so is one that it has not."""
        columns = self.layout.columns[name]
        return np.asarray((self.determined[columns] | (columns < 0)).all(axis=1))


def assess_extended(
    assessed: Assessment, names: Sequence[str] | None = None
) -> ExtendedObservability | None:
    """Return the rank with the errors that the filter estimates as states; None if there are none.

    `names` are other errors to have as states; tuple(ERROR_STATES) for all that have a sigma. Takes
    memory with the square of the number of states, and time with its cube.
    """
    team = assessed.team
    wanted = team.errors.estimated if names is None else names
    layout = layout_of(team, [name for name in wanted if ERROR_STATES[name].constant])
    if not layout.names:
        return None
    rows = wide_rows(team, assessed.sightings, layout)
    matrix = _triangle(_blocks(rows, assessed.sightings), layout.size)
    values, null_space = _spectrum(matrix, layout.size)
    rank = matrix_rank(values, RANK_TOLERANCE)
    return ExtendedObservability(layout, rank, values, rank_gap(values, rank), null_space)


def _spectrum(matrix: Array, size: int) -> tuple[Array, Array]:
    """Singular values (size,) and null space of an upper trapezoid (r, size), r <= size.

    A large one is too slow for all vectors: those of the null space are found by QR, and taken
    where the matrix leaves no more of them than counts as zero.
    """
    if size > VECTORS_LIMIT:
        values = np.zeros(size)
        values[: len(matrix)] = np.linalg.svd(matrix, compute_uv=False)
        rank = matrix_rank(values, RANK_TOLERANCE)
        if rank == size:
            return values, np.zeros((0, size))
        found = _null_space(matrix, rank)
        if np.linalg.norm(matrix @ found.T, axis=0).max() <= RANK_TOLERANCE * values[0]:
            return values, found
    values, null_space, _ = decomposed(matrix, size)
    return values, null_space


def _null_space(matrix: Array, rank: int) -> Array:
    """(size - rank, size) orthonormal, close to the null space, by QR with pivoting."""
    size = matrix.shape[1]
    triangle, order = qr(matrix, mode="r", pivoting=True, check_finite=False)
    null = np.zeros((size, size - rank))
    null[order[rank:]] = np.eye(size - rank)
    null[order[:rank]] = solve_triangular(triangle[:rank, :rank], -triangle[:rank, rank:])
    return np.asarray(np.linalg.qr(null)[0].T)


def _blocks(rows: WideRows, sightings: Sightings) -> Iterator[tuple[Index, Array]]:
    """The rows of each pair, reduced, and the columns (c,) that they have, (r, c)."""
    low = np.minimum(sightings.observers, sightings.targets)
    high = np.maximum(sightings.observers, sightings.targets)
    order = np.lexsort((high, low))
    new = (np.diff(low[order], prepend=-1) != 0) | (np.diff(high[order], prepend=-1) != 0)
    for begin, end in pairwise([*np.flatnonzero(new).tolist(), len(order)]):
        own = order[begin:end]
        columns, place = np.unique(rows.columns[own], return_inverse=True)
        block = np.zeros((len(own), len(columns)))
        number = np.arange(len(own))[:, None]
        np.add.at(block, (number, place.reshape(len(own), -1)), rows.entries[own])
        if len(block) > len(columns):
            block = np.asarray(np.linalg.qr(block, mode="r"))
        yield columns, block


def _triangle(blocks: Iterator[tuple[Index, Array]], size: int) -> Array:
    """(r, size) with r <= size the rows of all blocks, reduced whenever twice as many are there."""
    matrix, filled = np.zeros((2 * size + 16, size)), 0
    for columns, block in blocks:
        if filled + len(block) > len(matrix):
            reduced = np.asarray(np.linalg.qr(matrix[:filled], mode="r"))
            matrix[:] = 0.0
            filled = len(reduced)
            matrix[:filled] = reduced
        matrix[filled : filled + len(block), columns] = block
        filled += len(block)
    if not filled:
        return matrix[:0]
    return np.asarray(np.linalg.qr(matrix[:filled], mode="r"))
