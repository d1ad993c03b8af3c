"""Correction of the state and its covariance by sightings, one after another.

A sighting z of a kind corrects a state x with covariance P:

    nu = z - h(x),   u = P h,   S = h' u + sigma^2,   x += u nu / S,   P -= u u' / S

The row h holds the slopes by the observer's pose, their negative for the target's position, and 1
for a bearing's bias and walk. The gate rejects a sighting by nu^2 / S. A sighting that is NaN is
missed: its lane's state, covariance and statistics stay as they are.

P is in the frame of `motion_kernels`, and so is a row h: with the ways W of a state since, its
entry is h W for the observer and -h W for the target. A common drift moves both alike and drops
out. P is large, and each correction would read all of it. So the halves u of up to AT_ONCE
corrections of a step are kept and subtracted from any part of P that is read, until one sweep
corrects P by all of them. Only the lower triangle of P is maintained.

A vehicle whose clock offset is delta stamps t on a sighting taken at t + delta. By then each
vehicle has moved on from its pose at t, along its arc and with the air. With the observer's slopes
(h_x, h_y, h_psi), the reading changes at the rate

    h_x (v_o - v_t)_x + h_y (v_o - v_t)_y + h_psi w_o

The change of that motion with heading, scale and air is of second order and left out of the row.

Second-order noise accounts for a sighting's curvature. A filter replaces a sighting by its tangent
at the estimate. With the error of the relative position split into a along and b across the line of
sight, at distance rho, the next term is

    -a b / rho^2      of a bearing      variance  (P_aa P_bb + P_ab^2) / rho^4
    b^2 / (2 rho)     of a distance     variance  P_bb^2 / (2 rho^2)

for normal errors (Isserlis). Added to the variance of the sighting, it keeps a filter whose start
is uncertain from believing its first sightings too much. A compass is linear and has no such term.
The mean of the term is left out.

Extension: a further kind of sighting needs a branch of `sight_poses`.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3, and 10.3.2 (second-order extended Kalman filter).
"""

import math
from typing import NamedTuple, cast

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.filter_setup import (
    BEARING_KIND,
    COMPASS_KIND,
    DELAY,
    DISTANCE_KIND,
    DRIFT,
    SHIFT,
    SPEED,
    TURN,
    FilterRun,
    FilterSetup,
    FilterStatistics,
    States,
)
from syncplan.estimation.kernels import Lanes, inner, linked, part
from syncplan.estimation.motion_kernels import Frame

SMALLEST_SQUARE = 1e-300
"""Least squared distance in m^2: bodies estimated at one place give a row of zeros, not NaN."""

NEAREST_SQUARE = 1e-12
"""Least squared distance in m^2 in second-order variances, which keeps them finite."""

NONE = cast(int, np.int64(0))
"""A count of 0 that is not a literal: numba compiles a kernel again for each literal."""

WHOLE, OFF = cast(bool, np.bool_(False)), cast(bool, np.bool_(True))
"""For `correct`: x is a whole state, or the deviation from the state of linearisation."""

AT_ONCE = 2
"""Sightings by which one sweep corrects P; more would cost more than they save."""


class Correction(NamedTuple):
    """Scratch arrays for corrections.

    Fields
    ------
    columns, entries : (most,), (most, lanes) of a row
    slopes : (12, lanes) those of `move`
    seen : (4, lanes) slopes by the observer's pose and by its clock offset
    innovation, curvature : (lanes,)
    halves, gains : (AT_ONCE, 3n + e, lanes) u and u / S of a step's corrections
    axis_columns, axis_entries : (3, most), (3, most, lanes) of a row for each axis of a pose
    counts : (3,) number of entries of these rows
    sums : (7, lanes)
    places, rates : (2, 3, lanes) poses of observer and target, and their rates, at the true time of
        a sighting
    """

    columns: Index
    entries: Array
    slopes: Array
    seen: Array
    innovation: Array
    curvature: Array
    halves: Array
    gains: Array
    axis_columns: Index
    axis_entries: Array
    counts: Index
    sums: Array
    places: Array
    rates: Array


