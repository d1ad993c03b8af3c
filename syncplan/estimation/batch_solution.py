"""The batch solution: the most likely trajectory over a window, from any start.

A filter that linearises sightings one by one at an uncertain estimate can lose a vehicle for good.
The batch solution takes all sightings of a window at once. It minimises

    |start - prior|^2 / P0  +  sum of (noise of readings)^2 / Q  +  sum of (z - h)^2 / R

over the start and all noise, by Gauss-Newton steps with a line search; R is tempered:
`start_search`.

A trial's solution depends on that trial alone, whatever runs beside it.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.augmented_prediction import LEAST_LEFT
from syncplan.estimation.augmented_rows import MOST_ENTRIES
from syncplan.estimation.augmented_setup import AugmentedSetup
from syncplan.estimation.batch_linearisation import linear_pass
from syncplan.estimation.batch_problem import (
    Linearised,
    Prior,
    Trajectory,
    Window,
    trajectory_cost,
)
from syncplan.estimation.batch_smoother import smooth
from syncplan.estimation.lane_filter import Lanes, augmented_specimen, has_compiled, lanes_of
from syncplan.estimation.start_search import (
    CLOSE_ENOUGH,
    MOST_HALVINGS,
    MOST_STEPS,
    TEMPERS,
    Tempering,
)

THINNING = 8
"""Sightings of a kind and a pair that one stands for, until R is true."""

ROUNDING = 1e-12
"""Share of the cost below which what a step gains does not show."""


@dataclass(frozen=True, slots=True)
class BatchSolution:
    """The most likely trajectory of each lane over a window of K samples.

    Attributes
    ----------
    path : of each lane
    cost : (lanes,) twice the negative log-likelihood, less a constant
    sightings : (lanes,) number of sightings made
    poses, errors, covariance : (n, 3, lanes), (e, lanes), (3n + e, 3n + e, lanes) at the end of the
        window; of the covariance the lower triangle
    steps : (lanes,) Gauss-Newton steps taken
    """

    path: Trajectory
    cost: Array
    sightings: Index
    poses: Array
    errors: Array
    covariance: Array
    steps: Index


def solve(
    setup: AugmentedSetup,
    speeds: Array,
    turn_rates: Array,
    sightings: Array,
    prior: Prior,
    begin: int,
    start: tuple[Array, Array] | None = None,
    *,
    close_enough: float = CLOSE_ENOUGH[-1],
) -> BatchSolution:
    """Return the batch solution over the K samples from `begin` on, searched for from `start`.

    `speeds` and `turn_rates` (K, n, lanes) in m/s and rad/s, and `sightings` (s, lanes), NaN where
    missed, are what is read in them. `start` is (poses, errors) as Prior has them, those of the
    prior if None. Less than `close_enough` is then to be gained by another step.
    """
    n, _, width = prior.poses.shape
    K, changing = len(speeds), 3 * n + len(setup.variances) - setup.first_changing
    poses, errors = (prior.poses, prior.errors) if start is None else start
    path = Trajectory(
        poses=poses.copy(),
        errors=errors.copy(),
        speeds=np.zeros((K, n, width)),
        turn_rates=np.zeros((K, n, width)),
        changes=np.zeros((K, changing, width)),
    )
    window = Window(begin, speeds, turn_rates, sightings, np.ones(width))
    thin, kept = _thinned(setup, begin, begin + K)
    coarse = _Problem.of(thin, window._replace(sightings=sightings[kept]), prior, K)
    taken = _descend(coarse, path, TEMPERS[:-1], MOST_STEPS[:-1], CLOSE_ENOUGH[:-1])
    fine = _Problem.of(setup, window, prior, K)
    taken += _descend(fine, path, TEMPERS[-1:], MOST_STEPS[-1:], (close_enough,))
    made = np.sum(~np.isnan(sightings), axis=0)
    return BatchSolution(path, fine.found.cost, made, *fine.ended, taken)


def solver_is_compiled(n: int) -> bool:
    """Return whether the kernels for n vehicles are in memory or in numba's disk cache."""
    problem = _specimen(n)
    setup, window, prior = problem.setup, problem.window, problem.prior
    found, best, lanes = problem.found, problem.best, problem.lanes
    return (
        has_compiled(trajectory_cost, (setup, window, prior, best, lanes))
        and has_compiled(linear_pass, (setup, window, prior, best, found, lanes))
        and has_compiled(smooth, (setup, window, prior, found, best, lanes))
    )


def compile_solver(n: int) -> None:
    """Compile the kernels for n vehicles, or load them from numba's disk cache."""
    problem = _specimen(n)
    setup, window, prior = problem.setup, problem.window, problem.prior
    found, best, lanes = problem.found, problem.best, problem.lanes
    trajectory_cost(setup, window, prior, best, lanes)
    linear_pass(setup, window, prior, best, found, lanes)
    smooth(setup, window, prior, found, best, lanes)


def _specimen(n: int) -> "_Problem":
    """A problem of n vehicles and no sample."""
    setup, readings, *_ = augmented_specimen(n)
    window = Window(0, readings.speeds, readings.turn_rates, readings.sightings, np.ones(1))
    prior = Prior(readings.initial, np.zeros((0, 1)), np.ones(3 * n))
    return _Problem.of(setup, window, prior, 0)


