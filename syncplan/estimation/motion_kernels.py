"""Prediction of poses from readings and bias states, and the frame of the covariance.

A vehicle that reads speed v and turn rate w moves in a step of T s by

    (displacement((1 + scale) v, w + bias) + T drift,  T (w + bias))

and bias states that are not constant decay. F, the derivative of the state after a step by the
state before it, is the identity except in rows of poses: an error of heading turns the way (dx, dy)
through the air about its start, a speed scale lengthens it, a turn-rate bias bends it, and a drift
adds T. P = F P F' + G Q G'.

P itself stays in the *frame* of an earlier step. The product of all F since is the identity except
for the `ways`, one for each row of States: how far a unit of the state at that step has moved its
vehicle's pose since. In that frame prediction only adds noise, and a sighting's row gains entries
for the states that move its bodies. P is brought to the present only where it is needed. This is
exact, and it saves the most expensive part of a step, carrying P. Where states decay within a few
steps, P is brought along that often. Without bias states it is brought along at each step, since
that costs less than rows with further entries.

Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3, and 11.4 (state augmentation).
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.filter_setup import (
    DRIFT,
    SPEED,
    TURN,
    FilterSetup,
    MotionModel,
    States,
)
from syncplan.estimation.kernels import Lanes, inner, linked, part

LEAST_LEFT = 0.1
"""Share left of a state below which P is brought to the present.

Noise referred to an earlier frame is divided by the square of this share, so rounding grows.
"""

SMALL = 0.03
"""Half a step's turn in rad up to which a chord's length is computed by series."""


class Frame(NamedTuple):
    """The frame of a covariance.

    Fields
    ------
    ways : (m, 3, lanes) how far a unit of the state in each row of States, in the frame, has moved
        its vehicle's pose since; for headings, apart from the heading itself
    left : (e,) share left of each bias state, 1 for constants
    fresh : (1,) whether it is that of the present step, where all ways are zero
    """

    ways: Array
    left: Array
    fresh: Flags


def frame_of(states: States, width: int) -> Frame:
    """Return the frame of the present step."""
    ways, left = np.zeros((len(states.acts), 3, width)), np.ones(len(states.variances))
    return Frame(ways, left, np.ones(1, dtype=np.bool_))


# --- the motion of poses ------------------------------------------------------------------------


@inner
def copy(x: Array, into: Array, lanes: Lanes) -> None:
    """Copy a state (3n + e, lanes)."""
    for k in range(len(x)):
        for lane in range(len(lanes)):
            into[k, lane] = x[k, lane]


@inner
def motion_in(setup: FilterSetup, step: int) -> MotionModel:
    """Return the motion model of a step, 1 to the last, with its length and variances."""
    motion, span = setup.motion, setup.spans[step - 1]
    share = motion.time / span
    return MotionModel(
        span, motion.substeps, motion.speed_variance * share, motion.turn_rate_variance * share
    )


@inner
def shortening(half_turn: float, substeps: int) -> tuple[float, float]:
    """Return the ratio s(a) of chord to path and its derivative by a; see docs/theory.md.

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
def _short_arc(a: float) -> tuple[float, float]:
    """Return sin(a) / a and its derivative by their series, exact to rounding up to SMALL."""
    square = a * a
    ratio = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    return ratio, -a / 3.0 * (1.0 - square / 10.0 * (1.0 - square / 28.0))


