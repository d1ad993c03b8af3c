"""The least-squares problem of a window: what is read and known, trajectories, what each costs.

A trajectory follows from its start and the noise of its readings. Its cost is

    |start - prior|^2 / P0  +  sum of (noise of readings)^2 / Q  +  sum of (z - h)^2 / R

over the sightings z of the window, whose R may be tempered. Lanes are as in `batched_filter`.
"""

import math
from typing import NamedTuple

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.estimation.augmented_clocks import Read, sight_as_stamped
from syncplan.estimation.augmented_correction import expect_shift
from syncplan.estimation.augmented_prediction import gained, kept, move
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batched_filter import motion_in
from syncplan.estimation.filter_setup import BEARING_KIND, MotionModel
from syncplan.estimation.lane_filter import Lanes, compiled

FAR = 2.0
"""Standard deviations from which on a reading's pull grows no further, where some may be wild."""


class Window(NamedTuple):
    """What is read in a window of K samples, a lane for each trial.

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
    """What is known of the state at the beginning, uncorrelated.

    Fields
    ------
    poses : (n, 3, lanes) m, m, rad
    errors : (e, lanes)
    variances : (3n + e,)
    """

    poses: Array
    errors: Array
    variances: Array


class Trajectory(NamedTuple):
    """A trajectory of each lane.

    Fields
    ------
    poses : (n, 3, lanes) m, m, rad, at the beginning
    errors : (e, lanes) further states at the beginning
    speeds, turn_rates : (K, n, lanes) m/s, rad/s, by which readings are too small
    changes : (K, g, lanes) what each of g further states that change gains in a sample
    """

    poses: Array
    errors: Array
    speeds: Array
    turn_rates: Array
    changes: Array


class Linearised(NamedTuple):
    """What a pass forward leaves for the pass backward.

    Fields
    ------
    columns, entries, counts : (s, MOST_ENTRIES), (s, MOST_ENTRIES, lanes), (s,) rows of sightings
    gains, pulls : (s, 3n + e, lanes) g, (s, lanes) nu / S
    ways : (K, n, 4, lanes) G's entries of x and y by speed and by turn rate
    blown : (K,) how far a gust has blown when a sample's gusts come
    lefts : (K, e) what is left then of each further state
    ended : (K,) 1 where P left its frame at that sample, otherwise 0
    frames, frame_ages, frame_lefts : (f, n, 6, lanes), (f, 2), (f, e) frames that P has left
    cost, linear_cost : (lanes,) of the trajectory, and of the best one if all were linear
    """

    columns: Index
    entries: Array
    counts: Index
    gains: Array
    pulls: Array
    ways: Array
    blown: Array
    lefts: Array
    ended: Array
    frames: Array
    frame_ages: Array
    frame_lefts: Array
    cost: Array
    linear_cost: Array


@compiled
def trajectory_cost(
    setup: AugmentedSetup, window: Window, prior: Prior, path: Trajectory, lanes: Lanes
) -> Array:
    """Return twice the negative log-likelihood of each trajectory (lanes,), less a constant.

    A sighting that is far off counts as `misfit` has it.
    """
    poses, n, width = setup.poses, len(path.poses), len(lanes)
    x, errors, cost = path.poses.copy(), path.errors.copy(), np.zeros(width)
    slopes = np.empty((12, width))
    seen, innovation = np.empty((4, width)), np.empty(width)
    speeds, turn_rates = np.empty((n, width)), np.empty((n, width))
    read = speeds, turn_rates
    begin = first_sighting(setup, window)
    add_prior_cost(prior, path, cost, lanes)
    for k in range(len(path.speeds)):
        motion = motion_in(poses, window.begin + k + 1)
        correct_readings(motion, window, path, k, speeds, turn_rates, cost, lanes)
        for i in range(n):
            move(x, errors, i, speeds, turn_rates, motion, setup.columns[i], slopes, lanes)
        change(errors, setup, motion.time, path.changes[k], cost, lanes)
        for s in range(poses.first[window.begin + k + 1], poses.first[window.begin + k + 2]):
            innovate(x, errors, s, begin, setup, window, read, seen, innovation, lanes)
            for lane in range(width):
                off = innovation[lane] * innovation[lane]
                off /= poses.variances[s] * window.temper[lane]
                cost[lane] += misfit(off, poses.gate, window.temper[lane]) if off == off else 0.0
    return cost


@compiled
def misfit(square: float, gate: float, temper: float) -> float:
    """Return what a sighting costs that is off by so many standard deviations, squared.

    Where a gate rejects readings that may be anything, one beyond it costs as much as one at it. At
    a start that is far off most good readings are beyond it, too, and would pull nowhere: until R
    is true, a reading beyond FAR costs in proportion to how far it is off (Huber).
    """
    if temper <= 1.0 or gate == np.inf:
        return min(square, gate)
    return square if square <= FAR * FAR else 2.0 * FAR * math.sqrt(square) - FAR * FAR


@compiled
def add_prior_cost(prior: Prior, path: Trajectory, cost: Array, lanes: Lanes) -> None:
    n = len(path.poses)
    for i in range(n):
        for c in range(3):
            if prior.variances[3 * i + c] > 0.0:
                for lane in range(len(lanes)):
                    off = path.poses[i, c, lane] - prior.poses[i, c, lane]
                    cost[lane] += off * off / prior.variances[3 * i + c]
    for k in range(len(path.errors)):
        if prior.variances[3 * n + k] > 0.0:
            for lane in range(len(lanes)):
                off = path.errors[k, lane] - prior.errors[k, lane]
                cost[lane] += off * off / prior.variances[3 * n + k]


@compiled
def correct_readings(
    motion: MotionModel,
    window: Window,
    path: Trajectory,
    k: int,
    speeds: Array,
    turn_rates: Array,
    cost: Array,
    lanes: Lanes,
) -> None:
    """Fill in readings (n, lanes) of a sample with their noise taken off; add what it costs."""
    by_speed = 1.0 / motion.speed_variance if motion.speed_variance > 0.0 else 0.0
    by_turn = 1.0 / motion.turn_rate_variance if motion.turn_rate_variance > 0.0 else 0.0
    for i in range(len(speeds)):
        for lane in range(len(lanes)):
            v, w = path.speeds[k, i, lane], path.turn_rates[k, i, lane]
            speeds[i, lane] = window.speeds[k, i, lane] + v
            turn_rates[i, lane] = window.turn_rates[k, i, lane] + w
            cost[lane] += v * v * by_speed + w * w * by_turn


@compiled
def change(
    errors: Array, setup: AugmentedSetup, time: float, gains: Array, cost: Array, lanes: Lanes
) -> None:
    """Let errors decay for `time` s, and gain what that brings; add what it costs."""
    first = len(errors) - len(gains)
    for c in range(len(gains)):
        left, brought = kept(setup, first + c, time), gained(setup, first + c, time)
        weight = 1.0 / brought if brought > 0.0 else 0.0
        for lane in range(len(lanes)):
            gain = gains[c, lane]
            errors[first + c, lane] = left * errors[first + c, lane] + gain
            cost[lane] += gain * gain * weight


@compiled
def innovate(
    x: Array,
    errors: Array,
    s: int,
    begin: int,
    setup: AugmentedSetup,
    window: Window,
    read: Read,
    seen: Array,
    innovation: Array,
    lanes: Lanes,
) -> int:
    """Fill in slopes (4, lanes) and innovation (lanes,); return the kind of the sighting.

    The window's sightings are those from `begin` on.
    """
    poses = setup.poses
    o, t, kind = poses.observers[s], poses.targets[s], poses.kinds[s]
    measured = window.sightings[s - begin]
    sight_as_stamped(kind, (x, errors), o, t, measured, setup, read, seen, innovation, lanes)
    if kind == BEARING_KIND:
        expect_shift(errors, setup.columns[o], 3 * len(x), innovation, lanes)
    return int(kind)


@compiled
def first_sighting(setup: AugmentedSetup, window: Window) -> int:
    """Return the number of the first sighting of a window."""
    return int(setup.poses.first[window.begin + 1])
