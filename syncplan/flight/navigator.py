"""Navigator: filter and guidance of flights one step at a time, for real robots.

    navigator = Navigator(plan)
    command = navigator.command                       of the first sample
    estimate, command = navigator.step(sensed)        after each sample, until the flight ends

It takes readings only, without ground truth. It computes as `fly` does, with the same kernels, for
the whole team: run it where all readings come together, and send the commands out.
"""

import hashlib
import io
from collections.abc import Iterable
from functools import cached_property
from typing import Any
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.estimation.correction_kernels import correction_of
from syncplan.estimation.filter_setup import COMPASS_KIND, poses_of
from syncplan.estimation.kernels import lanes_of
from syncplan.estimation.online_filter import Arrived, OnlineFilter
from syncplan.estimation.trial_readings import filter_stream
from syncplan.flight.flying import flight_run
from syncplan.flight.onboard_data import (
    Arrivals,
    Command,
    Estimate,
    SampleRead,
    Sensed,
    TimedSighting,
)
from syncplan.guidance.closed_loop import carry_on
from syncplan.guidance.flight_options import AS_COMMANDED, TRACKING, FlightOptions
from syncplan.guidance.flown_lanes import winds_of
from syncplan.guidance.predictive_guidance import Memory, PredictiveGuidance, PredictiveOptions
from syncplan.guidance.tracking_law import move_circles, steer
from syncplan.orbits.circles import heading, position
from syncplan.orbits.sighting_kinds import SIGHTING_KINDS
from syncplan.planning.plan_files import PlanSubject
from syncplan.scenario.filters import FILTERS


