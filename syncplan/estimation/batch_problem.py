"""The least-squares problem of a window: readings, prior, trajectories and their cost.

A trajectory follows from its start and the noise of its readings. Its cost is

    |start - prior|^2 / P0  +  sum of (noise of readings)^2 / Q  +  sum of (z - h)^2 / R

over the sightings z of the window, whose R may be tempered.
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.correction_kernels import Correction, correction_of, sight
from syncplan.estimation.filter_setup import FilterSetup, MotionModel
from syncplan.estimation.kernels import Lanes, inner, lean
from syncplan.estimation.motion_kernels import Frame, copy, frame_of, gained, kept, motion_in, move

FAR = 2.0
"""Standard deviations beyond which a reading's pull stops growing, where outliers are possible."""


class Window(NamedTuple):
    """Readings in a window of K samples, a lane for each trial.

    Fields
    ------
    begin : sample of the run at which it begins
    speeds, turn_rates : (K, n, lanes) m/s, rad/s
    sightings : (s, lanes) in the unit of their kind; NaN where missed
    temper : (lanes,) factor on the variance of sightings
    """

    begin: int
    speeds: Array
    turn_rates: Array
    sightings: Array
    temper: Array


class Prior(NamedTuple):
    """Prior of the state at the beginning, uncorrelated.

    Fields
    ------
    mean : (3n + e, lanes)
    variances : (3n + e,)
    """

    mean: Array
    variances: Array


class Trajectory(NamedTuple):
    """One trajectory for each lane.

    Fields
    ------
    start : (3n + e, lanes) state at the beginning
    speeds, turn_rates : (K, n, lanes) m/s, rad/s, added to the readings
    changes : (K, g, lanes) gain of each of the g changing bias states in a sample
    """

    start: Array
    speeds: Array
    turn_rates: Array
    changes: Array


class Linearised(NamedTuple):
    """Results of a forward pass that the backward pass needs.

    Fields
    ------
    columns, entries, counts : (s, MOST_ENTRIES), (s, MOST_ENTRIES, lanes), (s,) rows of sightings
    gains, pulls : (s, 3n + e, lanes) g, (s, lanes) nu / S
    ways : (K, n, 4, lanes) entries of G: x and y by speed, x and y by turn rate
    since : (K, m) ways, for rows of States that drift and change, when a sample's noise enters
    lefts : (K, e) share of each bias state left then
    ended : (K,) 1 where P left its frame at that sample, otherwise 0
    frames, frame_lefts : (f, m, 3, lanes), (f, e) frames that P has left
    cost, linear_cost : (lanes,) of the trajectory, and of the optimum of the linearised problem
    """

    columns: Index
    entries: Array
    counts: Index
    gains: Array
    pulls: Array
    ways: Array
    since: Array
    lefts: Array
    ended: Array
    frames: Array
    frame_lefts: Array
    cost: Array
    linear_cost: Array


class Scratch(NamedTuple):
    """Scratch arrays for passes along trajectories.

    Fields
    ------
    x, P : (3n + e, lanes), (3n + e, 3n + e, lanes) state and covariance, lower triangle
    mean, carried : (1, 3n + e, lanes), (3n + e, lanes) mean deviation from the trajectory, in P's
        frame and at present
    adjoint : (3n + e, lanes)
    speeds, turn_rates : (n, lanes)
    cost, share, ones : (lanes,)
    work, frame : for sightings; between passes the frame is that of the present
    """

    x: Array
    P: Array
    mean: Array
    carried: Array
    adjoint: Array
    speeds: Array
    turn_rates: Array
    cost: Array
    share: Array
    ones: Array
    work: Correction
    frame: Frame


def scratch_of(setup: FilterSetup, width: int) -> Scratch:
    """Return scratch for passes over `width` lanes."""
    n, size = setup.vehicles, len(setup.initial_variances)
    return Scratch(
        x=np.empty((size, width)),
        P=np.empty((size, size, width)),
        mean=np.empty((1, size, width)),
        carried=np.empty((size, width)),
        adjoint=np.empty((size, width)),
        speeds=np.empty((n, width)),
        turn_rates=np.empty((n, width)),
        cost=np.empty(width),
        share=np.empty(width),
        ones=np.ones(width),
        work=correction_of(setup.states, size, width),
        frame=frame_of(setup.states, width),
    )


