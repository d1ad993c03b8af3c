"""The extended Kalman filter of a team: every vehicle's x, y and heading from sightings.

The state stacks (x, y, heading) of n vehicles, 3n in all. Each sample:

    predict   x += displacement(speed, turn rate readings),   P = F P F' + G Q G'
    update    one sighting after another, such as a bearing:
              nu = z - (atan2(target - observer) - observer's heading)
              u = P h,  S = h' u + sigma^2,  x += u nu / S,  P -= u u' / S

F is exact: an error of heading turns the displacement (dx, dy) about its start, so its column holds
(-dy, dx, 1). h has six non-zeros, three for a landmark. The gate rejects a sighting by nu^2 / S.

`reference_filter` does this in NumPy for one trial and is the one to read; these kernels filter
many trials at a time. All trials share their sightings, so a trial is a *lane*: the last,
contiguous axis of every array, and arithmetic runs over lanes in vector registers. Lanes are
independent and no sum is reordered, so a trial's figures depend neither on the lanes beside it nor
on their number. Of P only the lower triangle is maintained.

Extension: a further kind of sighting needs one function beside `bearing_lanes` and a branch of
`sighting_lanes`. Further states (a wind, a bias) have a filter of their own, `augmented_filter`.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3; NEES and NIS as in `consistency`.
"""

import math

from syncplan.arrays import Array
from syncplan.estimation.filter_setup import (
    BEARING_KIND,
    COMPASS_KIND,
    DISTANCE_KIND,
    FilterSetup,
    MotionModel,
)
from syncplan.estimation.filter_statistics import FilterStatistics
from syncplan.estimation.lane_filter import Lanes, inner
from syncplan.estimation.lane_statistics import subtract_outer

Work = tuple[Array, Array, Array, Array, Array]

SMALLEST_SQUARE = 1e-300
"""Least squared distance in m^2: bodies estimated at one place give a row of zeros, not NaN."""


@inner
def shortening(half_turn: float, substeps: int) -> tuple[float, float]:
    """Return the ratio s(a) of chord to path and its derivative by a; see `reference_filter`.

    a is `half_turn` in rad.
    """
    inverse = 1.0 / substeps if substeps else 0.0
    part = half_turn * inverse
    if abs(half_turn) < 2e-4:
        ratio = 1.0 - (half_turn * half_turn - part * part) / 6.0
        return ratio, -(half_turn - part * inverse) / 3.0
    path = substeps * math.sin(part) if substeps else half_turn
    ratio = math.sin(half_turn) / path
    return ratio, (math.cos(half_turn) - ratio * math.cos(part)) / path


@inner
def motion_in(setup: FilterSetup, step: int) -> MotionModel:
    """Return the motion model of a step, 1 to the last: that of a sample for one as long."""
    motion, span = setup.motion, setup.spans[step - 1]
    share = motion.time / span
    return MotionModel(
        span, motion.substeps, motion.speed_variance * share, motion.turn_rate_variance * share
    )


@inner
def predict_lanes(
    x: Array,
    P: Array,
    speeds: Array,
    turn_rates: Array,
    motion: MotionModel,
    moves: Array,
    lanes: Lanes,
) -> None:
    """Advance x (n, 3, lanes) and P (3n, 3n, lanes) by one sample of readings (n, lanes).

    `moves` (6, lanes) is scratch: the displacement, and its derivatives by speed and turn rate.
    """
    time, substeps = motion.time, motion.substeps
    share = 0.5 * (substeps - 1) / substeps if substeps else 0.5
    for i in range(len(x)):
        for lane in range(len(lanes)):
            speed, turn = speeds[i, lane], turn_rates[i, lane] * time
            ratio, slope = shortening(0.5 * turn, substeps)
            direction = x[i, 2, lane] + share * turn
            cos, sin = math.cos(direction), math.sin(direction)
            path = speed * time
            moves[0, lane], moves[1, lane] = path * ratio * cos, path * ratio * sin
            moves[2, lane], moves[3, lane] = time * ratio * cos, time * ratio * sin
            along, across = 0.5 * path * time * slope, path * time * share * ratio
            moves[4, lane] = along * cos - across * sin
            moves[5, lane] = along * sin + across * cos
        _turn_covariance(P, 3 * i, moves, lanes)
        add_motion_noise(P, 3 * i, moves, motion, lanes)
        for lane in range(len(lanes)):
            x[i, 0, lane] += moves[0, lane]
            x[i, 1, lane] += moves[1, lane]
            x[i, 2, lane] += turn_rates[i, lane] * time


