"""A run with all errors referred to time 0: noise that is added, rows of sightings, and changes.

Errors that are constant need no prediction: how they move a vehicle stands in the rows. Gusts and
other Gauss-Markov processes do, since they change. With each, g, in units of its own sigma, at each
sample

    p <- p + Ts sigma g          the place, at time 0 as now, where it is a gust
    g <- a g + noise             a = exp(-Ts / its correlation time), variance 1 - a^2
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.referred_rows import SightingRows, dense_rows

GROUP_ROWS = 64
"""Rows of a group, where rows are processed by groups."""

SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Where the elements of a symmetric block are among its (xx, xy, x psi, yy, y psi, psi psi)."""

UPPER = np.triu_indices(3)
"""The rows and columns of these six in the block."""

_SAMPLES_AT_ONCE, _ELEMENTS_AT_ONCE = 128, 2.5e5
"""Samples whose rows are laid out together, and elements of these at most."""


@dataclass(frozen=True, slots=True)
class GaussMarkov:
    """How errors that change are carried from sample to sample.

    Attributes
    ----------
    columns : (g,) their own
    kept : (g,) share of each that is left after a sample
    places, drifting : (2 n,) columns of the coordinates that some of them move, and of these; none
        where none does
    push : (2 n,) how far a unit moves a coordinate in a sample
    driven : whether noise keeps their variance up; estimates of them just decay
    """

    columns: Index
    kept: Array
    places: Index
    drifting: Index
    push: Array
    driven: bool = True

    def transition(self, size: int) -> tuple[Array, Array]:
        """Return the (size, size) matrix of a prediction, and the noise that comes with it."""
        matrix, noise = np.eye(size), np.zeros((size, size))
        matrix[self.places, self.drifting] = self.push
        matrix[self.columns, self.columns] = self.kept
        noise[self.columns, self.columns] = 1.0 - self.kept**2
        return matrix, noise

    def predict(self, covariance: Array) -> None:
        """Carry a covariance over one sample, in place."""
        covariance[self.places] += self.push[:, None] * covariance[self.drifting]
        covariance[self.columns] *= self.kept[:, None]
        covariance[:, self.places] += self.push * covariance[:, self.drifting]
        covariance[:, self.columns] *= self.kept
        if self.driven:
            covariance[self.columns, self.columns] += 1.0 - self.kept**2


@dataclass(frozen=True, slots=True)
class Run:
    """Noise and sightings along a run of n vehicles, referred to time 0.

    Attributes
    ----------
    noise : (6, n, steps + 1) of the step that ends at k, nothing at 0: the upper triangle of each
        vehicle's block, (xx, xy, x psi, yy, y psi, psi psi)
    rows : whitened, in order of time
    first : (steps + 2,) rows of sample k are first[k] to first[k + 1]
    size : of the state; poses come first
    changing : its errors that change; None where there are none
    """

    noise: Array
    rows: SightingRows
    first: Index
    size: int
    changing: GaussMarkov | None = None

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return int(self.noise.shape[1])

    @property
    def steps(self) -> int:
        """Number of samples after time 0."""
        return int(self.noise.shape[-1]) - 1

    @property
    def poses_alone(self) -> bool:
        """Whether the state has nothing beside the poses."""
        return self.size == 3 * self.count

    def predict(self, covariance: Array, noise: Array) -> None:
        """Carry a covariance to the next sample with its noise (n, 3, 3), in place."""
        if self.changing is not None:
            self.changing.predict(covariance)
        poses = covariance[: 3 * self.count, : 3 * self.count]
        # a view: each vehicle's own block
        own = np.einsum("iaib->iab", poses.reshape(self.count, 3, self.count, 3))
        own += noise

    @property
    def at_once(self) -> int:
        """Samples whose rows are laid out together."""
        each = max(self.size * len(self.rows.entries) / (self.steps + 1), 1.0)
        return max(min(_SAMPLES_AT_ONCE, int(_ELEMENTS_AT_ONCE / each)), 1)

    def samples(self) -> Iterator[tuple[slice, Array, Array]]:
        """Yield of each sample from 0 on which rows it has, these in full, and its noise (n, 3, 3).

        Rows are laid out for many samples at once, as many as take little memory.
        """
        for start in range(0, self.steps + 1, self.at_once):
            edges = self.first[start : start + self.at_once + 1].tolist()
            begin = edges[0]
            rows = dense_rows(self.rows.of(slice(begin, edges[-1])), self.size)
            noise = np.moveaxis(self.noise[..., start : start + self.at_once], (2, 1), (0, 1))
            blocks = noise.take(SYMMETRIC, axis=2)
            for own, block in zip(pairwise(edges), blocks, strict=True):
                yield slice(*own), rows[own[0] - begin : own[1] - begin], block


def grouped(run: Run, which: Index, six: Array, noise: Array, sample: Index) -> tuple[Array, Array]:
    """Return rows in groups, and the noise up to each times it: both (g, 3 n, m), rows as columns.

    `which` are the (r,) rows, `six` their (r, 6) elements or those of functions of the same states.
    `sample` is the place of each in `noise`, (6, n, k). Zeros fill up the last group.
    """
    number = -(-len(sample) // GROUP_ROWS)
    rows, noisy = np.zeros((2, number, 3 * run.count, GROUP_ROWS))
    group, within = np.divmod(np.arange(len(sample)), GROUP_ROWS)
    place = group * (3 * run.count * GROUP_ROWS) + within
    axes = GROUP_ROWS * np.arange(3)[:, None]
    # targets first: in place of a landmark is a vehicle, which may be the observer itself
    for first in (3, 0):
        who, own = run.rows.columns[which, first] // 3, six[:, first : first + 3].T
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
