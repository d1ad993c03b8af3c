"""Run with all errors referred to time 0: added noise, rows of sightings and changing errors.

Constant errors need no prediction: the rows contain their effect on a vehicle. Gusts and other
Gauss-Markov processes change, so they are predicted. For each, g, in units of its own sigma, a
sample makes

    p <- p + Ts sigma g          position, at time 0 as now, if g is a gust
    g <- a g + noise             a = exp(-Ts / its correlation time), variance 1 - a^2
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.observability.referred_rows import SightingRows, dense_rows

SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
"""Index of each element of a symmetric block in (xx, xy, x psi, yy, y psi, psi psi)."""

_SAMPLES_AT_ONCE, _ELEMENTS_AT_ONCE = 128, 2.5e5
"""Largest number of samples whose rows are laid out together, and of their elements."""


@dataclass(frozen=True, slots=True)
class GaussMarkov:
    """Propagation of changing errors from sample to sample.

    Attributes
    ----------
    columns : (g,) of these errors
    kept : (g,) share of each that remains after a sample
    places, drifting : (2 n,) columns of the coordinates that some of the errors move, and of those
        errors; empty if none does
    push : (2 n,) displacement of a coordinate by a unit in a sample
    driven : whether noise keeps their variance up; without it they only decay
    """

    columns: Index
    kept: Array
    places: Index
    drifting: Index
    push: Array
    driven: bool = True

    def transition(self, size: int) -> tuple[Array, Array]:
        """Return the (size, size) transition matrix of a prediction, and its noise."""
        matrix, noise = np.eye(size), np.zeros((size, size))
        matrix[self.places, self.drifting] = self.push
        matrix[self.columns, self.columns] = self.kept
        noise[self.columns, self.columns] = 1.0 - self.kept**2
        return matrix, noise

    def predict(self, covariance: Array) -> None:
        """Propagate a covariance over one sample, in place."""
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
    noise : (6, n, steps + 1) of the step that ends at k, zero at k = 0: the upper triangle of each
        vehicle's block, (xx, xy, x psi, yy, y psi, psi psi)
    rows : whitened, in order of time
    first : (steps + 2,) rows of sample k are first[k] to first[k + 1]
    size : of the state; poses come first
    changing : propagation of the changing errors; None if there are none
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
        """Whether the state consists of poses alone."""
        return self.size == 3 * self.count

    def predict(self, covariance: Array, noise: Array) -> None:
        """Propagate a covariance to the next sample, with its noise (n, 3, 3), in place."""
        if self.changing is not None:
            self.changing.predict(covariance)
        poses = covariance[: 3 * self.count, : 3 * self.count]
        # a view: each vehicle's own block
        own = np.einsum("iaib->iab", poses.reshape(self.count, 3, self.count, 3))
        own += noise

    @property
    def at_once(self) -> int:
        """Number of samples whose rows are laid out together."""
        each = max(self.size * len(self.rows.entries) / (self.steps + 1), 1.0)
        return max(min(_SAMPLES_AT_ONCE, int(_ELEMENTS_AT_ONCE / each)), 1)

    def samples(self) -> Iterator[tuple[slice, Array, Array]]:
        """Yield each sample's slice of rows, these in full, and its noise (n, 3, 3), from 0 on.

        Rows are laid out for `at_once` samples at a time, as many as take little memory.
        """
        for start in range(0, self.steps + 1, self.at_once):
            edges = self.first[start : start + self.at_once + 1].tolist()
            begin = edges[0]
            rows = dense_rows(self.rows.of(slice(begin, edges[-1])), self.size)
            noise = np.moveaxis(self.noise[..., start : start + self.at_once], (2, 1), (0, 1))
            blocks = noise.take(SYMMETRIC, axis=2)
            for own, block in zip(pairwise(edges), blocks, strict=True):
                yield slice(*own), rows[own[0] - begin : own[1] - begin], block
