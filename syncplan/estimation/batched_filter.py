"""The extended Kalman filter of a team: every vehicle's x, y and heading from all bearings.

The state stacks (x, y, heading) of n vehicles, 3n in all. Each sample:

    predict   x += displacement(speed, turn rate readings),   P = F P F' + G Q G'
    update    one bearing after another:  nu = z - (atan2(target - observer) - observer's heading)
              u = P h,  S = h' u + sigma^2,  x += u nu / S,  P -= u u' / S

F is exact in closed form: an error of heading turns the displacement (dx, dy) about its start, so
the column of the heading holds (-dy, dx, 1). A bearing's row h has six non-zeros, three for a
landmark. A bearing whose nu^2 / S exceeds the gate is left out.

`reference_filter.predict` and `reference_filter.update` say this in NumPy for one trial; read
those. Here it is said for numba, many trials at a time. In simulation the vehicles truly follow
their circles, so who sees whom is the same in every trial, and a trial is a *lane*: the last,
contiguous axis of every array. All arithmetic on covariances then runs over lanes in vector
registers. No lane ever looks at another and no sum is reordered, so a trial's figures do not depend
on the lanes beside it, nor on how many there are. Of P only the lower triangle is kept up.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Index

__all__ = [
    "Course",
    "Drive",
    "Readings",
    "Tally",
    "bearing_lanes",
    "compile_kernels",
    "correct_lanes",
    "empty_tally",
    "filter_lanes",
    "kernels_are_compiled",
    "lanes_for",
    "predict_lanes",
]

Work = tuple[Array, Array, Array, Array]
Lanes = NDArray[np.int8] | tuple[int]
Function = TypeVar("Function", bound=Callable[..., Any])

SAMPLE_EVERY = 10
"""NEES and coverage are taken at every tenth step, and at the last."""

WIDE_LANES = 16
"""Trials filtered side by side: four times as fast as one by one for 6 vehicles."""

WIDE_UP_TO = 60
"""Largest team filtered in wide lanes; above they gain nothing and cost sixteenfold memory."""

SMALLEST_PIVOT = 1e-13
"""Share of a variance below which what the other states leave of it is rounding, not variance."""

SMALLEST_SQUARE = 1e-300
"""Least squared distance in m^2: bodies estimated at one place give a row of zeros, not NaN."""

SERIES = (
    *("error_x", "error_y", "error_heading", "position", "heading", "var_position", "var_head"),
    *("square_x", "square_y", "var_x", "var_y"),
)
"""What a tally's series sums over trials: three signed errors, the squared errors of position and
heading, their two variances, and squares and variances of x and y alone."""


class Drive(NamedTuple):
    """How motion readings are integrated, and how far they are trusted.

    Fields
    ------
    time : s, of one sample
    substeps : Euler sub-steps in a sample, 0 for exact arcs
    speed_variance, turn_rate_variance : (m/s)^2, (rad/s)^2, of each reading
    """

    time: float
    substeps: int
    speed_variance: float
    turn_rate_variance: float


class Course(NamedTuple):
    """What all trials of a run share.

    Fields
    ------
    truth : (steps + 1, n, 3) m, m, rad
    landmarks : (m, 2) m
    first : (steps + 2,) bearings of step k are first[k] to first[k + 1]
    observers, targets : (s,) of each bearing; targets from n on are landmarks
    initial_variances : (n, 3) m^2, m^2, rad^2
    bearing_variances : (n,) rad^2, by observer
    drive : the motion model
    gate : largest innovation^2 / variance that counts
    """

    truth: Array
    landmarks: Array
    first: Index
    observers: Index
    targets: Index
    initial_variances: Array
    bearing_variances: Array
    drive: Drive
    gate: float


class Readings(NamedTuple):
    """What the filter is given, a lane for each trial.

    Fields
    ------
    initial : (n, 3, lanes) initial estimate in m, m, rad
    speeds, turn_rates : (steps, n, lanes) m/s, rad/s
    bearings : (s, lanes) rad
    """

    initial: Array
    speeds: Array
    turn_rates: Array
    bearings: Array


class Tally(NamedTuple):
    """What comes out: per lane, except the series, which is summed over lanes.

    Fields
    ------
    squares, late_squares : (n, 3, lanes) sums of squared error over all k >= 1, and over 2k > steps
    final : (n, 3, lanes) error at the last step
    covered : (n, lanes) coordinates within three sigma, over the sampled steps
    nees, nees_samples : (lanes,) sum and number of samples with a positive definite covariance
    nis, accepted, gated : (lanes,) sum and number over accepted innovations, and number left out
    series : (steps + 1, n, 11) as SERIES, or (0, n, 11) when not wanted; added to
    """

    squares: Array
    late_squares: Array
    final: Array
    covered: Array
    nees: Array
    nees_samples: Array
    nis: Array
    accepted: Array
    gated: Array
    series: Array


def empty_tally(n: int, lanes: int, series: Array) -> Tally:
    """Return a tally of zeros for n vehicles that adds to the given `series`."""
    return Tally(
        squares=np.zeros((n, 3, lanes)),
        late_squares=np.zeros((n, 3, lanes)),
        final=np.zeros((n, 3, lanes)),
        covered=np.zeros((n, lanes)),
        nees=np.zeros(lanes),
        nees_samples=np.zeros(lanes),
        nis=np.zeros(lanes),
        accepted=np.zeros(lanes),
        gated=np.zeros(lanes),
        series=series,
    )


def lanes_for(n: int) -> int:
    """Return how many trials of n vehicles are best filtered side by side."""
    return WIDE_LANES if n <= WIDE_UP_TO else 1


def _compiled(function: Function) -> Function:
    """The kernel, kept in numba's disk cache where there is a place to keep it."""
    try:
        jit: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
        compiled: Function = jit(function)
    except RuntimeError:  # neither the package nor the home directory can be written
        jit = numba.njit(nogil=True, error_model="numpy")
        compiled = jit(function)
    return compiled


