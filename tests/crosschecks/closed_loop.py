"""Vehicles that steer by what a filter in plain NumPy estimates, on any plant.

What a trial is drawn is that of syncplan.flight, so that `fly`, this loop with unicycles and this
loop with somebody else's vehicles fly under the same noise. That of a bearing is a function of
trial, step, observer and target: two plants that see different things still read the same noise
where both see the same.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syncplan.arrays import Array, Flags
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.estimation.filter_setup import FilterSetup
from syncplan.estimation.montecarlo import setup_along
from syncplan.estimation.reference_filter import (
    covariance_at_start,
    predict_state,
    update_state,
)
from syncplan.flight.flight_setup import Flown
from syncplan.flight.flown_team import FlownTeam
from syncplan.orbits.circles import wrap
from syncplan.orbits.error_states import layout_of
from syncplan.orbits.sightings import Sightings
from syncplan.orbits.team import Team
from tests.crosschecks.plants import MakePlant
from tests.crosschecks.tracking import TrackingLaw, moved_circles
from tests.crosschecks.unicycle_team import Response

__all__ = ["Flight", "fly", "normal_of"]


@dataclass(frozen=True, slots=True)
class Flight:
    """What came of some trials.

    Attributes
    ----------
    path : (steps + 1, trials, n, 3) m, m, rad, as flown
    estimates : (steps + 1, trials, n, 3) m, m, rad
    sightings : (trials,) number
    """

    path: Array
    estimates: Array
    sightings: Array


def normal_of(key: NDArray[Any], step: int, observer: int, target: int) -> float:
    """Return the standard normal number of a bearing in the trial of a key (2,), at a step >= 1."""
    counter = [step - 1, observer, target, 0]
    words = np.random.Philox(key=key.astype(np.uint64), counter=counter).random_raw(2)
    u, v = ((float(word >> np.uint64(11)) + 0.5) * 2.0**-53 for word in words)
    return math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v)


def fly(flown: FlownTeam, trials: int, lag: float, make: MakePlant) -> Flight:
    """Return the first trials of a team as a plant flies them, which the filter takes to `lag` s.

    Raises InputError where a team has more than cameras, or more lasting errors than wind.
    """
    _check(flown.team)
    drawn, readings, _ = flown.begun(range(trials))
    setup, n, steps = flown.setup, flown.team.count, flown.steps
    first = np.moveaxis(drawn.path[0], -1, 0)
    path, estimates = np.empty((2, steps + 1, trials, n, 3))
    path[0], estimates[0] = first, np.moveaxis(readings.initial, -1, 0)
    pilots = _Pilots(flown, drawn, estimates[0], lag)
    plan = np.tile(
        np.column_stack([flown.team.orbits.speeds, flown.team.orbits.turn_rates]), (trials, 1)
    )
    plant = make(first.reshape(-1, 3), plan, _air(drawn, 0, n, trials), setup.time)
    sigmas = [setup.response.speed_sigma, setup.response.turn_rate_sigma]
    counts, measured = np.zeros(trials), setup.response.measured
    for k in range(steps):
        noise = np.stack([drawn.speed_noise[k].T, drawn.turn_noise[k].T], axis=-1) * sigmas
        commands = pilots.commands(k)
        # noise is on what is read, or what is done falls short of what is read by it
        short = np.zeros_like(plan) if measured else -noise.reshape(-1, 2)
        done = plant.fly(commands, _air(drawn, k, n, trials), short)
        path[k + 1] = done.poses.reshape(trials, n, 3)
        read = done.means.reshape(noise.shape) + noise if measured else pilots.expected
        counts += pilots.estimate(k + 1, read, path[k + 1])
        estimates[k + 1] = pilots.poses
    return Flight(path, estimates, counts)


class _Pilots:
    """The filters of all trials, and the law that steers by them."""

    def __init__(self, flown: FlownTeam, drawn: Flown, poses: Array, lag: float) -> None:
        self._flown, self._keys, self._law = flown, drawn.keys, _law_of(flown)
        self._setup = _every_bearing(flown.team)
        further = np.zeros(len(flown.layout.sigmas))
        self._states = np.array([np.concatenate([one.ravel(), further]) for one in poses])
        self._covariances = [covariance_at_start(self._setup) for _ in poses]
        self._moved = np.zeros_like(poses[..., :2])
        self._last = np.zeros(poses.shape[:2], dtype=np.int64)
        orbits = flown.team.orbits
        plan = np.tile(np.column_stack([orbits.speeds, orbits.turn_rates]), (len(poses), 1, 1))
        self._response, self.expected = Response(plan, lag, flown.setup.time), plan

    @property
    def poses(self) -> Array:
        """(trials, n, 3) as estimated."""
        n = self._flown.team.count
        return self._states[:, : 3 * n].reshape(-1, n, 3)

    def commands(self, step: int) -> Array:
        """Return (trials n, 2) m/s, rad/s for the sample that begins at a step."""
        columns, time = self._flown.layout.columns, step * self._flown.setup.time
        wind = np.zeros((*self.poses.shape[:2], 2))
        for own in (columns[name] for name in ("wind", "gusts") if name in columns):
            wind += np.where(own >= 0, self._states[:, own], 0.0)
        commands = self._law.commands(time, self.poses, wind, self._moved)
        self.expected = self._response.follow(commands)
        return commands.reshape(-1, 2)

    def estimate(self, step: int, motion: Array, true: Array) -> Array:
        """Return the number of sightings (trials,) by which the estimates were corrected."""
        sensors, contact = self._flown.team.sensors, self._flown.setup.contact
        counts = np.zeros(len(motion))
        for trial, poses in enumerate(true):
            state, P = self._states[trial], self._covariances[trial]
            speeds, turn_rates = motion[trial].T
            state, P = predict_state(state, P, speeds, turn_rates, self._setup)
            bearings, seen = _bearings(self._flown.team, poses)
            for o, t in np.argwhere(seen).tolist():
                noise = sensors.bearing_sigmas[o] * normal_of(self._keys[trial], step, o, t)
                s = o * bearings.shape[1] + t
                state, P, _, _ = update_state(
                    state, P, s, float(bearings[o, t] + noise), self._setup
                )
            self._states[trial], self._covariances[trial] = state, 0.5 * (P + P.T)
            counts[trial] = seen.sum()
            together = seen.any(axis=1) | seen[:, : len(seen)].any(axis=0)
            self._last[trial][together] = step
            if step % contact.look_every == 0:
                unseen = step - self._last[trial]
                self._moved[trial] = moved_circles(contact, self._flown.layout, P, unseen)
        return counts


def _law_of(flown: FlownTeam) -> TrackingLaw:
    law, vehicles = flown.setup.law, flown.setup.response
    turns = vehicles.most_turn_rates
    return TrackingLaw(
        orbits=flown.team.orbits,
        place_gain=law.place_gain,
        heading_gain=law.heading_gain,
        closing=law.closing_speeds,
        least=np.column_stack([vehicles.least_speeds, -turns]),
        most=np.column_stack([vehicles.most_speeds, turns]),
    )


def _air(drawn: Flown, step: int, n: int, trials: int) -> Array:
    """(trials n, 2) m/s, wind and gusts in the sample that begins at a step."""
    air = drawn.drift[min(step, len(drawn.drift) - 1)]
    return np.broadcast_to(np.moveaxis(air, -1, 0), (trials, n, 2)).reshape(-1, 2)


def _every_bearing(team: Team) -> FilterSetup:
    """A set-up whose s-th sighting is that of body s mod bodies by vehicle s // bodies."""
    n, bodies = team.count, team.count + len(team.landmarks)
    observers, targets = (one.ravel() for one in np.indices((n, bodies)))
    every = Sightings(np.ones_like(observers), observers, targets, np.zeros_like(observers))
    return setup_along(team, layout_of(team), every, 1, FilterOptions())


def _bearings(team: Team, poses: Array) -> tuple[Array, Flags]:
    """(n, bodies) true bearings rad, and which of them are within range and view."""
    sensors, places = team.sensors, np.concatenate([poses[:, :2], team.landmarks])
    q = places - poses[:, None, :2]
    distances = np.linalg.norm(q, axis=2)
    bearings = np.arctan2(q[..., 1], q[..., 0]) - poses[:, 2:]
    ahead = np.abs(wrap(bearings - sensors.boresights[:, None]))
    seen = (distances <= sensors.ranges[:, None]) & (ahead <= 0.5 * sensors.fields_of_view[:, None])
    np.fill_diagonal(seen, False)
    return bearings, seen


def _check(team: Team) -> None:
    sensors, errors = team.sensors, team.errors
    plain = (
        np.all(np.isinf(sensors.range_sigmas) & np.isinf(sensors.compass_sigmas))
        and np.all((sensors.every == 1) & (sensors.detection == 1.0))
        and not (team.obstacles or np.any(sensors.bearing_bias_sigmas > 0.0))
    )
    if not plain or errors.of("speed_scale") or errors.of("turn_rate_bias"):
        raise InputError("the cross-checks fly with plain bearings, wind and gusts", key="sensor")
