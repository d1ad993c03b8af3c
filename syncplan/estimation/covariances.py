"""Covariance along a run with all errors referred to time 0, where prediction only adds noise.

The recursion goes row by row (Tichavsky, Muravchik, Nehorai 1998, Proposition 1):

    P <- P + N, and what changes (syncplan.estimation.referred_run)      each sample
    g  = P h,  s = h . g + 1,  P <- P - g g^T / s                        each row h

A few rows share a pass over P: P is kept as it was before the first of them, and g is corrected by
the rows since, g - sum of half_j (half_j . h) with half = g / sqrt(s). A whitened row has few
non-zeros, so P h takes as many times the size of the state. P is kept as its lower triangle; three
columns at a time, those of a vehicle's pose, have their whole block on the diagonal.

The recursion also gives a filter's covariances of two functions a, b of the states of a sighting,
just before its row: a . P a, a . P b and b . P b.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.referred_run import Run
from syncplan.observability.referred_rows import SightingRows

ROWS_AT_ONCE = 8
"""Number of rows that share a pass over the covariance, a multiple of four."""

_ELEMENTS_AT_ONCE = 1e6
"""Number of elements of `moves` that are held at a time."""


@dataclass(frozen=True, slots=True)
class Foreseen:
    """Predictions just before each of the first s rows, after all earlier ones.

    Attributes
    ----------
    pairs : (3, s) variance of the first function, covariance of both, variance of the second
    innovation : (s,) variance of the row's own innovation, in whitened units
    """

    pairs: Array
    innovation: Array


@dataclass(frozen=True, slots=True)
class RunVariances:
    """Variances after each sample's sightings.

    Attributes
    ----------
    moves : (k, n, 3) of each vehicle's x, y and heading, as moved by the covariance's states
    states : (k, f) of the states after the poses
    covariance : (size, size) at the end
    foreseen : of the functions, if any
    """

    moves: Array
    states: Array
    covariance: Array
    foreseen: Foreseen


def variances_along(
    run: Run,
    covariance: Array,
    tracked: Index,
    moves: Callable[[Index], Array],
    functions: tuple[SightingRows, SightingRows] | None = None,
) -> RunVariances:
    """Return the variances along a run from `covariance` (size, size) at time 0.

    Vehicle i moves at sample k by `moves(k)[i]` (3, c) times the states of columns `tracked[i]`
    (c,). `functions` belong to the first s rows and have the same columns. Raises LinAlgError where
    the variance of an innovation is not positive in floating point.
    """
    from syncplan.estimation.covariance_kernels import along

    steps, width = run.steps + 1, run.rows.entries.shape[1]
    changing = run.changing
    none = np.zeros(0, dtype=np.int64)
    if functions is None:
        nothing = SightingRows(np.zeros((0, width)), np.zeros((0, width), dtype=np.int64))
        functions = nothing, nothing
    count = len(functions[0].entries)
    found = RunVariances(
        moves=np.empty((steps, run.count, 3)),
        states=np.empty((steps, run.size - 3 * run.count)),
        covariance=covariance.copy(),
        foreseen=Foreseen(np.empty((3, count)), np.empty(count)),
    )
    given = (
        np.ascontiguousarray(run.noise.transpose(2, 1, 0)),
        np.ascontiguousarray(run.rows.entries),
        np.ascontiguousarray(run.rows.columns),
        np.ascontiguousarray(run.first),
        changing.columns if changing else none,
        changing.kept if changing else np.zeros(0),
        changing.places if changing else none,
        changing.drifting if changing else none,
        changing.push if changing else np.zeros(0),
        int(changing.driven) if changing else 0,
        np.ascontiguousarray(tracked),
        np.stack([one.entries for one in functions]),
        np.ascontiguousarray(functions[0].columns),
        np.zeros((ROWS_AT_ONCE, run.size)),
        found.covariance,
        found.foreseen.pairs,
        found.foreseen.innovation,
    )
    at_once = max(int(_ELEMENTS_AT_ONCE / (3 * tracked.size)), 1)
    for begin in range(0, steps, at_once):
        own = slice(begin, min(begin + at_once, steps))
        effects = np.ascontiguousarray(moves(np.arange(own.start, own.stop)))
        if not along(*given, effects, begin, found.moves[own], found.states[own]):
            raise np.linalg.LinAlgError("the variance of an innovation is not positive")
    upper = np.triu_indices(run.size, 1)
    found.covariance[upper] = found.covariance.T[upper]
    return found
