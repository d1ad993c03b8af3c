"""The navigator: the filter and the guidance of flights one step at a time, as on real robots.

    navigator = Navigator(plan)
    command = navigator.command                       of the first sample
    estimate, command = navigator.step(sensed)        after each sample, until the flight ends

What it is given is what was read; there is no truth in it. It computes as `fly` does, by the same
kernels, for the whole team: run it where all readings come together, and send the commands out.
"""

import io
import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.filters import FILTERS
from syncplan.estimation.lane_filter import lanes_of
from syncplan.estimation.online_filter import Arrived, OnlineFilter
from syncplan.estimation.trial_readings import filter_stream
from syncplan.flight.flight_options import AS_COMMANDED, TRACKING, FlightOptions
from syncplan.flight.flying import flight_run
from syncplan.flight.lane_guidance import winds_of
from syncplan.flight.onboard_data import Command, Estimate, Sensed, TimedSighting
from syncplan.flight.onboard_kernels import carry_ahead, keep_contact, steer
from syncplan.flight.predictive_guidance import Memory, PredictiveGuidance, PredictiveOptions
from syncplan.orbits.circles import heading, position
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.planning.subjects import PlanSubject

__all__ = ["Navigator"]

_NO_ROWS = np.zeros(0, dtype=np.int64)

NOTHING = Arrived(_NO_ROWS, _NO_ROWS, _NO_ROWS, np.zeros(0), np.zeros(0))
"""No sightings."""


@dataclass(slots=True)
class _Pending:
    """A sample whose late sightings may still arrive."""

    speeds: Array
    turn_rates: Array
    sightings: list[TimedSighting] = field(default_factory=list)


