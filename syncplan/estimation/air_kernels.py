"""Processes and motion of `drawn_errors`, compiled; the bytes are those of plain NumPy."""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.kernels import compile_for, inner, lean

SMALL = 0.05
"""Largest angle in rad for which series are exact to rounding."""


@lean
def correlate(values: Array, decays: Array) -> None:
    """Add to each row of `values` (times, s) the shares `decays` (s,) of the row before."""
    for k in range(1, len(values)):
        for j in range(len(decays)):
            values[k, j] += values[k - 1, j] * decays[j]


@lean
def turn_by_series(moved: Array, drift: Array, time: float, begin: int, work: Array) -> bool:
    """Fill in displacements through the air, and the turns in rad from each to the next.

    `moved` and `drift` are those of `motion_in_air`. `work` (5, k, n, lanes) takes x and y, what
    the next displacement is across and along, and the turn to it, from moved[begin] on. Returns
    whether all turns are SMALL; if not, they are wrong.
    """
    large = 0
    for m in range(work.shape[1]):
        for i in range(work.shape[2]):
            k = min(max(begin + m - 2, 0), len(drift) - 1)
            air, x, y = drift[k, min(i, drift.shape[1] - 1)], work[0, m, i], work[1, m, i]
            _blow(moved[begin + m, i], air, time, x, y)
            if m > 0:
                places, last = (work[0, m - 1, i], work[1, m - 1, i], x, y), work[2:, m - 1, i]
                large += _turn(*places, last[0], last[1], last[2])
    return large == 0


@inner
def _blow(moved: Array, air: Array, time: float, x: Array, y: Array) -> None:
    for lane in range(len(x)):
        x[lane], y[lane] = moved[0] - time * air[0, lane], moved[1] - time * air[1, lane]


@inner
def _turn(
    x: Array, y: Array, next_x: Array, next_y: Array, across: Array, along: Array, turns: Array
) -> int:
    """Fill in a vehicle's turns; return in how many lanes they are too large."""
    large = 0
    for lane in range(len(x)):
        a = x[lane] * next_y[lane] - y[lane] * next_x[lane]
        b = x[lane] * next_x[lane] + y[lane] * next_y[lane]
        large += 0 if abs(a) < SMALL * b else 1
        slope = a / b
        square = slope * slope
        rest = 1 / 3 - square * (1 / 5 - square * (1 / 7 - square / 9))
        across[lane], along[lane], turns[lane] = a, b, slope * (1.0 - square * rest)
    return large


@lean
def steer(
    work: Array, time: float, start: Array, headings: Array, speeds: Array, turns: Array
) -> bool:
    """Fill in headings from `start` (n, lanes) on, speeds, and turns in rad a sample, evened out.

    `work` is that of `turn_by_series` from two samples before on, and is overwritten. Returns
    whether half of each turn is SMALL; if not, the speeds are wrong.
    """
    large = 0
    work[2, 0] = 0.0
    for k in range(len(speeds)):
        for i in range(speeds.shape[1]):
            _even_out(work[4, k : k + 4, i], start[i], work[2, 0, i], turns[k, i], headings[k, i])
            x, y = work[0, k + 2, i], work[1, k + 2, i]
            large += _pace(x, y, turns[k, i], time, speeds[k, i])
    return large == 0


@inner
def _even_out(sharp: Array, start: Array, total: Array, turns: Array, headings: Array) -> None:
    for lane in range(len(total)):
        turn = 5.0 * (sharp[1, lane] + sharp[2, lane])
        turns[lane] = 0.125 * (turn - sharp[0, lane] - sharp[3, lane])
        total[lane] += turns[lane]
        headings[lane] = total[lane] + start[lane]


@inner
def _pace(x: Array, y: Array, turns: Array, time: float, speeds: Array) -> int:
    """Fill in a vehicle's speeds along (x, y); return in how many lanes it turns too much."""
    large = 0
    for lane in range(len(x)):
        square = 0.25 * turns[lane] * turns[lane]
        chord = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
        speeds[lane] = math.sqrt(x[lane] * x[lane] + y[lane] * y[lane]) / (time * chord)
        large += 0 if square <= SMALL * SMALL else 1
    return large


def compile_motion() -> None:
    """Compile this module's kernels, or load them from the disk cache."""
    rows, samples, work = np.zeros((1, 1)), np.zeros((1, 1, 1)), np.zeros((5, 1, 1, 1))
    compile_for(correlate, rows, rows[0])
    compile_for(turn_by_series, samples, work, 1.0, 1, work)
    compile_for(steer, work, 1.0, rows, samples, samples, samples)
