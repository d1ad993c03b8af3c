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
from syncplan.estimation.kernels import fused
from syncplan.estimation.referred_run import Run
from syncplan.observability.referred_rows import SightingRows

ROWS_AT_ONCE = 8
"""Number of rows that share a pass over the covariance, a multiple of four."""

_POSES = 6
"""Number of entries of a row for the poses of observer and target, three each."""

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
        if not _along(*given, effects, begin, found.moves[own], found.states[own]):
            raise np.linalg.LinAlgError("the variance of an innovation is not positive")
    upper = np.triu_indices(run.size, 1)
    found.covariance[upper] = found.covariance.T[upper]
    return found


@fused
def _change(
    covariance: Array,
    columns: Index,
    kept: Array,
    places: Index,
    drifting: Index,
    push: Array,
    driven: int,
) -> int:
    """Propagate the errors that change over one sample; both triangles are then right."""
    size = len(covariance)
    for i in range(size):
        for j in range(i):
            covariance[j, i] = covariance[i, j]
    for p in range(len(places)):
        for j in range(size):
            covariance[places[p], j] += push[p] * covariance[drifting[p], j]
    for c in range(len(columns)):
        for j in range(size):
            covariance[columns[c], j] *= kept[c]
    for i in range(size):
        for p in range(len(places)):
            covariance[i, places[p]] += push[p] * covariance[i, drifting[p]]
        for c in range(len(columns)):
            covariance[i, columns[c]] *= kept[c]
    if driven:
        for c in range(len(columns)):
            covariance[columns[c], columns[c]] += 1.0 - kept[c] * kept[c]
    return 1


@fused
def _grow(covariance: Array, noise: Array) -> int:
    """Add a step's noise, (n, 6), to the vehicles' blocks."""
    for k in range(len(noise)):
        x, y, turn = 3 * k, 3 * k + 1, 3 * k + 2
        xx, xy, xp, yy, yp, pp = noise[k]
        covariance[x, x] += xx
        covariance[x, y] += xy
        covariance[y, x] += xy
        covariance[x, turn] += xp
        covariance[turn, x] += xp
        covariance[y, y] += yy
        covariance[y, turn] += yp
        covariance[turn, y] += yp
        covariance[turn, turn] += pp
    return 1


@fused
def _reduce(covariance: Array, halves: Array, many: int) -> int:
    """Subtract the squares of `many` halves; the rest up to a multiple of four are zero.

    Above the diagonal only the blocks of three columns are right afterwards.
    """
    size = len(covariance)
    for b in range(0, many, 4):
        # three lines at a time, the poses' own number, share what is loaded
        for i in range(0, size - size % 3, 3):
            p, q, r, s = halves[b, i], halves[b + 1, i], halves[b + 2, i], halves[b + 3, i]
            i1, i2 = i + 1, i + 2
            p1, q1, r1, s1 = halves[b, i1], halves[b + 1, i1], halves[b + 2, i1], halves[b + 3, i1]
            p2, q2, r2, s2 = halves[b, i2], halves[b + 1, i2], halves[b + 2, i2], halves[b + 3, i2]
            for j in range(i + 3):
                one, two = halves[b, j], halves[b + 1, j]
                three, four = halves[b + 2, j], halves[b + 3, j]
                covariance[i, j] -= p * one + q * two + r * three + s * four
                covariance[i1, j] -= p1 * one + q1 * two + r1 * three + s1 * four
                covariance[i2, j] -= p2 * one + q2 * two + r2 * three + s2 * four
        for i in range(size - size % 3, size):
            for j in range(i + 1):
                for k in range(b, b + 4):
                    covariance[i, j] -= halves[k, i] * halves[k, j]
    return 1