@inner
def _sine_and_cosine(angle: float) -> tuple[float, float]:
    """Return sine and cosine without a branch, so that loops over lanes vectorise.

    Takes the remainder by a quarter turn, in three parts, and the polynomials of fdlibm's k_sin and
    k_cos; exact to 2e-16 for angles up to 1e5.
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


@inner
def move(
    x: Array,
    i: int,
    speeds: Array,
    turn_rates: Array,
    motion: MotionModel,
    states: States,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Move vehicle i of x (3n + e, lanes) by readings (n, lanes); fill in the slopes of its way.

    `slopes` (12, lanes) are the way through the air, its derivatives by read speed, by turn rate
    and by speed scale, x and y each, and four intermediate values.
    """
    time, substeps, r = motion.time, motion.substeps, 3 * i
    share = 0.5 * (substeps - 1) / substeps if substeps else 0.5
    begin, end = states.first[i] + 1, states.first[i + 1]
    for lane in range(len(lanes)):
        slopes[8, lane], slopes[9, lane] = 1.0, turn_rates[i, lane]
    for m in range(begin, end):
        if states.acts[m] == SPEED:
            for lane in range(len(lanes)):
                slopes[8, lane] += x[states.columns[m], lane]
        elif states.acts[m] == TURN:
            for lane in range(len(lanes)):
                slopes[9, lane] += x[states.columns[m], lane]
    for lane in range(len(lanes)):
        slopes[9, lane] *= time
        half = 0.5 * slopes[9, lane]
        if substeps or abs(half) > SMALL:
            slopes[10, lane], slopes[11, lane] = shortening(half, substeps)
        else:
            slopes[10, lane], slopes[11, lane] = _short_arc(half)
    for lane in range(len(lanes)):
        grown, turn = slopes[8, lane], slopes[9, lane]
        ratio, slope = slopes[10, lane], slopes[11, lane]
        sin, cos = _sine_and_cosine(x[r + 2, lane] + share * turn)
        read = speeds[i, lane] * time
        path = read * grown
        along, across = 0.5 * path * time * slope, path * time * share * ratio
        slopes[0, lane], slopes[1, lane] = path * ratio * cos, path * ratio * sin
        slopes[2, lane], slopes[3, lane] = grown * time * ratio * cos, grown * time * ratio * sin
        slopes[4, lane], slopes[5, lane] = along * cos - across * sin, along * sin + across * cos
        slopes[6, lane], slopes[7, lane] = read * ratio * cos, read * ratio * sin
        x[r, lane] += path * ratio * cos
        x[r + 1, lane] += path * ratio * sin
        x[r + 2, lane] += turn
    for m in range(begin, end):
        if states.acts[m] == DRIFT:
            for lane in range(len(lanes)):
                x[r + states.axes[m, 0], lane] += time * x[states.columns[m], lane]


@inner
def kept(setup: FilterSetup, k: int, span: float) -> float:
    """Return the share of bias state k that is left after `span` s."""
    time, decay = setup.motion.time, setup.states.decays[k]
    return float(decay if span == time or decay in (0.0, 1.0) else decay ** (span / time))


@inner
def gained(setup: FilterSetup, k: int, span: float) -> float:
    """Return the variance that bias state k gains in `span` s."""
    left = kept(setup, k, span)
    return float(setup.states.variances[k] * (1.0 - left * left))


# --- the covariance -----------------------------------------------------------------------------


@inner
def add_reading_noise(
    P: Array, i: int, motion: MotionModel, states: States, frame: Frame, slopes: Array, lanes: Lanes
) -> None:
    """Extend the ways of vehicle i by its step, and add the noise of its readings to P.

    `slopes` are those of `move`. Those by speed and by turn rate become those in P's frame: there a
    turn rate swings the vehicle about the point where its way began.
    """
    ways, r, heading = frame.ways, 3 * i, states.first[i]
    time, first = motion.time, 3 * (len(states.first) - 1)
    frame.fresh[0] = False
    for m in range(heading + 1, states.first[i + 1]):
        act, column = states.acts[m], states.columns[m]
        if act == DRIFT:
            since = time * frame.left[column - first]
            for lane in range(len(lanes)):
                ways[m, states.axes[m, 0], lane] += since
        elif act == SPEED:
            for lane in range(len(lanes)):
                ways[m, 0, lane] += slopes[6, lane]
                ways[m, 1, lane] += slopes[7, lane]
        elif act == TURN:
            for lane in range(len(lanes)):
                ways[m, 0, lane] += slopes[4, lane] - slopes[1, lane] * ways[m, 2, lane]
                ways[m, 1, lane] += slopes[5, lane] + slopes[0, lane] * ways[m, 2, lane]
                ways[m, 2, lane] += time
    for lane in range(len(lanes)):
        ways[heading, 0, lane] -= slopes[1, lane]
        ways[heading, 1, lane] += slopes[0, lane]
        slopes[4, lane] -= ways[heading, 0, lane] * time
        slopes[5, lane] -= ways[heading, 1, lane] * time
    speed_variance, turn_variance = motion.speed_variance, motion.turn_rate_variance
    for lane in range(len(lanes)):
        vx, vy = slopes[2, lane], slopes[3, lane]
        wx, wy = slopes[4, lane], slopes[5, lane]
        P[r, r, lane] += speed_variance * vx * vx + turn_variance * wx * wx
        P[r + 1, r, lane] += speed_variance * vx * vy + turn_variance * wx * wy
        P[r + 1, r + 1, lane] += speed_variance * vy * vy + turn_variance * wy * wy
        P[r + 2, r, lane] += turn_variance * wx * time
        P[r + 2, r + 1, lane] += turn_variance * wy * time
        P[r + 2, r + 2, lane] += turn_variance * time * time


