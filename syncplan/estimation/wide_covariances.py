"""Covariance along a run whose state has errors beside the poses, referred to time 0.

The recursion of syncplan.estimation.covariances, sample by sample, with further columns. Errors
that are constant need no prediction: how they move a vehicle stands in the rows. Gusts and other
Gauss-Markov processes do, since they change. With each, g, in units of its own sigma, at each
sample

    p <- p + Ts sigma g          the place, at time 0 as now, where it is a gust
    g <- a g + noise             a = exp(-Ts / its correlation time), variance 1 - a^2

Rows are dense here: BLAS takes them in faster than elements can be gathered.

A filter that leaves errors out of its state takes them for noise. Its gain K comes from its own
covariance; what its errors truly are, with those of the whole state and rows H of all of it, is

    C <- (1 - K H) C (1 - K H)^T + K K^T

for any gain (Joseph): the consider analysis of Schmidt, with the filter's gains instead of others.
Where rows are noisier than the filter takes them for, K K^T has the noise's variances between. What
changes in another way than the filter takes it to, as gusts of another strength or memory, stands
there twice: as it truly is and, as the filter goes on with it, as estimated.

Sources
-------
errors that are considered : Schmidt, "Application of state-space methods to navigation problems",
    Advances in Control Systems 3, 1966; Bierman, "Factorization Methods for Discrete Sequential
    Estimation", 1977, VIII.2 and IX (errors of a filter with the wrong model)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import SYMMETRIC
from syncplan.observability.referred_rows import WideRows, dense_rows

_SAMPLES_AT_ONCE, _ELEMENTS_AT_ONCE = 128, 4e6
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
class WideRun:
    """Noise and sightings along a run of n vehicles whose state has `size` elements.

    Attributes
    ----------
    noise : (6, n, steps + 1) of the poses, as in Run
    rows : whitened, in order of time
    first : (steps + 2,) rows of sample k are first[k] to first[k + 1]
    size : of the state; poses come first
    changing : its errors that change; None where there are none
    """

    noise: Array
    rows: WideRows
    first: Index
    size: int
    changing: GaussMarkov | None

    @property
    def count(self) -> int:
        """Number of vehicles."""
        return int(self.noise.shape[1])

    @property
    def steps(self) -> int:
        """Number of samples after time 0."""
        return int(self.noise.shape[-1]) - 1

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

    def laid_out(self, first: int, end: int) -> tuple[Array, list[slice], Array]:
        """Return samples `first` to `end`: rows in full, those of each sample, and its noise."""
        begin, until = int(self.first[first]), int(self.first[end])
        rows = WideRows(self.rows.entries[begin:until], self.rows.columns[begin:until])
        edges = (self.first[first : end + 1] - begin).tolist()
        each = [slice(a, b) for a, b in pairwise(edges)]
        noise = np.moveaxis(self.noise[..., first:end], (2, 1), (0, 1)).take(SYMMETRIC, axis=2)
        return dense_rows(rows, self.size), each, noise


@dataclass(frozen=True, slots=True)
class TrueRun:
    """What truly happens along a filter's run.

    Attributes
    ----------
    run : noise, rows and errors that there are, rows over the sigmas that the filter takes for true
    variances : (s,) of each row's noise
    held : (size of the filter's state,) where in the true covariance each of its states is
    followed : states of the filter that stand, as estimated, behind those of `run`
    estimates : how these are carried; None where there are none
    """

    run: WideRun
    variances: Array
    held: Index
    followed: Index
    estimates: GaussMarkov | None

    @property
    def size(self) -> int:
        """Size of the true covariance."""
        return self.run.size + len(self.followed)

    def predict(self, covariance: Array, noise: Array) -> None:
        """Carry the true covariance to the next sample with its noise, in place."""
        self.run.predict(covariance, noise)
        if self.estimates is not None:
            self.estimates.predict(covariance)

    def rows(self, true: Array, own: Array) -> Array:
        """Return rows (m, size) of true errors, those of the true run and of the filter's given."""
        return np.hstack([true, -own[:, self.followed]]) if len(self.followed) else true

    def gains(self, own: Array) -> Array:
        """Return the filter's gains (m, its size) for the true errors: estimates grow by them."""
        gains = np.zeros((len(own), self.size))
        gains[:, self.held] = own
        gains[:, self.run.size :] *= -1.0
        return gains


@dataclass(frozen=True, slots=True)
class Sample:
    """A sample of a run, its rows taken in.

    Attributes
    ----------
    number : of the sample
    rows : its rows, counted through the run
    covariance : (size, size) after them, changed in place with the next sample
    before : (size, size) the one before; None where it has no rows, or it was not asked for
    halves : (m, size) L^-1 H P of its rows, S = L L^T; empty where it has none
    innovation : (m,) variance of each row's own innovation, the earlier ones taken in
    """

    number: int
    rows: slice
    covariance: Array
    before: Array | None
    halves: Array
    innovation: Array


def carried_along(run: WideRun, covariance: Array, *, keep_until: int = -1) -> Iterator[Sample]:
    """Yield the samples of a run from 0 on, from `covariance` (size, size) at time 0.

    Up to sample `keep_until` each has the covariance from before its rows. Raises LinAlgError where
    an innovation covariance is not positive definite in floating point.
    """
    covariance = covariance.copy()
    none = np.zeros((0, run.size))
    for start in range(0, run.steps + 1, run.at_once):
        end = min(start + run.at_once, run.steps + 1)
        rows, each, noise = run.laid_out(start, end)
        offset = int(run.first[start])
        for k, own in enumerate(each, start):
            if k:
                run.predict(covariance, noise[k - start])
            before, half, innovation = None, none, none[:, 0]
            if own.stop > own.start:
                before = covariance.copy() if k <= keep_until else None
                factor, gain = _factored(rows[own], covariance)
                half = _solved(factor, gain)
                covariance -= half.T @ half
                innovation = np.diagonal(factor) ** 2
            counted = slice(own.start + offset, own.stop + offset)
            yield Sample(k, counted, covariance, before, half, innovation)


def considered_along(
    own: WideRun, truth: TrueRun, covariances: tuple[Array, Array]
) -> Iterator[Array]:
    """Yield the true covariance after each sample of a filter whose run is `own`.

    `covariances` are the filter's and the true one at time 0. What is yielded is changed in place
    with the next sample. Raises LinAlgError as carried_along.
    """
    trusted, true = (one.copy() for one in covariances)
    whole = truth.run
    for start in range(0, own.steps + 1, whole.at_once):
        end = min(start + whole.at_once, own.steps + 1)
        rows, each, noise = own.laid_out(start, end)
        wide, _, true_noise = whole.laid_out(start, end)
        wide, variances = truth.rows(wide, rows), truth.variances[int(own.first[start]) :]
        for k, sighted in enumerate(each, start):
            if k:
                own.predict(trusted, noise[k - start])
                truth.predict(true, true_noise[k - start])
            if sighted.stop > sighted.start:
                factor, gain = _factored(rows[sighted], trusted)
                half = _solved(factor, gain)
                trusted -= half.T @ half
                gains = truth.gains(_solved(factor.T, half))
                _take_in(true, wide[sighted], gains, variances[sighted])
            yield true


def _factored(rows: Array, covariance: Array) -> tuple[Array, Array]:
    """The factor (m, m) of the innovation of m rows, and H P (m, size)."""
    gain = rows @ covariance
    innovation = gain @ rows.T
    innovation.reshape(-1)[:: len(rows) + 1] += 1.0
    return np.asarray(np.linalg.cholesky(innovation), dtype=float), gain


def _solved(factor: Array, sides: Array) -> Array:
    return np.asarray(np.linalg.solve(factor, sides), dtype=float)


def _take_in(covariance: Array, rows: Array, gains: Array, variances: Array) -> None:
    """C <- (1 - K H) C (1 - K H)^T + K R K^T in place, with the transposed gain K^T (m, size)."""
    seen = rows @ covariance
    innovation = seen @ rows.T
    innovation.reshape(-1)[:: len(rows) + 1] += variances
    taken = gains.T @ (seen - 0.5 * innovation @ gains)
    covariance -= taken
    covariance -= taken.T