class Navigator:
    """A team's filter and guidance on their way.

    Attributes
    ----------
    plan : that is flown
    steps : samples so far
    command : of the next sample
    too_late : sightings that arrived after more than `late` samples, and were not used
    """

    def __init__(
        self,
        subject: PlanSubject,
        *,
        guidance: str = "track",
        filter: str = "auto",
        gate_probability: float | None = None,
        late: int = 0,
        start: Array | None = None,
        seed: int = 0,
    ) -> None:
        """Begin at time 0 at the poses `start` (n, 3), the plan's if None.

        The other arguments are those of syncplan.fly, whose first trial has the numbers that this
        filter draws; `late` is by how many samples sightings may be late. Raises InputError naming
        the argument at fault.
        """
        options = FlightOptions(
            guidance=guidance,
            filter=filter,
            gate_probability=gate_probability,
            seed=seed,
            late=late,
        )
        run = flight_run(subject, options)
        self.plan, self._team = run.plan, run.team
        self._options, orbits = run.options, run.plan.orbits
        n = orbits.count
        begin = np.column_stack([position(orbits, 0.0), heading(orbits, 0.0)])
        if start is not None:
            begin = np.asarray(start, dtype=float)
            if begin.shape != (n, 3) or not np.isfinite(begin).all():
                problem = f"must be {n} poses of x, y and heading, has shape {begin.shape}"
                raise InputError(problem, key="start")
        self._setup = run.team.filter_setup()
        stream = filter_stream(seed, 0)
        self._filter = OnlineFilter(self._setup, begin, FILTERS[run.options.filter], stream)
        self._lanes = lanes_of(n, 1)
        response = run.team.setup.response
        self._bounds = response.least_speeds, response.most_speeds, response.most_turn_rates
        self._moved, self._sought = np.zeros((n, 2, 1)), np.zeros((n, 1), dtype=np.int64)
        self._seen = np.zeros((n, 1), dtype=np.int64)
        self._commands = np.stack([orbits.speeds, orbits.turn_rates], axis=1)[..., None]
        self._slopes = np.empty((12, 1))
        self._variances: list[list[float]] = np.square(run.team.setup.eyes.sigmas).tolist()
        self._bodies = n + len(run.team.team.landmarks)
        self._pending: deque[_Pending] = deque()
        self._predictive: PredictiveGuidance | None = None
        if run.team.setup.law.mode == AS_COMMANDED:
            chosen = PredictiveOptions()
            self._every = max(1, round(chosen.interval / run.team.setup.time))
            self._predictive = PredictiveGuidance(orbits, run.limits, chosen)
        self.steps = self.too_late = 0
        self._steer(*self._filter.lanes)
        self.command = self._command()

    @property
    def time(self) -> float:
        """Time in s since the start."""
        return self.steps * self._team.setup.time

    def step(self, sensed: Sensed) -> tuple[Estimate, Command]:
        """Return where the team is after a sample, and what it does in the next.

        Raises InputError for readings that are not the team's.
        """
        n = len(self._moved)
        before = self._commands[..., 0]
        speeds = _read(sensed.speeds, before[:, 0], "speeds", n)
        turn_rates = _read(sensed.turn_rates, before[:, 1], "turn_rates", n)
        self._pending.append(_Pending(speeds, turn_rates))
        self.steps += 1
        self._sort_in(sensed.sightings)
        late = self._options.late
        while len(self._pending) > late:
            self._take_in(self._pending.popleft())
        x, errors = self._ahead()
        self._steer(x, errors)
        self.command = self._command()
        poses = x[..., 0].copy()
        own = self._filter.lower_covariance[..., 0].diagonal()[: 3 * n]
        sigmas = np.sqrt(own).reshape(n, 3)
        return Estimate(self.time, poses, errors[..., 0].copy(), sigmas), self.command

    def named(
        self, sightings: Iterable[tuple[str, str, str, float] | tuple[str, str, str, float, int]]
    ) -> list[TimedSighting]:
        """Return sightings given by names: ("v1", "v2", "bearing", 0.31), with an age if late.

        The target of a compass is its own vehicle. Raises InputError for a name that nothing has.
        """
        scenario = self.plan.scenario
        bodies = {
            name: k for k, name in enumerate([*scenario.vehicle_names, *scenario.landmark_names])
        }
        kinds = {name: k for k, name in enumerate(SIGHTING_KINDS)}
        found = []
        for observer, target, kind, value, *age in sightings:
            for name, known in ((observer, bodies), (target, bodies), (kind, kinds)):
                if name not in known:
                    problem = f"{name!r} is unknown; known are {', '.join(known)}"
                    raise InputError(problem, key="sightings")
            found.append(TimedSighting(bodies[observer], bodies[target], kinds[kind], value, *age))
        return found

    def save(self) -> bytes:
        """Return all that the navigator goes on from, as bytes."""
        guided = None if self._predictive is None else self._predictive.memory
        late = [(place, *one) for place, of in enumerate(self._pending) for one in of.sightings]
        n = len(self._moved)
        arrays: dict[str, Any] = {
            **{f"filter_{name}": one for name, one in self._filter.memory.items()},
            "counts": np.array([self.steps, self.too_late]),
            "moved": self._moved,
            "sought": self._sought,
            "seen": self._seen,
            "commands": self._commands,
            "pending": np.array([(of.speeds, of.turn_rates) for of in self._pending]).reshape(
                -1, 2, n
            ),
            "late": np.array(late).reshape(-1, 6),
            **(
                {}
                if guided is None
                else {f"guided_{name}": getattr(guided, name) for name in _KEPT}
            ),
        }
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        return buffer.getvalue()

    def restore(self, data: bytes) -> None:
        """Go on where the navigator that was saved did; it must be of the same plan and options.

        Raises InputError for bytes that are no such state.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                kept = {name: stored[name] for name in stored.files}
            begun = {
                name.removeprefix("filter_"): one
                for name, one in kept.items()
                if name.startswith("filter_")
            }
            self._filter.memory = begun
            self.steps, self.too_late = (int(one) for one in kept["counts"])
            self._moved[:], self._sought[:] = kept["moved"], kept["sought"]
            self._seen[:], self._commands[:] = kept["seen"], kept["commands"]
            self._pending = deque(_Pending(*one) for one in kept["pending"])
            for place, *one in kept["late"].tolist():
                observer, target, kind, value, age = one
                sighted = TimedSighting(int(observer), int(target), int(kind), value, int(age))
                self._pending[int(place)].sightings.append(sighted)
            if self._predictive is not None:
                time = float(kept["guided_time"])
                self._predictive.memory = Memory(
                    time, *(kept[f"guided_{name}"] for name in _KEPT[1:])
                )
        except (OSError, EOFError, BadZipFile, ValueError, KeyError, IndexError) as error:
            problem = f"is no state of a navigator of this plan and these options: {error}"
            raise InputError(problem, key="data") from None
        self.command = self._command()

    def _sort_in(self, sightings: Sequence[TimedSighting]) -> None:
        """Put sightings to the samples at whose end they were made."""
        newest, variances, bodies = len(self._pending) - 1, self._variances, self._bodies
        kinds, n = len(variances), len(variances[0])
        for one in sightings:
            observer, target, kind, _, age = one
            known = 0 <= kind < kinds and 0 <= observer < n and 0 <= target < bodies
            if not known or age < 0:
                raise InputError(f"{one}: no such observer, target, kind or age", key="sightings")
            if variances[kind][observer] == math.inf:
                name = self.plan.scenario.vehicle_names[observer]
                problem = f"{name} has no sigma for a {list(SIGHTING_KINDS)[kind]}"
                raise InputError(f"{problem}; give it in the scenario", key="sightings")
            if age > newest:
                self.too_late += 1
            else:
                self._pending[newest - age].sightings.append(one)

    def _take_in(self, sample: _Pending) -> None:
        """Let the filter take in a sample, with its sightings in the order of those of flights."""
        step, arrived = self._filter.steps + 1, NOTHING
        if sample.sightings:
            observers, targets, kinds, values, _ = zip(*sorted(sample.sightings), strict=True)
            variances = [self._variances[k][o] for k, o in zip(kinds, observers, strict=True)]
            arrived = Arrived(
                np.array(observers),
                np.array(targets),
                np.array(kinds),
                np.array(variances),
                np.array(values),
            )
            seen = self._seen[:, 0]
            n = len(seen)
            # one by one: an index of so few takes NumPy longer
            for body in {*observers, *targets}:
                if body < n:
                    seen[body] = step
        self._filter.step(sample.speeds, sample.turn_rates, arrived)
        contact = self._team.setup.contact
        if step % contact.look_every == 0:
            keep_contact(
                contact,
                self._setup.columns,
                self._filter.lower_covariance,
                step,
                self._seen,
                self._moved,
                self._sought,
                self._lanes,
            )

    def _ahead(self) -> tuple[Array, Array]:
        """The estimate now, (n, 3, 1) and (e, 1): the filter's, carried on by what is pending."""
        x, errors = self._filter.lanes
        if not self._pending:
            return x, errors
        speeds = np.array([one.speeds for one in self._pending])[..., None]
        turn_rates = np.array([one.turn_rates for one in self._pending])[..., None]
        return carry_ahead(x, errors, speeds, turn_rates, self._setup, self._slopes, self._lanes)

    def _steer(self, x: Array, errors: Array) -> None:
        """Write the commands of the sample that begins now."""
        flight, time = self._team.setup, self.time
        if flight.law.mode == TRACKING:
            steer(
                flight.circles,
                flight.law,
                self._bounds,
                time,
                x,
                errors,
                self._setup.columns,
                self._moved,
                self._commands,
                self._lanes,
            )
        elif self._predictive is not None and self.steps % self._every == 0:
            winds = winds_of(errors[..., 0], self._setup.columns - 3 * len(x))
            poses, before = np.ascontiguousarray(x[..., 0]), self._commands[..., 0].copy()
            decision = self._predictive.decide(
                time, poses, winds, before, moved=self._moved[..., 0].copy()
            )
            self._commands[..., 0] = decision.commands

    def _command(self) -> Command:
        return Command(self._commands[:, 0, 0].copy(), self._commands[:, 1, 0].copy())


_KEPT = ("time", "known", "flights", "multipliers")
"""What guidance remembers."""


def _read(given: Array | None, commanded: Array, name: str, n: int) -> Array:
    """Readings (n,), the commands where there are none."""
    if given is None:
        return commanded.copy()
    found = np.asarray(given, dtype=float)
    if found.shape != (n,):
        raise InputError(f"must be {n} numbers, has shape {found.shape}", key=name)
    # NaN anywhere makes the sum of squares one
    return np.where(np.isnan(found), commanded, found) if math.isnan(found @ found) else found
