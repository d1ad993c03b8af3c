"""The batch solution: the most likely trajectory over a window, from any start.

A filter that linearises sightings one by one at an uncertain estimate can lose a vehicle for good.
The batch solution takes all sightings of a window at once. It minimises

    |start - prior|^2 / P0  +  sum of (noise of readings)^2 / Q  +  sum of (z - h)^2 / R

over the start and all noise, by Gauss-Newton steps with a line search. R is tempered, see
`start_search`.

A trial's solution depends on that trial alone, whatever runs beside it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.batch_linearisation import linear_pass, smooth
from syncplan.estimation.batch_problem import (
    Linearised,
    Prior,
    Problem,
    Trajectory,
    Window,
    scratch_of,
    trajectory_cost,
)
from syncplan.estimation.correction_kernels import most_entries
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.kernels import Lanes, has_compiled, lanes_of
from syncplan.estimation.lane_filter import specimen
from syncplan.estimation.motion_kernels import LEAST_LEFT
from syncplan.estimation.start_search import (
    CLOSE_ENOUGH,
    MOST_HALVINGS,
    MOST_STEPS,
    TEMPERS,
    Tempering,
)

THINNING = 8
"""Sightings of one kind and pair that one of them represents while R is tempered."""

ROUNDING = 1e-12
"""Share of the cost below which the gain of a step is lost in rounding."""


@dataclass(frozen=True, slots=True)
class BatchSolution:
    """The most likely trajectory of each lane over a window of K samples.

    Attributes
    ----------
    path : trajectory of each lane
    cost : (lanes,) twice the negative log-likelihood, less a constant
    sightings : (lanes,) number of sightings made
    state, covariance : (3n + e, lanes), (3n + e, 3n + e, lanes) at the end of the window; only the
        covariance's lower triangle is valid
    steps : (lanes,) Gauss-Newton steps taken
    """

    path: Trajectory
    cost: Array
    sightings: Index
    state: Array
    covariance: Array
    steps: Index


def solve(
    setup: FilterSetup,
    speeds: Array,
    turn_rates: Array,
    sightings: Array,
    prior: Prior,
    begin: int,
    start: Array | None = None,
    *,
    close_enough: float = CLOSE_ENOUGH[-1],
    most_steps: int = MOST_STEPS[-1],
) -> BatchSolution:
    """Return the batch solution over the K samples from `begin` on, searched for from `start`.

    `speeds` and `turn_rates` (K, n, lanes) in m/s and rad/s, and `sightings` (s, lanes), NaN where
    missed, are the readings of these samples. `start` is (3n + e, lanes), the mean of the prior if
    None. The search ends, with the true R, once a step promises to gain less than `close_enough`,
    no step lowers the cost, or `most_steps` were taken.
    """
    K, width = len(speeds), prior.mean.shape[1]
    path = _still(prior.mean if start is None else start, setup, K)
    window = Window(begin, speeds, turn_rates, sightings, np.ones(width))
    thin, kept = _thinned(setup, begin, begin + K)
    coarse = problem_of(thin, window._replace(sightings=sightings[kept]), prior, K)
    taken = _descend(coarse, path, TEMPERS[:-1], MOST_STEPS[:-1], CLOSE_ENOUGH[:-1])
    fine = problem_of(setup, window, prior, K)
    taken += _descend(fine, path, TEMPERS[-1:], (most_steps,), (close_enough,))
    made = np.sum(~np.isnan(sightings), axis=0)
    return BatchSolution(path, fine.found.cost, made, fine.scratch.x, fine.scratch.P, taken)


def solver_is_compiled(n: int) -> bool:
    """Return whether the kernels for n vehicles are in memory or in numba's disk cache."""
    return all(has_compiled(kernel, given) for kernel, given in _calls(n))


def compile_solver(n: int) -> None:
    """Compile the kernels for n vehicles, or load them from numba's disk cache."""
    for kernel, given in _calls(n):
        kernel(*given)


def _calls(n: int) -> list[tuple[Any, tuple[Any, ...]]]:
    """Return the kernels, each with arguments for n vehicles and no samples."""
    setup, readings, *_ = specimen(n)[0]
    window = Window(0, readings.speeds, readings.turn_rates, readings.sightings, np.ones(1))
    prior = Prior(np.zeros((3 * n, 1)), np.ones(3 * n))
    problem, lanes = problem_of(setup, window, prior, 0), lanes_of(n, 1)
    along = problem, problem.best, lanes
    return [(linear_pass, along), (smooth, (problem, lanes)), (trajectory_cost, along)]


