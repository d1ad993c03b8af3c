"""Flights by perfect estimates: exact arcs at samples of 0.1 s, in steady wind, with a hold."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.guidance.flight_setup import FlightLimits
from syncplan.guidance.predictive_guidance import Decision, PredictiveGuidance
from syncplan.guidance.reference_tracking import tracking_commands, tracking_gains
from syncplan.orbits.circles import Orbits, perpendicular, phase, position, unit, wrap
from tests.tools.on_paper import plan
from tests.tools.plain_truth import after_arcs
from tests.tools.scenarios import example

SAMPLE = 0.1

Guidance = Callable[[float, Array, Array, Flags], Array]
"""Commands (n, 2) from time in s, poses (n, 3), the commands before (n, 2) and who is held (n,)."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Vehicle `vehicle` is held at `time` s for `length` s."""

    vehicle: int
    time: float
    length: float

    def holds(self, time: float) -> bool:
        """Return whether it is held at `time` s."""
        return self.time - 1e-6 <= time < self.time + self.length - 1e-6


@dataclass(frozen=True, slots=True)
class Flight:
    """What was flown: `times` (k,) s, `poses` (k, n, 3), `commands` (k - 1, n, 2)."""

    orbits: Orbits
    times: Array
    poses: Array
    commands: Array

    def off(self) -> Array:
        """(k, n) m from the plan's places."""
        return np.asarray(
            np.hypot(*np.moveaxis(self.poses[..., :2] - position(self.orbits, self.times), -1, 0))
        )

    def phase_errors(self) -> Array:
        """(k, n) s: the angle about the centre that is off, over the rate."""
        away = self.poses[..., :2] - self.orbits.centers
        angles = np.arctan2(away[..., 1], away[..., 0])
        return wrap(angles - phase(self.orbits, self.times)) / self.orbits.rate

    def back_after(self, hold: Hold, tolerance: float = 1.0) -> float:
        """S from the end of a hold until the phase error stays within `tolerance` s."""
        late = np.abs(self.phase_errors()[:, hold.vehicle]) > tolerance
        return float(self.times[np.flatnonzero(late)[-1] + 1] - hold.time - hold.length)

    def least_separation(self) -> float:
        """M between the two vehicles that come nearest."""
        a, b = np.triu_indices(self.orbits.count, 1)
        apart = self.poses[:, a, :2] - self.poses[:, b, :2]
        return float(np.hypot(*np.moveaxis(apart, -1, 0)).min())


def paper_grid() -> tuple[Orbits, FlightLimits]:
    """The plan of paper-grid-same and its limits in flight, at least 10 m apart."""
    made = plan(example("paper-grid-same"))
    limits = FlightLimits.of(made.scenario, made.team.orbits)
    return made.team.orbits, replace(limits, separation=10.0)


def narrow(limits: FlightLimits, least: float, most: float, turn: float) -> FlightLimits:
    """The limits with speeds of `least` to `most` m/s and turn rates of up to `turn` rad/s."""
    ones = np.ones(len(limits.most_speeds))
    return replace(
        limits, least_speeds=least * ones, most_speeds=most * ones, most_turn_rates=turn * ones
    )


def at_start(orbits: Orbits, time: float, wind: Array) -> Array:
    """(n, 3) poses of vehicles that keep their circles over ground in a wind."""
    turns = orbits.senses * orbits.rate * orbits.radii
    air = turns[:, None] * perpendicular(unit(phase(orbits, time))) - wind
    return np.column_stack([position(orbits, time), np.arctan2(air[:, 1], air[:, 0])])


def fly(
    orbits: Orbits,
    limits: FlightLimits,
    guidance: Guidance,
    samples: int,
    begin: float,
    end: float,
    hold: Hold | None = None,
    wind: Array | None = None,
    start: Array | None = None,
) -> Flight:
    """Return a flight; commands change every so many `samples`.

    It begins at poses `start` (n, 3), by default the right ones.
    """
    blow = np.zeros(2) if wind is None else wind
    poses = at_start(orbits, begin, blow) if start is None else start
    before = np.column_stack([orbits.speeds, orbits.turn_rates])
    path, done = [poses], []
    commands = before
    for k in range(round((end - begin) / SAMPLE)):
        time, held = begin + k * SAMPLE, np.zeros(orbits.count, dtype=np.bool_)
        if hold is not None:
            held[hold.vehicle] = hold.holds(time)
        if k % samples == 0:
            commands = guidance(time, poses, before, held)
        still = np.stack([limits.least_speeds, limits.most_turn_rates], axis=-1)
        still[limits.least_speeds == 0.0, 1] = 0.0
        before = np.where(held[:, None], still, commands)
        poses = after_arcs(poses, before, blow, SAMPLE)
        path.append(poses)
        done.append(before)
    times = begin + SAMPLE * np.arange(len(path))
    return Flight(orbits, np.asarray(times, dtype=float), np.array(path), np.array(done))


def tracking(orbits: Orbits, limits: FlightLimits, wind: Array | None = None) -> Guidance:
    """Guidance `track`, which knows the wind."""
    gains = tracking_gains(orbits, limits)
    winds = np.tile(np.zeros(2) if wind is None else wind, (orbits.count, 1))

    def guide(time: float, poses: Array, before: Array, held: Flags) -> Array:
        return tracking_commands(orbits, limits, gains, time, poses, winds)

    return guide


Seen = Callable[[Decision, Array, Array], None]
"""Looks at a decision, the poses (n, 3) and the commands before (n, 2)."""


def predictive(
    guidance: PredictiveGuidance, wind: Array | None = None, seen: Seen | None = None
) -> Guidance:
    """Guidance `mpc`, which knows the wind; `seen` is shown each decision."""
    blow = np.zeros(2) if wind is None else wind

    def guide(time: float, poses: Array, before: Array, held: Flags) -> Array:
        found = guidance.decide(time, poses, np.tile(blow, (len(poses), 1)), before, held)
        if seen is not None:
            seen(found, poses, before)
        return found.commands

    return guide
