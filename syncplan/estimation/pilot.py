"""Pilot: a few trials of a filter along a plan, side by side in plain NumPy.

A plan must not wait for kernels to compile or for numba to load. So a pilot thins out samples
(`pilot_readings`) and processes all sightings of an instant at once. A filter that finds its start
is second-order for a period, then continues from the batch solution over it; its later searches
for the start and its alarm are left out. Lasting errors are left out of both truth and filter: the
pilot shows the effect of the start.

The batch solution over the first samples starts all trials. It minimises the cost of
`batch_solution` by the same search, over the start and the noise of readings, here in units of
their sigmas. Along a trajectory, errors at time 0 are those of the start and all noise so far,
which has block-diagonal covariance N_k after k samples. So a chunk of sightings of several samples,
with rows h and tempered variances R, is one correction:

    V_a = (P + N_a) h_a,    S_ab = h_a' P h_b + h_a' N_min(a, b) h_b + R,    P -= V S^-1 V'

where P + N_k is the covariance after sample k. The Gauss-Newton step follows from the multipliers y
of the sightings, last chunk first:

    y = S^-1 (nu - V' lambda),   lambda += h y,   start = P0 lambda,   noise of k = Q G_k' lambda_k

where nu is the innovation less the effect of the errors expected so far, and lambda_k includes the
sightings from k on.

Source: Bell (1994), SIAM Journal on Optimization 4; Bierman (1973), International Journal of
Control 18.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.estimation.pilot_model import Arcs, PilotFilter, Seen, arcs_of, solved
from syncplan.estimation.pilot_readings import PilotReadings, thinned
from syncplan.estimation.start_search import (
    CLOSE_ENOUGH,
    MOST_HALVINGS,
    MOST_STEPS,
    ROUNDS,
    TEMPERS,
    Tempering,
    search_further,
)
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sightings import sample_sightings, steps_within
from syncplan.orbits.team import Team
from syncplan.scenario.filters import FilterModel

PILOT_TRIALS = 16
PILOT_SEED = 0

BATCH_WORK = 15.0
"""Work of a batch solution over a period, relative to that of the filter."""


def pilot_work(team: Team, windows: Windows, duration: float, model: FilterModel) -> float:
    """Return the approximate number of multiplications in a pilot of `duration` s."""
    thin = thinned(team)
    steps = steps_within(duration, thin.sensors.sample_time)
    turn = _samples_of_start(thin, model)
    seen = sample_sightings(windows, team.orbits.period, thin.sensors, 1, steps).steps
    sightings = len(seen) + (BATCH_WORK * np.sum(seen <= turn) if turn <= steps else 0.0)
    return 2.0 * PILOT_TRIALS * float(sightings) * (3.0 * team.count) ** 2


def pilot_squares(
    team: Team,
    windows: Windows,
    duration: float,
    model: FilterModel,
    *,
    trials: int = PILOT_TRIALS,
    seed: int = PILOT_SEED,
) -> Array:
    """Return (trials, n) mean squared position errors in m^2 over the second half of `duration` s.

    `team` is as `thinned` returns it. All errors of a trial are infinite if its filter broke down.
    """
    run = PilotReadings.drawn(team, windows, duration, trials, seed)
    lanes = PilotFilter.at_start(run, second_order=model.second_order)
    found, turn = np.zeros((trials, team.count)), _samples_of_start(team, model)
    with np.errstate(all="ignore"):
        for k in range(1, run.steps + 1):
            if k == turn:
                lanes = batch_start(run, turn, seed)
            elif k > turn or 2 * turn > run.steps:
                # before the batch solution, the filter matters only if its errors count
                lanes.predict(run, k)
                lanes.correct(run, k)
            if 2 * k > run.steps:
                errors = lanes.x[..., :2] - run.places[k, : team.count]
                found += np.sum(errors**2, axis=-1)
    found /= run.steps - run.steps // 2
    found[~np.isfinite(found).all(axis=1)] = np.inf
    return found


def _samples_of_start(team: Team, model: FilterModel) -> int:
    """Number of samples that the batch solution covers, a period; 0 for a filter without one."""
    if not model.finds_start:
        return 0
    return math.ceil(team.orbits.period / team.sensors.sample_time - 1e-9)


# --- the batch solution ---------------------------------------------------------------------------


LAST_GAIN = 0.1
"""Predicted decrease of the cost below which a lane is done; a pilot need not be closer."""

AT_ONCE = 24
"""Largest number of sightings in a chunk, unless one sample has more."""

WIDE_LANES = 16
"""Number of starts searched side by side; more take memory and save no time."""


def batch_start(run: PilotReadings, samples: int, seed: int) -> PilotFilter:
    """Return second-order filters of all trials, from the batch solution over `samples` samples.

    Further starts of a trial are drawn from SeedSequence(seed, spawn_key=(trial, 1, round)).
    """
    trials, n = run.initial.shape[:2]
    best = _solved_from(run, np.arange(trials), np.zeros((trials, n, 3)), samples)

    def tried(missing: Index, number: int) -> _BatchStarts:
        starts = ROUNDS[number]
        away = [
            np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial, 1, number)))
            for trial in missing.tolist()
        ]
        drawn = np.concatenate([one.standard_normal((starts, n, 3)) for one in away])
        return _solved_from(run, np.repeat(missing, starts), drawn, samples)

    search_further(best, np.full(trials, run.first[samples + 1] - run.first[1]), tried)
    lanes = PilotFilter(best.x, best.P, best.gone, second_order=True)
    lanes.change(best.errors)
    return lanes


@dataclass(slots=True)
class _BatchStarts:
    """Best trajectories found, one per lane.

    Attributes
    ----------
    cost : (lanes,) twice the negative log-likelihood, less a constant
    x, P, gone : as in PilotFilter, at the end of the window
    errors : (lanes, 3 n) remaining corrections of x, referred to time 0
    """

    cost: Array
    x: Array
    P: Array
    gone: Array
    errors: Array

    def take(self, other: "_BatchStarts", mine: Index, its: Index) -> None:
        """Replace solutions `mine` by the other's solutions `its`."""
        for one in fields(self):
            getattr(self, one.name)[mine] = getattr(other, one.name)[its]


