"""A linear filter along trajectories: the covariance at the end, and what a smoother needs.

Along a trajectory the system is linear in small changes m of it:

    m, P from the prior about the trajectory,   nu = z - h(trajectory) - h' m
    S = h' P h + R,   g = P h / S,   m += g nu,   P -= g (P h)'

P is in the frame of `augmented_frame`, where prediction only adds noise. Lanes are as in
`batched_filter`, and of P only the lower triangle is maintained.

Source: Bell (1994), The iterated Kalman smoother as a Gauss-Newton method, SIAM Journal on
Optimization 4.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.augmented_clocks import Read
from syncplan.estimation.augmented_correction import (
    AT_ONCE,
    correct_covariance,
    correct_state,
    take_off,
)
from syncplan.estimation.augmented_frame import GUST, OWN, Frame, bring_to_now, frame_of
from syncplan.estimation.augmented_prediction import (
    LEAST_LEFT,
    add_reading_noise,
    gained,
    grow_older,
    move,
)
from syncplan.estimation.augmented_rows import dot, multiply, refer
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batch_problem import (
    FAR,
    Linearised,
    Prior,
    Trajectory,
    Window,
    add_prior_cost,
    change,
    correct_readings,
    first_sighting,
    innovate,
    misfit,
)
from syncplan.estimation.batched_filter import motion_in
from syncplan.estimation.filter_setup import MotionModel
from syncplan.estimation.lane_filter import Lanes, compiled


@compiled
def linear_pass(
    setup: AugmentedSetup,
    window: Window,
    prior: Prior,
    path: Trajectory,
    found: Linearised,
    lanes: Lanes,
) -> tuple[Array, Array, Array]:
    """Filter along the trajectories, filling in `found`.

    Returns poses (n, 3, lanes), errors (e, lanes) and the lower triangle of the covariance at the
    end, as the last sighting leaves them.
    """
    poses, n, size, width = setup.poses, len(path.poses), len(prior.variances), len(lanes)
    x, errors, P = path.poses.copy(), path.errors.copy(), np.zeros((size, size, width))
    mean, frame = np.empty((size, width)), frame_of(setup, lanes)
    slopes, before = np.empty((12, width)), np.empty((OWN, 3, width))
    speeds, turn_rates = np.empty((n, width)), np.empty((n, width))
    scratch = np.empty((AT_ONCE, size, width)), np.empty((4, width)), np.empty(width)
    found.cost[:], found.linear_cost[:] = 0.0, 0.0
    add_prior_cost(prior, path, found.cost, lanes)
    for k in range(size):
        P[k, k] = prior.variances[k]
        for lane in range(width):
            if k < 3 * n:
                mean[k, lane] = prior.poses[k // 3, k % 3, lane] - x[k // 3, k % 3, lane]
            else:
                mean[k, lane] = prior.errors[k - 3 * n, lane] - errors[k - 3 * n, lane]
    left = 0
    for k in range(len(path.speeds)):
        motion = motion_in(poses, window.begin + k + 1)
        correct_readings(motion, window, path, k, speeds, turn_rates, found.cost, lanes)
        for i in range(n):
            move(x, errors, i, speeds, turn_rates, motion, setup.columns[i], slopes, lanes)
            _add_noise(P, mean, i, k, motion, path, frame, slopes, found.ways[k, i], lanes)
        if grow_older(setup, motion.time, frame) < LEAST_LEFT:
            found.frames[left], found.frame_ages[left], found.frame_lefts[left] = frame
            _carry_mean(mean, n, setup, frame, lanes)
            bring_to_now(P, setup, frame, before, lanes)
            left += 1
            found.ended[k] = 1.0
        found.blown[k], found.lefts[k] = frame[1][1], frame[2]
        change(errors, setup, motion.time, path.changes[k], found.cost, lanes)
        _add_changes(P, mean, setup, motion.time, path.changes[k], frame, lanes)
        read = speeds, turn_rates
        _take_in(x, errors, P, mean, k, setup, window, read, frame, scratch, found, lanes)
    correct_state(x, errors, mean, np.ones(width), setup, frame, lanes)
    bring_to_now(P, setup, frame, before, lanes)
    return x, errors, P


@compiled
def _add_noise(
    P: Array,
    mean: Array,
    i: int,
    k: int,
    motion: MotionModel,
    path: Trajectory,
    frame: Frame,
    slopes: Array,
    way: Array,
    lanes: Lanes,
) -> None:
    """Noise of a sample of vehicle i in P's frame; what is expected of it is none at all."""
    r = 3 * i
    add_reading_noise(P, i, motion, frame, slopes, lanes)
    for c in range(4):
        way[c] = slopes[2 + c]
    for lane in range(len(lanes)):
        v, w = path.speeds[k, i, lane], path.turn_rates[k, i, lane]
        mean[r, lane] -= way[0, lane] * v + way[2, lane] * w
        mean[r + 1, lane] -= way[1, lane] * v + way[3, lane] * w
        mean[r + 2, lane] -= motion.time * w


