"""Vehicles that steer by what a filter in plain NumPy estimates, on any plant.

One loop for all plants, with noise that belongs to what it disturbs and not to the order in which
it is drawn: two plants that see different things still read the same noise where both see the same.
Trial k draws its start, wind, motion noise and gusts from SeedSequence(seed, spawn_key=(k,)),
and the noise of a bearing at step s from Philox keyed by seed and trial, its counter at s: a table
of all observers and targets, whether they see each other or not.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.errors import InputError
from syncplan.estimation.augmented_setup import AugmentedSetup, augmented_setup_of, gust_decay
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.montecarlo import _setup
from syncplan.estimation.reference_states import (
    covariance_at_start,
    predict_state,
    update_state,
)
from syncplan.flight.flight_limits import FlightLimits
from syncplan.orbits.circles import heading, position, wrap
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from tests.crosschecks.plants import MakePlant
from tests.crosschecks.tracking import TrackingLaw
from tests.crosschecks.unicycle_team import STILL, Lag, Response

__all__ = ["Flight", "FlightCase", "Noise", "Readings", "fly", "noise_of", "sightings_noise"]

Readings = Literal["measured", "commanded"]
"""What the filter takes for motion.

measured: what the vehicle did in the sample, with noise on the reading; it flies without noise
commanded: what a vehicle of the modelled lag makes of the command; noise is on what it does
"""


@dataclass(frozen=True, slots=True)
class FlightCase:
    """What is flown.

    Attributes
    ----------
    team : vehicles on their plan, which see bearings alone
    limits : of their commands
    duration : s
    trials, seed : of the noise
    readings : of motion
    lag : of the model, for commanded readings
    """

    team: Team
    limits: FlightLimits
    duration: float
    trials: int
    seed: int
    readings: Readings = "measured"
    lag: Lag = STILL

    @property
    def steps(self) -> int:
        """Number of samples."""
        return round(self.duration / self.team.sensors.sample_time)


@dataclass(frozen=True, slots=True)
class Noise:
    """What disturbs the trials of a case.

    Attributes
    ----------
    start : (trials, n, 3) m, m, rad off the plan
    motion : (steps, trials, n, 2) m/s, rad/s
    air : (steps, trials, n, 2) m/s, wind and gust
    """

    start: Array
    motion: Array
    air: Array


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of the trials of a case.

    Attributes
    ----------
    estimation, tracking : (steps + 1, trials, n, 2) m, of estimates from the truth, and of the
        truth from the plan
    separation : (steps + 1, trials) m, least between two vehicles
    sightings : (trials,) number
    """

    estimation: Array
    tracking: Array
    separation: Array
    sightings: Array


def noise_of(case: FlightCase) -> Noise:
    """Return what disturbs each trial of a case, whatever plant flies it."""
    team, steps = case.team, case.steps
    n, errors, noise = team.count, team.errors, team.noise
    sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
    starts, motions, airs = [], [], []
    for trial in range(case.trials):
        draw = np.random.default_rng(np.random.SeedSequence(case.seed, spawn_key=(trial,)))
        starts.append(sigmas * draw.standard_normal((n, 3)))
        wind = errors.wind * draw.standard_normal(2)
        motion = draw.standard_normal((steps, n, 2))
        motions.append(motion * [noise.speed_sigma, noise.turn_rate_sigma])
        gust = errors.gust * draw.standard_normal((steps, n, 2))
        decay = gust_decay(errors, team.sensors.sample_time)
        for k in range(1, steps):
            gust[k] = decay * gust[k - 1] + math.sqrt(1.0 - decay**2) * gust[k]
        airs.append(wind + gust)
    return Noise(np.array(starts), np.stack(motions, axis=1), np.stack(airs, axis=1))


def sightings_noise(seed: int, trial: int, step: int, n: int, bodies: int) -> Array:
    """Return (n, bodies) standard normal numbers: of each observer's bearing of each body."""
    bits = np.random.Philox(key=np.array([seed, trial], np.uint64), counter=[0, 0, step, 0])
    return np.random.Generator(bits).standard_normal((n, bodies))


def fly(case: FlightCase, make: MakePlant, noise: Noise) -> Flight:
    """Return what comes of a case on a plant; raises InputError where sensors are not cameras."""
    _check(case.team)
    team, steps, trials = case.team, case.steps, case.trials
    n, orbits, time = team.count, team.orbits, team.sensors.sample_time
    flown = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
    poses = flown + noise.start
    speeds = np.tile(orbits.speeds, trials)
    plant = make(poses.reshape(-1, 3), speeds, noise.air[0].reshape(-1, 2), time)
    pilot = _Pilot(case, np.tile(flown, (trials, 1, 1)), speeds)
    found = Flight(
        estimation=np.empty((steps + 1, trials, n, 2)),
        tracking=np.empty((steps + 1, trials, n, 2)),
        separation=np.empty((steps + 1, trials)),
        sightings=np.zeros(trials, dtype=int),
    )
    _note(found, 0, case, poses, pilot.poses)
    quiet = np.zeros((trials * n, 2))
    for k in range(1, steps + 1):
        commands = pilot.commands((k - 1) * time)
        motion = noise.motion[k - 1].reshape(-1, 2)
        disturbance = quiet if case.readings == "measured" else motion
        done = plant.fly(
            commands[:, 0], commands[:, 1], noise.air[k - 1].reshape(-1, 2), disturbance
        )
        poses = done.poses.reshape(trials, n, 3)
        read = np.column_stack([done.speeds, done.turn_rates]) + motion
        found.sightings[:] += pilot.estimate(k, read.reshape(trials, n, 2), poses)
        _note(found, k, case, poses, pilot.poses)
    return found


