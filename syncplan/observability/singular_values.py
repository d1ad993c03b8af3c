"""Singular values of the windowed matrix: rank, gap and null space."""

import numpy as np

from syncplan.arrays import Array

RANK_TOLERANCE = 1e-8
"""A singular value of the whole matrix counts above this share of the largest."""

VECTORS_LIMIT = 900
"""State dimension above which singular vectors are computed only where rank is lacking."""


def decomposed(matrix: Array, size: int) -> tuple[Array, Array, Array]:
    """Return singular values (size,), null space, diagonal of the information's pseudo-inverse.

    `matrix` is (r, size), with r at most `size`. Large matrices of full rank need no singular
    vectors, which halves the time.
    """
    if size > VECTORS_LIMIT and len(matrix) == size:
        values = np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=float)
        if matrix_rank(values, RANK_TOLERANCE) == size:
            return values, np.zeros((0, size)), np.sum(np.linalg.inv(matrix) ** 2, axis=1)
    _, found, vectors = np.linalg.svd(matrix, full_matrices=True)
    right = np.asarray(vectors, dtype=float)
    values = np.concatenate([found, np.zeros(size - len(found))]).astype(float)
    rank = matrix_rank(values, RANK_TOLERANCE)
    variances = np.sum((right[:rank] / values[:rank, None]) ** 2, axis=0)
    return values, right[rank:], variances


def matrix_rank(values: Array, tolerance: float) -> int:
    """Return how many singular values, descending, are above `tolerance` times the largest."""
    if len(values) == 0 or values[0] == 0.0:
        return 0
    return int(np.sum(values > tolerance * values[0]))


def rank_gap(values: Array, rank: int) -> float:
    """Return the last singular value that counts over the first that does not.

    Infinite where all count or the rest is exactly zero.
    """
    below = values[rank] if rank < len(values) else 0.0
    return float(values[rank - 1] / below) if rank and below > 0.0 else float("inf")