def _thinned(setup: AugmentedSetup, begin: int, end: int) -> tuple[AugmentedSetup, Index]:
    """The set-up with one of up to THINNING sightings of a kind and a pair, which stands for all.

    Returned with which of the sightings of the window these are.
    """
    poses = setup.poses
    window = slice(poses.first[begin + 1], poses.first[end + 1])
    of = np.stack([poses.kinds[window], poses.observers[window], poses.targets[window]])
    _, stream, counts = np.unique(of, axis=1, return_inverse=True, return_counts=True)
    order = np.argsort(stream.ravel(), kind="stable")
    starts = np.cumsum(counts) - counts
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order)) - np.repeat(starts, counts)
    every = counts[stream.ravel()]
    group, within = place // THINNING, place % THINNING
    members = np.minimum(THINNING, every - group * THINNING)
    chosen = np.flatnonzero(within == members // 2)
    counted = np.concatenate([[0], np.cumsum(within == members // 2)])
    first = counted[np.clip(poses.first, window.start, window.stop) - window.start]
    thin = poses._replace(
        first=first.astype(np.int64),
        observers=poses.observers[window][chosen],
        targets=poses.targets[window][chosen],
        kinds=poses.kinds[window][chosen],
        variances=poses.variances[window][chosen] / members[chosen],
    )
    return setup._replace(poses=thin), chosen


@dataclass(slots=True)
class _Problem:
    """A least-squares problem, and what its last linear pass left."""

    setup: AugmentedSetup
    window: Window
    prior: Prior
    found: Linearised
    best: Trajectory
    lanes: Lanes
    ended: tuple[Array, Array, Array]

    @classmethod
    def of(cls, setup: AugmentedSetup, window: Window, prior: Prior, K: int) -> "_Problem":
        n, _, width = prior.poses.shape
        first = setup.poses.first
        sightings = int(first[window.begin + K + 1] - first[window.begin + 1])
        changing = 3 * n + len(setup.variances) - setup.first_changing
        none = np.zeros((0, 0, 0))
        return cls(
            setup=setup,
            window=window,
            prior=prior,
            found=_empty(setup, window.begin, K, sightings, width),
            best=Trajectory(
                poses=np.empty_like(prior.poses),
                errors=np.empty_like(prior.errors),
                speeds=np.empty((K, n, width)),
                turn_rates=np.empty((K, n, width)),
                changes=np.empty((K, changing, width)),
            ),
            lanes=lanes_of(n, width),
            ended=(none, none, none),
        )


def _descend(
    problem: _Problem,
    path: Trajectory,
    tempers: tuple[float, ...],
    most: tuple[int, ...],
    close: tuple[float, ...],
) -> Index:
    """Take the paths down to a minimum, in place; return the number of steps of each."""
    setup, window, prior, found = problem.setup, problem.window, problem.prior, problem.found
    width = len(found.cost)
    at, taken = Tempering.of(width, tempers, most, close), np.zeros(width, dtype=np.int64)
    while True:
        window.temper[:] = at.factors
        problem.ended = linear_pass(setup, window, prior, path, found, problem.lanes)
        settled = at.settled(found.cost - found.linear_cost)
        moving = at.moving(settled)
        if not moving.any():
            return taken
        smooth(setup, window, prior, found, problem.best, problem.lanes)
        moved = _searched(problem, path, moving)
        taken += moving
        at.advance(settled | ~moved)


def _searched(problem: _Problem, path: Trajectory, moving: Flags) -> Flags:
    """Move each path towards its best as far as its cost falls; return which moved."""
    cost, best = problem.found.cost, problem.best
    # too little to show in the cost, and so near the minimum that the whole step is right
    little = cost - problem.found.linear_cost < ROUNDING * cost
    share, found, there = np.ones(len(cost)), moving & little, best
    for _ in range(MOST_HALVINGS):
        tried = trajectory_cost(problem.setup, problem.window, problem.prior, there, problem.lanes)
        found |= moving & (tried < cost)
        if np.all(found | ~moving):
            break
        share[~found] *= 0.5
        there = Trajectory(*(a + share * (b - a) for a, b in zip(path, best, strict=True)))
    share[~found] = 0.0
    for a, b in zip(path, best, strict=True):
        a += share * (b - a)
    return found


def _empty(setup: AugmentedSetup, begin: int, K: int, sightings: int, width: int) -> Linearised:
    n, e = len(setup.columns), len(setup.variances)
    size, frames = 3 * n + e, _frames_left(setup, begin, K)
    return Linearised(
        columns=np.zeros((sightings, MOST_ENTRIES), dtype=np.int64),
        entries=np.zeros((sightings, MOST_ENTRIES, width)),
        counts=np.zeros(sightings, dtype=np.int64),
        gains=np.zeros((sightings, size, width)),
        pulls=np.zeros((sightings, width)),
        ways=np.zeros((K, n, 4, width)),
        blown=np.zeros(K),
        lefts=np.zeros((K, e)),
        ended=np.zeros(K),
        frames=np.zeros((frames, n, 6, width)),
        frame_ages=np.zeros((frames, 2)),
        frame_lefts=np.zeros((frames, e)),
        cost=np.zeros(width),
        linear_cost=np.zeros(width),
    )


def _frames_left(setup: AugmentedSetup, begin: int, K: int) -> int:
    """How often the covariance leaves its frame, as errors pass."""
    if setup.first_changing == 3 * len(setup.columns) + len(setup.variances):
        return 0
    spans = setup.poses.spans[begin : begin + K] / setup.poses.motion.time
    left, count = 1.0, 0
    # the one that passes first decides
    for decay in (setup.decays.min() ** spans).tolist():
        left *= decay
        if left < LEAST_LEFT:
            left, count = 1.0, count + 1
    return count + 1
