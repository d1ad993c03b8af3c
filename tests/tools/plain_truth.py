"""How a trial of a flight truly goes, in plain NumPy, written from its description.

The draws of a trial, how vehicles obey, geometry of sight, and random numbers of a sighting by
numpy.random.Philox. `plain_flights` closes the loop.
"""

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from syncplan.arrays import Array, Flags
from syncplan.guidance.flight_events import TimedLoss
from syncplan.orbits.circles import heading, position, unit
from syncplan.orbits.team import Team
from syncplan.planning.plan_flights import FlightRun

BEARING, DISTANCE, COMPASS = range(3)


@dataclass(frozen=True, slots=True)
class Sighting:
    """A sighting: who measures what of whom, and what is read."""

    observer: int
    target: int
    kind: int
    reading: float


def steps_until(time: float, sample_time: float) -> int:
    """Return the first step that is not before a time in s."""
    return math.ceil(time / sample_time - 1e-9)


def planned(team: Team) -> Array:
    """Return the (n, 3) poses of the plan at time 0."""
    return np.column_stack([position(team.orbits, 0.0), heading(team.orbits, 0.0)])


def words(key: NDArray[np.uint64], step: int, observer: int, target: int) -> list[int]:
    """Return the four words of a key (2,) and a counter."""
    before = (step + (observer << 64) + (target << 128) - 1) % 2**256
    generator = np.random.Philox(key=key, counter=before)
    return [int(word) for word in generator.random_raw(4)]


def uniform(word: int) -> float:
    """Return a number in (0, 1): the middle of one of 2^52 equal parts."""
    return ((word >> 12) + 0.5) / 2.0**52