# In what follows `lanes` is read for its length alone. One lane is passed as the tuple (0,): the
# length of a tuple is known to the compiler, the loop over lanes vanishes and the loop over
# columns vectorises instead. More lanes are passed as an array, and the loop over lanes vectorises.


@_compiled
def _shortening(half_turn: float, substeps: int) -> tuple[float, float]:
    """Ratio s(a) of chord to path and its derivative by a = half_turn; see `reference_filter`."""
    inverse = 1.0 / substeps if substeps else 0.0
    part = half_turn * inverse
    if abs(half_turn) < 2e-4:
        ratio = 1.0 - (half_turn * half_turn - part * part) / 6.0
        return ratio, -(half_turn - part * inverse) / 3.0
    path = substeps * math.sin(part) if substeps else half_turn
    ratio = math.sin(half_turn) / path
    return ratio, (math.cos(half_turn) - ratio * math.cos(part)) / path


@_compiled
def predict_lanes(
    x: Array, P: Array, speeds: Array, turn_rates: Array, drive: Drive, moves: Array, lanes: Lanes
) -> None:
    """Advance x (n, 3, lanes) and P (3n, 3n, lanes) by one sample of readings (n, lanes).

    `moves` (6, lanes) is scratch: the displacement, and its derivatives by speed and turn rate.
    """
    time, substeps = drive.time, drive.substeps
    share = 0.5 * (substeps - 1) / substeps if substeps else 0.5
    for i in range(len(x)):
        for lane in range(len(lanes)):
            speed, turn = speeds[i, lane], turn_rates[i, lane] * time
            ratio, slope = _shortening(0.5 * turn, substeps)
            direction = x[i, 2, lane] + share * turn
            cos, sin = math.cos(direction), math.sin(direction)
            path = speed * time
            moves[0, lane], moves[1, lane] = path * ratio * cos, path * ratio * sin
            moves[2, lane], moves[3, lane] = time * ratio * cos, time * ratio * sin
            along, across = 0.5 * path * time * slope, path * time * share * ratio
            moves[4, lane] = along * cos - across * sin
            moves[5, lane] = along * sin + across * cos
        _turn_covariance(P, 3 * i, moves, lanes)
        _add_motion_noise(P, 3 * i, moves, drive, lanes)
        for lane in range(len(lanes)):
            x[i, 0, lane] += moves[0, lane]
            x[i, 1, lane] += moves[1, lane]
            x[i, 2, lane] += turn_rates[i, lane] * time