def _solved_from(run: PilotReadings, trials: Index, start: Array, samples: int) -> _BatchStarts:
    """Solve `trials`, which may repeat, from starts (lanes, n, 3) in sigmas off the prior."""
    parts = [
        _descend(run, trials[k : k + WIDE_LANES], start[k : k + WIDE_LANES], samples)
        for k in range(0, len(trials), WIDE_LANES)
    ]
    names = [one.name for one in fields(_BatchStarts)]
    return _BatchStarts(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in names)
    )


def _descend(run: PilotReadings, trials: Index, start: Array, samples: int) -> _BatchStarts:
    still = np.zeros((len(trials), samples, run.team.count, 2))
    path = _Path.of(run, trials, start, still)
    at = Tempering.of(len(trials), TEMPERS, MOST_STEPS, (*CLOSE_ENOUGH[:-1], LAST_GAIN))
    while True:
        step, cost = _linear(path, at.factors), path.cost(at.factors)
        settled = at.settled(cost - step.cost)
        moving = at.moving(settled)
        if not moving.any():
            return _BatchStarts(cost, path.x, step.P, path.gone[:, -1], step.errors)
        path, moved = _searched(path, step, cost, at.factors, moving)
        at.advance(settled | ~moved)


@dataclass(frozen=True, slots=True)
class _Path:
    """Trajectory of each lane over K samples, with the innovations of its sightings.

    Attributes
    ----------
    trials : (lanes,) trial whose readings each lane uses
    start : (lanes, n, 3) in sigmas off the prior
    noise : (lanes, K, n, 2) in sigmas, added to the readings of speed and turn rate
    x : (lanes, n, 3) m, m, rad, at the end
    gone : (lanes, K, n + 1, 2) m, J D after each sample; the last, for landmarks, is 0
    arcs : of each sample
    seen, innovation : sightings of all samples, and their innovations (lanes, s)
    """

    run: PilotReadings
    trials: Index
    start: Array
    noise: Array
    x: Array
    gone: Array
    arcs: Arcs
    seen: Seen
    innovation: Array

    @classmethod
    def of(cls, run: PilotReadings, trials: Index, start: Array, noise: Array) -> "_Path":
        K, n = noise.shape[1:3]
        time, sigmas = run.team.sensors.sample_time, run.team.noise
        read = slice(run.first[1], run.first[K + 1])
        speeds, turn_rates = (
            np.swapaxes(given[:K, trials], 0, 1) for given in (run.speeds, run.turn_rates)
        )
        speeds = speeds + sigmas.speed_sigma * noise[..., 0]
        turn_rates = turn_rates + sigmas.turn_rate_sigma * noise[..., 1]
        poses = run.initial[trials] + run.spread * start
        headings = poses[:, None, :, 2] + time * np.cumsum(turn_rates, axis=1)
        arcs = arcs_of(speeds, turn_rates, headings - time * turn_rates, time)
        places = poses[:, None, :, :2] + np.cumsum(arcs.moved, axis=1)
        gone = np.zeros((len(trials), K, n + 1, 2))
        np.cumsum(arcs.left, axis=1, out=gone[:, :, :n])
        steps = run.sightings.steps[read] - 1
        seen = Seen.of(run, read, run.with_landmarks(places), headings, gone, steps)
        x = np.concatenate([places[:, -1], headings[:, -1, :, None]], axis=-1)
        innovation = seen.innovation(run.measured[trials][:, read])
        return cls(run, trials, start, noise, x, gone, arcs, seen, innovation)

    @property
    def steps(self) -> Index:
        """Index (s,) of each sighting's sample among the K."""
        return self.run.sightings.steps[self.read] - 1

    @property
    def read(self) -> slice:
        """Slice of the run's sightings that fall in the K samples."""
        return slice(self.run.first[1], self.run.first[self.noise.shape[1] + 1])

    def cost(self, temper: Array) -> Array:
        """Return the cost of each lane, with sighting variances scaled by `temper` (lanes,)."""
        seen = np.sum(self.innovation**2 / self.run.variances[self.read], axis=1)
        own = np.sum(self.start**2, axis=(1, 2)) + np.sum(self.noise**2, axis=(1, 2, 3))
        return np.asarray(own + seen / temper)

    def toward(self, step: "_GaussNewtonStep", share: Array) -> "_Path":
        """Return the trajectories after a share (lanes,) of a step."""
        start = self.start + share[:, None, None] * (step.start - self.start)
        noise = self.noise + share[:, None, None, None] * (step.noise - self.noise)
        return _Path.of(self.run, self.trials, start, noise)


