"""Robust filter: second-order for a period, then continued from the batch solution.

After the first period the batch solution over it refines the estimate, and the filter continues
from there. If a vehicle is still poorly known then, but better than a period before, this is
repeated over two periods and over four. The innovations of each further period are judged. If
they are larger than noise explains, the filter may be lost; a batch solution over the period, from
a wide prior about the filter's estimate at its beginning, is then an alternative.

A solution from the start on replaces the filter's estimate at once if the two agree. Any other is a
hypothesis: both run on the same later sightings, and the less likely one is dropped (`rivals`).
Until then the filter's own estimate stays, except after the first period, where a credible solution
takes precedence. A trial whose alternative was dropped is not solved again before its innovations
have grown further.

The result of a trial depends on that trial alone; starts are drawn from its own stream.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.batch_problem import Prior
from syncplan.estimation.batch_solution import compile_solver, solve, solver_is_compiled
from syncplan.estimation.filter_setup import FilterRun, State, poses_of, start_of
from syncplan.estimation.kernels import compiled_beside, lanes_for
from syncplan.estimation.lane_filter import EXTENDED, LaneFilter, LaneRun, Stepped
from syncplan.estimation.rivals import LOOKS, Rivals, lanes_of_state
from syncplan.estimation.start_search import DOUBT, ROUNDS, STARTS, is_credible, search_further
from syncplan.orbits.circles import wrap

# --- solutions of some lanes ----------------------------------------------------------------------


@dataclass(slots=True)
class Solved:
    """Best solutions found for k lanes; arrays are as in BatchSolution."""

    lanes: Index
    cost: Array
    sightings: Index
    state: Array
    covariance: Array

    @property
    def credible(self) -> Flags:
        """Whether noise alone explains the cost, (k,)."""
        return is_credible(self.cost, self.sightings)

    def take(self, other: "Solved", mine: Index, its: Index) -> None:
        """Replace solutions `mine` by the other's solutions `its`."""
        self.cost[mine] = other.cost[its]
        self.state[..., mine] = other.state[..., its]
        self.covariance[..., mine] = other.covariance[..., its]


ALARM = 1.2
"""Mean of innovation^2 / variance over a period above which a filter may be lost."""

ALARM_SIGMAS = 6.0
"""Standard deviations of that mean that noise explains."""

GROWTH = 1.5
"""Factor by which the mean must grow before a trial is solved again."""

AGREES = 1.0
"""Standard deviations of the filter within which a solution is a refinement of its estimate."""

SETTLED = 0.9
"""Ratio of a vehicle's sigma to that of a period before, above which it hardly falls any more."""


@dataclass(frozen=True, slots=True)
class RobustFilter:
    """Filter of trials as lanes, like LaneFilter, that restarts lost lanes.

    Attributes
    ----------
    base : the filter between batch solutions
    """

    base: LaneFilter

    def is_compiled(self, n: int) -> bool:
        """Return whether all kernels for n vehicles are in memory or in numba's disk cache."""
        return self.base.is_compiled(n) and solver_is_compiled(n)

    def compile(self, n: int) -> None:
        """Compile all kernels for n vehicles, or load them from numba's disk cache."""
        if not self.is_compiled(n):
            with compiled_beside("syncplan.estimation.batch_solution:compile_solver", n):
                self.base.compile(n)
        compile_solver(n)

    def run(self, run: FilterRun, streams: Sequence[np.random.SeedSequence]) -> State:
        """Run as LaneFilter.run does; starts of a lane are drawn from its stream."""
        own = RobustRun.begun(self.base, run, streams)
        own.advance(len(run.readings.speeds))
        return own.state