@linked
def predict(
    x: Array,
    P: Array,
    speeds: Array,
    turn_rates: Array,
    setup: FilterSetup,
    step: int,
    frame: Frame,
    slopes: Array,
    lanes: Lanes,
) -> None:
    """Advance x (3n + e, lanes) by a step's readings (n, lanes); P gains noise in its frame."""
    motion = motion_in(setup, step)
    for i in range(len(speeds)):
        move(x, i, speeds, turn_rates, motion, setup.states, slopes, lanes)
        add_reading_noise(P, i, motion, setup.states, frame, slopes, lanes)
    pass_step(x, P, setup, motion.time, frame, lanes)


@part
def pass_step(
    x: Array, P: Array, setup: FilterSetup, time: float, frame: Frame, lanes: Lanes
) -> None:
    """Let bias states that change decay for `time` s and gain noise."""
    if grow_older(setup, time, frame) < LEAST_LEFT or not len(frame.left):
        bring_to_now(P, setup.states, frame, lanes)
    if setup.states.first_changing < len(P):
        first = len(P) - len(frame.left)
        for c in range(setup.states.first_changing, len(P)):
            decay = kept(setup, c - first, time)
            for lane in range(len(lanes)):
                x[c, lane] *= decay
        add_changes(P, setup, time, frame, lanes)


@inner
def grow_older(setup: FilterSetup, time: float, frame: Frame) -> float:
    """Let the bias states of P's frame decay for `time` s; return the least share left."""
    least, first = 1.0, len(setup.initial_variances) - len(frame.left)
    for k in range(setup.states.first_changing - first, len(frame.left)):
        frame.left[k] *= kept(setup, k, time)
        least = min(least, frame.left[k])
    return least


@inner
def add_changes(P: Array, setup: FilterSetup, time: float, frame: Frame, lanes: Lanes) -> None:
    """Add the noise of bias states that change to P.

    In its frame these are larger by 1 / left. Their displacement of vehicles since, in which
    present noise has no part, is subtracted.
    """
    states, ways, left = setup.states, frame.ways, frame.left
    first = len(P) - len(left)
    for c in range(states.first_changing, len(P)):
        share = left[c - first]
        noise = gained(setup, c - first, time) / (share * share)
        for lane in range(len(lanes)):
            P[c, c, lane] += noise
    for i in range(len(states.first) - 1):
        for m in range(states.first[i], states.first[i + 1]):
            c = states.columns[m]
            if states.acts[m] == DRIFT and c >= states.first_changing:
                r, axis, share = 3 * i + states.axes[m, 0], states.axes[m, 0], left[c - first]
                noise = gained(setup, c - first, time) / (share * share)
                for lane in range(len(lanes)):
                    P[c, r, lane] -= noise * ways[m, axis, lane]
                    P[r, r, lane] += noise * ways[m, axis, lane] * ways[m, axis, lane]


@part
def bring_to_now(P: Array, states: States, frame: Frame, lanes: Lanes) -> None:
    """Bring P into the frame of the present step: P = F P F' for the product F since."""
    for i in range(len(states.first) - 1):
        _carry(P, i, states, frame, lanes)
    begin, first = states.first_changing, len(P) - len(frame.left)
    for c in range(begin, len(P)):
        decay = frame.left[c - first]
        for k in range(c + 1):
            both = decay * frame.left[k - first] if k >= begin else decay
            for lane in range(len(lanes)):
                P[c, k, lane] *= both
    frame.ways[:] = 0.0
    frame.left[:] = 1.0
    frame.fresh[0] = True


@inner
def _carry(P: Array, i: int, states: States, frame: Frame, lanes: Lanes) -> None:
    """Update P = F P F' for the pose of vehicle i, state by state and axis by axis.

    Its heading is the first of these states, before another one moves it.
    """
    ways = frame.ways
    for m in range(states.first[i], states.first[i + 1]):
        c = states.columns[m]
        for a in range(states.axes[m, 0], states.axes[m, 1]):
            r = 3 * i + a
            p, q = max(c, r), min(c, r)
            for lane in range(len(lanes)):
                way = ways[m, a, lane]
                P[r, r, lane] += way * (2.0 * P[p, q, lane] + way * P[c, c, lane])
            for k in range(len(P)):
                if k != r:
                    p, q = max(c, k), min(c, k)
                    e, f = max(r, k), min(r, k)
                    for lane in range(len(lanes)):
                        P[e, f, lane] += ways[m, a, lane] * P[p, q, lane]