@_compiled
def _turn_covariance(P: Array, r: int, moves: Array, lanes: Lanes) -> None:
    """P = F P F' for the vehicle at rows r, r + 1, r + 2; F's heading column is (-dy, dx, 1)."""
    for k in range(r):
        for lane in range(len(lanes)):
            P[r, k, lane] -= moves[1, lane] * P[r + 2, k, lane]
            P[r + 1, k, lane] += moves[0, lane] * P[r + 2, k, lane]
    for lane in range(len(lanes)):
        a, b = -moves[1, lane], moves[0, lane]
        hx, hy, hh = P[r + 2, r, lane], P[r + 2, r + 1, lane], P[r + 2, r + 2, lane]
        P[r, r, lane] += a * (2.0 * hx + a * hh)
        P[r + 1, r, lane] += a * hy + b * (hx + a * hh)
        P[r + 1, r + 1, lane] += b * (2.0 * hy + b * hh)
        P[r + 2, r, lane] = hx + a * hh
        P[r + 2, r + 1, lane] = hy + b * hh
    for k in range(r + 3, len(P)):
        for lane in range(len(lanes)):
            P[k, r, lane] -= moves[1, lane] * P[k, r + 2, lane]
            P[k, r + 1, lane] += moves[0, lane] * P[k, r + 2, lane]


@_compiled
def _add_motion_noise(P: Array, r: int, moves: Array, drive: Drive, lanes: Lanes) -> None:
    """P += G Q G' for the vehicle at row r: moves[2:4] is G by speed, moves[4:6] by turn rate."""
    time, speed_variance = drive.time, drive.speed_variance
    turn_variance = drive.turn_rate_variance
    for lane in range(len(lanes)):
        vx, vy = moves[2, lane], moves[3, lane]
        wx, wy = moves[4, lane], moves[5, lane]
        P[r, r, lane] += speed_variance * vx * vx + turn_variance * wx * wx
        P[r + 1, r, lane] += speed_variance * vx * vy + turn_variance * wx * wy
        P[r + 1, r + 1, lane] += speed_variance * vy * vy + turn_variance * wy * wy
        P[r + 2, r, lane] += turn_variance * wx * time
        P[r + 2, r + 1, lane] += turn_variance * wy * time
        P[r + 2, r + 2, lane] += turn_variance * time * time


@_compiled
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
    """Fill in the innovation (lanes,) and the observer's part (3, lanes) of a bearing's row.

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


@_compiled
def _add_product(
    P: Array, r: int, row: Array, sign: float, width: int, u: Array, lanes: Lanes
) -> None:
    """u += sign * P[:, r : r + width] row, from the lower triangle of P alone."""
    for c in range(width):
        for k in range(r + c):
            for lane in range(len(lanes)):
                u[k, lane] += sign * row[c, lane] * P[r + c, k, lane]
        for k in range(r + c, len(P)):
            for lane in range(len(lanes)):
                u[k, lane] += sign * row[c, lane] * P[k, r + c, lane]


@_compiled
def _subtract_outer(P: Array, factor: Array, u: Array, start: int, lanes: Lanes) -> None:
    """P -= factor u' on the lower triangle, rows and columns from `start` on."""
    for i in range(start, len(P)):
        for j in range(start, i + 1):
            for lane in range(len(lanes)):
                P[i, j, lane] -= factor[i, lane] * u[j, lane]


