"""What a filter knows just before it takes in a sighting, of two functions a, b of its six states.

While rows are brought into a covariance (syncplan.estimation.covariances has the notation), it is

    cov(a_k, b_k) = a_k . (P + N_k) b_k - sum over the rows j < k of (half_j . a_k) (half_j . b_k)

Of all rows only one is wanted: where the second moment of the product of the two,

    m_k = cov(a, a) cov(b, b) + cov(a, b)^2

is largest beside the innovation's variance S_k, weighted. So it is computed only where it can be:
by Cauchy and Schwarz, m_k <= 2 cov(a, a) cov(b, b), and with o and t for the two vehicles' parts

    cov(a, a) <= (sqrt(a_o . P_oo a_o) + sqrt(a_t . P_tt a_t))^2

for any earlier P with the noise since, as rows only reduce it. Where rows are taken in sample by
sample, all are computed.
"""

from dataclasses import dataclass, field

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import GROUP_ROWS, Run, grouped

MARGIN, ROUNDING = 1.0 + 1e-6, 1e-12
"""By how much a ceiling has to be missed; share of `most` that rounding may add."""


@dataclass(frozen=True, slots=True)
class Foreseen:
    """Predictions just before each of the first s rows, all earlier ones taken in.

    Attributes
    ----------
    pairs : (2, 2, s) covariances of the two functions asked for; zero where not computed
    innovation : (s,) variance of the row's own innovation, in whitened units
    """

    pairs: Array
    innovation: Array

    def of_sample(
        self, rows: slice, functions: Array, before: Array, halves: Array, innovation: Array
    ) -> None:
        """Fill in the rows of a sample from their functions, (2, m, size) of the whole state.

        `before` is the covariance that has none of the rows, `halves` (m, size) what they take.
        """
        number = rows.stop - rows.start
        earlier = np.tril(np.ones((number, number)), -1)
        # of each function, by how much each earlier row of the sample reduced it
        reduced = (functions @ halves.T) * earlier
        self.pairs[..., rows] = np.einsum("amc,bmc->abm", functions @ before, functions)
        self.pairs[..., rows] -= np.einsum("amj,bmj->abm", reduced, reduced)
        self.innovation[rows] = innovation


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups of rows as they were brought into a covariance.

    Attributes
    ----------
    before : (g, 3 n, 3 n) the covariance before each group, without noise since the first
    own : (6, n, g) each vehicle's block of it
    halves : (m, g, 3 n)
    innovation : (g, m) each row's variance
    """

    before: Array
    own: Array
    halves: Array
    innovation: Array


@dataclass(slots=True)
class Asked:
    """Two functions of the states that rows concern, and what is found of them on the way.

    Attributes
    ----------
    functions : (2, s, 6), of the first s rows, whole samples
    weights : (s,) of m_k / S_k; the row where their product is largest is wanted
    most : that no variance is above: those at the start with all noise
    found : the answers
    largest : the largest product so far
    ceilings : (s,) that the products times S are not above, where known so far
    """

    functions: Array
    weights: Array
    most: float
    found: Foreseen = field(init=False)
    largest: float = 0.0
    ceilings: Array = field(init=False)

    def __post_init__(self) -> None:
        """Make room for the answers."""
        size = len(self.weights)
        self.found = Foreseen(np.zeros((2, 2, size)), np.ones(size))
        self.ceilings = np.full(size, np.inf)

    @property
    def size(self) -> int:
        """Number of rows asked for."""
        return len(self.weights)

    def of_groups(self, run: Run, noise: Array, sample: Index, begin: int, groups: Groups) -> None:
        """Answer for groups of rows from `begin` on.

        `noise` is (6, n, k) since the first, `sample` (r,) each row's place in it.
        """
        rows = slice(begin, min(begin + len(sample), self.size))
        size = rows.stop - begin
        if size <= 0:
            return
        sample = sample[:size]
        self.found.innovation[rows] = groups.innovation.reshape(-1)[:size]
        group = np.arange(size) // GROUP_ROWS
        self._bound(run, rows, (groups.own, group), (noise, sample))
        ceilings = np.maximum.reduceat(
            self.ceilings[rows] / self.found.innovation[rows], np.arange(0, size, GROUP_ROWS)
        )
        # the one that promises most spares others
        best = int(np.argmax(ceilings))
        ceilings[best] = np.inf
        for chosen in (np.array([best]), None):
            if chosen is None:
                chosen = np.flatnonzero(~(ceilings * MARGIN < self.largest))
                chosen = chosen[chosen != best]
            if not len(chosen):
                continue
            which = np.flatnonzero(np.isin(group, chosen))
            probes = [
                grouped(run, begin + which, one[begin + which], noise, sample[which])
                for one in self.functions
            ]
            known = _known_before(groups.before[chosen], groups.halves[:, chosen], probes)
            self._found(begin + which, known.reshape(2, 2, -1)[..., : len(which)])

    def _bound(
        self, run: Run, rows: slice, known: tuple[Array, Index], noise: tuple[Array, Index]
    ) -> None:
        """Find the ceilings of rows from earlier blocks and the noise since.

        Both are (6, n, k) with each row's place in them.
        """
        functions = np.ascontiguousarray(np.swapaxes(self.functions[:, rows], 1, 2))
        spread = np.zeros((2, rows.stop - rows.start))
        seen = run.rows.of(rows)
        for vehicles, columns in ((seen.observers, slice(0, 3)), (seen.targets, slice(3, 6))):
            own, added = (
                blocks[:, vehicles, place[: len(spread[0])]] for blocks, place in (known, noise)
            )
            for one, parts in zip(spread, functions[:, columns], strict=True):
                one += np.sqrt(self._largest_variance(own + added, parts))
        with np.errstate(over="ignore", invalid="ignore"):
            self.ceilings[rows] = 2.0 * (spread[0] * spread[1]) ** 2 * self.weights[rows]

    def _largest_variance(self, blocks: Array, vectors: Array) -> Array:
        """(s,) variance of linear functions (3, s) with blocks (6, s), with room for rounding."""
        xx, xy, xp, yy, yp, pp = blocks
        x, y, p = vectors
        exact = x * (xx * x + 2.0 * (xy * y + xp * p)) + y * (yy * y + 2.0 * yp * p) + pp * p * p
        return np.asarray(np.maximum(exact, 0.0) + ROUNDING * self.most * (x * x + y * y + p * p))

    def _found(self, rows: Index | slice, pairs: Array) -> None:
        self.found.pairs[..., rows] = pairs
        (along, both), (_, across) = pairs
        moments = np.maximum(along, 0.0) * np.maximum(across, 0.0) + both * both
        with np.errstate(over="ignore", invalid="ignore"):
            products = moments * self.weights[rows] / self.found.innovation[rows]
        self.largest = float(np.maximum(self.largest, products.max()))


def _known_before(before: Array, halves: Array, probes: list[tuple[Array, Array]]) -> Array:
    """(2, 2, g, m) covariances of two functions (g, 3 n, m), with their noise, before each row."""
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
