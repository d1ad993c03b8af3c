"""The pilot: a few trials of the extended Kalman filter along a plan, side by side in plain NumPy.

A plan must not wait for kernels to be compiled, or for numba to be loaded. So a pilot thins the
samples out: of each m samples it keeps the last, with the noise that m of them leave together,

    bearings   sigma / sqrt(m)        speed and turn-rate readings   sigma / sqrt(m)

and so for other sightings; m is how many are made, where they come at intervals or are missed now
and then. It takes all sightings of an instant in at once, and refers errors to time 0, where
prediction only adds noise. With D the way that a vehicle was predicted to go since, without its
corrections, and J a quarter turn counter-clockwise, an error of position and heading (a, psi) at
time 0 is

    (a + J D psi, psi)

later: the product of the filter's own transitions, in closed form. Errors that last are left out,
of truth and filter alike: the pilot shows what the start does.

Trial k draws from SeedSequence(seed, spawn_key=(k,)): initial pose, speeds, turn rates, sightings.
Source: Bar-Shalom, Li, Kirubarajan (2001), 10.3 (extended Kalman filter).
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.bearings import BEARING
from syncplan.orbits.circles import heading, position
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sighting_kinds import (
    SIGHTING_KINDS,
    measured_by_kind,
    place_of,
    sigmas_by_kind,
    turns_by_kind,
)
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within
from syncplan.orbits.team import Team

__all__ = ["PILOT_SEED", "PILOT_TRIALS", "pilot_squares", "pilot_work", "thinned"]

PILOT_TRIALS = 16
PILOT_SEED = 0

INSTANTS_A_TURN = 32
"""Samples of a period that a pilot keeps, at least."""

_BEARINGS = place_of(BEARING)

_ANGLES = np.array([kind.unit == "rad" for kind in SIGHTING_KINDS.values()])
"""Whether sightings of each kind are angles, equal up to whole turns."""

_TURNED = np.array([-1.0, 1.0])
"""With the coordinates swapped, a quarter turn counter-clockwise."""


def thinned(team: Team, instants: int = INSTANTS_A_TURN) -> Team:
    """Return the team with as few samples a period as can be, but at least `instants`."""
    sensors, noise = team.sensors, team.noise
    kept = max(int(team.orbits.period / (sensors.sample_time * instants)), 1)
    share = 1.0 / np.sqrt(kept)
    every = np.maximum(np.round(sensors.every / kept), 1.0)
    of_targets = 1.0 / np.sqrt(kept * every / sensors.every * sensors.detection)
    return replace(
        team,
        sensors=replace(
            sensors,
            sample_time=sensors.sample_time * kept,
            bearing_sigmas=sensors.bearing_sigmas * of_targets,
            range_sigmas=sensors.range_sigmas * of_targets,
            compass_sigmas=sensors.compass_sigmas_each_sample * share,
            compass_every=np.ones(team.count, dtype=np.int64),
            every=every.astype(np.int64),
            detection=np.ones(team.count),
        ),
        noise=replace(
            noise,
            speed_sigma=noise.speed_sigma * share,
            turn_rate_sigma=noise.turn_rate_sigma * share,
        ),
    )


def pilot_work(team: Team, windows: Windows, duration: float) -> float:
    """Return about how many multiplications a pilot of `duration` s takes."""
    thin = thinned(team)
    steps = steps_within(duration, thin.sensors.sample_time)
    seen = sample_sightings(windows, team.orbits.period, thin.sensors, 1, steps)
    return 2.0 * PILOT_TRIALS * len(seen.steps) * (3.0 * team.count) ** 2


def pilot_squares(
    team: Team,
    windows: Windows,
    duration: float,
    *,
    trials: int = PILOT_TRIALS,
    seed: int = PILOT_SEED,
) -> Array:
    """Return (trials, n) m^2: squared position errors, mean over the second half of `duration` s.

    Infinite for all vehicles of a trial whose filter broke down.
    """
    run = _PilotRun.drawn(team, windows, duration, trials, seed)
    lanes = _Lanes.at_start(run)
    found = np.zeros((trials, team.count))
    steps = len(run.places) - 1
    with np.errstate(all="ignore"):
        for k in range(1, steps + 1):
            lanes.predict(run, k)
            lanes.correct(run, k)
            if 2 * k > steps:
                found += np.sum((lanes.x[..., :2] - run.places[k, : team.count]) ** 2, axis=-1)
    found /= steps - steps // 2
    found[~np.isfinite(found).all(axis=1)] = np.inf
    return found


@dataclass(frozen=True, slots=True)
class _PilotRun:
    """What the trials of a pilot share, and what each of them reads."""

    team: Team
    sightings: Sightings
    first: Index
    places: Array  # (steps + 1, n + m, 2) m, true
    sigmas: Array  # (s,)
    initial: Array  # (trials, n, 3)
    speeds: Array  # (steps, trials, n)
    turn_rates: Array  # (steps, trials, n)
    measured: Array  # (trials, s)

    @classmethod
    def drawn(
        cls, team: Team, windows: Windows, duration: float, trials: int, seed: int
    ) -> "_PilotRun":
        orbits, sensors, noise, n = team.orbits, team.sensors, team.noise, team.count
        steps = steps_within(duration, sensors.sample_time)
        seen = sample_sightings(windows, orbits.period, sensors, 1, steps)
        times = np.arange(steps + 1) * sensors.sample_time
        fixed = np.broadcast_to(team.landmarks, (steps + 1, *team.landmarks.shape))
        places = np.concatenate([position(orbits, times), fixed], axis=1)
        ahead = heading(orbits, times)
        away = places[seen.steps, seen.targets] - places[seen.steps, seen.observers]
        true = measured_by_kind(seen.kinds, away.T, ahead[seen.steps, seen.observers])
        sigmas = sigmas_by_kind(sensors, seen.kinds, seen.observers)
        sizes = np.cumsum([3 * n, steps * n, steps * n])
        poses, speeds, rates, errors = np.split(
            _draws(trials, seed, sizes[-1] + len(true)), sizes, 1
        )
        spread = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        start = np.concatenate([places[0, :n], ahead[0][:, None]], axis=1)

        def read(mean: Array, sigma: float, draws: Array) -> Array:
            return mean + sigma * np.swapaxes(draws.reshape(trials, steps, n), 0, 1)

        return cls(
            team=team,
            sightings=seen,
            first=seen.first_of_steps(steps),
            places=places,
            sigmas=sigmas,
            initial=start + spread * poses.reshape(trials, n, 3),
            speeds=read(orbits.speeds, noise.speed_sigma, speeds),
            turn_rates=read(orbits.turn_rates, noise.turn_rate_sigma, rates),
            measured=true + sigmas * errors,
        )


def _draws(trials: int, seed: int, size: int) -> Array:
    """(trials, size) standard normal numbers, those of a trial from a generator of its own."""
    return np.stack(
        [
            np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k,))).standard_normal(
                size
            )
            for k in range(trials)
        ]
    )


@dataclass(slots=True)
class _Lanes:
    """The filters of all trials.

    Attributes
    ----------
    x : (trials, n, 3) estimates
    P : (trials, 3 n, 3 n) covariances, of errors at time 0
    own : (trials, n, 3, 3) view of P, each vehicle's own block
    gone : (trials, n, 2) m, J D: the way predicted since time 0, turned
    bodies : (trials, n + m, 2) m, where vehicles are estimated and landmarks are
    """

    x: Array
    P: Array
    own: Array
    gone: Array
    bodies: Array

    @classmethod
    def at_start(cls, run: _PilotRun) -> "_Lanes":
        trials, n = run.initial.shape[:2]
        noise = run.team.noise
        spread = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        bodies = np.broadcast_to(run.places[0], (trials, *run.places[0].shape)).copy()
        covariance = np.zeros((trials, 3 * n, 3 * n))
        covariance[:] = np.diag(np.tile(spread**2, n))
        own = np.einsum("liaib->liab", covariance.reshape(trials, n, 3, n, 3))
        # the way of a landmark, always 0, stands behind those of the vehicles
        return cls(run.initial.copy(), covariance, own, np.zeros((trials, n + 1, 2)), bodies)

    def predict(self, run: _PilotRun, k: int) -> None:
        """Advance by the readings of sample k, along arcs."""
        trials, n = self.x.shape[:2]
        time, noise = run.team.sensors.sample_time, run.team.noise
        speeds, half = run.speeds[k - 1], 0.5 * time * run.turn_rates[k - 1]
        chord = time * np.sinc(half / np.pi)
        middle = self.x[..., 2] + half
        ahead = np.stack([np.cos(middle), np.sin(middle)], axis=-1)
        left = ahead[..., ::-1] * _TURNED
        moved = (speeds * chord)[..., None]
        self.x[..., :2] += moved * ahead
        self.x[..., 2] += 2.0 * half
        self.gone[:, :n] += moved * left
        # the chord turns by half of what the heading does, and shortens: sinc' = -h/3 + h^3/30 ...
        shorter = 0.5 * time * speeds * (half * half * half / 30.0 - half / 3.0)
        gain = np.zeros((trials, n, 3, 2))
        gain[..., :2, 0] = (noise.speed_sigma * chord)[..., None] * ahead
        swing = 0.5 * moved * left + shorter[..., None] * ahead - self.gone[:, :n]
        gain[..., :2, 1] = noise.turn_rate_sigma * time * swing
        gain[..., 2, 1] = noise.turn_rate_sigma * time
        self.own += gain @ np.swapaxes(gain, -1, -2)

    def correct(self, run: _PilotRun, k: int) -> None:
        """Take in the sightings of sample k."""
        own = slice(run.first[k], run.first[k + 1])
        observers, targets = run.sightings.observers[own], run.sightings.targets[own]
        if not len(observers):
            return
        n = run.team.count
        kinds = run.sightings.kinds[own]
        rows, expected = self._expected(observers, targets, kinds)
        innovation = run.measured[:, own] - expected
        turns = 2.0 * np.pi * np.floor((innovation + np.pi) / (2.0 * np.pi))
        innovation -= np.where(_ANGLES[kinds], turns, 0.0)
        reduced = self.P @ np.swapaxes(rows, 1, 2)
        spread = rows @ reduced
        np.einsum("lmm->lm", spread)[:] += run.sigmas[own] ** 2
        gain = _solved(spread, np.swapaxes(reduced, 1, 2))
        self.P -= reduced @ gain
        change = (innovation[:, None] @ gain).reshape(self.x.shape)
        self.x[..., :2] += change[..., :2] + change[..., 2:] * self.gone[:, :n]
        self.x[..., 2] += change[..., 2]

    def _expected(self, observers: Index, targets: Index, kinds: Index) -> tuple[Array, Array]:
        """Rows (trials, m, 3 n) of errors at time 0, and the sightings expected (trials, m)."""
        n = self.x.shape[1]
        self.bodies[:, :n] = self.x[..., :2]
        q = self.bodies[:, targets] - self.bodies[:, observers]
        ends = np.empty((2, *q.shape[:2], 3))
        there, here = ends
        expected = _measured(q, self.x[:, observers, 2], kinds, there[..., :2])
        np.negative(there[..., :2], out=here[..., :2])
        moving = np.minimum(targets, n)
        for end, vehicles in ((there, moving), (here, observers)):
            way = self.gone[:, vehicles]
            end[..., 2] = end[..., 0] * way[..., 0] + end[..., 1] * way[..., 1]
        here[..., 2] += turns_by_kind(kinds)
        rows = np.zeros((*expected.shape, n + 1, 3))
        each = np.arange(len(observers))
        rows[:, each, moving], rows[:, each, observers] = there, here
        return rows.reshape(*q.shape[:2], -1)[..., : 3 * n], expected


def _measured(q: Array, headings: Array, kinds: Index, slopes: Array) -> Array:
    """(trials, m) sightings at q (trials, m, 2); fills in `slopes`, dz / dq (trials, m, 2)."""
    if np.all(kinds == _BEARINGS):
        x, y = q[..., 0], q[..., 1]
        squared = x * x + y * y
        np.divide(-y, squared, out=slopes[..., 0])
        np.divide(x, squared, out=slopes[..., 1])
        return np.asarray(np.arctan2(y, x) - headings)
    expected = np.empty(headings.shape)
    for place, kind in enumerate(SIGHTING_KINDS.values()):
        own = np.flatnonzero(kinds == place)
        away = np.moveaxis(q[:, own], -1, 0)
        expected[:, own] = kind.measured(away, headings[:, own])
        slopes[:, own] = np.moveaxis(kind.slopes(away, np.ones(away.shape[1:])), 0, -1)
    return expected


def _solved(matrices: Array, sides: Array) -> Array:
    """The batched solution; NaN throughout for a matrix that is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, sides), dtype=np.float64)
    except np.linalg.LinAlgError:
        found = np.full_like(sides, np.nan)
        for lane, (matrix, side) in enumerate(zip(matrices, sides, strict=True)):
            try:
                found[lane] = np.linalg.solve(matrix, side)
            except np.linalg.LinAlgError:
                continue
        return found
