"""A linear filter along trajectories: the covariance at the end, and input for a smoother.

Along a trajectory the system is linear in small changes m of it:

    m, P from the prior about the trajectory,   nu = z - h(trajectory) - h' m
    S = h' P h + R,   g = P h / S,   m += g nu,   P -= g (P h)'

P is in the frame of `motion_kernels`, where prediction only adds noise. Only its lower triangle is
maintained.

The smoother's adjoint runs backward over the filter's results and gives a Gauss-Newton step
exactly.

    lambda = 0, then for each sighting, last first,   lambda += h (nu / S - g' lambda)
    noise of a sample = Q G' lambda,   start = prior + P0 lambda

Where P changed frame, so does lambda, by the transpose.

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
    Problem,
    Trajectory,
    add_prior_cost,
    change,
    correct_readings,
    first_sighting,
    misfit,
)
from syncplan.estimation.correction_kernels import (
    AT_ONCE,
    NONE,
    correct_covariance,
    correct_state,
    dot,
    half_of,
    sight,
)
from syncplan.estimation.filter_setup import DRIFT, MotionModel
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
def linear_pass(problem: Problem, path: Trajectory, lanes: Lanes) -> None:
    """Filter along the trajectories and fill in the problem's `found`.

    The problem's scratch then holds state and covariance at the end, after the last sighting.
    """
    setup, window, found, scratch = problem.setup, problem.window, problem.found, problem.scratch
    x, P, mean, work, frame = scratch.x, scratch.P, scratch.mean, scratch.work, scratch.frame
    speeds, turn_rates, ones = scratch.speeds, scratch.turn_rates, scratch.ones
    copy(path.start, x, lanes)
    for lane in range(len(lanes)):
        found.cost[lane], found.linear_cost[lane] = 0.0, 0.0
    prior = problem.prior
    add_prior_cost(prior, path, found.cost, lanes)
    for k in range(len(P)):
        P[k] = 0.0
        for lane in range(len(lanes)):
            P[k, k, lane] = prior.variances[k]
            mean[0, k, lane] = prior.mean[k, lane] - x[k, lane]
    left = NONE
    for k in range(len(path.speeds)):
        motion = motion_in(setup, window.begin + k + 1)
        correct_readings(problem, path, k, motion, found.cost, lanes)
        for i in range(len(speeds)):
            move(x, i, speeds, turn_rates, motion, setup.states, work.slopes, lanes)
            add_reading_noise(P, i, motion, setup.states, frame, work.slopes, lanes)
            _expect_noise(problem, path, i, k, motion, lanes)
        if grow_older(setup, motion.time, frame) < LEAST_LEFT:
            _keep_frame(left, frame, found, lanes)
            _carry_mean(problem, lanes)
            bring_to_now(P, setup.states, frame, lanes)
            left += 1
            found.ended[k] = 1.0
        change(x, setup, motion.time, path.changes, k, found.cost, lanes)
        add_changes(P, setup, motion.time, frame, lanes)
        _expect_changes(problem, path.changes, k, lanes)
        _take_in(problem, k, lanes)
    correct_state(x, mean, 0, ones, setup.states, frame, lanes)
    bring_to_now(P, setup.states, frame, lanes)


@inner
def _keep_frame(place: int, frame: Frame, found: Linearised, lanes: Lanes) -> None:
    """Store the frame that P leaves at index `place`."""
    for m in range(len(frame.ways)):
        for c in range(3):
            for lane in range(len(lanes)):
                found.frames[place, m, c, lane] = frame.ways[m, c, lane]
    for k in range(len(frame.left)):
        found.frame_lefts[place, k] = frame.left[k]


@inner
def _expect_noise(
    problem: Problem, path: Trajectory, i: int, k: int, motion: MotionModel, lanes: Lanes
) -> None:
    """Subtract the reading noise of vehicle i in sample k from the mean, in P's frame."""
    r, ways = 3 * i, problem.found.ways
    mean, slopes = problem.scratch.mean, problem.scratch.work.slopes
    for c in range(4):
        for lane in range(len(lanes)):
            ways[k, i, c, lane] = slopes[2 + c, lane]
    for lane in range(len(lanes)):
        v, w = path.speeds[k, i, lane], path.turn_rates[k, i, lane]
        mean[0, r, lane] -= slopes[2, lane] * v + slopes[4, lane] * w
        mean[0, r + 1, lane] -= slopes[3, lane] * v + slopes[5, lane] * w
        mean[0, r + 2, lane] -= motion.time * w


@inner
def _expect_changes(problem: Problem, gains: Array, k: int, lanes: Lanes) -> None:
    """Subtract the gains of changing bias states in sample k from the mean, in P's frame.

    There each gain is larger by 1 / the share left.
    """
    found, mean, frame = problem.found, problem.scratch.mean, problem.scratch.frame
    states, left = problem.setup.states, frame.left
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
def _carry_mean(problem: Problem, lanes: Lanes) -> None:
    """Bring the mean (1, 3n + e, lanes) from P's frame to the present."""
    setup, scratch = problem.setup, problem.scratch
    mean, now, ones, frame = scratch.mean, scratch.carried, scratch.ones, scratch.frame
    for k in range(len(now)):
        for lane in range(len(lanes)):
            now[k, lane] = 0.0
    correct_state(now, mean, 0, ones, setup.states, frame, lanes)
    for k in range(len(now)):
        for lane in range(len(lanes)):
            mean[0, k, lane] = now[k, lane]


