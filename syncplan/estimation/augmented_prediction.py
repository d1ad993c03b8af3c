"""Prediction with further states: how errors move poses, and the covariance with them.

The kernels are those of `augmented_filter`, whose docstring has the model. F is exact along the
arc. Rows of a vehicle's x and y have the columns

    heading (-dy, dx)    wind, gust T    scale displacement(read speed, w)    bias d(dx, dy) / dw

and its heading has T for the bias; (dx, dy) is the way through the air.

P itself stays in the frame of an earlier sample: errors then, whose product of all F since is in
closed form, (dx, dy) and its derivatives summed up. There prediction only adds noise, and a
sighting's row gains entries for the errors; P is brought to the present where it is asked for.
`augmented_frame`. This is exact, and of all that a sample takes, carrying P was most. Where gusts
or other errors pass within a few samples, P is brought along that often.
"""

import math

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_frame import GUST, SCALE, TURN, WIND, Frame, bring_to_now
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batched_filter import add_motion_noise, motion_in, shortening
from syncplan.estimation.filter_setup import MotionModel
from syncplan.estimation.lane_filter import Lanes, inner

LEAST_LEFT = 0.1
"""Share left of an error below which P is brought to the present.

Noise that is referred to an earlier frame is divided by its square, and rounding grows with it.
"""

SMALL = 0.03
"""rad: half a sample's turn up to which a chord's length is by series."""


@inner
def predict_augmented(
    x: Array,
    errors: Array,
    P: Array,
    speeds: Array,
    turn_rates: Array,
    setup: AugmentedSetup,
    step: int,
    frame: Frame,
    slopes: Array,
    before: Array,
    lanes: Lanes,
) -> None:
    """Advance x (n, 3, lanes) and errors (e, lanes) by a step's readings (n, lanes).

    P stays in its frame, but for the noise. `slopes` (12, lanes) is scratch: the way through the
    air, its derivatives by read speed, turn rate and scale, and what they are made of; `before` is
    that of `bring_to_now`.
    """
    motion = motion_in(setup.poses, step)
    for i in range(len(x)):
        move(x, errors, i, speeds, turn_rates, motion, setup.columns[i], slopes, lanes)
        add_reading_noise(P, i, motion, frame, slopes, lanes)
    pass_sample(P, errors, setup, motion.time, frame, before, lanes)


@inner
def add_reading_noise(
    P: Array, i: int, motion: MotionModel, frame: Frame, slopes: Array, lanes: Lanes
) -> None:
    """Add the noise of vehicle i's readings to P, which stays in its frame.

    `slopes` are those of its way, of which it makes those in P's frame: there a turn rate swings
    the vehicle about where its way began.
    """
    since = frame[0][i]
    _lengthen(since, frame[1][0], slopes, motion.time, lanes)
    for lane in range(len(lanes)):
        slopes[4, lane] += since[1, lane] * motion.time
        slopes[5, lane] -= since[0, lane] * motion.time
    add_motion_noise(P, 3 * i, slopes, motion, lanes)


@inner
def pass_sample(
    P: Array,
    errors: Array,
    setup: AugmentedSetup,
    time: float,
    frame: Frame,
    before: Array,
    lanes: Lanes,
) -> None:
    """Let P's frame grow older by `time` s, and errors that change decay and gain noise."""
    least = grow_older(setup, time, frame)
    if setup.first_changing < len(P):
        if least < LEAST_LEFT:
            bring_to_now(P, setup, frame, before, lanes)
        _change(P, errors, setup, time, frame, lanes)


@inner
def grow_older(setup: AugmentedSetup, time: float, frame: Frame) -> float:
    """Let P's frame grow older by `time` s; return the least share that is left of an error."""
    _, age, left = frame
    gust, first, least = setup.columns[0, GUST], 3 * len(setup.columns), 1.0
    age[0] += time
    if gust >= 0:
        age[1] += time * left[gust - first]
    for k in range(setup.first_changing - first, len(left)):
        left[k] *= kept(setup, k, time)
        least = min(least, left[k])
    return least


@inner
def _lengthen(since: Array, elapsed: float, slopes: Array, time: float, lanes: Lanes) -> None:
    """The way since P's frame, and its derivatives by bias and scale, one sample longer."""
    for lane in range(len(lanes)):
        dx, dy = slopes[0, lane], slopes[1, lane]
        since[0, lane] += dx
        since[1, lane] += dy
        since[2, lane] += slopes[4, lane] - dy * elapsed
        since[3, lane] += slopes[5, lane] + dx * elapsed
        since[4, lane] += slopes[6, lane]
        since[5, lane] += slopes[7, lane]


@inner
def kept(setup: AugmentedSetup, k: int, span: float) -> float:
    """The share that is left of further state k after `span` s."""
    time, decay = setup.poses.motion.time, setup.decays[k]
    return float(decay if span == time or decay in (0.0, 1.0) else decay ** (span / time))


