"""The robust filter: second-order until a period has passed, then from the batch solution on.

After the first period the batch solution over it takes the filter's place, and the filter goes on
from there. Where a vehicle is still hardly known then, the same is done over two periods and over
four. After each further period its innovations of that period are judged: where they are
larger than noise explains, the filter is taken for lost, and a batch solution over the period, from
a wide prior about where the filter began it, may take its place. It does where it is credible, or
explains the sightings far better than the filter did. A trial whose errors no start explains is
not solved again before its innovations have grown further.

What a trial does depends on that trial alone; starts are drawn from its own stream.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.augmented_filter import AUGMENTED
from syncplan.estimation.augmented_setup import (
    AugmentedReadings,
    AugmentedSetup,
    AugmentedStatistics,
    without_errors,
)
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import compile_solver, solve, solver_is_compiled
from syncplan.estimation.extended_filter import EXTENDED
from syncplan.estimation.filter_setup import FilterSetup, Readings
from syncplan.estimation.filter_statistics import FilterStatistics
from syncplan.estimation.lane_filter import LaneFilter, start_of
from syncplan.estimation.start_search import DOUBT, ROUNDS, STARTS, is_credible, search_further

__all__ = ["ROBUST", "ROBUST_AUGMENTED", "RobustFilter", "RobustRun"]

ALARM = 1.2
"""Mean of innovation^2 / variance over a period above which a filter may be lost."""

ALARM_SIGMAS = 6.0
"""So many standard deviations of that mean are noise."""

GROWTH = 1.5
"""How far the mean must grow until a trial that no start explained is solved again."""

FAR_BETTER = 0.5
"""Share of the filter's cost below which a solution takes its place, even if not credible."""


@dataclass(frozen=True, slots=True)
class RobustFilter:
    """A filter whose trials are lanes, as a LaneFilter, which begins again where it is lost.

    Attributes
    ----------
    base : the filter between batch solutions
    """

    base: LaneFilter

    def lanes_for(self, n: int) -> int:
        """Return how many trials of n vehicles it is best to filter side by side."""
        return self.base.lanes_for(n)

    def is_compiled(self, n: int) -> bool:
        """Return whether all kernels for n vehicles are in memory or in numba's disk cache."""
        return self.base.is_compiled(n) and solver_is_compiled(n)

    def compile(self, n: int) -> None:
        """Compile all kernels for n vehicles, or load them from numba's disk cache."""
        self.base.compile(n)
        compile_solver(n)

    def run(
        self,
        setup: FilterSetup | AugmentedSetup,
        readings: Readings | AugmentedReadings,
        statistics: FilterStatistics | AugmentedStatistics,
        streams: Sequence[np.random.SeedSequence],
    ) -> tuple[Array, ...]:
        """Return what LaneFilter.run does; starts of a lane are drawn from its stream."""
        run = RobustRun.begun(self.base, setup, readings, statistics, streams)
        run.advance(len(readings.speeds))
        return run.state


@dataclass(slots=True)
class _Solved:
    """The best solutions found for some lanes: (k,) each, arrays as in BatchSolution."""

    lanes: Index
    cost: Array
    sightings: Index
    poses: Array
    errors: Array
    covariance: Array

    @property
    def credible(self) -> Flags:
        return is_credible(self.cost, self.sightings)

    def take(self, other: "_Solved", mine: Index, its: Index) -> None:
        """Take the other's solutions `its` in place of `mine`."""
        self.cost[mine] = other.cost[its]
        self.poses[..., mine] = other.poses[..., its]
        self.errors[..., mine] = other.errors[..., its]
        self.covariance[..., mine] = other.covariance[..., its]


class Stepped(Protocol):
    """What takes a filter from sample to sample: a LaneFilter, or what flies as it does."""

    def lanes_for(self, n: int) -> int:
        """Return how many trials of n vehicles it is best to filter side by side."""

    def advance(
        self,
        setup: FilterSetup | AugmentedSetup,
        readings: Readings | AugmentedReadings,
        statistics: FilterStatistics | AugmentedStatistics,
        state: tuple[Array, ...],
        begin: int,
        end: int,
    ) -> None:
        """Take a state from sample `begin` to sample `end`, in place."""