@compiled
def _add_changes(
    P: Array,
    mean: Array,
    setup: AugmentedSetup,
    time: float,
    gains: Array,
    frame: Frame,
    lanes: Lanes,
) -> None:
    """The same of errors that change, which P's frame takes for larger by 1 / what is left."""
    _, age, left = frame
    first, begin = len(P) - len(left), len(P) - len(gains)
    for k in range(begin - first, len(left)):
        noise, c = gained(setup, k, time) / (left[k] * left[k]), first + k
        for lane in range(len(lanes)):
            P[c, c, lane] += noise
            mean[c, lane] -= gains[c - begin, lane] / left[k]
    for i in range(len(setup.columns)):
        for axis in range(2):
            c, r = setup.columns[i, GUST + axis], 3 * i + axis
            if c >= 0:
                share = left[c - first]
                noise = gained(setup, c - first, time) / (share * share)
                for lane in range(len(lanes)):
                    P[c, r, lane] -= noise * age[1]
                    P[r, r, lane] += noise * age[1] * age[1]
                    mean[r, lane] += gains[c - begin, lane] / share * age[1]


@compiled
def _carry_mean(mean: Array, n: int, setup: AugmentedSetup, frame: Frame, lanes: Lanes) -> None:
    """Bring the mean (3n + e, lanes) from P's frame to the present."""
    x, errors = np.zeros((n, 3, len(lanes))), np.zeros((len(mean) - 3 * n, len(lanes)))
    correct_state(x, errors, mean, np.ones(len(lanes)), setup, frame, lanes)
    for i in range(n):
        for c in range(3):
            mean[3 * i + c] = x[i, c]
    mean[3 * n :] = errors


@compiled
def _take_in(
    x: Array,
    errors: Array,
    P: Array,
    mean: Array,
    k: int,
    setup: AugmentedSetup,
    window: Window,
    read: Read,
    frame: Frame,
    scratch: tuple[Array, Array, Array],
    found: Linearised,
    lanes: Lanes,
) -> None:
    """Correct mean and P by the sightings of a sample; x and errors are the trajectory's."""
    poses, begin = setup.poses, first_sighting(setup, window)
    us, seen, innovation = scratch
    first, last = poses.first[window.begin + k + 1], poses.first[window.begin + k + 2]
    done = first
    for s in range(first, last):
        place = s - begin
        kind = innovate(x, errors, s, begin, setup, window, read, seen, innovation, lanes)
        row = found.columns[place], found.entries[place]
        o, t = poses.observers[s], poses.targets[s]
        count = refer(seen, o, t, kind, setup, frame, row, lanes)
        found.counts[place] = count
        u, gain, pending = us[s - done], found.gains[place], s - done
        multiply(P, row, count, u, lanes)
        for j in range(pending):
            dot(row, count, us[j], seen[1], lanes)
            take_off(found.gains[done - begin + j], seen[1], u, lanes)
        dot(row, count, u, seen[0], lanes)
        dot(row, count, mean, seen[1], lanes)
        _weigh(poses.variances[s], poses.gate, window.temper, seen, innovation, found, place, lanes)
        for i in range(len(P)):
            for lane in range(len(lanes)):
                gain[i, lane] = u[i, lane] * seen[0, lane]
                mean[i, lane] += gain[i, lane] * innovation[lane]
        if pending + 1 == AT_ONCE or s + 1 == last:
            halves = us, found.gains[done - begin : s + 1 - begin]
            correct_covariance(P, pending + 1, halves, lanes)
            done = s + 1


@compiled
def _weigh(
    variance: float,
    gate: float,
    temper: Array,
    seen: Array,
    innovation: Array,
    found: Linearised,
    place: int,
    lanes: Lanes,
) -> None:
    """Turn h' P h in seen[0] into 1 / S, and the innovation into nu; 0 where none counts.

    seen[1] holds h' m.
    """
    for lane in range(len(lanes)):
        read = variance * temper[lane]
        off = innovation[lane]
        square = off * off / read if off == off else 0.0
        cost = misfit(square, gate, temper[lane])
        pulled = gate < np.inf and temper[lane] > 1.0 and square > FAR * FAR
        counted = gate if temper[lane] <= 1.0 else np.inf
        made = 1.0 if off == off and square <= counted else 0.0
        # weighted down so that its pull is that of its cost
        read *= math.sqrt(square) / FAR if pulled else 1.0
        rest = cost - off * off / read if pulled else 0.0
        total = max(seen[0, lane], 0.0) + read
        nu = off - seen[1, lane] if made > 0.0 else 0.0
        seen[0, lane] = made / total
        innovation[lane] = nu
        found.pulls[place, lane] = nu / total
        found.cost[lane] += cost
        found.linear_cost[lane] += nu * nu / total + rest if made > 0.0 else cost