@inner
def gained(setup: AugmentedSetup, k: int, span: float) -> float:
    """The variance that further state k gains in `span` s."""
    left = kept(setup, k, span)
    return float(setup.variances[k] * (1.0 - left * left))


@inner
def _change(
    P: Array, errors: Array, setup: AugmentedSetup, time: float, frame: Frame, lanes: Lanes
) -> None:
    """Let errors decay and gain noise, which P's frame takes for errors larger by 1 / left."""
    _, age, left = frame
    first = len(P) - len(errors)
    for k in range(setup.first_changing - first, len(errors)):
        decay = kept(setup, k, time)
        noise, c = gained(setup, k, time) / (left[k] * left[k]), first + k
        for lane in range(len(lanes)):
            errors[k, lane] *= decay
            P[c, c, lane] += noise
    for i in range(len(setup.columns)):
        for axis in range(2):
            c, r = setup.columns[i, GUST + axis], 3 * i + axis
            if c >= 0:
                noise = gained(setup, c - first, time) / (left[c - first] * left[c - first])
                for lane in range(len(lanes)):
                    P[c, r, lane] -= noise * age[1]
                    P[r, r, lane] += noise * age[1] * age[1]


@inner
def error_of(errors: Array, count: int, column: int, lane: int) -> float:
    """The error in a column of the state; 0 where the column is -1."""
    return errors[column - 3 * count, lane] if column >= 0 else 0.0


@inner
def move(
    x: Array,
    errors: Array,
    i: int,
    speeds: Array,
    turn_rates: Array,
    motion: MotionModel,
    own: Index,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Move vehicle i and fill in the slopes of its way."""
    n, time, substeps = len(x), motion.time, motion.substeps
    share = 0.5 * (substeps - 1) / substeps if substeps else 0.5
    for lane in range(len(lanes)):
        slopes[8, lane] = 1.0 + error_of(errors, n, own[SCALE], lane)
        slopes[9, lane] = (turn_rates[i, lane] + error_of(errors, n, own[TURN], lane)) * time
    for lane in range(len(lanes)):
        half = 0.5 * slopes[9, lane]
        if substeps or abs(half) > SMALL:
            slopes[10, lane], slopes[11, lane] = shortening(half, substeps)
        else:
            slopes[10, lane], slopes[11, lane] = _short_arc(half)
    for lane in range(len(lanes)):
        grown, turn = slopes[8, lane], slopes[9, lane]
        ratio, slope = slopes[10, lane], slopes[11, lane]
        sin, cos = _sine_and_cosine(x[i, 2, lane] + share * turn)
        read = speeds[i, lane] * time
        path = read * grown
        along, across = 0.5 * path * time * slope, path * time * share * ratio
        slopes[0, lane], slopes[1, lane] = path * ratio * cos, path * ratio * sin
        slopes[2, lane], slopes[3, lane] = grown * time * ratio * cos, grown * time * ratio * sin
        slopes[4, lane], slopes[5, lane] = along * cos - across * sin, along * sin + across * cos
        slopes[6, lane], slopes[7, lane] = read * ratio * cos, read * ratio * sin
        x[i, 0, lane] += path * ratio * cos
        x[i, 1, lane] += path * ratio * sin
        x[i, 2, lane] += turn
    for axis in range(2):
        for column in (own[WIND + axis], own[GUST + axis]):
            if column >= 0:
                for lane in range(len(lanes)):
                    x[i, axis, lane] += time * errors[column - 3 * n, lane]


@inner
def _short_arc(a: float) -> tuple[float, float]:
    """sin(a) / a and its derivative by their series, exact to rounding up to SMALL."""
    square = a * a
    ratio = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    return ratio, -a / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))


@inner
def _sine_and_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine without a branch, so that lanes are taken side by side.

    The remainder by a quarter turn, in three parts, and the polynomials of fdlibm's k_sin and
    k_cos: within 2e-16 for angles up to 1e5.
    """
    quarters = np.floor(angle * (2.0 / math.pi) + 0.5)
    r = angle - quarters * 1.57079632673412561417e00
    r -= quarters * 6.07710050630396597660e-11
    r -= quarters * 2.02226624879595063154e-21
    z = r * r
    sin = 2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    )
    sin = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * sin)
    sin = r + r * z * (-1.66666666666666324348e-01 + z * sin)
    cos = -2.75573143513906633035e-07 + z * (
        2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
    )
    cos = 4.16666666666666019037e-02 + z * (
        -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * cos)
    )
    cos = 1.0 - 0.5 * z + z * z * cos
    quadrant = quarters - 4.0 * np.floor(0.25 * quarters)
    odd = quadrant == 1.0 or quadrant == 3.0
    s, c = (cos, sin) if odd else (sin, cos)
    return (-s if quadrant >= 2.0 else s), (-c if quadrant == 1.0 or quadrant == 2.0 else c)
