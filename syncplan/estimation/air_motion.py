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

__all__ = ["AirMotion", "motion_in_air"]


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
    places = position(orbits, time * np.arange(-2, steps + 3))
    moved = np.diff(places, axis=0)[..., None]
    held = np.broadcast_to(drift, (steps + 1, *drift.shape[1:]))
    held = np.concatenate([held[:1], held[:1], held, held[-1:]])
    x = moved[:, :, 0] - time * held[:, :, 0]
    y = moved[:, :, 1] - time * held[:, :, 1]
    along = np.arctan2(y, x)
    turns = np.diff(along, axis=0)
    turns -= 2.0 * np.pi * np.floor((turns + np.pi) / (2.0 * np.pi))
    steady = 5.0 * (turns[1:-2] + turns[2:-1])
    steady -= turns[:-3] + turns[3:]
    steady *= 0.125
    headings = np.empty((steps + 1, *steady.shape[1:]))
    headings[0] = along[1] + 0.125 * (4.0 * turns[1] - turns[2] + turns[0])
    np.cumsum(steady, axis=0, out=headings[1:])
    headings[1:] += headings[0]
    ratio = np.sinc(steady / (2.0 * np.pi))
    return AirMotion(
        headings=headings,
        speeds=np.hypot(x[2:-2], y[2:-2]) / (time * ratio),
        turn_rates=steady / time,
    )
