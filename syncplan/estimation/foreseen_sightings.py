"""What a filter knows just before it takes in a sighting, of two functions a, b of its six states.

While rows are brought into a covariance (syncplan.estimation.covariances has the notation), it is

    cov(a_k, b_k) = a_k . (P + N_k) b_k - sum over the rows j < k of (half_j . a_k) (half_j . b_k)

Of a sample the covariance has all noise already.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import GROUP_ROWS, Run, grouped


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups of rows as they were brought into a covariance.

    Attributes
    ----------
    before : (g, 3 n, 3 n) the covariance before each group, without noise since the first
    halves : (m, g, 3 n)
    innovation : (g, m) each row's variance
    """

    before: Array
    halves: Array
    innovation: Array


@dataclass(frozen=True, slots=True)
class Foreseen:
    """Predictions just before each of the first s rows, all earlier ones taken in.

    Attributes
    ----------
    pairs : (2, 2, s) covariances of the two functions asked for
    innovation : (s,) variance of the row's own innovation, in whitened units
    """

    pairs: Array
    innovation: Array

    @classmethod
    def of_rows(cls, size: int) -> "Foreseen":
        """Return room for the predictions of so many rows."""
        return cls(np.zeros((2, 2, size)), np.ones(size))

    def of_sample(
        self, rows: slice, functions: Array, before: Array, halves: Array, innovation: Array
    ) -> None:
        """Fill in the rows of a sample from their functions, (2, m, size) of the whole state.

        `before` is the covariance that has none of the rows, `halves` (m, size) what they take.
        """
        # of each function, by how much each earlier row of the sample reduced it
        reduced = (functions @ halves.T) * np.tril(np.ones((len(halves), len(halves))), -1)
        self.pairs[..., rows] = np.einsum("amc,bmc->abm", functions @ before, functions)
        self.pairs[..., rows] -= np.einsum("amj,bmj->abm", reduced, reduced)
        self.innovation[rows] = innovation

    def of_groups(
        self, run: Run, functions: Array, noise: Array, sample: Index, begin: int, groups: Groups
    ) -> None:
        """Fill in groups of rows from `begin` on from their functions (2, s, 6).

        `noise` is (6, n, k) since the first, `sample` (r,) each row's place in it.
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
    # in one piece: of a mere view the products take several times as long
    by_group = np.ascontiguousarray(np.swapaxes(halves, 0, 1))
    reduced = [by_group @ one * earlier for one, _ in probes]
    grown = [before @ one + noisy for one, noisy in probes]
    known = np.empty((2, 2, *probes[0][0].shape[::2]))
    for a, b in ((0, 0), (0, 1), (1, 1)):
        known[a, b] = known[b, a] = np.einsum("gkm,gkm->gm", probes[a][0], grown[b]) - np.einsum(
            "gjm,gjm->gm", reduced[a], reduced[b]
        )
    return known