@inner
def _turn_covariance(P: Array, r: int, moves: Array, lanes: Lanes) -> None:
    """P = F P F' for the vehicle at rows r, r + 1, r + 2; F's heading column is (-dy, dx, 1)."""
    for k in range(r):
        for lane in range(len(lanes)):
            P[r, k, lane] -= moves[1, lane] * P[r + 2, k, lane]
            P[r + 1, k, lane] += moves[0, lane] * P[r + 2, k, lane]
    turn_block(P, r, moves, lanes)
    for k in range(r + 3, len(P)):
        for lane in range(len(lanes)):
            P[k, r, lane] -= moves[1, lane] * P[k, r + 2, lane]
            P[k, r + 1, lane] += moves[0, lane] * P[k, r + 2, lane]


@inner
def turn_block(P: Array, r: int, moves: Array, lanes: Lanes) -> None:
    """Turn the block of the pose at row r, whose place is moves[0:2] from where it began."""
    for lane in range(len(lanes)):
        a, b = -moves[1, lane], moves[0, lane]
        hx, hy, hh = P[r + 2, r, lane], P[r + 2, r + 1, lane], P[r + 2, r + 2, lane]
        P[r, r, lane] += a * (2.0 * hx + a * hh)
        P[r + 1, r, lane] += a * hy + b * (hx + a * hh)
        P[r + 1, r + 1, lane] += b * (2.0 * hy + b * hh)
        P[r + 2, r, lane] = hx + a * hh
        P[r + 2, r + 1, lane] = hy + b * hh


@inner
def add_motion_noise(P: Array, r: int, moves: Array, motion: MotionModel, lanes: Lanes) -> None:
    """P += G Q G' for the vehicle at row r: moves[2:4] is G by speed, moves[4:6] by turn rate."""
    time, speed_variance = motion.time, motion.speed_variance
    turn_variance = motion.turn_rate_variance
    for lane in range(len(lanes)):
        vx, vy = moves[2, lane], moves[3, lane]
        wx, wy = moves[4, lane], moves[5, lane]
        P[r, r, lane] += speed_variance * vx * vx + turn_variance * wx * wx
        P[r + 1, r, lane] += speed_variance * vx * vy + turn_variance * wx * wy
        P[r + 1, r + 1, lane] += speed_variance * vy * vy + turn_variance * wy * wy
        P[r + 2, r, lane] += turn_variance * wx * time
        P[r + 2, r + 1, lane] += turn_variance * wy * time
        P[r + 2, r + 2, lane] += turn_variance * time * time


@inner
def bearing_lanes(
    x: Array,
    observer: int,
    target: int,
    landmarks: Array,
    bearings: Array,
    row: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Fill in a bearing's innovation (lanes,) and the observer's part (3, lanes) of its row.

    The target's part is the negative of the first two.
    """
    n = len(x)
    for lane in range(len(lanes)):
        if target < n:
            dx, dy = x[target, 0, lane], x[target, 1, lane]
        else:
            dx, dy = landmarks[target - n, 0], landmarks[target - n, 1]
        dx -= x[observer, 0, lane]
        dy -= x[observer, 1, lane]
        square = max(dx * dx + dy * dy, SMALLEST_SQUARE)
        row[0, lane], row[1, lane], row[2, lane] = dy / square, -dx / square, -1.0
        innovation[lane] = bearings[lane] - (math.atan2(dy, dx) - x[observer, 2, lane])
    for lane in range(len(lanes)):
        turns = math.floor((innovation[lane] + math.pi) / (2.0 * math.pi))
        innovation[lane] -= 2.0 * math.pi * turns


@inner
def distance_lanes(
    x: Array,
    observer: int,
    target: int,
    landmarks: Array,
    distances: Array,
    row: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Fill in a distance's innovation and row, as `bearing_lanes` does a bearing's."""
    n = len(x)
    for lane in range(len(lanes)):
        if target < n:
            dx, dy = x[target, 0, lane], x[target, 1, lane]
        else:
            dx, dy = landmarks[target - n, 0], landmarks[target - n, 1]
        dx -= x[observer, 0, lane]
        dy -= x[observer, 1, lane]
        rho = math.sqrt(max(dx * dx + dy * dy, SMALLEST_SQUARE))
        row[0, lane], row[1, lane], row[2, lane] = -dx / rho, -dy / rho, 0.0
        innovation[lane] = distances[lane] - rho


@inner
def heading_lanes(
    x: Array, observer: int, headings: Array, row: Array, innovation: Array, lanes: Lanes
) -> None:
    """Fill in a compass's innovation and row; it has no target, whose part is zero."""
    for lane in range(len(lanes)):
        row[0, lane], row[1, lane], row[2, lane] = 0.0, 0.0, 1.0
        turn = headings[lane] - x[observer, 2, lane]
        innovation[lane] = turn - 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))


