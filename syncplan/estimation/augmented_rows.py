"""Rows of sightings in the frame of a covariance with further states.

In P's frame a row h has further entries: with the way (X, Y) since and its derivatives, for the
observer

    heading  h_psi - h_x Y + h_y X      scale  h_x X_s + h_y Y_s     gust  blown h
    bias     h_x X_b + h_y Y_b + h_psi t                             wind  t h
    bearing bias   1, of a bearing                                   bearing walk  what is left
    clock    d reading / dt: `augmented_clocks`

and for the target likewise, with -h_x and -h_y; of a common wind, which moves both alike, nothing
is left. Where these states are columns of P: `augmented_setup`; the frame: `augmented_frame`.
"""

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_frame import BIAS, CLOCK, GUST, SCALE, TURN, WALK, WIND, Frame
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.filter_setup import BEARING_KIND
from syncplan.estimation.lane_filter import Lanes, inner

MOST_ENTRIES = 21
"""Of a row: three of each pose, two of the wind, four of each vehicle's errors, a bearing's bias
and walk, a clock offset; and a multiple of three."""

Sparse = tuple[Index, Array]
"""A row: columns (MOST_ENTRIES,) and entries (MOST_ENTRIES, lanes)."""


@inner
def refer(
    slopes: Array,
    o: int,
    t: int,
    kind: int,
    setup: AugmentedSetup,
    frame: Frame,
    row: Sparse,
    lanes: Lanes,
) -> int:
    """Fill in the row in P's frame; return how many entries it has, a multiple of three.

    `kind` is that of the sighting, -1 of a function of poses that is none. The slopes are by the
    observer's pose and, the fourth, by its clock offset where it has one.
    """
    columns, entries = row
    since, age, left = frame
    count = _refer_vehicle(slopes, o, 1.0, 1.0, setup.columns[o], since[o], age, row, 0, lanes)
    bias, walk = setup.columns[o, BIAS], setup.columns[o, WALK]
    if kind == BEARING_KIND and bias >= 0:
        columns[count], entries[count] = bias, 1.0
        count += 1
    if kind == BEARING_KIND and walk >= 0:
        columns[count], entries[count] = walk, left[walk - 3 * len(since)]
        count += 1
    if kind >= 0 and setup.columns[o, CLOCK] >= 0:
        columns[count], entries[count] = setup.columns[o, CLOCK], slopes[3]
        count += 1
    if t >= len(since) or t == o:
        for axis in range(2):
            if setup.columns[o, WIND + axis] >= 0:
                columns[count] = setup.columns[o, WIND + axis]
                for lane in range(len(lanes)):
                    entries[count, lane] = age[0] * slopes[axis, lane]
                count += 1
    else:
        own = setup.columns[t]
        count = _refer_vehicle(slopes, t, -1.0, 0.0, own, since[t], age, row, count, lanes)
    while count % 3:
        columns[count], entries[count] = 0, 0.0
        count += 1
    return count


@inner
def _refer_vehicle(
    slopes: Array,
    i: int,
    sign: float,
    turns: float,
    own: Index,
    since: Array,
    age: Array,
    row: Sparse,
    count: int,
    lanes: Lanes,
) -> int:
    """Add the entries of one vehicle: its slopes are `sign` and `turns` times those given."""
    columns, entries = row
    columns[count], columns[count + 1], columns[count + 2] = 3 * i, 3 * i + 1, 3 * i + 2
    for lane in range(len(lanes)):
        a, b = sign * slopes[0, lane], sign * slopes[1, lane]
        entries[count, lane], entries[count + 1, lane] = a, b
        about = b * since[0, lane] - a * since[1, lane]
        entries[count + 2, lane] = turns * slopes[2, lane] + about
    count += 3
    if own[SCALE] >= 0:
        columns[count] = own[SCALE]
        for lane in range(len(lanes)):
            way = slopes[0, lane] * since[4, lane] + slopes[1, lane] * since[5, lane]
            entries[count, lane] = sign * way
        count += 1
    if own[TURN] >= 0:
        columns[count] = own[TURN]
        for lane in range(len(lanes)):
            way = slopes[0, lane] * since[2, lane] + slopes[1, lane] * since[3, lane]
            entries[count, lane] = sign * way + turns * slopes[2, lane] * age[0]
        count += 1
    for axis in range(2):
        if own[GUST + axis] >= 0:
            columns[count] = own[GUST + axis]
            for lane in range(len(lanes)):
                entries[count, lane] = sign * age[1] * slopes[axis, lane]
            count += 1
    return count


@inner
def multiply(P: Array, row: Sparse, count: int, u: Array, lanes: Lanes) -> None:
    """u = P h, three entries of h at a time."""
    columns, h = row
    for c in range(0, count, 3):
        p, q, r = columns[c], columns[c + 1], columns[c + 2]
        for k in range(len(P)):
            a0, b0, a1, b1 = max(k, p), min(k, p), max(k, q), min(k, q)
            a2, b2 = max(k, r), min(k, r)
            if c == 0:
                for lane in range(len(lanes)):
                    u[k, lane] = (
                        h[0, lane] * P[a0, b0, lane]
                        + h[1, lane] * P[a1, b1, lane]
                        + h[2, lane] * P[a2, b2, lane]
                    )
            else:
                for lane in range(len(lanes)):
                    u[k, lane] += (
                        h[c, lane] * P[a0, b0, lane]
                        + h[c + 1, lane] * P[a1, b1, lane]
                        + h[c + 2, lane] * P[a2, b2, lane]
                    )


@inner
def dot(row: Sparse, count: int, u: Array, products: Array, lanes: Lanes) -> None:
    """Fill in h . u (lanes,)."""
    columns, h = row
    products[:] = 0.0
    for c in range(0, count, 3):
        p, q, r = columns[c], columns[c + 1], columns[c + 2]
        for lane in range(len(lanes)):
            products[lane] += (
                h[c, lane] * u[p, lane] + h[c + 1, lane] * u[q, lane] + h[c + 2, lane] * u[r, lane]
            )
