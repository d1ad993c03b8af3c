"""A factor graph of GTSAM's made linear, and solved as least squares under constraints."""

from dataclasses import dataclass
from typing import Any

import gtsam
import numpy as np
from scipy.sparse import block_array, csc_array, csr_array, eye_array
from scipy.sparse.linalg import SuperLU, splu

from syncplan.arrays import Array

__all__ = ["CONSTANT", "GUST", "POSE", "WALK", "LinearSystem"]

POSE, CONSTANT, GUST, WALK = "x", "c", "g", "w"
"""Letters of the variables' keys."""

SIZES = {POSE: 3, CONSTANT: 1, GUST: 2, WALK: 1}
"""Numbers that a variable has."""


@dataclass(frozen=True, slots=True)
class LinearSystem:
    """A graph made linear: least squares of F x = g where C x = d.

    With the residuals r and the multipliers l, the solution has

        [1  0   F] [r]   [g]
        [0  0   C] [l] = [d]
        [F' C'  0] [x]   [0]

    whose matrix is sparse, and far better conditioned than F'F.

    Attributes
    ----------
    matrix, factors : the matrix above, and its LU factors
    right : its right-hand side
    columns : where the variables' entries are in x, by key
    """

    matrix: csc_array
    factors: SuperLU
    right: Array
    columns: dict[int, slice]

    @classmethod
    def of(cls, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> "LinearSystem":
        """Return the graph as it is at some values."""
        linear = graph.linearize(values)
        rows, places, entries = np.asarray(linear.sparseJacobian_())
        whole = csr_array((entries, (rows.astype(int) - 1, places.astype(int) - 1)))
        fixed = np.zeros(whole.shape[0], dtype=bool)
        end = 0
        for k in range(linear.size()):
            factor: Any = linear.at(k)
            end += factor.rows()
            # of a step's rows the last
            fixed[end - 1] = factor.isConstrained()
        F, C = whole[~fixed, :-1], whole[fixed, :-1]
        matrix = block_array(
            [[eye_array(F.shape[0]), None, F], [None, None, C], [F.T, C.T, None]], format="csc"
        )
        right = np.zeros(len(fixed) + F.shape[1])
        b = whole[:, [-1]].toarray().ravel()
        right[: len(fixed)] = np.concatenate([b[~fixed], b[fixed]])
        # GTSAM's columns are in the order of the keys
        keys = sorted(values.keys())
        ends = np.cumsum([SIZES[chr(gtsam.symbolChr(key))] for key in keys]).tolist()
        columns = dict(zip(keys, map(slice, [0, *ends], ends), strict=False))
        matrix = csc_array(matrix)
        return cls(matrix, splu(matrix), right, columns)

    def solution(self) -> Array:
        """Return x."""
        return self._solved(self.right)[-self.size :]

    def covariance(self, keys: list[int]) -> Array:
        """Return that of some variables, one after another."""
        places = np.concatenate([np.r_[self.columns[key]] for key in keys])
        unit = np.zeros((len(self.right), len(places)))
        unit[len(self.right) - self.size + places, np.arange(len(places))] = -1.0
        found: Array = self._solved(unit)[-self.size :][places]
        return found

    def split(self, x: Array) -> gtsam.VectorValues:
        """Return x by variable."""
        parts = gtsam.VectorValues()
        for key, own in self.columns.items():
            parts.insert(key, x[own])
        return parts

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(own.stop - own.start for own in self.columns.values())

    def _solved(self, right: Array) -> Array:
        found: Array = self.factors.solve(right)
        # what rounding left
        refined: Array = found + self.factors.solve(right - self.matrix @ found)
        return refined