@fused
def _foresee(
    covariance: Array,
    halves: Array,
    earlier: int,
    row: int,
    functions: Array,
    columns: Index,
    pairs: Array,
) -> int:
    """Covariances of a row's two functions, after so many earlier halves."""
    width = functions.shape[2]
    along, both, across = 0.0, 0.0, 0.0
    for p in range(width):
        a, b, i = functions[0, row, p], functions[1, row, p], columns[row, p]
        for q in range(width):
            j = columns[row, q]
            shared = covariance[max(i, j), min(i, j)]
            along += a * functions[0, row, q] * shared
            both += a * functions[1, row, q] * shared
            across += b * functions[1, row, q] * shared
    for k in range(earlier):
        one, other = 0.0, 0.0
        for p in range(width):
            half = halves[k, columns[row, p]]
            one += functions[0, row, p] * half
            other += functions[1, row, p] * half
        along -= one * one
        both -= one * other
        across -= other * other
    pairs[0, row], pairs[1, row], pairs[2, row] = along, both, across
    return 1


@fused
def _along(
    noise: Array,
    entries: Array,
    columns: Index,
    first: Index,
    changing: Index,
    kept: Array,
    places: Index,
    drifting: Index,
    push: Array,
    driven: int,
    tracked: Index,
    functions: Array,
    function_columns: Index,
    halves: Array,
    covariance: Array,
    pairs: Array,
    innovation: Array,
    moves: Array,
    start: int,
    found: Array,
    states: Array,
) -> int:
    """Go on from sample `start` as far as `moves` go; 0 where a variance is not positive."""
    size, width = len(covariance), entries.shape[1]
    at_once, vehicles, own = len(halves), len(tracked), tracked.shape[1]
    for k in range(start, start + len(moves)):
        if k and len(changing):
            _change(covariance, changing, kept, places, drifting, push, driven)
        _grow(covariance, noise[k])
        for begin in range(first[k], first[k + 1], at_once):
            many = min(at_once, first[k + 1] - begin)
            for r in range(many):
                row = begin + r
                for j in range(size):
                    halves[r, j] = 0.0
                for q in range(0, _POSES, 3):
                    x, y, turn = entries[row, q], entries[row, q + 1], entries[row, q + 2]
                    if x != 0.0 or y != 0.0 or turn != 0.0:
                        c, c1, c2 = columns[row, q], columns[row, q + 1], columns[row, q + 2]
                        for j in range(c + 3):
                            halves[r, j] += (
                                x * covariance[c, j]
                                + y * covariance[c1, j]
                                + turn * covariance[c2, j]
                            )
                        for j in range(c + 3, size):
                            halves[r, j] += (
                                x * covariance[j, c]
                                + y * covariance[j, c1]
                                + turn * covariance[j, c2]
                            )
                for q in range(_POSES, width):
                    entry, column = entries[row, q], columns[row, q]
                    if entry != 0.0:
                        for j in range(column):
                            halves[r, j] += entry * covariance[column, j]
                        for j in range(column, size):
                            halves[r, j] += entry * covariance[j, column]
                for b in range(r):
                    shared = 0.0
                    for q in range(width):
                        shared += entries[row, q] * halves[b, columns[row, q]]
                    for j in range(size):
                        halves[r, j] -= shared * halves[b, j]
                variance = 1.0
                for q in range(width):
                    variance += entries[row, q] * halves[r, columns[row, q]]
                if not variance > 0.0:
                    return 0
                if row < len(innovation):
                    innovation[row] = variance
                    _foresee(covariance, halves, r, row, functions, function_columns, pairs)
                share = 1.0 / np.sqrt(variance)
                for j in range(size):
                    halves[r, j] *= share
            for b in range(many, at_once):
                for j in range(size):
                    halves[b, j] = 0.0
            _reduce(covariance, halves, many)
        for v in range(vehicles):
            for axis in range(3):
                total = 0.0
                for p in range(own):
                    move, i = moves[k - start, v, axis, p], tracked[v, p]
                    total += move * move * covariance[i, i]
                    for q in range(p):
                        shared = covariance[max(i, tracked[v, q]), min(i, tracked[v, q])]
                        total += 2.0 * move * moves[k - start, v, axis, q] * shared
                found[k - start, v, axis] = total
        for c in range(states.shape[1]):
            states[k - start, c] = covariance[3 * vehicles + c, 3 * vehicles + c]
    return 1
