"""The smoother's adjoint, backward over what a linear filter left: a Gauss-Newton step, exactly.

    lambda = 0, then for each sighting, last first,   lambda += h (nu / S - g' lambda)
    noise of a sample = Q G' lambda,   start = prior + P0 lambda

lambda changes frame where P did, by the transpose: `batch_linearisation`.

Source: Bierman (1973), Fixed interval smoothing with discrete measurements, International Journal
of Control 18 (modified Bryson-Frazier smoother).
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.batch_problem import Linearised, Prior, Trajectory, Window, first_sighting
from syncplan.estimation.filter_setup import DRIFT, FilterSetup
from syncplan.estimation.kernels import Lanes, inner, kernel
from syncplan.estimation.motion_kernels import gained, motion_in


@kernel
def smooth(
    setup: FilterSetup,
    window: Window,
    prior: Prior,
    found: Linearised,
    path: Trajectory,
    lanes: Lanes,
) -> None:
    """Fill in the trajectories that are best if all were linear."""
    size, width = len(prior.variances), len(lanes)
    begin = first_sighting(setup, window)
    adjoint, share = np.zeros((size, width)), np.empty(width)
    left = int(found.ended.sum())
    for k in range(len(path.speeds) - 1, -1, -1):
        motion = motion_in(setup, window.begin + k + 1)
        first = setup.first[window.begin + k + 1] - begin
        last = setup.first[window.begin + k + 2] - begin
        for place in range(last - 1, first - 1, -1):
            _pull(adjoint, place, found, share, lanes)
        if path.changes.shape[1]:
            _smooth_changes(adjoint, k, setup, motion.time, found, path.changes, lanes)
            if found.ended[k] > 0.0:
                left -= 1
                _refer_adjoint(adjoint, setup, found, left, lanes)
        for i in range(path.speeds.shape[1]):
            r, ways = 3 * i, found.ways
            for lane in range(width):
                ax, ay, ah = adjoint[r, lane], adjoint[r + 1, lane], adjoint[r + 2, lane]
                along = ways[k, i, 0, lane] * ax + ways[k, i, 1, lane] * ay
                about = ways[k, i, 2, lane] * ax + ways[k, i, 3, lane] * ay + motion.time * ah
                path.speeds[k, i, lane] = motion.speed_variance * along
                path.turn_rates[k, i, lane] = motion.turn_rate_variance * about
    for k in range(size):
        for lane in range(width):
            path.start[k, lane] = prior.mean[k, lane] + prior.variances[k] * adjoint[k, lane]


@inner
def _pull(adjoint: Array, place: int, found: Linearised, share: Array, lanes: Lanes) -> None:
    """lambda += h (nu / S - g' lambda) by the sighting at a place."""
    columns, entries, gains = found.columns, found.entries, found.gains
    for lane in range(len(lanes)):
        share[lane] = 0.0
    for i in range(len(adjoint)):
        for lane in range(len(lanes)):
            share[lane] += gains[place, i, lane] * adjoint[i, lane]
    for lane in range(len(lanes)):
        share[lane] = found.pulls[place, lane] - share[lane]
    for c in range(found.counts[place]):
        k = columns[place, c]
        for lane in range(len(lanes)):
            adjoint[k, lane] += entries[place, c, lane] * share[lane]


@inner
def _smooth_changes(
    adjoint: Array,
    k: int,
    setup: FilterSetup,
    time: float,
    found: Linearised,
    gains: Array,
    lanes: Lanes,
) -> None:
    """What bias states that change gain in sample k."""
    states = setup.states
    begin, first = states.first_changing, len(adjoint) - found.lefts.shape[1]
    for c in range(begin, len(adjoint)):
        for lane in range(len(lanes)):
            gains[k, c - begin, lane] = adjoint[c, lane]
    for i in range(len(states.first) - 1):
        for m in range(states.first[i], states.first[i + 1]):
            c, r = states.columns[m], 3 * i + states.axes[m, 0]
            if states.acts[m] == DRIFT and c >= begin:
                for lane in range(len(lanes)):
                    gains[k, c - begin, lane] -= found.since[k, m] * adjoint[r, lane]
    for c in range(begin, len(adjoint)):
        variance = gained(setup, c - first, time)
        for lane in range(len(lanes)):
            gain = gains[k, c - begin, lane] / found.lefts[k, c - first]
            gains[k, c - begin, lane] = variance * gain


@inner
def _refer_adjoint(
    adjoint: Array, setup: FilterSetup, found: Linearised, place: int, lanes: Lanes
) -> None:
    """lambda = F' lambda, into the frame that was left at a place."""
    states, ways = setup.states, found.frames
    first = len(adjoint) - found.frame_lefts.shape[1]
    for c in range(states.first_changing, len(adjoint)):
        for lane in range(len(lanes)):
            adjoint[c, lane] *= found.frame_lefts[place, c - first]
    for i in range(len(states.first) - 1):
        # the heading last: what moves it takes the adjoint of the present one
        for m in range(states.first[i + 1] - 1, states.first[i] - 1, -1):
            c = states.columns[m]
            for a in range(states.axes[m, 0], states.axes[m, 1]):
                for lane in range(len(lanes)):
                    adjoint[c, lane] += ways[place, m, a, lane] * adjoint[3 * i + a, lane]