@dataclass(frozen=True, slots=True)
class _GaussNewtonStep:
    """Minimum of the cost, linearised along a path.

    Attributes
    ----------
    start, noise : as in _Path
    cost : (lanes,) predicted
    P : (lanes, 3 n, 3 n) covariance at the end, referred to time 0
    errors : (lanes, 3 n) expected errors of the path at the end, referred to time 0
    """

    start: Array
    noise: Array
    cost: Array
    P: Array
    errors: Array


def _linear(path: _Path, temper: Array) -> _GaussNewtonStep:
    """Gauss-Newton step from a path."""
    run, rows, steps = path.run, path.seen.rows(), path.steps
    lanes, K, n, _ = path.noise.shape
    gains = path.arcs.gains(run.team, path.gone[:, :, :n])
    grown = np.cumsum(gains @ np.swapaxes(gains, -1, -2), axis=1)
    strayed = np.cumsum((gains @ path.noise[..., None]).reshape(lanes, K, -1), axis=1)
    # errors of the path: prior and readings lie off it by the negative of its start and noise
    spread = np.tile(run.spread, n)
    errors = -spread * path.start.reshape(lanes, -1)
    P = np.zeros((lanes, 3 * n, 3 * n))
    P[:] = np.diag(spread**2)
    cost, passed = np.zeros(lanes), []
    variances = run.variances[path.read] * temper[:, None]
    for chunk in _chunks(steps):
        h, then = rows[:, chunk], steps[chunk]
        blocks = h.reshape(lanes, -1, n, 3)
        own = np.einsum("lsiab,lsib->lsia", grown[:, then], blocks).reshape(h.shape)
        shared = own @ np.swapaxes(h, 1, 2)
        V = h @ P
        S = V @ np.swapaxes(h, 1, 2) + np.triu(shared) + np.swapaxes(np.triu(shared, 1), 1, 2)
        V += own
        np.einsum("lmm->lm", S)[:] += variances[:, chunk]
        known = errors[:, None] - strayed[:, then]
        off = path.innovation[:, chunk] - np.einsum("lsj,lsj->ls", h, known)
        found = solved(S, np.concatenate([V, off[..., None]], axis=-1))
        gain, pull = found[..., :-1], found[..., -1]
        P -= np.swapaxes(V, 1, 2) @ gain
        errors += (off[:, None] @ gain)[:, 0]
        cost += np.sum(off * pull, axis=1)
        passed.append((chunk, gain, pull))
    np.einsum("liaib->liab", P.reshape(lanes, n, 3, n, 3))[:] += grown[:, -1]
    start, noise = _smoothed(rows, steps, gains, passed)
    return _GaussNewtonStep(
        (spread * start).reshape(lanes, n, 3), noise, cost, P, errors - strayed[:, -1]
    )


