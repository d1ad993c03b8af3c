"""Second-order noise of sightings where the state has errors beside the poses.

As in `second_order`; the covariance of the relative position is that of its two rows, in P's frame,
less the corrections of the same sample that P has not had yet.
"""

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_frame import Frame
from syncplan.estimation.augmented_rows import MOST_ENTRIES, refer
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.filter_setup import COMPASS_KIND
from syncplan.estimation.lane_filter import Lanes, compiled
from syncplan.estimation.second_order import second_order_variance


@compiled
def curved_variances(
    kind: int,
    x: Array,
    observer: int,
    target: int,
    P: Array,
    pending: int,
    setup: AugmentedSetup,
    frame: Frame,
    halves: tuple[Array, Array],
    variances: Array,
    lanes: Lanes,
) -> None:
    """Fill in the variance (lanes,) of a sighting's second-order term.

    `halves` are u and gain of the `pending` corrections of this sample.
    """
    variances[:] = 0.0
    if kind == COMPASS_KIND:
        return
    width = len(lanes)
    columns = np.zeros(MOST_ENTRIES, dtype=np.int64)
    east, north = np.zeros((MOST_ENTRIES, width)), np.zeros((MOST_ENTRIES, width))
    slopes = np.zeros((3, width))
    slopes[0] = 1.0
    refer(slopes, observer, target, -1, setup, frame, (columns, east), lanes)
    slopes[0], slopes[1] = 0.0, 1.0
    count = refer(slopes, observer, target, -1, setup, frame, (columns, north), lanes)
    spread = np.zeros((3, width))
    _spread(P, columns, east, north, count, spread, lanes)
    for j in range(pending):
        _take_off(halves[0][j], halves[1][j], columns, east, north, count, spread, lanes)
    n, landmarks = len(x), setup.poses.landmarks
    for lane in range(len(lanes)):
        if target < n:
            dx, dy = x[target, 0, lane], x[target, 1, lane]
        else:
            dx, dy = landmarks[target - n, 0], landmarks[target - n, 1]
        dx -= x[observer, 0, lane]
        dy -= x[observer, 1, lane]
        xx, xy, yy = spread[0, lane], spread[1, lane], spread[2, lane]
        variances[lane] = second_order_variance(kind, dx, dy, xx, xy, yy)


@compiled
def _spread(
    P: Array,
    columns: Index,
    east: Array,
    north: Array,
    count: int,
    spread: Array,
    lanes: Lanes,
) -> None:
    """Fill in east' P east, east' P north and north' P north, (3, lanes)."""
    for p in range(count):
        for q in range(p + 1):
            a, b = max(columns[p], columns[q]), min(columns[p], columns[q])
            share = 1.0 if p == q else 2.0
            for lane in range(len(lanes)):
                entry = P[a, b, lane]
                spread[0, lane] += share * entry * east[p, lane] * east[q, lane]
                mixed = east[p, lane] * north[q, lane] + east[q, lane] * north[p, lane]
                spread[1, lane] += 0.5 * share * entry * mixed
                spread[2, lane] += share * entry * north[p, lane] * north[q, lane]


@compiled
def _take_off(
    u: Array,
    gain: Array,
    columns: Index,
    east: Array,
    north: Array,
    count: int,
    spread: Array,
    lanes: Lanes,
) -> None:
    """Take a correction gain u' off what is spread."""
    for lane in range(len(lanes)):
        ue, un, ge, gn = 0.0, 0.0, 0.0, 0.0
        for p in range(count):
            ue += u[columns[p], lane] * east[p, lane]
            un += u[columns[p], lane] * north[p, lane]
            ge += gain[columns[p], lane] * east[p, lane]
            gn += gain[columns[p], lane] * north[p, lane]
        spread[0, lane] -= ge * ue
        spread[1, lane] -= 0.5 * (ge * un + gn * ue)
        spread[2, lane] -= gn * un