@_compiled
def correct_lanes(
    x: Array,
    P: Array,
    observer: int,
    target: int,
    variance: float,
    gate: float,
    work: Work,
    tally: Tally,
    lanes: Lanes,
) -> None:
    """Correct x and P by one scalar measurement a lane; count it in the tally.

    `work` is (row (3, lanes), innovation (lanes,), u (3n, lanes), gain (3n, lanes)), of which
    row and innovation are filled in: any measurement of where the target (x, y) lies as seen from
    the observer's pose has a row of this shape. Row and innovation are spent.
    """
    row, innovation, u, gain = work
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
        total = max(spread, 0.0) + variance
        square = innovation[lane] * innovation[lane]
        accepted = 1.0 if square <= gate * total else 0.0
        tally.nis[lane] += accepted * (square / total)
        tally.accepted[lane] += accepted
        tally.gated[lane] += 1.0 - accepted
        row[0, lane] = accepted / total
    for k in range(3 * n):
        for lane in range(len(lanes)):
            gain[k, lane] = u[k, lane] * row[0, lane]
    for i in range(n):
        for c in range(3):
            for lane in range(len(lanes)):
                x[i, c, lane] += gain[3 * i + c, lane] * innovation[lane]
    _subtract_outer(P, gain, u, 0, lanes)


@_compiled
def _add_nees(
    P: Array, error: Array, A: Array, u: Array, factor: Array, tally: Tally, lanes: Lanes
) -> None:
    """Add e' P^-1 e by a square-root-free Cholesky factorisation of a copy of P.

    Lanes whose covariance is not positive definite (to rounding) are left out of sum and count.
    """
    size = len(P)
    total, valid = np.zeros(len(lanes)), np.ones(len(lanes))
    for i in range(size):
        A[i, : i + 1] = P[i, : i + 1]
    for j in range(size):
        for lane in range(len(lanes)):
            if not A[j, j, lane] > SMALLEST_PIVOT * P[j, j, lane]:
                valid[lane] = 0.0
                A[j, j, lane] = np.inf
            total[lane] += error[j, lane] * error[j, lane] / A[j, j, lane]
        for k in range(j + 1, size):
            for lane in range(len(lanes)):
                u[k, lane] = A[k, j, lane]
                factor[k, lane] = A[k, j, lane] / A[j, j, lane]
                error[k, lane] -= factor[k, lane] * error[j, lane]
        _subtract_outer(A, factor, u, j + 1, lanes)
    for lane in range(len(lanes)):
        if valid[lane] > 0.0:
            tally.nees[lane] += total[lane]
            tally.nees_samples[lane] += 1.0


@_compiled
def _tally_errors(
    x: Array, truth: Array, error: Array, squares: Array, late: bool, tally: Tally, lanes: Lanes
) -> None:
    """Fill in the errors (3n, lanes), heading wrapped, and add their squares."""
    for i in range(len(x)):
        for c in range(3):
            for lane in range(len(lanes)):
                e = x[i, c, lane] - truth[i, c]
                if c == 2:
                    e -= 2.0 * math.pi * math.floor((e + math.pi) / (2.0 * math.pi))
                error[3 * i + c, lane] = e
                tally.final[i, c, lane] = e
                squares[i, c, lane] += e * e
                if late:
                    tally.late_squares[i, c, lane] += e * e