def correction_of(states: States, size: int, width: int) -> Correction:
    """Return scratch for corrections of `size` states in `width` lanes."""
    most = most_entries(states)
    return Correction(
        np.zeros(most, dtype=np.int64),
        np.zeros((most, width)),
        np.empty((12, width)),
        np.empty((4, width)),
        np.empty(width),
        np.empty(width),
        np.empty((AT_ONCE, size, width)),
        np.empty((AT_ONCE, size, width)),
        np.zeros((3, most), dtype=np.int64),
        np.zeros((3, most, width)),
        np.zeros(3, dtype=np.int64),
        np.empty((7, width)),
        np.zeros((2, 3, width)),
        np.zeros((2, 3, width)),
    )


def most_entries(states: States) -> int:
    """Return the most entries of a row, in threes: 3 for each pose, 1 for each row of States."""
    most = int(np.diff(states.first).max())
    return 3 * ((6 + 2 * most + 2) // 3)


# --- sightings ----------------------------------------------------------------------------------


@inner
def _way(
    x: Array, observer: int, target: int, n: int, landmarks: Array, lane: int
) -> tuple[float, float]:
    """Return the relative position of a target, x and y in m; landmarks follow vehicles."""
    o, t = 3 * observer, 3 * target
    if target < n:
        return x[t, lane] - x[o, lane], x[t + 1, lane] - x[o + 1, lane]
    return landmarks[target - n, 0] - x[o, lane], landmarks[target - n, 1] - x[o + 1, lane]


@inner
def sight_poses(
    kind: int,
    x: Array,
    observer: int,
    target: int,
    n: int,
    landmarks: Array,
    read: Array,
    row: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Fill in a sighting's innovation (lanes,) and the observer's part (3, lanes) of its row.

    The target's part is the negative of the first two entries. `kind` is the sighting's place in
    SIGHTING_KINDS, and `read` (lanes,) its reading. x (3n or more, lanes) begins with poses, and
    targets from n on are landmarks. A compass has its own vehicle as target.
    """
    for lane in range(len(lanes)):
        dx, dy = _way(x, observer, target, n, landmarks, lane)
        square, psi = max(dx * dx + dy * dy, SMALLEST_SQUARE), x[3 * observer + 2, lane]
        if kind == BEARING_KIND:
            row[0, lane], row[1, lane], row[2, lane] = dy / square, -dx / square, -1.0
            innovation[lane] = read[lane] - (math.atan2(dy, dx) - psi)
        elif kind == DISTANCE_KIND:
            rho = math.sqrt(square)
            row[0, lane], row[1, lane], row[2, lane] = -dx / rho, -dy / rho, 0.0
            innovation[lane] = read[lane] - rho
        else:
            row[0, lane], row[1, lane], row[2, lane] = 0.0, 0.0, 1.0
            innovation[lane] = read[lane] - psi
    if kind != DISTANCE_KIND:
        _wrap(innovation, lanes)


@inner
def _wrap(angles: Array, lanes: Lanes) -> None:
    """Wrap angles (lanes,) to within half a turn."""
    for lane in range(len(lanes)):
        turns = np.floor((angles[lane] + math.pi) / (2.0 * math.pi))
        angles[lane] -= 2.0 * math.pi * turns


@part
def sight(
    s: int,
    row: int,
    x: Array,
    measured: Array,
    speeds: Array,
    turn_rates: Array,
    setup: FilterSetup,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Fill in slopes and innovation of sighting s of a set-up.

    Its reading is measured[row] (lanes,); `speeds` and `turn_rates` (n, lanes) are the motion
    readings at its time.
    """
    states, n = setup.states, len(speeds)
    kind, o, t = setup.kinds[s], setup.observers[s], setup.targets[s]
    begin, end = states.first[o] + 1, states.first[o + 1]
    clock = states.clocks[o]
    if clock >= 0:
        _sight_later(s, x, measured[row], clock, setup, speeds, turn_rates, work, lanes)
    else:
        read, seen, innovation = measured[row], work.seen, work.innovation
        sight_poses(kind, x, o, t, n, setup.landmarks, read, seen, innovation, lanes)
    for m in range(begin, end):
        if states.acts[m] == SHIFT and states.kinds[m] == kind:
            _expect_shift(x, states.columns[m], kind, work.innovation, lanes)


@inner
def _expect_shift(x: Array, column: int, kind: int, innovation: Array, lanes: Lanes) -> None:
    """Subtract the estimated shift of a sighting, a state, from its innovation."""
    for lane in range(len(lanes)):
        innovation[lane] -= x[column, lane]
    if kind != DISTANCE_KIND:
        _wrap(innovation, lanes)


@linked
def _sight_later(
    s: int,
    x: Array,
    read: Array,
    clock: int,
    setup: FilterSetup,
    speeds: Array,
    turn_rates: Array,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Fill in slopes and innovation of sighting s, whose stamp is off by the state `clock`."""
    kind, o, t = setup.kinds[s], setup.observers[s], setup.targets[s]
    n, rates, seen = len(speeds), work.rates, work.seen
    rates[1] = 0.0
    for place, i in enumerate((o, t)):
        if i < n:
            _go_on(x, i, x[clock], setup.states, speeds, turn_rates, work, place, lanes)
    # these are the only two bodies; landmarks follow
    target = 1 if t < n else 2 + t - n
    own, bodies = NONE, NONE + 2
    poses = work.places.reshape(6, len(lanes))
    landmarks, innovation = setup.landmarks, work.innovation
    sight_poses(kind, poses, own, target, bodies, landmarks, read, seen, innovation, lanes)
    for lane in range(len(lanes)):
        along = seen[0, lane] * (rates[0, 0, lane] - rates[1, 0, lane])
        across = seen[1, lane] * (rates[0, 1, lane] - rates[1, 1, lane])
        seen[3, lane] = along + across + seen[2, lane] * rates[0, 2, lane]


@inner
def _go_on(
    x: Array,
    i: int,
    offsets: Array,
    states: States,
    speeds: Array,
    turn_rates: Array,
    work: Correction,
    place: int,
    lanes: Lanes,
) -> None:
    """Fill in vehicle i's pose `offsets` (lanes,) s later, and its rate of change then."""
    r, pose, rates = 3 * i, work.places[place], work.rates[place]
    for lane in range(len(lanes)):
        # at first these hold the factor on speed, the turn rate and the air's velocity
        pose[0, lane], pose[1, lane], pose[2, lane] = 1.0, turn_rates[i, lane], 0.0
        rates[0, lane], rates[1, lane] = 0.0, 0.0
    for m in range(states.first[i] + 1, states.first[i + 1]):
        act, column = states.acts[m], states.columns[m]
        for lane in range(len(lanes)):
            if act == SPEED:
                pose[0, lane] += x[column, lane]
            elif act == TURN:
                pose[1, lane] += x[column, lane]
            elif act == DRIFT:
                rates[states.axes[m, 0], lane] += x[column, lane]
    for lane in range(len(lanes)):
        speed, turning = pose[0, lane] * speeds[i, lane], pose[1, lane]
        psi, span = x[r + 2, lane], offsets[lane]
        halfway, then = psi + 0.5 * turning * span, psi + turning * span
        air_x, air_y = rates[0, lane], rates[1, lane]
        pose[0, lane] = x[r, lane] + span * (speed * math.cos(halfway) + air_x)
        pose[1, lane] = x[r + 1, lane] + span * (speed * math.sin(halfway) + air_y)
        pose[2, lane] = then
        rates[0, lane] = speed * math.cos(then) + air_x
        rates[1, lane] = speed * math.sin(then) + air_y
        rates[2, lane] = turning


# --- rows in the frame of the covariance --------------------------------------------------------


@part
def refer(s: int, setup: FilterSetup, frame: Frame, work: Correction, lanes: Lanes) -> int:
    """Fill in the row of sighting s in P's frame; return its number of entries, in threes.

    The slopes are those of `sight`.
    """
    states, columns, entries = setup.states, work.columns, work.entries
    kind, o, t = setup.kinds[s], setup.observers[s], setup.targets[s]
    n = len(states.first) - 1
    apart = t >= n or t == o
    count = _refer_vehicle(o, 1.0, apart, states, frame, work, NONE, lanes)
    for m in range(states.first[o] + 1, states.first[o + 1]):
        act, column = states.acts[m], states.columns[m]
        if act == SHIFT and states.kinds[m] == kind:
            columns[count], entries[count] = column, frame.left[column - 3 * n]
            count += 1
        elif act == DELAY:
            columns[count] = column
            for lane in range(len(lanes)):
                entries[count, lane] = work.seen[3, lane]
            count += 1
    if not apart:
        count = _refer_vehicle(t, -1.0, apart, states, frame, work, count, lanes)
    while count % 3:
        columns[count], entries[count] = 0, 0.0
        count += 1
    return count


@inner
def _refer_vehicle(
    i: int,
    sign: float,
    apart: bool,
    states: States,
    frame: Frame,
    work: Correction,
    count: int,
    lanes: Lanes,
) -> int:
    """Append the entries of one vehicle: the observer or, with the sign -1, the target."""
    columns, entries, seen, ways = work.columns, work.entries, work.seen, frame.ways
    heading, turns = states.first[i], 1.0 if sign > 0.0 else 0.0
    columns[count], columns[count + 1], columns[count + 2] = 3 * i, 3 * i + 1, 3 * i + 2
    for lane in range(len(lanes)):
        entries[count, lane] = sign * seen[0, lane]
        entries[count + 1, lane] = sign * seen[1, lane]
        entries[count + 2, lane] = turns * seen[2, lane]
    count += 3
    if frame.fresh[0]:
        return count
    for lane in range(len(lanes)):
        way = seen[0, lane] * ways[heading, 0, lane] + seen[1, lane] * ways[heading, 1, lane]
        entries[count - 1, lane] += sign * way
    for m in range(heading + 1, states.first[i + 1]):
        axis, end = states.axes[m, 0], states.axes[m, 1]
        if axis == end or (states.acts[m] == DRIFT and states.common[m] and not apart):
            continue
        columns[count] = states.columns[m]
        if end - axis == 1:
            for lane in range(len(lanes)):
                entries[count, lane] = sign * seen[axis, lane] * ways[m, axis, lane]
        else:
            for lane in range(len(lanes)):
                way = seen[0, lane] * ways[m, 0, lane] + seen[1, lane] * ways[m, 1, lane]
                about = turns * seen[2, lane] * ways[m, 2, lane]
                entries[count, lane] = sign * way + about
        count += 1
    return count


@inner
def refer_place(
    i: int,
    axis: int,
    sign: float,
    apart: bool,
    states: States,
    frame: Frame,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Append the entries, in P's frame, of an axis of a vehicle's pose to that axis's row."""
    columns, entries, counts = work.axis_columns, work.axis_entries, work.counts
    count = counts[axis]
    columns[axis, count] = 3 * i + axis
    for lane in range(len(lanes)):
        entries[axis, count, lane] = sign
    counts[axis] = count + 1
    if frame.fresh[0]:
        return
    for m in range(states.first[i], states.first[i + 1]):
        if not states.axes[m, 0] <= axis < states.axes[m, 1]:
            continue
        if states.acts[m] == DRIFT and states.common[m] and not apart:
            continue
        columns[axis, counts[axis]] = states.columns[m]
        for lane in range(len(lanes)):
            entries[axis, counts[axis], lane] = sign * frame.ways[m, axis, lane]
        counts[axis] += 1


@inner
def spread(P: Array, a: int, b: int, work: Correction, row: int, lanes: Lanes) -> None:
    """Fill sums[row] (lanes,) with h_a' P h_b of the rows of two axes."""
    columns, h, sums = work.axis_columns, work.axis_entries, work.sums
    for lane in range(len(lanes)):
        sums[row, lane] = 0.0
    for p in range(work.counts[a]):
        for q in range(p + 1 if a == b else work.counts[b]):
            i, j = columns[a, p], columns[b, q]
            i, j = max(i, j), min(i, j)
            share = 2.0 if a == b and q < p else 1.0
            for lane in range(len(lanes)):
                product = share * h[a, p, lane] * h[b, q, lane]
                sums[row, lane] += product * P[i, j, lane]


@inner
def fill_variance(
    k: int, P: Array, states: States, frame: Frame, work: Correction, lanes: Lanes
) -> None:
    """Fill sums[0] (lanes,) with the variance of the present state k, whatever P's frame."""
    axis, poses = k % 3, 3 * (len(states.first) - 1)
    work.counts[axis] = 0
    if k < poses:
        refer_place(k // 3, axis, 1.0, True, states, frame, work, lanes)
    else:
        work.axis_columns[axis, 0], work.counts[axis] = k, 1
        work.axis_entries[axis, 0] = frame.left[k - poses]
    spread(P, axis, axis, work, 0, lanes)


@part
def _curve(
    s: int,
    x: Array,
    P: Array,
    pending: int,
    setup: FilterSetup,
    frame: Frame,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Fill in the curvature: the variance of the second-order term of sighting s.

    `pending` corrections of this step are not in P yet.
    """
    kind, o, t = setup.kinds[s], setup.observers[s], setup.targets[s]
    n, states = len(setup.states.first) - 1, setup.states
    columns, h, sums, apart = work.axis_columns, work.axis_entries, work.sums, t >= n
    for axis in range(2):
        work.counts[axis] = 0
        refer_place(o, axis, -1.0, apart, states, frame, work, lanes)
        if not apart:
            refer_place(t, axis, 1.0, apart, states, frame, work, lanes)
        # padded to threes, as in other rows
        end = work.counts[axis] + 2
        columns[axis, work.counts[axis] : end], h[axis, work.counts[axis] : end] = 0, 0.0
    for row in range(3):
        spread(P, row // 2, (row + 1) // 2, work, row, lanes)
    for j in range(pending):
        for axis in range(2):
            own, entries, count = columns[axis], h[axis], work.counts[axis]
            dot(own, entries, count, work.halves, j, sums, 3 + axis, lanes)
            dot(own, entries, count, work.gains, j, sums, 5 + axis, lanes)
        for lane in range(len(lanes)):
            sums[0, lane] -= sums[5, lane] * sums[3, lane]
            mixed = sums[5, lane] * sums[4, lane] + sums[6, lane] * sums[3, lane]
            sums[1, lane] -= 0.5 * mixed
            sums[2, lane] -= sums[6, lane] * sums[4, lane]
    for lane in range(len(lanes)):
        dx, dy = _way(x, o, t, n, setup.landmarks, lane)
        xx, xy, yy = sums[0, lane], sums[1, lane], sums[2, lane]
        work.curvature[lane] = second_order_variance(kind, dx, dy, xx, xy, yy)


@inner
def second_order_variance(
    kind: int, dx: float, dy: float, xx: float, xy: float, yy: float
) -> float:
    """Return the variance of the second-order term, in the kind's unit squared.

    (dx, dy) is the relative position in m, xx, xy and yy are its covariance in m^2.
    """
    if kind == COMPASS_KIND:
        return 0.0
    square = max(dx * dx + dy * dy, NEAREST_SQUARE)
    if kind == DISTANCE_KIND:
        across = (dy * dy * xx - 2.0 * dx * dy * xy + dx * dx * yy) / square
        return across * across / (2.0 * square)
    mixed = (dx * dy * (yy - xx) + (dx * dx - dy * dy) * xy) / square
    # P_aa P_bb = det P + P_ab^2, whatever the axes
    return max(xx * yy - xy * xy + 2.0 * mixed * mixed, 0.0) / (square * square)


# --- corrections --------------------------------------------------------------------------------


@inner
def multiply(
    P: Array, columns: Index, h: Array, count: int, halves: Array, place: int, lanes: Lanes
) -> None:
    """Fill halves[place] (3n + e, lanes) with u = P h, three entries of h at a time."""
    for c in range(0, count, 3):
        p, q, r = columns[c], columns[c + 1], columns[c + 2]
        for k in range(len(P)):
            a0, b0, a1, b1 = max(k, p), min(k, p), max(k, q), min(k, q)
            a2, b2 = max(k, r), min(k, r)
            if c == 0:
                for lane in range(len(lanes)):
                    halves[place, k, lane] = (
                        h[0, lane] * P[a0, b0, lane]
                        + h[1, lane] * P[a1, b1, lane]
                        + h[2, lane] * P[a2, b2, lane]
                    )
            else:
                for lane in range(len(lanes)):
                    halves[place, k, lane] += (
                        h[c, lane] * P[a0, b0, lane]
                        + h[c + 1, lane] * P[a1, b1, lane]
                        + h[c + 2, lane] * P[a2, b2, lane]
                    )


@inner
def dot(
    columns: Index,
    h: Array,
    count: int,
    halves: Array,
    place: int,
    products: Array,
    row: int,
    lanes: Lanes,
) -> None:
    """Fill products[row] (lanes,) with h . u of the half at index `place`."""
    for lane in range(len(lanes)):
        products[row, lane] = 0.0
    for c in range(0, count, 3):
        p, q, r = columns[c], columns[c + 1], columns[c + 2]
        for lane in range(len(lanes)):
            products[row, lane] += (
                h[c, lane] * halves[place, p, lane]
                + h[c + 1, lane] * halves[place, q, lane]
                + h[c + 2, lane] * halves[place, r, lane]
            )


@inner
def take_off(
    gains: Array, j: int, shares: Array, row: int, halves: Array, place: int, lanes: Lanes
) -> None:
    """Update u -= gain shares by sighting j, whose correction is not in P yet."""
    for k in range(halves.shape[1]):
        for lane in range(len(lanes)):
            halves[place, k, lane] -= gains[j, k, lane] * shares[row, lane]


@part
def half_of(
    s: int,
    P: Array,
    pending: int,
    gains: Array,
    setup: FilterSetup,
    frame: Frame,
    work: Correction,
    lanes: Lanes,
) -> int:
    """Fill in row and half of sighting s, and h' P h in seen[0]; return the row's count.

    The corrections by the `pending` sightings before it, with these gains, are not in P yet.
    """
    columns, h, halves, seen = work.columns, work.entries, work.halves, work.seen
    count = refer(s, setup, frame, work, lanes)
    multiply(P, columns, h, count, halves, pending, lanes)
    for j in range(pending):
        dot(columns, h, count, halves, j, seen, 0, lanes)
        take_off(gains, j, seen, 0, halves, pending, lanes)
    dot(columns, h, count, halves, pending, seen, 0, lanes)
    return count


@inner
def correct_state(
    x: Array,
    gains: Array,
    place: int,
    innovation: Array,
    states: States,
    frame: Frame,
    lanes: Lanes,
) -> None:
    """Update x += F gain innovation; the gain is in P's frame, x (3n + e, lanes) at present."""
    n, ways = len(states.first) - 1, frame.ways
    for k in range(3 * n):
        for lane in range(len(lanes)):
            x[k, lane] += gains[place, k, lane] * innovation[lane]
    for k in range(3 * n, len(x)):
        left = frame.left[k - 3 * n]
        for lane in range(len(lanes)):
            x[k, lane] += left * gains[place, k, lane] * innovation[lane]
    if frame.fresh[0]:
        return
    for i in range(n):
        for m in range(states.first[i], states.first[i + 1]):
            c = states.columns[m]
            for a in range(states.axes[m, 0], states.axes[m, 1]):
                for lane in range(len(lanes)):
                    moved = ways[m, a, lane] * gains[place, c, lane]
                    x[3 * i + a, lane] += moved * innovation[lane]


@inner
def correct_covariance(P: Array, u: Array, g: Array, pending: int, lanes: Lanes) -> None:
    """Update P -= sum of g u' over the one or two pending sightings, on the lower triangle.

    Two rows at a time share what they read of u.
    """
    for i in range(len(P)):
        if i % 2 == 0 and i + 1 < len(P):
            for j in range(i + 1):
                _lessen_both(P[i, j], P[i + 1, j], u, g, i, j, pending, lanes)
        else:
            for j in range(i if i % 2 else 0, i + 1):
                _lessen(P[i, j], u, g, i, j, pending, lanes)


@inner
def _lessen_both(
    p: Array, q: Array, u: Array, g: Array, i: int, j: int, pending: int, lanes: Lanes
) -> None:
    """Correct p and q (lanes,), entries j of the rows i and i + 1."""
    if pending == AT_ONCE:
        for lane in range(len(lanes)):
            first, second = u[0, j, lane], u[1, j, lane]
            p[lane] -= g[0, i, lane] * first + g[1, i, lane] * second
            q[lane] -= g[0, i + 1, lane] * first + g[1, i + 1, lane] * second
    else:
        for lane in range(len(lanes)):
            p[lane] -= g[0, i, lane] * u[0, j, lane]
            q[lane] -= g[0, i + 1, lane] * u[0, j, lane]


@inner
def _lessen(p: Array, u: Array, g: Array, i: int, j: int, pending: int, lanes: Lanes) -> None:
    """Correct p (lanes,), entry j of row i."""
    if pending == AT_ONCE:
        for lane in range(len(lanes)):
            p[lane] -= g[0, i, lane] * u[0, j, lane] + g[1, i, lane] * u[1, j, lane]
    else:
        for lane in range(len(lanes)):
            p[lane] -= g[0, i, lane] * u[0, j, lane]


@linked
def correct(
    x: Array,
    P: Array,
    step: int,
    run: FilterRun,
    about: Array,
    is_off: bool,
    frame: Frame,
    work: Correction,
    lanes: Lanes,
) -> None:
    """Correct state and P by the sightings of a step, one after another, and count them.

    `about` (3n + e, lanes) is the state at which they are linearised. It is x itself or, where
    `is_off`, the state from which x is the deviation.
    """
    setup, readings, statistics = run.setup, run.readings, run.statistics
    seen, innovation, halves, gains = work.seen, work.innovation, work.halves, work.gains
    speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
    first, end = setup.first[step], setup.first[step + 1]
    for s in range(first, end):
        pending = (s - first) % AT_ONCE
        if setup.second_order and setup.kinds[s] != COMPASS_KIND:
            _curve(s, x, P, pending, setup, frame, work, lanes)
        else:
            for lane in range(len(lanes)):
                work.curvature[lane] = 0.0
        sight(s, s, about, readings.sightings, speeds, turn_rates, setup, work, lanes)
        if is_off:
            _expect_off(s, x, setup, work, lanes)
        half_of(s, P, pending, gains, setup, frame, work, lanes)
        _weigh(setup.variances[s], setup.gate, work, statistics, lanes)
        if s < len(statistics.innovations):
            for lane in range(len(lanes)):
                statistics.innovations[s, 0, lane] = innovation[lane]
                statistics.innovations[s, 1, lane] = seen[0, lane]
        for k in range(len(P)):
            for lane in range(len(lanes)):
                gains[pending, k, lane] = halves[pending, k, lane] * seen[0, lane]
        correct_state(x, gains, pending, innovation, setup.states, frame, lanes)
        if pending == AT_ONCE - 1 or s == end - 1:
            correct_covariance(P, halves, gains, pending + 1, lanes)


@inner
def _expect_off(s: int, x: Array, setup: FilterSetup, work: Correction, lanes: Lanes) -> None:
    """Subtract from the innovation the part expected from the deviation x of the state."""
    states, seen, n = setup.states, work.seen, len(setup.states.first) - 1
    kind, o, t = setup.kinds[s], setup.observers[s], setup.targets[s]
    for lane in range(len(lanes)):
        a, b = seen[0, lane], seen[1, lane]
        off = a * x[3 * o, lane] + b * x[3 * o + 1, lane] + seen[2, lane] * x[3 * o + 2, lane]
        if t < n:
            off -= a * x[3 * t, lane] + b * x[3 * t + 1, lane]
        for m in range(states.first[o] + 1, states.first[o + 1]):
            if states.acts[m] == SHIFT and states.kinds[m] == kind:
                off += x[states.columns[m], lane]
            elif states.acts[m] == DELAY:
                off += seen[3, lane] * x[states.columns[m], lane]
        work.innovation[lane] -= off


@inner
def _weigh(
    variance: float, gate: float, work: Correction, statistics: FilterStatistics, lanes: Lanes
) -> None:
    """Replace h' P h in seen[0] by 1 / S; 0 where a sighting is missed or rejected."""
    weight, innovation = work.seen, work.innovation
    for lane in range(len(lanes)):
        total = max(weight[0, lane], 0.0) + (variance + work.curvature[lane])
        made = 0.0 if math.isnan(innovation[lane]) else 1.0
        off = 0.0 if math.isnan(innovation[lane]) else innovation[lane]
        square = off * off
        accepted = made if square <= gate * total else 0.0
        statistics.nis[lane] += accepted * (square / total)
        statistics.accepted[lane] += accepted
        statistics.gated[lane] += made - accepted
        innovation[lane] = off
        weight[0, lane] = accepted / total
