"""The smoother's adjoint, backward over what a linear filter left: a Gauss-Newton step, exactly.

    lambda = 0, then for each sighting, last first,   lambda += h (nu / S - g' lambda)
    noise of a sample = Q G' lambda,   start = prior + P0 lambda

lambda changes frame where P did, by the transpose: `batch_linearisation`.

Source: Bierman (1973), Fixed interval smoothing with discrete measurements, International Journal
of Control 18 (modified Bryson-Frazier smoother).
"""

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_frame import GUST, SCALE, TURN, WIND, Frame
from syncplan.estimation.augmented_prediction import gained
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batch_problem import Linearised, Prior, Trajectory, Window, first_sighting
from syncplan.estimation.batched_filter import motion_in
from syncplan.estimation.lane_filter import Lanes, compiled


@compiled
def smooth(
    setup: AugmentedSetup,
    window: Window,
    prior: Prior,
    found: Linearised,
    path: Trajectory,
    lanes: Lanes,
) -> None:
    """Fill in the trajectories that are best if all were linear."""
    poses, size, width = setup.poses, len(prior.variances), len(lanes)
    begin = first_sighting(setup, window)
    adjoint, share = np.zeros((size, width)), np.empty(width)
    left = int(found.ended.sum())
    for k in range(len(path.speeds) - 1, -1, -1):
        motion = motion_in(poses, window.begin + k + 1)
        first = poses.first[window.begin + k + 1] - begin
        last = poses.first[window.begin + k + 2] - begin
        for place in range(last - 1, first - 1, -1):
            _pull(adjoint, place, found, share, lanes)
        if len(path.changes[k]):
            since = found.blown[k], found.lefts[k]
            _smooth_changes(adjoint, setup, motion.time, since, path.changes[k], lanes)
            if found.ended[k] > 0.0:
                left -= 1
                frame = found.frames[left], found.frame_ages[left], found.frame_lefts[left]
                _refer_adjoint(adjoint, setup, frame, lanes)
        for i in range(len(path.poses)):
            r, way = 3 * i, found.ways[k, i]
            for lane in range(width):
                ax, ay, ah = adjoint[r, lane], adjoint[r + 1, lane], adjoint[r + 2, lane]
                along = way[0, lane] * ax + way[1, lane] * ay
                about = way[2, lane] * ax + way[3, lane] * ay + motion.time * ah
                path.speeds[k, i, lane] = motion.speed_variance * along
                path.turn_rates[k, i, lane] = motion.turn_rate_variance * about
    n = len(path.poses)
    for k in range(size):
        for lane in range(width):
            pulled = prior.variances[k] * adjoint[k, lane]
            if k < 3 * n:
                path.poses[k // 3, k % 3, lane] = prior.poses[k // 3, k % 3, lane] + pulled
            else:
                path.errors[k - 3 * n, lane] = prior.errors[k - 3 * n, lane] + pulled


@compiled
def _pull(adjoint: Array, place: int, found: Linearised, share: Array, lanes: Lanes) -> None:
    """lambda += h (nu / S - g' lambda) by the sighting at a place."""
    columns, entries, gain = found.columns[place], found.entries[place], found.gains[place]
    share[:] = 0.0
    for i in range(len(adjoint)):
        for lane in range(len(lanes)):
            share[lane] += gain[i, lane] * adjoint[i, lane]
    for lane in range(len(lanes)):
        share[lane] = found.pulls[place, lane] - share[lane]
    for c in range(found.counts[place]):
        for lane in range(len(lanes)):
            adjoint[columns[c], lane] += entries[c, lane] * share[lane]


@compiled
def _smooth_changes(
    adjoint: Array,
    setup: AugmentedSetup,
    time: float,
    since: tuple[float, Array],
    gains: Array,
    lanes: Lanes,
) -> None:
    """What errors that change gain in a sample; `since` is how far gusts had blown, and lefts."""
    blown, left = since
    first, begin = len(adjoint) - len(left), len(adjoint) - len(gains)
    for c in range(begin, len(adjoint)):
        gains[c - begin] = adjoint[c]
    for i in range(len(setup.columns)):
        for axis in range(2):
            c, r = setup.columns[i, GUST + axis], 3 * i + axis
            if c >= 0:
                for lane in range(len(lanes)):
                    gains[c - begin, lane] -= blown * adjoint[r, lane]
    for c in range(begin, len(adjoint)):
        variance = gained(setup, c - first, time)
        for lane in range(len(lanes)):
            gains[c - begin, lane] = variance * (gains[c - begin, lane] / left[c - first])


@compiled
def _refer_adjoint(adjoint: Array, setup: AugmentedSetup, frame: Frame, lanes: Lanes) -> None:
    """lambda = F' lambda, into the frame that was left."""
    since, age, left = frame
    first = len(adjoint) - len(left)
    for c in range(setup.first_changing, len(adjoint)):
        for lane in range(len(lanes)):
            adjoint[c, lane] *= left[c - first]
    for i in range(len(since)):
        r, own, way = 3 * i, setup.columns[i], since[i]
        for lane in range(len(lanes)):
            ax, ay, ah = adjoint[r, lane], adjoint[r + 1, lane], adjoint[r + 2, lane]
            if own[SCALE] >= 0:
                adjoint[own[SCALE], lane] += way[4, lane] * ax + way[5, lane] * ay
            if own[TURN] >= 0:
                about = way[2, lane] * ax + way[3, lane] * ay + age[0] * ah
                adjoint[own[TURN], lane] += about
            if own[WIND] >= 0:
                adjoint[own[WIND], lane] += age[0] * ax
                adjoint[own[WIND + 1], lane] += age[0] * ay
            if own[GUST] >= 0:
                adjoint[own[GUST], lane] += age[1] * ax
                adjoint[own[GUST + 1], lane] += age[1] * ay
            adjoint[r + 2, lane] = ah - way[1, lane] * ax + way[0, lane] * ay