@_compiled
def _tally_coverage(P: Array, error: Array, tally: Tally, lanes: Lanes) -> None:
    """Count the coordinates within three of the filter's own sigmas."""
    for k in range(len(P)):
        for lane in range(len(lanes)):
            inside = error[k, lane] * error[k, lane] <= 9.0 * P[k, k, lane]
            tally.covered[k // 3, lane] += 1.0 if inside else 0.0


@_compiled
def _tally_series(P: Array, error: Array, sums: Array, lanes: Lanes) -> None:
    """Add one step's errors and variances, lane after lane, to (n, 11)."""
    for i in range(len(sums)):
        r = 3 * i
        for lane in range(len(lanes)):
            ex, ey, eh = error[r, lane], error[r + 1, lane], error[r + 2, lane]
            sums[i, 0] += ex
            sums[i, 1] += ey
            sums[i, 2] += eh
            sums[i, 3] += ex * ex + ey * ey
            sums[i, 4] += eh * eh
            sums[i, 5] += P[r, r, lane] + P[r + 1, r + 1, lane]
            sums[i, 6] += P[r + 2, r + 2, lane]
            sums[i, 7] += ex * ex
            sums[i, 8] += ey * ey
            sums[i, 9] += P[r, r, lane]
            sums[i, 10] += P[r + 1, r + 1, lane]


@_compiled
def _filter(course: Course, readings: Readings, tally: Tally, lanes: Lanes) -> tuple[Array, Array]:
    n, width = len(course.initial_variances), len(lanes)
    steps = len(course.truth) - 1
    x = readings.initial.copy()
    P, A = np.zeros((3 * n, 3 * n, width)), np.empty((3 * n, 3 * n, width))
    moves, error = np.empty((6, width)), np.empty((3 * n, width))
    u, gain = np.empty((3 * n, width)), np.empty((3 * n, width))
    work = (np.empty((3, width)), np.empty(width), u, gain)
    for k in range(3 * n):
        P[k, k] = course.initial_variances[k // 3, k % 3]
    unwanted = np.zeros((n, 3, width))
    _tally_errors(x, course.truth[0], error, unwanted, False, tally, lanes)
    if len(tally.series):
        _tally_series(P, error, tally.series[0], lanes)
    for step in range(1, steps + 1):
        speeds, turn_rates = readings.speeds[step - 1], readings.turn_rates[step - 1]
        predict_lanes(x, P, speeds, turn_rates, course.drive, moves, lanes)
        for s in range(course.first[step], course.first[step + 1]):
            o, t, z = course.observers[s], course.targets[s], readings.bearings[s]
            bearing_lanes(x, o, t, course.landmarks, z, work[0], work[1], lanes)
            variance = course.bearing_variances[o]
            correct_lanes(x, P, o, t, variance, course.gate, work, tally, lanes)
        late = 2 * step > steps
        _tally_errors(x, course.truth[step], error, tally.squares, late, tally, lanes)
        if len(tally.series):
            _tally_series(P, error, tally.series[step], lanes)
        if step % SAMPLE_EVERY == 0 or step == steps:
            _tally_coverage(P, error, tally, lanes)
            _add_nees(P, error, A, u, gain, tally, lanes)
    return x, P


def filter_lanes(course: Course, readings: Readings, tally: Tally) -> tuple[Array, Array]:
    """Return state (n, 3, lanes) and lower triangle of the covariance (3n, 3n, lanes) at the end.

    Adds to the tally on the way. Any number of lanes will do.
    """
    n, _, width = readings.initial.shape
    filtered: tuple[Array, Array] = _filter(course, readings, tally, _lanes(n, width))
    return filtered


def _lanes(n: int, width: int) -> Lanes:
    return (0,) if width == lanes_for(n) == 1 else np.zeros(width, dtype=np.int8)


def kernels_are_compiled(n: int) -> bool:
    """Return whether the kernels for n vehicles are at hand, in memory or in numba's disk cache.

    Where not, the first run compiles them, which takes some seconds: say so before it starts.
    When numba keeps its cache in another way than known here, the answer is False.
    """
    dispatcher: Any = _filter
    typeof: Any = numba.typeof
    types = tuple(typeof(argument) for argument in _specimen(n))
    if types in dispatcher.overloads:
        return True
    try:
        index = dispatcher._cache._cache_file._load_index()
        return any(tuple(key[0]) == types for key in index)
    except (AttributeError, TypeError, IndexError, OSError):
        return False


def compile_kernels(n: int) -> None:
    """Compile the kernels for n vehicles, or load them from numba's disk cache."""
    _filter(*_specimen(n))


def _specimen(n: int) -> tuple[Any, ...]:
    """Arguments of `_filter` for n vehicles and no step: their types are what is compiled."""
    none = np.zeros(0, dtype=np.int64)
    still = np.zeros((0, n, 1))
    course = Course(
        truth=np.zeros((1, n, 3)),
        landmarks=np.zeros((0, 2)),
        first=np.zeros(2, dtype=np.int64),
        observers=none,
        targets=none,
        initial_variances=np.ones((n, 3)),
        bearing_variances=np.ones(n),
        drive=Drive(time=1.0, substeps=0, speed_variance=0.0, turn_rate_variance=0.0),
        gate=math.inf,
    )
    readings = Readings(np.zeros((n, 3, 1)), still, still, np.zeros((0, 1)))
    return course, readings, empty_tally(n, 1, np.zeros((0, n, len(SERIES)))), _lanes(n, 1)
