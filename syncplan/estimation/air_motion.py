"""Heading, airspeed and turn rate of vehicles that keep their circles over ground in moving air.

The air moves by T (wind + gust) in a sample, the vehicle over ground along a chord of its circle,
so through the air it moves by

    a_k = p(t_k) - p(t_k-1) - T (wind + gust_k-1)

where gusts are held over a sample, as the filter has them. A vehicle that turns evenly by
w_k T = psi_k - psi_k-1 flies along a_k if half-way it heads along b_k, the direction of a_k. No
smooth heading does that at each sample exactly: psi_k = 2 b_k - psi_k-1 would, but swings for ever
about what a vehicle does. So the heading is interpolated from the directions around it,

    psi_k = (5 (b_k + b_k+1) - (b_k-1 + b_k+2)) / 8
    v_k = |a_k| / (T s(w_k T / 2)),     s(x) = sin(x) / x

whose weights are those for which half-way it heads off b_k by a sixteenth of the fourth difference
of directions, no more. These sum up to differences of the third order: a filter that knows all
errors and starts right strays by fourth order in T in steady wind, and among gusts by 0.15 v T
times the standard deviation of what a sample's gust turns the direction by. Without wind the
directions turn evenly, and headings are tangents of the circle.

Source: the displacement along an arc, as in `reference_filter`.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.orbits.circles import Orbits, position

SMALL = 0.05
"""rad: up to here, series are exact to rounding."""

AT_ONCE = 64
"""Samples that are taken at once, so that what they need stays in the processor's cache."""


@dataclass(frozen=True, slots=True)
class AirMotion:
    """How vehicles move through the air, trials in lanes.

    Attributes
    ----------
    headings : (steps + 1, n, lanes) rad, continuous
    speeds : (steps, n, lanes) m/s, through the air
    turn_rates : (steps, n, lanes) rad/s
    """

    headings: Array
    speeds: Array
    turn_rates: Array


def motion_in_air(orbits: Orbits, time: float, steps: int, drift: Array) -> AirMotion:
    """Return how vehicles fly their circles for `steps` samples of `time` s.

    `drift` is the air's velocity in m/s, (1 or steps + 1, n or 1, 2, lanes), held from each sample
    to the next.
    """
    moved = np.diff(position(orbits, time * np.arange(-2, steps + 3)), axis=0)
    shape = steps, orbits.count, drift.shape[-1]
    flown = AirMotion(np.empty((steps + 1, *shape[1:])), np.empty(shape), np.empty(shape))
    for begin in range(0, steps, AT_ONCE):
        _fly(flown, moved, time, drift, begin, min(begin + AT_ONCE, steps))
    return flown


def _fly(flown: AirMotion, moved: Array, time: float, drift: Array, begin: int, end: int) -> None:
    """Fill in the samples from begin + 1 to end, from `moved` (steps + 4, n, 2) m over ground.

    moved[k + 1] is the way of sample k; it takes two samples before and after.
    """
    still = len(drift) == 1
    samples = np.arange(begin, end + 4)
    blown = time * (drift if still else drift[np.clip(samples - 2, 0, len(drift) - 1)])
    x = moved[begin : end + 4, :, 0, None] - blown[:, :, 0]
    y = moved[begin : end + 4, :, 1, None] - blown[:, :, 1]
    turns = _turns(x, y)
    steady = flown.turn_rates[begin:end]
    np.add(turns[1:-2], turns[2:-1], out=steady)
    steady *= 5.0
    steady -= turns[:-3]
    steady -= turns[3:]
    steady *= 0.125
    if begin == 0:
        flown.headings[0] = np.arctan2(y[1], x[1])
        flown.headings[0] += 0.125 * (4.0 * turns[1] - turns[2] + turns[0])
    ahead = flown.headings[begin + 1 : end + 1]
    np.cumsum(steady, axis=0, out=ahead)
    ahead += flown.headings[begin]
    x, y = x[2:-2], y[2:-2]
    np.sqrt(x * x + y * y, out=flown.speeds[begin:end])
    flown.speeds[begin:end] /= time * _shortening(steady)
    steady /= time


def _turns(x: Array, y: Array) -> Array:
    """(k - 1, ...) rad, from each way (k, ...) to the next; by its series where all are small."""
    across = x[:-1] * y[1:]
    across -= y[:-1] * x[1:]
    along = x[:-1] * x[1:]
    along += y[:-1] * y[1:]
    if not (along.min() > 0.0 and np.all(np.abs(across) < SMALL * along)):
        return np.asarray(np.arctan2(across, along))
    across /= along
    square = across * across
    return across * (1.0 - square * (1 / 3 - square * (1 / 5 - square * (1 / 7 - square / 9))))


def _shortening(turns: Array) -> Array:
    """Chord over arc, sin(a) / a of half the turns a."""
    square = 0.25 * turns * turns
    if square.max() > SMALL**2:
        return np.asarray(np.sinc(turns / (2.0 * np.pi)))
    return np.asarray(1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)))