@dataclass(slots=True)
class RobustRun(LaneRun):
    """Robust filter during a run.

    Attributes
    ----------
    streams : of the lanes
    began : state at the beginning of the present period
    counted : (3, lanes) sum of innovation^2 / variance, numbers of accepted and of rejected
        sightings until then
    limit : (lanes,) mean of innovation^2 / variance up to which a lane is not solved again
    doubtful : (lanes,) whether the start is searched for again over more periods
    looks, ends : steps at which 1 / LOOKS of a period ends, and a whole one
    rivals : of lanes that have an alternative to their estimate
    """

    streams: Sequence[np.random.SeedSequence]
    began: State
    counted: Array
    limit: Array
    doubtful: Flags
    looks: Index
    ends: Index
    rivals: Rivals

    @classmethod
    def begun(
        cls, base: Stepped, given: FilterRun, streams: Sequence[np.random.SeedSequence] = ()
    ) -> Self:
        """Return a filter at step 0; starts of a lane are drawn from its stream."""
        setup, readings = given.setup, given.readings
        state, lanes = start_of(setup, readings), readings.initial.shape[-1]
        return cls(
            base,
            given,
            state,
            streams,
            began=(state[0].copy(), state[1].copy()),
            counted=np.zeros((3, lanes)),
            limit=np.zeros(lanes),
            doubtful=np.ones(lanes, dtype=bool),
            looks=steps_passing(setup.spans, setup.period, LOOKS),
            ends=steps_passing(setup.spans, setup.period),
            rivals=Rivals.none(state),
        )

    def advance(self, end: int) -> None:
        """Process all steps up to `end`."""
        while self.at < end:
            place = int(self.looks.searchsorted(self.at, side="right"))
            look = int(self.looks[place]) if place < len(self.looks) else end + 1
            until = min(end, look)
            LaneRun.advance(self, until)
            if until == look:
                self._decide(until)
                place = int(self.ends.searchsorted(until))
                if place < len(self.ends) and self.ends[place] == until:
                    self._pass_period(place)

    def _pass_period(self, place: int) -> None:
        """Search for alternatives at the period's end `ends[place]`."""
        end = int(self.ends[place])
        self.rivals = Rivals.none(self.state)
        handled = np.zeros(0, dtype=np.int64)
        if place + 1 in STARTS:
            handled = self._start(end, first=not place)
        if place:
            self._find_lost(int(self.ends[place - 1]), end, handled)
        else:
            # until now the filter searched for its start: its innovations are no evidence
            for one in self._sums():
                one[:] = 0.0
        self.began = self.state[0].copy(), self.state[1].copy()
        self.counted = np.stack(self._sums())

    def _sums(self) -> tuple[Array, Array, Array]:
        counted = self.statistics
        return counted.nis, counted.accepted, counted.gated

    def _decide(self, end: int) -> None:
        """Continue from rivals that are clearly more likely than the estimate."""
        rivals = self.rivals
        rivals.advance(self.setup, self.readings, end)
        ahead, lanes = rivals.ahead, rivals.lanes[rivals.ahead]
        if len(lanes):
            for own, its in zip(self.state, rivals.rival, strict=True):
                own[..., lanes] = its[..., ahead]
            # the period is judged from here on, and begins at the rival's state
            self.began[0][..., lanes] = rivals.began[..., ahead]
            self.counted[:, lanes] = np.stack(self._sums())[:, lanes]
            self.limit[lanes] = 0.0
        self.rivals = rivals.take(rivals.undecided)

    def _start(self, end: int, *, first: bool) -> Index:
        """Search for the start again in lanes where it is in doubt; return these lanes."""
        setup = self.setup
        limit = DOUBT**2 * setup.lost_variances[:, :2].sum(axis=1)[:, None]
        if not first:
            then, now = (_place_variances(one[-1], len(limit)) for one in (self.began, self.state))
            falling = np.any((then > limit) & (now < SETTLED**2 * then), axis=0)
        lanes = np.flatnonzero(self.doubtful if first else self.doubtful & falling)
        if not len(lanes):
            return lanes
        variances = setup.initial_variances
        found = self._best(self.readings.initial, variances, lanes, 0, end)
        agrees = self._agrees(found)
        self._pit(found, agrees | (found.credible & first), ~agrees)
        wide = np.any(_place_variances(found.covariance, len(limit)) > limit, axis=0)
        self.doubtful[lanes] = wide & ~agrees
        return lanes

    def _find_lost(self, begin: int, end: int, handled: Index) -> None:
        """Add batch solutions over a period as rivals of lanes whose innovations suggest a loss."""
        setup = self.setup
        nis, accepted, gated = np.stack(self._sums()) - self.counted
        cost = nis + gated * (setup.gate if np.isfinite(setup.gate) else 0.0)
        count = np.maximum(accepted + gated, 1.0)
        noise = np.maximum(ALARM, 1.0 + ALARM_SIGMAS * np.sqrt(2.0 / count))
        # a cost that is not finite counts as lost
        lanes = np.flatnonzero(~(cost / count <= np.maximum(noise, self.limit)))
        lanes = np.setdiff1d(lanes, handled)
        if not len(lanes):
            return
        variances = setup.initial_variances.copy()
        lost = setup.lost_variances.ravel()
        variances[: len(lost)] = np.maximum(variances[: len(lost)], lost)
        found = self._best(poses_of(self.began[0], setup.vehicles), variances, lanes, begin, end)
        self.limit[lanes] = GROWTH * (cost / count)[lanes]
        none = np.zeros(len(lanes), dtype=bool)
        self._pit(found, none, ~none)

    def _agrees(self, found: Solved) -> Flags:
        """Whether solutions are within AGREES standard deviations of the estimates, (k,)."""
        n = self.setup.vehicles
        off = poses_of(found.state - self.state[0][..., found.lanes], n)
        variances = np.einsum("kkl->kl", self.state[-1])[: 3 * n, found.lanes].reshape(n, 3, -1)
        place = np.sum(off[:, :2] ** 2, axis=1) <= AGREES**2 * variances[:, :2].sum(axis=1)
        heading = wrap(off[:, 2]) ** 2 <= AGREES**2 * variances[:, 2]
        return np.asarray(np.all(place & heading, axis=0))

    def _pit(self, found: Solved, taken: Flags, rivals: Flags) -> None:
        """Continue from the solutions `taken`.

        In lanes with `rivals`, the estimate not continued from becomes a rival.
        """
        filtered = lanes_of_state(self.state, found.lanes)
        solved: State = found.state, found.covariance
        for own, its in zip(self.state, solved, strict=True):
            own[..., found.lanes[taken]] = its[..., taken]
        present = lanes_of_state(self.state, found.lanes[rivals])
        x, P = (
            np.ascontiguousarray(np.where(taken, a, b)[..., rivals])
            for a, b in zip(filtered, solved, strict=True)
        )
        formed = Rivals.of(found.lanes[rivals], present, (x, P), self.at)
        self.rivals = self.rivals.joined(formed)

    def _best(self, poses: Array, variances: Array, lanes: Index, begin: int, end: int) -> Solved:
        """Return the best solutions of some lanes over the steps from `begin` to `end`.

        The prior has mean `poses` (n, 3, all lanes), zero bias states and `variances` (3n + e,).
        If noise does not explain a solution, more starts are drawn.
        """
        mean = np.zeros((len(variances), poses.shape[-1]))
        mean[: 3 * len(poses)] = poses.reshape(-1, poses.shape[-1])
        prior = Prior(mean, variances)
        best = self._solved(prior, lanes, begin, end)

        def tried(missing: Index, number: int) -> Solved:
            away = [self._drawn(variances, lane, begin, number) for lane in lanes[missing]]
            again = lanes[np.repeat(missing, ROUNDS[number])]
            return self._solved(prior, again, begin, end, np.concatenate(away, axis=1))

        known = self.setup.noise_known
        search_further(best, best.sightings, tried, noise_known=known)
        return best

    def _drawn(self, variances: Array, lane: int, begin: int, number: int) -> Array:
        """Deviations (3n + e, starts) of a round's starts from the prior."""
        own = self.streams[lane]
        key = (*own.spawn_key, begin, number)
        child = np.random.SeedSequence(own.entropy, spawn_key=key)
        draws = np.random.default_rng(child).standard_normal((ROUNDS[number], len(variances)))
        return np.asarray((np.sqrt(variances) * draws).T)

    def _solved(
        self, prior: Prior, lanes: Index, begin: int, end: int, away: Array | None = None
    ) -> Solved:
        """Solutions of lanes, which may repeat, from starts `away` from the prior's mean."""
        readings, first, width = self.readings, self.setup.first, lanes_for(self.setup.vehicles)
        window, parts = slice(first[begin + 1], first[end + 1]), []
        for k in range(0, len(lanes), width):
            own = lanes[k : k + width]
            about = Prior(np.ascontiguousarray(prior.mean[:, own]), prior.variances)
            start = None if away is None else about.mean + away[:, k : k + width]
            speeds = np.ascontiguousarray(readings.speeds[begin:end][..., own])
            turn_rates = np.ascontiguousarray(readings.turn_rates[begin:end][..., own])
            made = np.ascontiguousarray(readings.sightings[window][..., own])
            parts.append(solve(self.setup, speeds, turn_rates, made, about, begin, start))
        return Solved(
            lanes=lanes,
            cost=np.concatenate([one.cost for one in parts]),
            sightings=np.concatenate([one.sightings for one in parts]),
            state=np.concatenate([one.state for one in parts], axis=-1),
            covariance=np.concatenate([one.covariance for one in parts], axis=-1),
        )


def steps_passing(spans: Array, period: float, share: int = 1) -> Index:
    """Return the steps at which another 1 / `share` of a period has passed."""
    passed = np.concatenate([[0.0], np.cumsum(spans)]) / period + 1e-9
    return np.flatnonzero(np.diff(np.floor(share * passed)) > 0.0) + 1


def _place_variances(P: Array, n: int) -> Array:
    """Position variances (n, lanes) of the vehicles in m^2."""
    own = np.arange(3 * n).reshape(-1, 3)[:, :2]
    return np.asarray(P[own, own].sum(axis=1))


ROBUST = RobustFilter(EXTENDED)
"""The robust filter."""
