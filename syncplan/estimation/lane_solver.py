"""Batch solutions of some lanes of a run over a window, from the prior and from drawn starts."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import solve
from syncplan.estimation.filter_setup import FilterSetup, Readings
from syncplan.estimation.start_search import ROUNDS, is_credible, search_further


@dataclass(slots=True)
class Solved:
    """The best solutions found for some lanes: (k,) each, arrays as in BatchSolution."""

    lanes: Index
    cost: Array
    sightings: Index
    state: Array
    covariance: Array

    @property
    def credible(self) -> Flags:
        """(k,) whether noise alone explains the cost."""
        return is_credible(self.cost, self.sightings)

    def take(self, other: "Solved", mine: Index, its: Index) -> None:
        """Take the other's solutions `its` in place of `mine`."""
        self.cost[mine] = other.cost[its]
        self.state[..., mine] = other.state[..., its]
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

    setup: FilterSetup
    readings: Readings
    streams: Sequence[np.random.SeedSequence]
    at_once: int
    begin: int
    end: int

    def best(self, poses: Array, variances: Array, lanes: Index) -> Solved:
        """Return the best solutions of some lanes.

        The prior is about `poses` (n, 3, all lanes), its bias states are zero, and `variances`
        (3n + e,) are its own. Where noise does not explain the solution, more starts are drawn.
        """
        mean = np.zeros((len(variances), poses.shape[-1]))
        mean[: 3 * len(poses)] = poses.reshape(-1, poses.shape[-1])
        prior = Prior(mean, variances)
        best = self._solved(prior, lanes, None)

        def tried(missing: Index, number: int) -> Solved:
            away = [self._drawn(variances, lane, number) for lane in lanes[missing]]
            again = lanes[np.repeat(missing, ROUNDS[number])]
            return self._solved(prior, again, np.concatenate(away, axis=1))

        known = self.setup.noise_known
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
        steps, first = slice(self.begin, self.end), self.setup.first
        window = slice(first[self.begin + 1], first[self.end + 1])
        parts = []
        for k in range(0, len(lanes), self.at_once):
            own = lanes[k : k + self.at_once]
            about = Prior(np.ascontiguousarray(prior.mean[:, own]), prior.variances)
            start = None if away is None else about.mean + away[:, k : k + self.at_once]
            speeds = np.ascontiguousarray(self.readings.speeds[steps][..., own])
            turn_rates = np.ascontiguousarray(self.readings.turn_rates[steps][..., own])
            made = np.ascontiguousarray(self.readings.sightings[window][..., own])
            parts.append(solve(self.setup, speeds, turn_rates, made, about, self.begin, start))
        return Solved(
            lanes=lanes,
            cost=np.concatenate([one.cost for one in parts]),
            sightings=np.concatenate([one.sightings for one in parts]),
            state=np.concatenate([one.state for one in parts], axis=-1),
            covariance=np.concatenate([one.covariance for one in parts], axis=-1),
        )
