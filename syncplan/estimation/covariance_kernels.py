"""Compiled loops of the covariance along a run: see syncplan.estimation.covariances.

They are imported where they run, since numba takes a fifth of a second to load.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.kernels import fused

_POSES = 6
"""Number of entries of a row for the poses of observer and target, three each."""


@fused
def refer(arm: Array, moved: Array, gain: Array, senses: Array, noise: Array) -> int:
    """Add the noise of each step after the first, by speed and by turn rate."""
    for v in range(len(senses)):
        for source in range(2):
            along, across, turn = gain[v, 0, source], gain[v, 1, source], gain[v, 2, source]
            for k in range(1, arm.shape[2]):
                # heading at the start of the step, a quarter turn from the arm
                ahead, left = -senses[v] * arm[1, v, k - 1], senses[v] * arm[0, v, k - 1]
                # referred to time 0, a turn moves the position backwards about the vehicle
                x = ahead * along - left * across + moved[1, v, k] * turn
                y = left * along + ahead * across - moved[0, v, k] * turn
                noise[0, v, k] += x * x
                noise[1, v, k] += x * y
                noise[2, v, k] += x * turn
                noise[3, v, k] += y * y
                noise[4, v, k] += y * turn
                noise[5, v, k] += turn * turn
    return 1


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
def along(
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
    variances: Array,
    states: Array,
) -> int:
    """Go on from sample `start` as far as `moves` go; 0 where a variance is not positive.

    Fill `variances` and `states`, the moves and states of RunVariances.
    """
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
                variances[k - start, v, axis] = total
        for c in range(states.shape[1]):
            states[k - start, c] = covariance[3 * vehicles + c, 3 * vehicles + c]
    return 1
