"""Predicted flights: poses that follow from commands over a horizon, and laws for first guesses.

Time goes in steps of h. With commands (v, w), held over a step, and steady air,

    psi_k+1 = psi_k + h w,    p_k+1 = p_k + h (v s(a) e(psi_k + a) + wind),    a = h w / 2

exactly, with s(a) = sin(a) / a. Commands and their changes from step to step stay within limits
under every law. Laws: `track`, as in `reference_tracking` but for whole steps; `intercept`, which
flies at full speed to the first place of the plan that the vehicle can reach in time.

Kernels for a team; arrays begin with the vehicle.
"""

import math
from typing import NamedTuple

from syncplan.arrays import Array
from syncplan.estimation.kernels import inner, kernel
from syncplan.guidance.flight_setup import Circles

SEARCHED = 2
"""Number of horizons searched for a place to intercept the plan at."""

NEAR = 2.0
"""Steps ahead up to which the plan is tracked instead of intercepted."""


class Bounds(NamedTuple):
    """Limits of commands.

    Fields
    ------
    least, most : (n, 2) of speeds in m/s, turn rates in rad/s
    changes : (n, 2) largest change from one step to the next
    """

    least: Array
    most: Array
    changes: Array


class Laws(NamedTuple):
    """Gains of the laws that make first guesses.

    Fields
    ------
    step : s, h
    place, heading : 1/s, gains of the tracking law
    turning : 1/s, gain of the heading while intercepting
    closing : (n,) m/s, largest closing speed
    """

    step: float
    place: float
    heading: float
    turning: float
    closing: Array


class Course(NamedTuple):
    """The plan as flown in the present wind, over a horizon of N steps.

    Fields
    ------
    places : (n, SEARCHED N + 1, 2) m
    headings : (n, N + 1) rad
    feed : (n, N, 2) m/s through the air and rad/s that lead from place to place
    winds : (n, 2) m/s
    """

    places: Array
    headings: Array
    feed: Array
    winds: Array


class Predicted(NamedTuple):
    """Predicted flights.

    Fields
    ------
    commands : (n, N, 2) m/s, rad/s
    poses : (n, N + 1, 3) m, m, rad
    """

    commands: Array
    poses: Array


@inner
def shortened(a: float) -> float:
    """Return sin(a) / a."""
    return 1.0 - a * a / 6.0 if abs(a) < 1e-4 else math.sin(a) / a


@inner
def _wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inner
def keep_within(v: float, w: float, before: Array, i: int, bounds: Bounds) -> tuple[float, float]:
    """Return the command (v, w) of vehicle i within its limits, changed no more than allowed.

    `before` (2,) is the command of the step before, itself within limits.
    """
    least, most, changes = bounds.least[i], bounds.most[i], bounds.changes[i]
    v = min(max(v, before[0] - changes[0], least[0]), before[0] + changes[0], most[0])
    w = min(max(w, before[1] - changes[1], least[1]), before[1] + changes[1], most[1])
    return v, w


@inner
def roll(pose: Array, after: Array, v: float, w: float, step: float, wind: Array) -> None:
    """Fill in the pose (3,) after a step with a command."""
    a = 0.5 * step * w
    way = step * v * shortened(a)
    after[0] = pose[0] + way * math.cos(pose[2] + a) + step * wind[0]
    after[1] = pose[1] + way * math.sin(pose[2] + a) + step * wind[1]
    after[2] = pose[2] + step * w