def draws_of(run: FlightRun, trial: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return the standard normal draws of a trial by what they are of, and its lasting errors.

    Errors are in their units: wind (1, 2), gusts (steps + 1, n, 2), bearing walks (steps + 1, n),
    others (n,).
    """
    team, steps, n = run.team.team, run.team.steps, run.team.team.count
    sequence = np.random.SeedSequence(run.options.seed, spawn_key=(trial,))
    generator = np.random.Generator(np.random.PCG64(sequence))
    draws = {
        "poses": generator.standard_normal((n, 3)),
        "speeds": generator.standard_normal((steps, n)),
        "turn_rates": generator.standard_normal((steps, n)),
    }
    shapes: dict[str, tuple[float | Array, tuple[int, ...]]] = {
        "wind": (team.errors.of("wind"), (1, 2)),
        "speed_scale": (team.errors.of("speed_scale"), (n,)),
        "turn_rate_bias": (team.errors.of("turn_rate_bias"), (n,)),
        "bearing_bias": (team.sensors.bearing_bias_sigmas, (n,)),
        "gusts": (team.errors.of("gusts"), (steps + 1, n, 2)),
        "bearing_walk": (team.sensors.bearing_walk_sigmas, (steps + 1, n)),
        "clock_offset": (team.errors.of("clock_offset"), (n,)),
    }
    errors: dict[str, Array] = {}
    for name, (sigma, shape) in shapes.items():
        some = bool(np.any(np.asarray(sigma) > 0.0))
        errors[name] = sigma * generator.standard_normal(shape) if some else np.zeros(shape)
    errors["speed_scale"] = np.maximum(errors["speed_scale"], -0.9)
    for name, time in (
        ("gusts", team.errors.gust_time),
        ("bearing_walk", team.sensors.bearing_walk_times),
    ):
        left, changing = np.exp(-team.sensors.sample_time / time), errors[name]
        for k in range(steps):
            changing[k + 1] = left * changing[k] + np.sqrt(1.0 - left**2) * changing[k + 1]
    if run.options.wind is not None:
        errors["wind"] = np.array([run.options.wind], dtype=float)
    return draws, errors


def hidden_by(corners: Array, a: Array, b: Array) -> bool:
    """Return whether the inside of a polygon (c, 2) is between two places, by GEOS."""
    between = shapely.LineString([a, b])
    return bool(shapely.relate_pattern(shapely.Polygon(corners), between, "T********"))


class PlainTruth:
    """A trial on its way; `flown` samples of it so far.

    Attributes
    ----------
    path : (steps + 1, n, 3) m, m, rad
    speeds, turn_rates : (steps, n) as read
    commands : (steps, n, 2) m/s, rad/s, within limits
    saturated : (steps, n) whether a command was at a limit, and not for a hold
    sightings : of each step
    seen : (steps + 1, n) whether a vehicle was in a sighting
    response_mean : (n, 2) m/s, rad/s, mean of what commands make of vehicles in the last sample
    """

    def __init__(self, run: FlightRun, trial: int) -> None:
        self.run, self.team = run, run.team.team
        steps, n, noise = run.team.steps, self.team.count, self.team.noise
        self.draws, self.errors = draws_of(run, trial)
        sequence = np.random.SeedSequence(run.options.seed, spawn_key=(trial, 2))
        self.key: NDArray[np.uint64] = sequence.generate_state(2, np.uint64)  # type: ignore[assignment]
        self.path = np.zeros((steps + 1, n, 3))
        sigmas = np.array([noise.position_sigma, noise.position_sigma, noise.heading_sigma])
        self.path[0] = planned(self.team) - sigmas * self.draws["poses"]
        self.speeds, self.turn_rates = np.zeros((steps, n)), np.zeros((steps, n))
        self.commands, self.saturated = np.zeros((steps, n, 2)), np.zeros((steps, n), dtype=bool)
        self.response = np.column_stack([self.team.orbits.speeds, self.team.orbits.turn_rates])
        self.response_mean = self.response
        self.sightings: list[list[Sighting]] = [[] for _ in range(steps + 1)]
        self.seen: Flags = np.zeros((steps + 1, n), dtype=bool)
        self.flown = 0

    def last_seen(self, vehicle: int, by: int) -> int:
        """Return the step of the last sighting of, or by, a vehicle up to a step; 0 before any."""
        found = np.flatnonzero(self.seen[: by + 1, vehicle])
        return int(found[-1]) if len(found) else 0

    def lost(self, step: int) -> list[TimedLoss]:
        """Return what is lost by a step."""
        time = self.team.sensors.sample_time
        return [one for one in self.run.events.losses if steps_until(one.time, time) <= step]

    def gone(self, body: int, step: int) -> bool:
        """Return whether a body takes no part any more."""
        n = self.team.count
        if body < n:
            return any(body in one.loss.vehicles for one in self.lost(step))
        return any(body - n in one.loss.landmarks for one in self.lost(step))

    def fly(self, wanted: Array) -> None:
        """Fly a sample by commands (n, 2), and look around at its end."""
        done = self.obey(wanted) + self.disturbance
        v = done[:, 0] * (1.0 + self.errors["speed_scale"])
        w = done[:, 1] + self.errors["turn_rate_bias"]
        now, time = self.path[self.flown], self.team.sensors.sample_time
        self.arrive(after_arcs(now, np.column_stack([v, w]), self.air, time), done)

    @property
    def air(self) -> Array:
        """(n, 2) m/s, wind and gusts in the sample that begins."""
        return np.asarray(self.errors["wind"] + self.errors["gusts"][self.flown])

    @property
    def disturbance(self) -> Array:
        """(n, 2) m/s, rad/s by which vehicles fly more than they respond in the sample that begins.

        Noise is on what they read where that is measured, and on what they fly where it is not.
        """
        return np.zeros_like(self._noise) if self._measured else -self._noise

    def obey(self, wanted: Array) -> Array:
        """Return the mean response (n, 2) of vehicles to commands (n, 2), m/s, rad/s."""
        self.response_mean = np.array([self._obeyed(i, one) for i, one in enumerate(wanted)])
        return self.response_mean

    def arrive(self, poses: Array, done: Array) -> None:
        """End the sample at poses (n, 3) after what was done in it (n, 2), and look around."""
        read = done + self._noise if self._measured else self.response_mean
        self.speeds[self.flown], self.turn_rates[self.flown] = read.T
        self.flown += 1
        self.path[self.flown] = poses
        self._look(self.flown)

    @property
    def _noise(self) -> Array:
        noise, k = self.team.noise, self.flown
        speeds, turn_rates = self.draws["speeds"][k], self.draws["turn_rates"][k]
        return np.column_stack([noise.speed_sigma * speeds, noise.turn_rate_sigma * turn_rates])

    @property
    def _measured(self) -> bool:
        return self.run.plan.scenario.motion.readings == "measured"

    def _obeyed(self, i: int, wanted: Array) -> Array:
        """The mean response (2,) of a vehicle over a sample, in m/s and rad/s."""
        k, time, limits = self.flown, self.team.sensors.sample_time, self.run.limits
        least, most = limits.least_speeds[i], limits.most_speeds[i]
        turn, lag = limits.most_turn_rates[i], self.run.plan.scenario.motion.lag_s or 0.0
        held = False
        for hold in self.run.events.holds:
            begin, end = (steps_until(at, time) for at in (hold.time, hold.time + hold.length))
            if hold.vehicle == i and begin <= k < end:
                wanted, held = np.array([least, turn if least > 0.0 else 0.0]), True
        command = np.clip(wanted, [least, -turn], [most, turn])
        range_ = np.array([most - least, 2.0 * turn])
        beside = np.minimum(command - [least, -turn], [most, turn] - command)
        self.saturated[k, i] = not held and bool(np.any(beside <= 1e-3 * range_))
        self.commands[k, i] = command
        off, left = self.response[i] - command, math.exp(-time / lag) if lag > 0.0 else 0.0
        self.response[i] = command + left * off
        return np.asarray(command + lag / time * (1.0 - left) * off)

    def in_sight(self, o: int, t: int, step: int) -> bool:
        """Return whether a body is in range, in view and not hidden."""
        sensors, here = self.team.sensors, self.path[step, o, :2]
        away = self.place(t, step) - here
        if np.hypot(*away) > sensors.ranges[o]:
            return False
        ahead = np.arctan2(away[1], away[0]) - self.path[step, o, 2] - sensors.boresights[o]
        if abs((ahead + np.pi) % (2.0 * np.pi) - np.pi) > 0.5 * sensors.fields_of_view[o]:
            return False
        return not any(hidden_by(one, here, here + away) for one in self.team.obstacles)

    def place(self, body: int, step: int) -> Array:
        """Return where a body is, (2,) m."""
        n = self.team.count
        found = self.path[step, body, :2] if body < n else self.team.landmarks[body - n]
        return np.asarray(found)

    def _look(self, step: int) -> None:
        """Make the sightings of a step, in order of observer, target and kind."""
        n, landmarks = self.team.count, len(self.team.landmarks)
        for o in (one for one in range(n) if not self.gone(one, step)):
            blind = any(o in one.loss.sensors for one in self.lost(step))
            lost = {kind for one in self.lost(step) for kind, of in one.loss.kinds if of == o}
            for t in range(n + landmarks):
                if t != o and (blind or self.gone(t, step) or not self.in_sight(o, t, step)):
                    continue
                kinds = (COMPASS,) if t == o else (BEARING, DISTANCE)
                due = [kind for kind in kinds if kind not in lost and self._is_due(kind, o, step)]
                if due:
                    self._read(o, t, due, step)

    def _is_due(self, kind: int, o: int, step: int) -> bool:
        sensors = self.team.sensors
        sigma = (sensors.bearing_sigmas, sensors.range_sigmas, sensors.compass_sigmas)[kind][o]
        every = (sensors.compass_every if kind == COMPASS else sensors.every)[o]
        return bool(np.isfinite(sigma) and step % every == 0)

    def _read(self, o: int, t: int, due: list[int], step: int) -> None:
        sensors, options = self.team.sensors, self.run.options
        drawn = words(self.key, step, o, t)
        radius = math.sqrt(-2.0 * math.log(uniform(drawn[0])))
        angle, psi = 2.0 * math.pi * uniform(drawn[1]), self.path[step, o, 2]
        if t == o:
            psi = self._later(o, o, step)[2]
            reading = psi + sensors.compass_sigmas[o] * radius * math.cos(angle)
            self.sightings[step].append(Sighting(o, o, COMPASS, float(reading)))
            return
        if not uniform(drawn[2]) < sensors.detection[o] * (1.0 - options.dropout):
            return
        chance, where = (drawn[3] >> 32) / 2.0**32, ((drawn[3] % 2**32) + 0.5) / 2.0**32
        shown = t
        if options.outliers <= chance < options.outliers + options.mistaken:
            shown = self._mistaken_for(o, t, step)
        psi = self._later(o, o, step)[2]
        away = self._later(shown, o, step)[:2] - self._later(o, o, step)[:2]
        ahead = math.atan2(away[1], away[0]) - psi
        if chance < options.outliers:
            half = min(0.5 * sensors.fields_of_view[o], math.pi)
            ahead = sensors.boresights[o] + (2.0 * where - 1.0) * half
        ahead += self.errors["bearing_bias"][o] + self.errors["bearing_walk"][step, o]
        readings = {BEARING: ahead + sensors.bearing_sigmas[o] * radius * math.cos(angle)}
        if DISTANCE in due:
            readings[DISTANCE] = np.hypot(*away) + sensors.range_sigmas[o] * radius * math.sin(
                angle
            )
        self.sightings[step] += [Sighting(o, t, kind, float(readings[kind])) for kind in due]
        self.seen[step, [body for body in (o, t) if body < self.team.count]] = True

    def _later(self, body: int, o: int, step: int) -> Array:
        """A body's pose when vehicle o's clock shows the time of a step."""
        if body >= self.team.count:
            return np.append(self.place(body, step), 0.0)
        before, now = self.path[step - 1, body], self.path[step, body]
        samples = self.errors["clock_offset"][o] / self.team.sensors.sample_time
        gone, turn = now - before, 0.5 * (1.0 + samples) * (now[2] - before[2])
        turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        return np.append(now[:2] + samples * turned @ gone[:2], now[2] + samples * gone[2])

    def _mistaken_for(self, o: int, t: int, step: int) -> int:
        """The next vehicle, by number, that is in sight too; the target itself if there is none."""
        n = self.team.count
        others = [(t + ahead) % n for ahead in range(1, n)]
        for other in others:
            if other not in (o, t) and not self.gone(other, step) and self.in_sight(o, other, step):
                return other
        return t


def after_arcs(poses: Array, commands: Array, air: Array, time: float) -> Array:
    """Return the poses (n, 3) at the end of arcs in moving air (n, 2) or (2,) m/s.

    `commands` (n, 2) are m/s, rad/s.
    """
    turns = time * commands[:, 1]
    chords = time * commands[:, 0] * np.sinc(0.5 * turns / np.pi)
    ways = chords[:, None] * unit(poses[:, 2] + 0.5 * turns) + time * air
    return np.column_stack([poses[:, :2] + ways, poses[:, 2] + turns])