class _Pilot:
    """The filters of all trials, and the law that steers by them."""

    def __init__(self, case: FlightCase, poses: Array, speeds: Array) -> None:
        team, trials = case.team, case.trials
        self._case, self._law = case, TrackingLaw(team.orbits, case.limits)
        self._setup = _all_bearings(team)
        further = np.zeros(len(self._setup.variances))
        self._states = [np.concatenate([one.ravel(), further]) for one in poses]
        self._covariances = [covariance_at_start(self._setup) for _ in range(trials)]
        self._response = Response(speeds, case.lag, team.sensors.sample_time)
        self._expected = np.zeros((trials * team.count, 2))

    @property
    def poses(self) -> Array:
        """(trials, n, 3) as estimated."""
        n = self._case.team.count
        return np.array([state[: 3 * n].reshape(n, 3) for state in self._states])

    def commands(self, time: float) -> Array:
        """Return (trials n, 2) m/s, rad/s for the sample that begins at `time` s."""
        columns = self._setup.columns
        found = np.array([np.where(columns >= 0, state[columns], 0.0) for state in self._states])
        law = self._law.commands(time, self.poses, found[..., :2] + found[..., 5:])
        commands = law.reshape(-1, 2)
        self._expected = self._response.follow(commands)
        return np.asarray(commands)

    def estimate(self, step: int, read: Array, poses: Array) -> Array:
        """Return the number of sightings (trials,) by which the estimates were corrected."""
        case, team = self._case, self._case.team
        if case.readings == "commanded":
            read = self._expected.reshape(read.shape)
        counts = np.zeros(case.trials, dtype=int)
        for trial, (motion, true) in enumerate(zip(read, poses, strict=True)):
            state, P = predict_state(
                self._states[trial], self._covariances[trial], *motion.T, self._setup
            )
            bearings, seen = _bearings(team, true)
            drawn = sightings_noise(case.seed, trial, step, *bearings.shape)
            bearings += team.sensors.bearing_sigmas[:, None] * drawn
            for s in np.flatnonzero(seen.ravel()).tolist():
                state, P, _, _ = update_state(state, P, s, float(bearings.ravel()[s]), self._setup)
            self._states[trial], self._covariances[trial] = state, 0.5 * (P + P.T)
            counts[trial] = int(seen.sum())
        return counts


def _all_bearings(team: Team) -> AugmentedSetup:
    """A set-up whose s-th sighting is that of body s mod bodies by vehicle s // bodies."""
    n, bodies = team.count, team.count + len(team.landmarks)
    observers, targets = (one.ravel() for one in np.indices((n, bodies)))
    every = Sightings(np.ones_like(observers), observers, targets, np.zeros_like(observers))
    poses = _setup(team, every, 1, FilterOptions())
    return augmented_setup_of(poses, layout_of(team), team.errors)


def _bearings(team: Team, poses: Array) -> tuple[Array, Flags]:
    """(n, bodies) true bearings rad, and which of them are within range and view."""
    sensors, places = team.sensors, np.concatenate([poses[:, :2], team.landmarks])
    q = places - poses[:, None, :2]
    distances = np.linalg.norm(q, axis=2)
    bearings = np.arctan2(q[..., 1], q[..., 0]) - poses[:, 2:]
    ahead = np.abs(wrap(bearings - sensors.boresights[:, None]))
    seen = (distances <= sensors.ranges[:, None]) & (distances > 0.0)
    return bearings, seen & (ahead <= 0.5 * sensors.fields_of_view[:, None])


def _note(found: Flight, k: int, case: FlightCase, poses: Array, estimates: Array) -> None:
    team = case.team
    places = poses[..., :2]
    found.estimation[k] = estimates[..., :2] - places
    found.tracking[k] = places - position(team.orbits, k * team.sensors.sample_time)
    a, b = np.triu_indices(team.count, 1)
    found.separation[k] = np.linalg.norm(places[:, a] - places[:, b], axis=-1).min(axis=1)


def _check(team: Team) -> None:
    sensors = team.sensors
    plain = (
        np.all(np.isinf(sensors.range_sigmas) & np.isinf(sensors.compass_sigmas))
        and np.all((sensors.every == 1) & (sensors.detection == 1.0))
        and not (team.obstacles or np.any(sensors.bearing_bias_sigmas > 0.0))
    )
    errors = team.errors
    if not plain or errors.speed_scale or errors.turn_rate_bias:
        raise InputError("the cross-checks fly with plain bearings, wind and gusts", key="sensor")