def _still(start: Array, setup: FilterSetup, K: int) -> Trajectory:
    """Return noise-free trajectories of K samples from `start`."""
    n, width = setup.vehicles, start.shape[1]
    return Trajectory(
        start=start.copy(),
        speeds=np.zeros((K, n, width)),
        turn_rates=np.zeros((K, n, width)),
        changes=np.zeros((K, len(start) - setup.states.first_changing, width)),
    )


def _thinned(setup: FilterSetup, begin: int, end: int) -> tuple[FilterSetup, Index]:
    """Return the set-up in which one sighting represents up to THINNING of its kind and pair.

    Also returns the indices of these sightings among those of the window.
    """
    window = slice(setup.first[begin + 1], setup.first[end + 1])
    of = np.stack([setup.kinds[window], setup.observers[window], setup.targets[window]])
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
    first = counted[np.clip(setup.first, window.start, window.stop) - window.start]
    thin = setup._replace(
        first=first.astype(np.int64),
        observers=setup.observers[window][chosen],
        targets=setup.targets[window][chosen],
        kinds=setup.kinds[window][chosen],
        variances=setup.variances[window][chosen] / members[chosen],
    )
    return thin, chosen


def problem_of(setup: FilterSetup, window: Window, prior: Prior, K: int) -> Problem:
    """Return the problem of a window of K samples, before any linear pass."""
    width, first = prior.mean.shape[1], setup.first
    sightings = int(first[window.begin + K + 1] - first[window.begin + 1])
    return Problem(
        setup=setup,
        window=window,
        prior=prior,
        found=_empty(setup, window.begin, K, sightings, width),
        best=_still(prior.mean, setup, K),
        scratch=scratch_of(setup, width),
    )


def _descend(
    problem: Problem,
    path: Trajectory,
    tempers: tuple[float, ...],
    most: tuple[int, ...],
    close: tuple[float, ...],
) -> Index:
    """Move the paths to a minimum, in place; return the number of steps of each."""
    window, found, width = problem.window, problem.found, path.start.shape[1]
    lanes = lanes_of(problem.setup.vehicles, width)
    at, taken = Tempering.of(width, tempers, most, close), np.zeros(width, dtype=np.int64)
    while True:
        window.temper[:] = at.factors
        linear_pass(problem, path, lanes)
        settled = at.settled(found.cost - found.linear_cost)
        moving = at.moving(settled)
        if not moving.any():
            return taken
        smooth(problem, lanes)
        moved = _searched(problem, path, moving, lanes)
        taken += moving
        at.advance(settled | ~moved)


def _searched(problem: Problem, path: Trajectory, moving: Flags, lanes: Lanes) -> Flags:
    """Move each path towards its best by a line search on its cost; return which moved."""
    cost, best = problem.found.cost, problem.best
    # the gain is lost in rounding: this near the minimum, the whole step is right
    little = cost - problem.found.linear_cost < ROUNDING * cost
    share, found, there = np.ones(len(cost)), moving & little, best
    for _ in range(MOST_HALVINGS):
        trajectory_cost(problem, there, lanes)
        found |= moving & (problem.scratch.cost < cost)
        if np.all(found | ~moving):
            break
        share[~found] *= 0.5
        there = Trajectory(*(a + share * (b - a) for a, b in zip(path, best, strict=True)))
    share[~found] = 0.0
    for a, b in zip(path, best, strict=True):
        a += share * (b - a)
    return found


def _empty(setup: FilterSetup, begin: int, K: int, sightings: int, width: int) -> Linearised:
    n, size, e = setup.vehicles, len(setup.initial_variances), len(setup.states.variances)
    m, most = len(setup.states.acts), most_entries(setup.states)
    frames = _frames_left(setup, begin, K)
    return Linearised(
        columns=np.zeros((sightings, most), dtype=np.int64),
        entries=np.zeros((sightings, most, width)),
        counts=np.zeros(sightings, dtype=np.int64),
        gains=np.zeros((sightings, size, width)),
        pulls=np.zeros((sightings, width)),
        ways=np.zeros((K, n, 4, width)),
        since=np.zeros((K, m)),
        lefts=np.zeros((K, e)),
        ended=np.zeros(K),
        frames=np.zeros((frames, m, 3, width)),
        frame_lefts=np.zeros((frames, e)),
        cost=np.zeros(width),
        linear_cost=np.zeros(width),
    )


def _frames_left(setup: FilterSetup, begin: int, K: int) -> int:
    """Return the largest number of frames that the covariance leaves as errors decay."""
    if setup.states.first_changing == len(setup.initial_variances):
        return 0
    spans = setup.spans[begin : begin + K] / setup.motion.time
    left, count = 1.0, 0
    # the error that decays fastest decides
    for decay in (setup.states.decays.min() ** spans).tolist():
        left *= decay
        if left < LEAST_LEFT:
            left, count = 1.0, count + 1
    return count + 1
