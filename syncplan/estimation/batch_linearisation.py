"""A linear filter along trajectories: the covariance at the end, and what a smoother needs.

Along a trajectory the system is linear in small changes m of it:

    m, P from the prior about the trajectory,   nu = z - h(trajectory) - h' m
    S = h' P h + R,   g = P h / S,   m += g nu,   P -= g (P h)'

P is in the frame of `motion_kernels`, where prediction only adds noise, and of it only the lower
triangle is maintained.

The smoother's adjoint goes backward over what the filter left; it gives a Gauss-Newton step
exactly.

    lambda = 0, then for each sighting, last first,   lambda += h (nu / S - g' lambda)
    noise of a sample = Q G' lambda,   start = prior + P0 lambda

lambda changes frame where P did, by the transpose.

Source: Bell (1994), The iterated Kalman smoother as a Gauss-Newton method, SIAM Journal on
Optimization 4; Bierman (1973), Fixed interval smoothing with discrete measurements, International
Journal of Control 18 (modified Bryson-Frazier smoother).
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation.batch_problem import (
    FAR,
    Linearised,
    Prior,
    Scratch,
    Trajectory,
    Window,
    add_prior_cost,
    change,
    correct_readings,
    first_sighting,
    misfit,
)
from syncplan.estimation.correction_kernels import (
    AT_ONCE,
    NONE,
    Correction,
    correct_covariance,
    correct_state,
    dot,
    multiply,
    refer,
    sight,
    take_off,
)
from syncplan.estimation.filter_setup import DRIFT, FilterSetup, MotionModel
from syncplan.estimation.kernels import Lanes, inner, lean
from syncplan.estimation.motion_kernels import (
    LEAST_LEFT,
    Frame,
    add_changes,
    add_reading_noise,
    bring_to_now,
    copy,
    gained,
    grow_older,
    motion_in,
    move,
)


@lean
def linear_pass(
    setup: FilterSetup,
    window: Window,
    prior: Prior,
    path: Trajectory,
    found: Linearised,
    frame: Frame,
    scratch: Scratch,
    lanes: Lanes,
) -> None:
    """Filter along the trajectories, filling in `found`.

    State and covariance at the end, as the last sighting leaves them, are those in `scratch`.
    """
    x, P, mean, work = scratch.x, scratch.P, scratch.mean, scratch.work
    speeds, turn_rates, ones = scratch.speeds, scratch.turn_rates, scratch.ones
    copy(path.start, x, lanes)
    for lane in range(len(lanes)):
        found.cost[lane], found.linear_cost[lane] = 0.0, 0.0
    add_prior_cost(prior, path, found.cost, lanes)
    for k in range(len(P)):
        P[k] = 0.0
        for lane in range(len(lanes)):
            P[k, k, lane] = prior.variances[k]
            mean[0, k, lane] = prior.mean[k, lane] - x[k, lane]
    left = NONE
    for k in range(len(path.speeds)):
        motion = motion_in(setup, window.begin + k + 1)
        correct_readings(motion, window, path, k, speeds, turn_rates, found.cost, lanes)
        for i in range(len(speeds)):
            move(x, i, speeds, turn_rates, motion, setup.states, work.slopes, lanes)
            add_reading_noise(P, i, motion, setup.states, frame, work.slopes, lanes)
            _expect_noise(mean, i, k, motion, path, work.slopes, found.ways, lanes)
        if grow_older(setup, motion.time, frame) < LEAST_LEFT:
            _keep_frame(left, frame, found, lanes)
            _carry_mean(mean, scratch.carried, ones, setup, frame, lanes)
            bring_to_now(P, setup.states, frame, lanes)
            left += 1
            found.ended[k] = 1.0
        change(x, setup, motion.time, path.changes, k, found.cost, lanes)
        add_changes(P, setup, motion.time, frame, lanes)
        _expect_changes(mean, k, setup, path.changes, frame, found, lanes)
        _take_in(x, P, mean, k, setup, window, speeds, turn_rates, frame, work, found, lanes)
    correct_state(x, mean, 0, ones, setup.states, frame, lanes)
    bring_to_now(P, setup.states, frame, lanes)


@inner
def _keep_frame(place: int, frame: Frame, found: Linearised, lanes: Lanes) -> None:
    """Keep, at a place, the frame that P leaves."""
    for m in range(len(frame.ways)):
        for c in range(3):
            for lane in range(len(lanes)):
                found.frames[place, m, c, lane] = frame.ways[m, c, lane]
    for k in range(len(frame.left)):
        found.frame_lefts[place, k] = frame.left[k]


@inner
def _expect_noise(
    mean: Array,
    i: int,
    k: int,
    motion: MotionModel,
    path: Trajectory,
    slopes: Array,
    ways: Array,
    lanes: Lanes,
) -> None:
    """Refer the mean to zero noise of sample k of vehicle i, in P's frame."""
    r = 3 * i
    for c in range(4):
        for lane in range(len(lanes)):
            ways[k, i, c, lane] = slopes[2 + c, lane]
    for lane in range(len(lanes)):
        v, w = path.speeds[k, i, lane], path.turn_rates[k, i, lane]
        mean[0, r, lane] -= slopes[2, lane] * v + slopes[4, lane] * w
        mean[0, r + 1, lane] -= slopes[3, lane] * v + slopes[5, lane] * w
        mean[0, r + 2, lane] -= motion.time * w