@inner
def _take_in(problem: Problem, k: int, lanes: Lanes) -> None:
    """Correct mean and P by the sightings of a sample; x is the trajectory's state."""
    setup, window, found, scratch = problem.setup, problem.window, problem.found, problem.scratch
    x, P, mean, work, frame = scratch.x, scratch.P, scratch.mean, scratch.work, scratch.frame
    speeds, turn_rates, innovation = scratch.speeds, scratch.turn_rates, work.innovation
    begin, seen, columns, h = first_sighting(setup, window), work.seen, work.columns, work.entries
    first, last = setup.first[window.begin + k + 1], setup.first[window.begin + k + 2]
    done = first
    for s in range(first, last):
        place, pending = s - begin, s - done
        sight(s, place, x, window.sightings, speeds, turn_rates, setup, work, lanes)
        gains = found.gains[done - begin :]
        count = half_of(s, P, pending, gains, setup, frame, work, lanes)
        found.counts[place] = count
        for c in range(count):
            found.columns[place, c] = columns[c]
            for lane in range(len(lanes)):
                found.entries[place, c, lane] = h[c, lane]
        dot(columns, h, count, mean, 0, seen, 1, lanes)
        _weigh(problem, s, place, lanes)
        for i in range(len(P)):
            for lane in range(len(lanes)):
                gains[pending, i, lane] = work.halves[pending, i, lane] * seen[0, lane]
                mean[0, i, lane] += gains[pending, i, lane] * innovation[lane]
        if pending + 1 == AT_ONCE or s + 1 == last:
            correct_covariance(P, work.halves, gains, pending + 1, lanes)
            done = s + 1


@inner
def _weigh(problem: Problem, s: int, place: int, lanes: Lanes) -> None:
    """Replace h' P h in seen[0] by 1 / S, and the innovation by nu; 0 for one not counted.

    seen[1] holds h' m.
    """
    gate, temper, found = problem.setup.gate, problem.window.temper, problem.found
    seen, innovation = problem.scratch.work.seen, problem.scratch.work.innovation
    for lane in range(len(lanes)):
        read = problem.setup.variances[s] * temper[lane]
        off = innovation[lane]
        square = off * off / read if off == off else 0.0
        cost = misfit(square, gate, temper[lane])
        pulled = gate < np.inf and temper[lane] > 1.0 and square > FAR * FAR
        counted = gate if temper[lane] <= 1.0 else np.inf
        made = 1.0 if off == off and square <= counted else 0.0
        # weighted down so that its pull matches the slope of its cost
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
def smooth(problem: Problem, lanes: Lanes) -> None:
    """Fill in `best`, the optimal trajectories of the linearised problem."""
    setup, window, prior, found, path, scratch = problem
    adjoint, width, begin = scratch.adjoint, len(lanes), first_sighting(setup, window)
    adjoint[:] = 0.0
    left = int(found.ended.sum())
    for k in range(len(path.speeds) - 1, -1, -1):
        motion = motion_in(setup, window.begin + k + 1)
        first = setup.first[window.begin + k + 1] - begin
        last = setup.first[window.begin + k + 2] - begin
        for place in range(last - 1, first - 1, -1):
            _pull(problem, place, lanes)
        if path.changes.shape[1]:
            _smooth_changes(problem, k, motion.time, lanes)
            if found.ended[k] > 0.0:
                left -= 1
                _refer_adjoint(problem, left, lanes)
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
def _pull(problem: Problem, place: int, lanes: Lanes) -> None:
    """Update lambda += h (nu / S - g' lambda) by the sighting at index `place`."""
    found, adjoint, share = problem.found, problem.scratch.adjoint, problem.scratch.share
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
def _smooth_changes(problem: Problem, k: int, time: float, lanes: Lanes) -> None:
    """Fill in the gains of changing bias states in sample k."""
    setup, found, gains = problem.setup, problem.found, problem.best.changes
    states, adjoint = setup.states, problem.scratch.adjoint
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
def _refer_adjoint(problem: Problem, place: int, lanes: Lanes) -> None:
    """Bring lambda = F' lambda into the frame left at index `place`."""
    found, adjoint = problem.found, problem.scratch.adjoint
    states, ways = problem.setup.states, found.frames
    first = len(adjoint) - found.frame_lefts.shape[1]
    for c in range(states.first_changing, len(adjoint)):
        for lane in range(len(lanes)):
            adjoint[c, lane] *= found.frame_lefts[place, c - first]
    for i in range(len(states.first) - 1):
        # the heading last: states that move it use its adjoint before its own update
        for m in range(states.first[i + 1] - 1, states.first[i] - 1, -1):
            c = states.columns[m]
            for a in range(states.axes[m, 0], states.axes[m, 1]):
                for lane in range(len(lanes)):
                    adjoint[c, lane] += ways[place, m, a, lane] * adjoint[3 * i + a, lane]