class Navigator:
    """Filter and guidance of a team, one step at a time.

    Attributes
    ----------
    plan : the plan that is flown
    steps : number of samples so far
    command : commands for the next sample
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

        The other arguments are those of syncplan.fly, whose first trial has the random numbers that
        this filter draws. `late` is the number of samples by which sightings may be late. Raises
        InputError naming the argument at fault.
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
        size = len(self._setup.initial_variances)
        self._work = correction_of(self._setup.states, size, 1)
        limits = run.limits
        self._bounds = (
            np.array(limits.least_speeds, dtype=float),
            np.array(limits.most_speeds, dtype=float),
            np.array(limits.most_turn_rates, dtype=float),
        )
        self._moved, self._sought = np.zeros((n, 2, 1)), np.zeros((n, 1), dtype=np.int64)
        self._heard = np.zeros((n, 1), dtype=np.int64)
        self._commands = np.stack([orbits.speeds, orbits.turn_rates], axis=1)[..., None]
        self._slopes = np.empty((12, 1))
        self._arrivals = Arrivals(run.team, run.plan.scenario.vehicle_names)
        self._predictive: PredictiveGuidance | None = None
        if run.team.setup.law.mode == AS_COMMANDED:
            chosen = PredictiveOptions()
            self._every = max(1, round(chosen.interval / run.team.setup.time))
            self._predictive = PredictiveGuidance(orbits, run.limits, chosen)
        self.steps = 0
        self._steer(self._filter.state[0])
        self.command = self._command()

    @property
    def time(self) -> float:
        """Time in s since the start."""
        return self.steps * self._team.setup.time

    @property
    def too_late(self) -> int:
        """Number of sightings that arrived more than `late` samples late and were not used."""
        return self._arrivals.too_late

    def step(self, sensed: Sensed) -> tuple[Estimate, Command]:
        """Process a sample; return the estimate at its end and the commands for the next.

        Raises InputError for readings that do not fit the team.
        """
        n, arrivals = len(self._moved), self._arrivals
        arrivals.take(sensed, self._commands[..., 0])
        self.steps += 1
        while len(arrivals) > self._options.late:
            self._take_in(*arrivals.oldest())
        x = self._ahead()
        self._steer(x)
        self.command = self._command()
        poses, errors = poses_of(x, n)[..., 0].copy(), x[3 * n :, 0].copy()
        own = self._filter.state[1][..., 0].diagonal()[: 3 * n]
        sigmas = np.sqrt(own).reshape(n, 3)
        return Estimate(self.time, poses, errors, sigmas), self.command

    def named(
        self, sightings: Iterable[tuple[str, str, str, float] | tuple[str, str, str, float, int]]
    ) -> list[TimedSighting]:
        """Return sightings given by names: ("v1", "v2", "bearing", 0.31), with an age if late.

        The target of a compass is its own vehicle. Raises InputError for an unknown name.
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
        """Return the state of the navigator as bytes, for `restore`."""
        guided = None if self._predictive is None else self._predictive.memory
        arrays: dict[str, Any] = {
            **{f"filter_{name}": one for name, one in self._filter.memory.items()},
            **self._arrivals.memory,
            "of": np.array(self._digest),
            "steps": np.array(self.steps),
            "moved": self._moved,
            "sought": self._sought,
            "heard": self._heard,
            "commands": self._commands,
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
        """Continue from the state of a saved navigator, which must have the same plan and options.

        Raises InputError for other bytes, and then keeps its present state.
        """
        before = self.save()
        try:
            self._resume(data)
        except (OSError, EOFError, BadZipFile, ValueError, KeyError, IndexError) as error:
            self._resume(before)
            raise InputError(f"is not a saved state of a navigator: {error}", key="data") from None

    def _resume(self, data: bytes) -> None:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            kept = {name: stored[name] for name in stored.files}
        if str(kept["of"]) != self._digest:
            raise InputError("was saved with another plan or other options", key="data")
        own = "filter_"
        self._filter.memory = {
            name.removeprefix(own): one for name, one in kept.items() if name.startswith(own)
        }
        self._arrivals.memory = kept
        self.steps = int(kept["steps"])
        self._moved[:], self._sought[:] = kept["moved"], kept["sought"]
        self._heard[:], self._commands[:] = kept["heard"], kept["commands"]
        if self._predictive is not None:
            time = float(kept["guided_time"])
            self._predictive.memory = Memory(time, *(kept[f"guided_{name}"] for name in _KEPT[1:]))
        self.command = self._command()

    @cached_property
    def _digest(self) -> str:
        """Digest of the plan and of all options that a state depends on."""
        plan, one = self.plan, self._options
        options = one.guidance, one.filter, one.gate_probability, one.seed, one.late
        found = hashlib.sha256(f"{plan.scenario.model_dump_json()} {options}".encode())
        for part in (
            plan.orbits.centers,
            plan.orbits.radii,
            plan.orbits.senses,
            plan.orbits.phases,
        ):
            found.update(np.ascontiguousarray(part, dtype=float).tobytes())
        return found.hexdigest()

    def _take_in(self, sample: SampleRead, arrived: Arrived) -> None:
        """Process a sample with the filter."""
        step, heard = self._filter.steps + 1, self._heard[:, 0]
        n = len(heard)
        # one by one: with so few, NumPy indexing is slower
        for observer, target, kind, *_ in sample.sightings:
            if kind != COMPASS_KIND:
                heard[observer] = step
                if target < n:
                    heard[target] = step
        self._filter.step(sample.speeds, sample.turn_rates, arrived)
        contact = self._team.setup.contact
        if step % contact.look_every == 0:
            move_circles(
                contact,
                self._setup.states,
                self._filter.state[1],
                step,
                self._heard,
                self._moved,
                self._sought,
                self._work,
                self._lanes,
            )

    def _ahead(self) -> Array:
        """Present estimate (3n + e, 1): the filter's, propagated with later readings."""
        x, _ = self._filter.state
        if not len(self._arrivals):
            return x
        speeds, turn_rates = (one[..., None] for one in self._arrivals.readings)
        ahead = np.empty_like(x)
        carry_on(x, ahead, speeds, turn_rates, self._setup, self._slopes, self._lanes)
        return ahead

    def _steer(self, x: Array) -> None:
        """Write the commands of the sample that begins now."""
        flight, time = self._team.setup, self.time
        if flight.law.mode == TRACKING:
            steer(
                flight.circles,
                flight.law,
                time,
                x,
                self._bounds,
                self._setup.states,
                self._moved,
                self._commands,
                self._lanes,
            )
        elif self._predictive is not None and self.steps % self._every == 0:
            winds, n = winds_of(x[:, 0], self._setup.states), len(self._moved)
            poses, before = poses_of(x, n)[..., 0].copy(), self._commands[..., 0].copy()
            decision = self._predictive.decide(
                time, poses, winds, before, moved=self._moved[..., 0].copy()
            )
            self._commands[..., 0] = decision.commands

    def _command(self) -> Command:
        return Command(self._commands[:, 0, 0].copy(), self._commands[:, 1, 0].copy())


_KEPT = ("time", "known", "flights", "multipliers")
"""Fields of the Memory of guidance, as saved."""