@inner
def _expect_changes(
    mean: Array,
    k: int,
    setup: FilterSetup,
    gains: Array,
    frame: Frame,
    found: Linearised,
    lanes: Lanes,
) -> None:
    """The same of bias states that change, which P's frame takes for larger by 1 / what is left."""
    states, left = setup.states, frame.left
    begin, first = states.first_changing, mean.shape[1] - len(left)
    for c in range(len(left)):
        found.lefts[k, c] = left[c]
    for c in range(begin, mean.shape[1]):
        for lane in range(len(lanes)):
            mean[0, c, lane] -= gains[k, c - begin, lane] / left[c - first]
    for i in range(len(states.first) - 1):
        for m in range(states.first[i], states.first[i + 1]):
            c, axis = states.columns[m], states.axes[m, 0]
            if states.acts[m] == DRIFT and c >= begin:
                # the same in all lanes
                since = frame.ways[m, axis, 0]
                found.since[k, m] = since
                for lane in range(len(lanes)):
                    gain = gains[k, c - begin, lane] / left[c - first]
                    mean[0, 3 * i + axis, lane] += gain * since


@inner
def _carry_mean(
    mean: Array, now: Array, ones: Array, setup: FilterSetup, frame: Frame, lanes: Lanes
) -> None:
    """Bring the mean (1, 3n + e, lanes) from P's frame to the present; `now` is scratch."""
    for k in range(len(now)):
        for lane in range(len(lanes)):
            now[k, lane] = 0.0
    correct_state(now, mean, 0, ones, setup.states, frame, lanes)
    for k in range(len(now)):
        for lane in range(len(lanes)):
            mean[0, k, lane] = now[k, lane]


@inner
def _take_in(
    x: Array,
    P: Array,
    mean: Array,
    k: int,
    setup: FilterSetup,
    window: Window,
    speeds: Array,
    turn_rates: Array,
    frame: Frame,
    work: Correction,
    found: Linearised,
    lanes: Lanes,
) -> None:
    """Correct mean and P by the sightings of a sample; x is the trajectory's."""
    begin, seen, innovation = first_sighting(setup, window), work.seen, work.innovation
    columns, h, halves = work.columns, work.entries, work.halves
    first, last = setup.first[window.begin + k + 1], setup.first[window.begin + k + 2]
    done = first
    for s in range(first, last):
        place, pending = s - begin, s - done
        sight(s, place, x, window.sightings, speeds, turn_rates, setup, work, lanes)
        count = refer(s, setup, frame, work, lanes)
        found.counts[place] = count
        for c in range(count):
            found.columns[place, c] = columns[c]
            for lane in range(len(lanes)):
                found.entries[place, c, lane] = h[c, lane]
        multiply(P, columns, h, count, halves, pending, lanes)
        for j in range(pending):
            dot(columns, h, count, halves, j, seen, 1, lanes)
            take_off(found.gains, done - begin + j, seen, 1, halves, pending, lanes)
        dot(columns, h, count, halves, pending, seen, 0, lanes)
        dot(columns, h, count, mean, 0, seen, 1, lanes)
        _weigh(setup.variances[s], setup.gate, window.temper, seen, innovation, found, place, lanes)
        for i in range(len(P)):
            for lane in range(len(lanes)):
                found.gains[place, i, lane] = halves[pending, i, lane] * seen[0, lane]
                mean[0, i, lane] += found.gains[place, i, lane] * innovation[lane]
        if pending + 1 == AT_ONCE or s + 1 == last:
            gains = found.gains[done - begin : s + 1 - begin]
            correct_covariance(P, halves, gains, pending + 1, lanes)
            done = s + 1


@inner
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


# --- the smoother's adjoint -----------------------------------------------------------------------


@lean
def smooth(
    setup: FilterSetup,
    window: Window,
    prior: Prior,
    found: Linearised,
    path: Trajectory,
    scratch: Scratch,
    lanes: Lanes,
) -> None:
    """Fill in the trajectories that are best if all were linear."""
    adjoint, width, begin = scratch.adjoint, len(lanes), first_sighting(setup, window)
    adjoint[:] = 0.0
    left = int(found.ended.sum())
    for k in range(len(path.speeds) - 1, -1, -1):
        motion = motion_in(setup, window.begin + k + 1)
        first = setup.first[window.begin + k + 1] - begin
        last = setup.first[window.begin + k + 2] - begin
        for place in range(last - 1, first - 1, -1):
            _pull(adjoint, place, found, scratch.share, lanes)
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
    for k in range(len(adjoint)):
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
    """Fill in the gains of changing bias states in sample k."""
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
