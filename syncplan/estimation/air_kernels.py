"""Processes and motion of `drawn_errors`, compiled; the bytes are those of plain NumPy.

Arrays are (samples, n, lanes) unless stated otherwise.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.kernels import compile_for, inner, lean


@lean
def correlate(values: Array, decays: Array) -> None:
    """Add to each row of `values` (times, s) the shares `decays` (s,) of the row before."""
    for k in range(1, len(values)):
        _add_share(values[k - 1], decays, values[k])


@inner
def _add_share(before: Array, decays: Array, now: Array) -> None:
    for j in range(len(now)):
        now[j] += before[j] * decays[j]


@lean
def turn_by_series(
    moved: Array,
    drift: Array,
    time: float,
    small: float,
    x: Array,
    y: Array,
    across: Array,
    along: Array,
    turns: Array,
) -> bool:
    """Fill in displacements (x, y) in m through the air, and the turns in rad between them.

    `moved` (samples, n, 2) m are displacements over ground, and `drift` (samples or 1, n or 1, 2,
    lanes) m/s is the air's velocity. Returns whether all turns are `small`. If not, they are wrong:
    their tangents are `across` over `along`.
    """
    large = 0
    for m in range(len(moved)):
        for i in range(moved.shape[1]):
            air = drift[min(m, len(drift) - 1), min(i, drift.shape[1] - 1)]
            _blow(moved[m, i], air, time, x[m, i], y[m, i])
            if m > 0:
                k, places = m - 1, (x[m - 1, i], y[m - 1, i], x[m, i], y[m, i])
                large += _turn(*places, small, across[k, i], along[k, i], turns[k, i])
    return large == 0


@inner
def _blow(moved: Array, air: Array, time: float, x: Array, y: Array) -> None:
    for lane in range(len(x)):
        x[lane] = moved[0] - time * air[0, lane]
        y[lane] = moved[1] - time * air[1, lane]


@inner
def _turn(
    x: Array,
    y: Array,
    later_x: Array,
    later_y: Array,
    small: float,
    across: Array,
    along: Array,
    turns: Array,
) -> int:
    """Fill in a vehicle's turns by the series; return in how many lanes they are too large."""
    large = 0
    for lane in range(len(x)):
        a = x[lane] * later_y[lane] - y[lane] * later_x[lane]
        b = x[lane] * later_x[lane] + y[lane] * later_y[lane]
        across[lane], along[lane] = a, b
        large += 0 if abs(a) < small * b else 1
        slope = a / b
        square = slope * slope
        rest = 1 / 3 - square * (1 / 5 - square * (1 / 7 - square / 9))
        turns[lane] = slope * (1.0 - square * rest)
    return large


@lean
def steer(
    turns: Array,
    x: Array,
    y: Array,
    time: float,
    small: float,
    start: Array,
    sums: Array,
    headings: Array,
    speeds: Array,
    steady: Array,
) -> bool:
    """Fill in headings from `start` (n, lanes) on, speeds, and steady turns in rad a sample.

    The turns between displacements and these are as above; `sums` (n, lanes) is scratch. Returns
    whether half of each steady turn is `small`. If not, the speeds are wrong.
    """
    large = 0
    sums[:] = 0.0
    for k in range(len(speeds)):
        for i in range(speeds.shape[1]):
            _even_out(turns[k : k + 4, i], start[i], sums[i], steady[k, i], headings[k, i])
            large += _pace(x[k + 2, i], y[k + 2, i], steady[k, i], time, small, speeds[k, i])
    return large == 0


@inner
def _even_out(turns: Array, start: Array, total: Array, steady: Array, ahead: Array) -> None:
    for lane in range(len(total)):
        turn = 5.0 * (turns[1, lane] + turns[2, lane])
        turn = 0.125 * (turn - turns[0, lane] - turns[3, lane])
        total[lane] += turn
        steady[lane], ahead[lane] = turn, total[lane] + start[lane]


@inner
def _pace(x: Array, y: Array, turns: Array, time: float, small: float, speeds: Array) -> int:
    """Fill in a vehicle's speeds by the series; return in how many lanes it turns too much."""
    large = 0
    for lane in range(len(x)):
        square = 0.25 * turns[lane] * turns[lane]
        chord = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
        speeds[lane] = math.sqrt(x[lane] * x[lane] + y[lane] * y[lane]) / (time * chord)
        large += 0 if square <= small * small else 1
    return large


def compile_motion() -> None:
    """Compile what this module offers, or load it from the disk cache."""
    rows, samples, drift = np.zeros((1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1, 2, 1))
    compile_for(correlate, rows, rows[0])
    compile_for(turn_by_series, samples, drift, 1.0, 1.0, *[samples] * 5)
    compile_for(steer, *[samples] * 3, 1.0, 1.0, rows, rows, *[samples] * 3)