def _smoothed(
    rows: Array, steps: Index, gains: Array, passed: list[tuple[slice, Array, Array]]
) -> tuple[Array, Array]:
    """lambda (lanes, 3 n) of the start and noise (lanes, K, n, 2), last chunk first."""
    lanes, K, n = gains.shape[:3]
    adjoint = np.zeros((lanes, 3 * n))
    pulls = np.zeros((lanes, K, 3 * n))
    pulled = np.empty_like(rows)
    for chunk, gain, pull in reversed(passed):
        weights = pull - (gain @ adjoint[..., None])[..., 0]
        pulled[:, chunk] = weights[..., None] * rows[:, chunk]
        adjoint += pulled[:, chunk].sum(axis=1)
    first = np.flatnonzero(np.diff(steps, prepend=-1))
    if len(first):
        pulls[:, steps[first]] = np.add.reduceat(pulled, first, axis=1)
    since = np.cumsum(pulls[:, ::-1], axis=1)[:, ::-1].reshape(lanes, K, n, 3, 1)
    return adjoint, (np.swapaxes(gains, -1, -2) @ since)[..., 0]


def _chunks(steps: Index) -> Iterator[slice]:
    """Yield slices of the sightings of whole samples, up to AT_ONCE sightings each."""
    begin, end = 0, 0
    for after in [*(np.flatnonzero(np.diff(steps)) + 1).tolist(), len(steps)]:
        if end > begin and after - begin > AT_ONCE:
            yield slice(begin, end)
            begin = end
        end = after
    if end > begin:
        yield slice(begin, end)


def _searched(
    path: _Path, step: _GaussNewtonStep, cost: Array, temper: Array, moving: Flags
) -> tuple[_Path, Flags]:
    """Paths moved along the step as far as lowers their cost, and which lanes moved."""
    share = np.where(moving, 1.0, 0.0)
    for _ in range(MOST_HALVINGS):
        tried = path.toward(step, share)
        found = tried.cost(temper) < cost
        if np.all(found | ~moving):
            return tried, moving
        share[~found] *= 0.5
    share[~found] = 0.0
    return path.toward(step, share), moving & found
