"""Set-up and readings of a pilot's trials, with samples thinned out.

A pilot keeps the last of every m samples, with the noise of a mean of m samples,

    bearings   sigma / sqrt(m)        speed and turn-rate readings   sigma / sqrt(m)

and likewise for other sightings. Where sightings come at intervals or may be missed, m is the
expected number made. Lasting errors are left out.

Trial k draws from SeedSequence(seed, spawn_key=(k,)): initial pose, speeds, turn rates, sightings.
"""

from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.orbits.circles import heading, position
from syncplan.orbits.contacts import Windows
from syncplan.orbits.sighting_kinds import measured_by_kind, sigmas_by_kind
from syncplan.orbits.sightings import Sightings, sample_sightings, steps_within
from syncplan.orbits.team import Team

INSTANTS_A_TURN = 32
"""Least number of samples per period in a pilot."""


def thinned(team: Team, instants: int = INSTANTS_A_TURN) -> Team:
    """Return the team with as few samples per period as possible, but at least `instants`."""
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


@dataclass(frozen=True, slots=True)
class PilotReadings:
    """Common set-up of a pilot's trials, and their readings.

    Attributes
    ----------
    team : with samples already thinned out
    sightings : at k = 1..steps
    first : (steps + 2,) index of the first sighting of each sample
    places : (steps + 1, n + m, 2) m, true positions of vehicles and landmarks
    variances : (s,) of sightings, in their kind's unit squared
    spread : (3,) m, m, rad, standard deviations of the initial pose
    initial : (trials, n, 3) m, m, rad
    speeds, turn_rates : (steps, trials, n) m/s, rad/s
    measured : (trials, s) in the unit of each kind
    """

    team: Team
    sightings: Sightings
    first: Index
    places: Array
    variances: Array
    spread: Array
    initial: Array
    speeds: Array
    turn_rates: Array
    measured: Array

    @classmethod
    def drawn(
        cls, team: Team, windows: Windows, duration: float, trials: int, seed: int
    ) -> "PilotReadings":
        """Return readings of `trials` runs of `duration` s."""
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
            variances=sigmas**2,
            spread=spread,
            initial=start + spread * poses.reshape(trials, n, 3),
            speeds=read(orbits.speeds, noise.speed_sigma, speeds),
            turn_rates=read(orbits.turn_rates, noise.turn_rate_sigma, rates),
            measured=true + sigmas * errors,
        )

    @property
    def steps(self) -> int:
        """Number of samples."""
        return len(self.speeds)

    def with_landmarks(self, vehicles: Array) -> Array:
        """Return places (..., n + m, 2) m of all bodies, from those of the vehicles."""
        landmarks = self.team.landmarks
        fixed = np.broadcast_to(landmarks, (*vehicles.shape[:-2], *landmarks.shape))
        return np.concatenate([vehicles, fixed], axis=-2)


def _draws(trials: int, seed: int, size: int) -> Array:
    """Standard normal numbers (trials, size), each trial's from its own generator."""
    return np.stack(
        [
            np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(k,))).standard_normal(
                size
            )
            for k in range(trials)
        ]
    )