@dataclass(slots=True)
class RobustRun:
    """A robust filter on its way; its lanes may be looked at, and moved, between samples.

    Attributes
    ----------
    base, setup, readings, statistics, streams : as RobustFilter.run has them
    state : as LaneFilter.run returns it
    began : the state as the present period began
    counted : (3, lanes) sum of innovation^2 / variance, number of accepted and of rejected
        sightings until then
    limit : (lanes,) mean of innovation^2 / variance up to which a lane is not solved again
    doubtful : (lanes,) whether the start is looked for again over more periods
    ends : steps at which a period ends
    at : steps taken in
    """

    base: Stepped
    setup: FilterSetup | AugmentedSetup
    readings: Readings | AugmentedReadings
    statistics: FilterStatistics | AugmentedStatistics
    streams: Sequence[np.random.SeedSequence]
    state: tuple[Array, ...]
    began: tuple[Array, ...]
    counted: Array
    limit: Array
    doubtful: Flags
    ends: Index
    at: int = 0

    @classmethod
    def begun(
        cls,
        base: Stepped,
        setup: FilterSetup | AugmentedSetup,
        readings: Readings | AugmentedReadings,
        statistics: FilterStatistics | AugmentedStatistics,
        streams: Sequence[np.random.SeedSequence],
    ) -> "RobustRun":
        """Return a filter at sample 0."""
        state, lanes = start_of(setup, readings), readings.initial.shape[-1]
        began, counted = tuple(one.copy() for one in state), np.zeros((3, lanes))
        poses = setup if isinstance(setup, FilterSetup) else setup.poses
        return cls(
            base,
            setup,
            readings,
            statistics,
            streams,
            state,
            began,
            counted,
            limit=np.zeros(lanes),
            doubtful=np.ones(lanes, dtype=bool),
            ends=_period_ends(poses),
        )

    @property
    def augmented(self) -> AugmentedSetup:
        """The set-up, as that of a filter with further states."""
        return without_errors(self.setup) if isinstance(self.setup, FilterSetup) else self.setup

    def advance(self, end: int) -> None:
        """Take in all samples up to `end`."""
        while self.at < end:
            place = int(self.ends.searchsorted(self.at, side="right"))
            last = int(self.ends[place]) if place < len(self.ends) else end
            until = min(end, last)
            self.base.advance(
                self.setup, self.readings, self.statistics, self.state, self.at, until
            )
            self.at = until
            if place < len(self.ends) and until == last:
                if place:
                    self._find_lost(int(self.ends[place - 1]), until)
                if place + 1 in STARTS:
                    self._start(until)
                if not place:
                    # so far the filter looked for its start: its innovations are no evidence
                    for one in self._sums():
                        one[:] = 0.0
                self.began = tuple(one.copy() for one in self.state)
                self.counted = np.stack(self._sums())

    def _sums(self) -> tuple[Array, Array, Array]:
        one = self.statistics
        counted = one.poses if isinstance(one, AugmentedStatistics) else one
        return counted.nis, counted.accepted, counted.gated

    def _start(self, end: int) -> None:
        """Go on from the batch solution from sample 0 where the start is in doubt."""
        lanes, setup = np.flatnonzero(self.doubtful), self.augmented
        if not len(lanes):
            return
        variances = np.concatenate([setup.poses.initial_variances.ravel(), setup.variances])
        found = self._best(self.readings.initial, variances, lanes, 0, end)
        self._replace(found, np.arange(len(lanes)))
        own = np.arange(3 * len(setup.columns)).reshape(-1, 3)[:, :2]
        spread = found.covariance[own, own].sum(axis=1)
        reach = setup.poses.lost_variances[:, :2].sum(axis=1)
        self.doubtful[lanes] = np.any(spread > DOUBT**2 * reach[:, None], axis=0)

    def _find_lost(self, begin: int, end: int) -> None:
        """Go on from batch solutions over a period where innovations say that a lane is lost."""
        setup = self.augmented
        nis, accepted, gated = np.stack(self._sums()) - self.counted
        cost = nis + gated * (setup.poses.gate if np.isfinite(setup.poses.gate) else 0.0)
        count = np.maximum(accepted + gated, 1.0)
        noise = np.maximum(ALARM, 1.0 + ALARM_SIGMAS * np.sqrt(2.0 / count))
        # not finite: broken down
        lanes = np.flatnonzero(~(cost / count <= np.maximum(noise, self.limit)))
        if not len(lanes):
            return
        starts = np.maximum(setup.poses.initial_variances, setup.poses.lost_variances)
        variances = np.concatenate([starts.ravel(), setup.variances])
        found = self._best(self.began[0], variances, lanes, begin, end)
        better = found.credible | ~(found.cost >= FAR_BETTER * cost[lanes])
        self.limit[lanes] = np.where(better, 0.0, GROWTH * (cost / count)[lanes])
        self._replace(found, np.flatnonzero(better))

    def _replace(self, found: _Solved, chosen: Index) -> None:
        """Go on from the solutions chosen among those found."""
        lanes = found.lanes[chosen]
        self.state[0][..., lanes] = found.poses[..., chosen]
        self.state[-1][..., lanes] = found.covariance[..., chosen]
        if len(self.state) == 3:
            self.state[1][..., lanes] = found.errors[..., chosen]

    def _best(self, poses: Array, variances: Array, lanes: Index, begin: int, end: int) -> _Solved:
        """The best solutions of some lanes, from the prior about `poses` and, in need, others."""
        prior = Prior(
            poses, np.zeros((len(variances) - 3 * len(poses), poses.shape[-1])), variances
        )
        best = self._solved(prior, lanes, None, begin, end)

        def tried(missing: Index, number: int) -> _Solved:
            away = [self._drawn(variances, lane, begin, number) for lane in lanes[missing]]
            again = lanes[np.repeat(missing, ROUNDS[number])]
            return self._solved(prior, again, np.concatenate(away, axis=1), begin, end)

        known = self.augmented.poses.noise_known
        search_further(best, best.sightings, tried, noise_known=known)
        return best

    def _drawn(self, variances: Array, lane: int, begin: int, number: int) -> Array:
        """(3n + e, starts) deviations from the prior of the starts of a round."""
        own = self.streams[lane]
        child = np.random.SeedSequence(own.entropy, spawn_key=(*own.spawn_key, begin, number))
        draws = np.random.default_rng(child).standard_normal((ROUNDS[number], len(variances)))
        return np.asarray((np.sqrt(variances) * draws).T)

    def _solved(
        self, prior: Prior, lanes: Index, away: Array | None, begin: int, end: int
    ) -> _Solved:
        """Solutions of lanes, which may recur, from starts as far `away` from the prior's."""
        setup, n = self.augmented, len(prior.poses)
        first, wide = setup.poses.first, self.lanes_at_once
        window = slice(first[begin + 1], first[end + 1])
        parts = []
        for k in range(0, len(lanes), wide):
            own = lanes[k : k + wide]
            about = Prior(
                np.ascontiguousarray(prior.poses[..., own]),
                np.ascontiguousarray(prior.errors[..., own]),
                prior.variances,
            )
            start = None
            if away is not None:
                off = away[:, k : k + wide]
                start = (
                    about.poses + off[: 3 * n].reshape(about.poses.shape),
                    about.errors + off[3 * n :],
                )
            speeds = np.ascontiguousarray(self.readings.speeds[begin:end][..., own])
            turn_rates = np.ascontiguousarray(self.readings.turn_rates[begin:end][..., own])
            made = np.ascontiguousarray(self.readings.sightings[window][..., own])
            parts.append(solve(setup, speeds, turn_rates, made, about, begin, start))
        return _Solved(
            lanes=lanes,
            cost=np.concatenate([one.cost for one in parts]),
            sightings=np.concatenate([one.sightings for one in parts]),
            poses=np.concatenate([one.poses for one in parts], axis=-1),
            errors=np.concatenate([one.errors for one in parts], axis=-1),
            covariance=np.concatenate([one.covariance for one in parts], axis=-1),
        )

    @property
    def lanes_at_once(self) -> int:
        """How many lanes are solved side by side."""
        return self.base.lanes_for(len(self.readings.initial))


def _period_ends(setup: FilterSetup) -> Index:
    """Steps at which a whole number of periods has passed."""
    passed = np.concatenate([[0.0], np.cumsum(setup.spans)]) / setup.period + 1e-9
    return np.flatnonzero(np.diff(np.floor(passed)) > 0.0) + 1


ROBUST, ROBUST_AUGMENTED = RobustFilter(EXTENDED), RobustFilter(AUGMENTED)
"""Of poses alone, and with further states."""