@kernel
def lay_course(circles: Circles, time: float, step: float, course: Course) -> None:
    """Fill in the course from `time` s on, in steps of `step` s; its winds are given."""
    centers, radii, senses, phases, rate = circles
    places, headings, feed, winds = course
    for i in range(len(radii)):
        turn = senses[i] * rate
        for k in range(places.shape[1]):
            angle = phases[i] + turn * (time + k * step)
            places[i, k, 0] = centers[i, 0] + radii[i] * math.cos(angle)
            places[i, k, 1] = centers[i, 1] + radii[i] * math.sin(angle)
        for k in range(headings.shape[1]):
            angle = phases[i] + turn * (time + k * step)
            east = -turn * radii[i] * math.sin(angle) - winds[i, 0]
            north = turn * radii[i] * math.cos(angle) - winds[i, 1]
            headings[i, k] = math.atan2(north, east)
        for k in range(feed.shape[1]):
            w = _wrapped(headings[i, k + 1] - headings[i, k]) / step
            x = places[i, k + 1, 0] - places[i, k, 0] - step * winds[i, 0]
            y = places[i, k + 1, 1] - places[i, k, 1] - step * winds[i, 1]
            feed[i, k, 0] = math.sqrt(x * x + y * y) / (step * shortened(0.5 * step * w))
            feed[i, k, 1] = w


@inner
def _tracking(i: int, k: int, pose: Array, course: Course, laws: Laws) -> tuple[float, float]:
    """Return the command of the tracking law for a step: (m/s, rad/s), without limits."""
    here, there, wind = course.places[i, k], course.places[i, k + 1], course.winds[i]
    near_x, near_y = laws.place * (here[0] - pose[0]), laws.place * (here[1] - pose[1])
    size = math.sqrt(near_x * near_x + near_y * near_y)
    share = min(1.0, laws.closing[i] / max(size, 1e-12))
    x = (there[0] - here[0]) / laws.step - wind[0] + share * near_x
    y = (there[1] - here[1]) / laws.step - wind[1] + share * near_y
    w = course.feed[i, k, 1]
    a = 0.5 * laws.step * w
    turn = _wrapped(math.atan2(y, x) - a - pose[2])
    speed = math.sqrt(x * x + y * y) / shortened(a)
    return speed * max(math.cos(turn), 0.0), w + laws.heading * turn


@inner
def _intercepting(
    i: int, k: int, pose: Array, course: Course, laws: Laws, fastest: float
) -> tuple[float, float]:
    """Return the command that flies at `fastest` m/s to the first place to meet the plan."""
    wind, steps = course.winds[i], course.places.shape[1] - 1
    for ahead in range(1, steps - k + 1):
        time = ahead * laws.step
        x = course.places[i, k + ahead, 0] - pose[0] - time * wind[0]
        y = course.places[i, k + ahead, 1] - pose[1] - time * wind[1]
        way = math.sqrt(x * x + y * y)
        if way <= time * fastest:
            if ahead <= NEAR:
                break
            turn = _wrapped(math.atan2(y, x) - pose[2])
            return way / time * max(math.cos(turn), 0.0), laws.turning * turn
    return _tracking(i, k, pose, course, laws)


@kernel
def foresee(
    i: int,
    given: int,
    intercept: bool,
    before: Array,
    course: Course,
    laws: Laws,
    bounds: Bounds,
    commands: Array,
    poses: Array,
) -> None:
    """Fill in a flight of vehicle i from poses[0], (N, 2) commands and (N + 1, 3) poses.

    The first `given` commands are taken as they stand, within limits; a law gives the others.
    """
    for k in range(len(commands)):
        v, w = commands[k, 0], commands[k, 1]
        if k >= given and intercept:
            v, w = _intercepting(i, k, poses[k], course, laws, bounds.most[i, 0])
        elif k >= given:
            v, w = _tracking(i, k, poses[k], course, laws)
        v, w = keep_within(v, w, before if k == 0 else commands[k - 1], i, bounds)
        commands[k, 0], commands[k, 1] = v, w
        roll(poses[k], poses[k + 1], v, w, laws.step, course.winds[i])


@inner
def shift(values: Array, steps: float, shifted: Array) -> int:
    """Fill in values (N, d), held over steps, `steps` later; return the number known."""
    whole = math.floor(steps + 1e-9)
    part = max(steps - whole, 0.0)
    last = len(values) - 1
    for k in range(len(values)):
        a, b = min(k + whole, last), min(k + whole + 1, last)
        for d in range(values.shape[1]):
            shifted[k, d] = (1.0 - part) * values[a, d] + part * values[b, d]
    return max(last + 1 - whole, 0)
