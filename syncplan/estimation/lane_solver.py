"""Batch solutions of some lanes of a run over a window, from the prior and from drawn starts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.augmented_setup import AugmentedReadings, AugmentedSetup
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import solve
from syncplan.estimation.filter_setup import Readings
from syncplan.estimation.start_search import ROUNDS, is_credible, search_further


@dataclass(slots=True)
class Solved:
    """The best solutions found for some lanes: (k,) each, arrays as in BatchSolution."""

    lanes: Index
    cost: Array
    sightings: Index
    poses: Array
    errors: Array
    covariance: Array

    @property
    def credible(self) -> Flags:
        """(k,) whether noise alone explains the cost."""
        return is_credible(self.cost, self.sightings)

    def take(self, other: "Solved", mine: Index, its: Index) -> None:
        """Take the other's solutions `its` in place of `mine`."""
        self.cost[mine] = other.cost[its]
        self.poses[..., mine] = other.poses[..., its]
        self.errors[..., mine] = other.errors[..., its]
        self.covariance[..., mine] = other.covariance[..., its]


@dataclass(frozen=True, slots=True)
class LaneSolver:
    """Solves lanes of a run from step `begin` to step `end`.

    Attributes
    ----------
    setup, readings : of the run
    streams : of each lane, from which its starts are drawn
    at_once : lanes solved side by side
    begin, end : steps
    """

    setup: AugmentedSetup
    readings: Readings | AugmentedReadings
    streams: Sequence[np.random.SeedSequence]
    at_once: int
    begin: int
    end: int

    def best(self, poses: Array, variances: Array, lanes: Index) -> Solved:
        """Return the best solutions of some lanes.

        The prior is about `poses` (n, 3, all lanes), its further states are zero, and `variances`
        (3n + e,) are its own. Where noise does not explain the solution, more starts are drawn.
        """
        prior = Prior(
            poses, np.zeros((len(variances) - 3 * len(poses), poses.shape[-1])), variances
        )
        best = self._solved(prior, lanes, None)

        def tried(missing: Index, number: int) -> Solved:
            away = [self._drawn(variances, lane, number) for lane in lanes[missing]]
            again = lanes[np.repeat(missing, ROUNDS[number])]
            return self._solved(prior, again, np.concatenate(away, axis=1))

        known = self.setup.poses.noise_known
        search_further(best, best.sightings, tried, noise_known=known)
        return best

    def _drawn(self, variances: Array, lane: int, number: int) -> Array:
        """(3n + e, starts) deviations from the prior of the starts of a round."""
        own = self.streams[lane]
        key = (*own.spawn_key, self.begin, number)
        child = np.random.SeedSequence(own.entropy, spawn_key=key)
        draws = np.random.default_rng(child).standard_normal((ROUNDS[number], len(variances)))
        return np.asarray((np.sqrt(variances) * draws).T)

    def _solved(self, prior: Prior, lanes: Index, away: Array | None) -> Solved:
        """Solutions of lanes, which may recur, from starts as far `away` from the prior's."""
        n, steps = len(prior.poses), slice(self.begin, self.end)
        first = self.setup.poses.first
        window = slice(first[self.begin + 1], first[self.end + 1])
        parts = []
        for k in range(0, len(lanes), self.at_once):
            own = lanes[k : k + self.at_once]
            about = Prior(
                np.ascontiguousarray(prior.poses[..., own]),
                np.ascontiguousarray(prior.errors[..., own]),
                prior.variances,
            )
            start = None
            if away is not None:
                off = away[:, k : k + self.at_once]
                start = (
                    about.poses + off[: 3 * n].reshape(about.poses.shape),
                    about.errors + off[3 * n :],
                )
            speeds = np.ascontiguousarray(self.readings.speeds[steps][..., own])
            turn_rates = np.ascontiguousarray(self.readings.turn_rates[steps][..., own])
            made = np.ascontiguousarray(self.readings.sightings[window][..., own])
            parts.append(solve(self.setup, speeds, turn_rates, made, about, self.begin, start))
        return Solved(
            lanes=lanes,
            cost=np.concatenate([one.cost for one in parts]),
            sightings=np.concatenate([one.sightings for one in parts]),
            poses=np.concatenate([one.poses for one in parts], axis=-1),
            errors=np.concatenate([one.errors for one in parts], axis=-1),
            covariance=np.concatenate([one.covariance for one in parts], axis=-1),
        )