class Problem(NamedTuple):
    """A least-squares problem and the results of its last linear pass.

    Fields
    ------
    setup, window, prior : data of the problem
    found : results of the pass
    best : optimal trajectories of the linearised problem
    scratch : with state and covariance at the end of the pass
    """

    setup: FilterSetup
    window: Window
    prior: Prior
    found: Linearised
    best: Trajectory
    scratch: Scratch


@lean
def trajectory_cost(problem: Problem, path: Trajectory, lanes: Lanes) -> None:
    """Compute each trajectory's cost: twice its negative log-likelihood, less a constant.

    Fills in the scratch's `cost`. Outlying sightings count as in `misfit`.
    """
    setup, window, scratch = problem.setup, problem.window, problem.scratch
    x, cost, work = scratch.x, scratch.cost, scratch.work
    speeds, turn_rates = scratch.speeds, scratch.turn_rates
    n, begin = len(speeds), first_sighting(setup, window)
    copy(path.start, x, lanes)
    for lane in range(len(lanes)):
        cost[lane] = 0.0
    add_prior_cost(problem.prior, path, cost, lanes)
    for k in range(len(path.speeds)):
        motion = motion_in(setup, window.begin + k + 1)
        correct_readings(problem, path, k, motion, cost, lanes)
        for i in range(n):
            move(x, i, speeds, turn_rates, motion, setup.states, work.slopes, lanes)
        change(x, setup, motion.time, path.changes, k, cost, lanes)
        for s in range(setup.first[window.begin + k + 1], setup.first[window.begin + k + 2]):
            sight(s, s - begin, x, window.sightings, speeds, turn_rates, setup, work, lanes)
            for lane in range(len(lanes)):
                off = work.innovation[lane] * work.innovation[lane]
                off /= setup.variances[s] * window.temper[lane]
                cost[lane] += misfit(off, setup.gate, window.temper[lane]) if off == off else 0.0


@inner
def misfit(square: float, gate: float, temper: float) -> float:
    """Return the cost of a sighting whose `square` is its squared error in standard deviations.

    Where a gate rejects outliers, a reading beyond it costs as much as one at it. From a poor start
    most good readings are beyond it too, and would pull nowhere. So while R is tempered, the cost
    of a reading beyond FAR grows linearly with its error (Huber).
    """
    if temper <= 1.0 or gate == np.inf:
        return min(square, gate)
    return square if square <= FAR * FAR else 2.0 * FAR * math.sqrt(square) - FAR * FAR


@inner
def add_prior_cost(prior: Prior, path: Trajectory, cost: Array, lanes: Lanes) -> None:
    """Add the cost of the trajectories' starts under the prior."""
    for k in range(len(path.start)):
        if prior.variances[k] > 0.0:
            for lane in range(len(lanes)):
                off = path.start[k, lane] - prior.mean[k, lane]
                cost[lane] += off * off / prior.variances[k]


@inner
def correct_readings(
    problem: Problem, path: Trajectory, k: int, motion: MotionModel, cost: Array, lanes: Lanes
) -> None:
    """Fill in a sample's readings (n, lanes) without their noise; add the cost of that noise."""
    window, speeds, turn_rates = problem.window, problem.scratch.speeds, problem.scratch.turn_rates
    by_speed = 1.0 / motion.speed_variance if motion.speed_variance > 0.0 else 0.0
    by_turn = 1.0 / motion.turn_rate_variance if motion.turn_rate_variance > 0.0 else 0.0
    for i in range(len(speeds)):
        for lane in range(len(lanes)):
            v, w = path.speeds[k, i, lane], path.turn_rates[k, i, lane]
            speeds[i, lane] = window.speeds[k, i, lane] + v
            turn_rates[i, lane] = window.turn_rates[k, i, lane] + w
            cost[lane] += v * v * by_speed + w * w * by_turn


@inner
def change(
    x: Array, setup: FilterSetup, time: float, gains: Array, k: int, cost: Array, lanes: Lanes
) -> None:
    """Let bias states decay for `time` s and add their gains in sample k; add the cost of these."""
    begin, n = setup.states.first_changing, len(setup.states.first) - 1
    for c in range(begin, len(x)):
        left, brought = kept(setup, c - 3 * n, time), gained(setup, c - 3 * n, time)
        weight = 1.0 / brought if brought > 0.0 else 0.0
        for lane in range(len(lanes)):
            gain = gains[k, c - begin, lane]
            x[c, lane] = left * x[c, lane] + gain
            cost[lane] += gain * gain * weight


@inner
def first_sighting(setup: FilterSetup, window: Window) -> int:
    """Return the index of the first sighting of a window."""
    return int(setup.first[window.begin + 1])
