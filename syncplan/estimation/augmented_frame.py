"""The covariance with further states, brought from an earlier frame to the present.

P = F P F' for the product F of all transitions since: see `augmented_prediction`. Constants do not
move, so only rows and columns of poses change, one vehicle after another; what changes decays.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batched_filter import turn_block
from syncplan.estimation.lane_filter import Lanes, compiled

Frame = tuple[Array, Array, Array]
"""Where P is: (n, 6, lanes) the way of each vehicle since, in m, and its derivatives by turn-rate
bias and by speed scale; (2,) the time since in s, and the way in m that a gust of 1 m/s then has
blown since; and (e,) the share that is left of each further state, 1 of constants."""

WIND, SCALE, TURN, BIAS, GUST, WALK, CLOCK = 0, 2, 3, 4, 5, 7, 8
"""Places in a row of AugmentedSetup.columns; wind and gusts take two each."""

OWN = 9
"""Places of such a row."""


@compiled
def frame_of(setup: AugmentedSetup, lanes: Lanes) -> Frame:
    """Return the frame of the present sample."""
    n, e = len(setup.columns), len(setup.variances)
    return np.zeros((n, 6, len(lanes))), np.zeros(2), np.ones(e)


@compiled
def bring_to_now(
    P: Array, setup: AugmentedSetup, frame: Frame, before: Array, lanes: Lanes
) -> None:
    """Bring P into the frame of the present sample; `before` (OWN, 3, lanes) is scratch."""
    since, age, left = frame
    for i in range(len(since)):
        _carry(P, 3 * i, setup.columns[i], age, since[i], before, lanes)
    begin, first = setup.first_changing, len(P) - len(left)
    for c in range(begin, len(P)):
        decay = left[c - first]
        for k in range(begin):
            for lane in range(len(lanes)):
                P[c, k, lane] *= decay
        for k in range(begin, c + 1):
            both = decay * left[k - first]
            for lane in range(len(lanes)):
                P[c, k, lane] *= both
    since[:] = 0.0
    age[:] = 0.0
    left[:] = 1.0


@compiled
def _carry_column(
    P: Array, r: int, k: int, own: Index, age: Array, since: Array, lanes: Lanes
) -> None:
    """P[r : r + 3, k] = F P[:, k] for the vehicle at row r and a column k of another state."""
    a, b = max(r, k), min(r, k)
    down, right = (1, 0) if k < r else (0, 1)
    for lane in range(len(lanes)):
        turned = P[a + 2 * down, b + 2 * right, lane]
        P[a, b, lane] -= since[1, lane] * turned
        P[a + down, b + right, lane] += since[0, lane] * turned
    if own[SCALE] >= 0:
        _add_rate(P, r, k, own[SCALE], 0.0, since[4:6], lanes)
    if own[TURN] >= 0:
        _add_rate(P, r, k, own[TURN], age[0], since[2:4], lanes)
    if own[WIND] >= 0:
        _add_drift(P, r, k, own[WIND], age[0], lanes)
    if own[GUST] >= 0:
        _add_drift(P, r, k, own[GUST], age[1], lanes)


@compiled
def _add_drift(P: Array, r: int, k: int, begin: int, time: float, lanes: Lanes) -> None:
    """The part of a wind or a gust, in columns `begin` and the next, that has blown for `time`."""
    for axis in range(2):
        a, b, c, d = max(r + axis, k), min(r + axis, k), max(begin + axis, k), min(begin + axis, k)
        for lane in range(len(lanes)):
            P[a, b, lane] += time * P[c, d, lane]


@compiled
def _add_rate(
    P: Array, r: int, k: int, column: int, time: float, moved: Array, lanes: Lanes
) -> None:
    """The part of a scale or a bias that moves by `moved` (2, lanes) and turns by `time`."""
    a, b = max(r, k), min(r, k)
    down, right = (1, 0) if k < r else (0, 1)
    c, d = max(column, k), min(column, k)
    for lane in range(len(lanes)):
        share = P[c, d, lane]
        P[a, b, lane] += moved[0, lane] * share
        P[a + down, b + right, lane] += moved[1, lane] * share
        P[a + 2 * down, b + 2 * right, lane] += time * share


@compiled
def _carry(
    P: Array, r: int, own: Index, age: Array, since: Array, before: Array, lanes: Lanes
) -> None:
    """P = F P F' for the vehicle at rows r, r + 1, r + 2; its errors' columns are `own`.

    With A = F's block of the pose, E that of its errors, C their covariance with the pose before
    and C* after, the pose's own block is (A B + E C) A' + C*' E'.
    """
    for s in range(len(own)):
        if own[s] >= 0:
            for c in range(3):
                before[s, c] = P[own[s], r + c]
    for k in range(r):
        _carry_column(P, r, k, own, age, since, lanes)
    for k in range(r + 3, len(P)):
        _carry_column(P, r, k, own, age, since, lanes)
    turn_block(P, r, since, lanes)
    for s in range(len(own)):
        if own[s] >= 0 and s not in (BIAS, WALK, CLOCK):
            _add_errors_part(P, r, s, own[s], age, since, before[s], lanes)


@compiled
def _add_errors_part(
    P: Array, r: int, s: int, column: int, age: Array, since: Array, old: Array, lanes: Lanes
) -> None:
    """E C A' + C*' E' of the error in a column: `old` (3, lanes) is its covariance before."""
    for lane in range(len(lanes)):
        ex, ey, eh = 0.0, 0.0, 0.0
        if s == SCALE:
            ex, ey = since[4, lane], since[5, lane]
        elif s == TURN:
            ex, ey, eh = since[2, lane], since[3, lane], age[0]
        elif s == WIND:
            ex = age[0]
        elif s == WIND + 1:
            ey = age[0]
        elif s == GUST:
            ex = age[1]
        else:
            ey = age[1]
        hx, hy, hh = old[0, lane], old[1, lane], old[2, lane]
        ax, ay = hx - since[1, lane] * hh, hy + since[0, lane] * hh
        nx, ny, nh = P[column, r, lane], P[column, r + 1, lane], P[column, r + 2, lane]
        P[r, r, lane] += ex * (ax + nx)
        P[r + 1, r, lane] += ey * ax + ex * ny
        P[r + 1, r + 1, lane] += ey * (ay + ny)
        P[r + 2, r, lane] += eh * ax + ex * nh
        P[r + 2, r + 1, lane] += eh * ay + ey * nh
        P[r + 2, r + 2, lane] += eh * (hh + nh)