@inner
def sighting_lanes(
    kind: int,
    x: Array,
    observer: int,
    target: int,
    landmarks: Array,
    measured: Array,
    row: Array,
    innovation: Array,
    lanes: Lanes,
) -> None:
    """Fill in innovation and row of a sighting of the kind at this place in SIGHTING_KINDS.

    Shapes are as in `bearing_lanes`. A kind that is not in the table leaves both as they are.
    """
    if kind == BEARING_KIND:
        bearing_lanes(x, observer, target, landmarks, measured, row, innovation, lanes)
    elif kind == DISTANCE_KIND:
        distance_lanes(x, observer, target, landmarks, measured, row, innovation, lanes)
    elif kind == COMPASS_KIND:
        heading_lanes(x, observer, measured, row, innovation, lanes)


@inner
def _add_product(
    P: Array, r: int, row: Array, sign: float, width: int, u: Array, lanes: Lanes
) -> None:
    """u += sign * P[:, r : r + width] row, from the lower triangle of P alone; width is 2 or 3."""
    for k in range(r):
        for lane in range(len(lanes)):
            total = u[k, lane] + sign * row[0, lane] * P[r, k, lane]
            total += sign * row[1, lane] * P[r + 1, k, lane]
            if width == 3:
                total += sign * row[2, lane] * P[r + 2, k, lane]
            u[k, lane] = total
    for k in range(r, r + 3):
        for c in range(width):
            i, j = max(k, r + c), min(k, r + c)
            for lane in range(len(lanes)):
                u[k, lane] += sign * row[c, lane] * P[i, j, lane]
    for k in range(r + 3, len(P)):
        for lane in range(len(lanes)):
            total = u[k, lane] + sign * row[0, lane] * P[k, r, lane]
            total += sign * row[1, lane] * P[k, r + 1, lane]
            if width == 3:
                total += sign * row[2, lane] * P[k, r + 2, lane]
            u[k, lane] = total


@inner
def correct_lanes(
    x: Array,
    P: Array,
    observer: int,
    target: int,
    variance: float,
    gate: float,
    work: Work,
    statistics: FilterStatistics,
    lanes: Lanes,
) -> None:
    """Correct x and P by one scalar measurement a lane; count it in the statistics.

    `work` is (row (3, lanes), innovation (lanes,), u (3n, lanes), gain (3n, lanes), further
    variance (lanes,)) with all but u and gain filled in. Any measurement that depends on the
    target's position relative to the observer's pose has a row of this shape. The row is
    overwritten.
    """
    row, innovation, u, gain, further = work
    n, o, t = len(x), 3 * observer, 3 * target
    u[:] = 0.0
    _add_product(P, o, row, 1.0, 3, u, lanes)
    if target < n:
        _add_product(P, t, row, -1.0, 2, u, lanes)
    for lane in range(len(lanes)):
        a, b = row[0, lane], row[1, lane]
        spread = a * u[o, lane] + b * u[o + 1, lane] + row[2, lane] * u[o + 2, lane]
        if target < n:
            spread -= a * u[t, lane] + b * u[t + 1, lane]
        total = max(spread, 0.0) + (variance + further[lane])
        square = innovation[lane] * innovation[lane]
        accepted = 1.0 if square <= gate * total else 0.0
        statistics.nis[lane] += accepted * (square / total)
        statistics.accepted[lane] += accepted
        statistics.gated[lane] += 1.0 - accepted
        row[0, lane] = accepted / total
    for k in range(3 * n):
        for lane in range(len(lanes)):
            gain[k, lane] = u[k, lane] * row[0, lane]
    for i in range(n):
        for c in range(3):
            for lane in range(len(lanes)):
                x[i, c, lane] += gain[3 * i + c, lane] * innovation[lane]
    subtract_outer(P, gain, u, 0, lanes)
