"""Trials of a flight in progress, side by side: the filter's run with the closed loop in it.

A flight is flown in legs. Between them, arrays grow for further sightings, whose number is not
known beforehand. After a loss, anchors are chosen anew from the remaining bodies.

Guidance `mpc` decides for each lane from its own estimates. Decisions are made at the start of a
leg and hold until the next. The estimate is the filter's, propagated with the readings where
sightings arrive late.
"""

from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.estimation import filter_setup
from syncplan.estimation.kernels import Lanes, has_compiled, lanes_of
from syncplan.estimation.lane_filter import LaneRun, scratch_of
from syncplan.estimation.online_filter import with_room
from syncplan.estimation.robust_filter import RobustRun
from syncplan.estimation.trial_readings import filter_stream
from syncplan.guidance.closed_loop import carry_on, fly_lanes, fly_to
from syncplan.guidance.flight_options import AS_COMMANDED
from syncplan.guidance.flight_records import LaneRecords, RecordedSteps
from syncplan.guidance.flight_setup import FlightSetup, Flown
from syncplan.guidance.flown_team import FlownTeam
from syncplan.guidance.predictive_guidance import PredictiveGuidance, PredictiveOptions, Status

# --- guidance mpc ---------------------------------------------------------------------------------


FAR = 1e7
"""Distance in m at which lost vehicles are placed, so that no other has to avoid them."""


class LaneGuidance:
    """Guidance `mpc` of some trials of a flight.

    Attributes
    ----------
    every : samples between decisions
    decisions : number of decisions made
    refused : (n, lanes) number of a vehicle's programs that were not solved
    """

    def __init__(self, team: FlownTeam, lanes: int) -> None:
        options = PredictiveOptions()
        self.every = max(1, round(options.interval / team.setup.time))
        self.decisions = 0
        self.refused = np.zeros((team.team.count, lanes), dtype=np.int64)
        self._guidances = [
            PredictiveGuidance(team.team.orbits, team.limits, options) for _ in range(lanes)
        ]

    def command(
        self,
        flight: FlightSetup,
        flown: Flown,
        x: Array,
        at: int,
        run: filter_setup.FilterRun,
        lanes: Lanes,
    ) -> None:
        """Write the commands of the leg that begins now, from the estimate x at step `at`."""
        step, n = int(flown.places[0]), len(flown.scales)
        setup, slopes = run.setup, np.empty((12, len(lanes)))
        read = run.readings.speeds[at:step], run.readings.turn_rates[at:step]
        carry_on(x, flown.ahead, *read, setup, slopes, lanes)
        mishaps = flight.mishaps
        gone = mishaps.gone_from[:n] <= step
        held = gone | ((mishaps.held_from <= step) & (step < mishaps.held_until)).any(axis=1)
        x = flown.ahead
        places = filter_setup.poses_of(x, n).copy()
        places[gone, :2] = FAR * (1.0 + np.arange(n)[gone])[:, None, None]
        for lane, guidance in enumerate(self._guidances):
            decision = guidance.decide(
                step * flight.time,
                np.ascontiguousarray(places[..., lane]),
                winds_of(x[:, lane], setup.states),
                np.ascontiguousarray(flown.commands[..., lane]),
                held,
                np.ascontiguousarray(flown.moved[..., lane]),
            )
            flown.commands[..., lane] = decision.commands
            self.refused[:, lane] += decision.status == Status.REFUSED
        self.decisions += 1


def winds_of(x: Array, states: filter_setup.States) -> Array:
    """Return the air's velocity (n, 2) m/s at each vehicle from a state (3n + e,): wind and gust.

    Zero where they are not states.
    """
    found = np.zeros((len(states.first) - 1, 2))
    rows = np.flatnonzero(states.acts == filter_setup.DRIFT)
    vehicles = np.searchsorted(states.first, rows, side="right") - 1
    np.add.at(found, (vehicles, states.axes[rows, 0]), x[states.columns[rows]])
    return found


LEG_STEPS = 64
"""Samples in a leg."""

MOST_ROWS = 1_000_000
"""Most sightings to make room for at once."""


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """Filter of lanes that also flies, in place of a LaneFilter.

    Attributes
    ----------
    flight, flown : inputs and state of the closed loop
    """

    flight: FlightSetup
    flown: Flown

    @staticmethod
    def is_compiled() -> bool:
        """Return whether the kernel is in memory or in numba's disk cache."""
        return has_compiled(fly_lanes)

    def advance(
        self, run: filter_setup.FilterRun, state: filter_setup.State, begin: int, end: int
    ) -> None:
        """Advance a state in place from step `begin` to step `end`, flying on the way."""
        n, _, width = run.readings.initial.shape
        scratch, lanes = scratch_of(run.setup, width), lanes_of(n, width)
        fly_lanes(self.flight, self.flown, run, scratch, lanes, *state, begin, end)


@dataclass(slots=True)
class FlownLanes:
    """Trials of a flight in progress.

    Attributes
    ----------
    team : the team that flies
    flown : the truth
    run : the filter's run, which also flies
    guidance : decides at the start of each leg; None where the closed loop has its own law
    records : errors, sigmas and tracks over time; None unless requested
    """

    team: FlownTeam
    flown: Flown
    run: LaneRun
    guidance: LaneGuidance | None = None
    records: LaneRecords | None = None

    @classmethod
    def begun(
        cls, team: FlownTeam, trials: range, statistics: filter_setup.FilterStatistics
    ) -> "FlownLanes":
        """Return trials at time 0."""
        flown, readings, truth = team.begun(trials)
        setup = team.filter_setup()
        loop = ClosedLoop(team.setup_from(0), flown)
        decides = team.setup.law.mode == AS_COMMANDED
        guidance = LaneGuidance(team, len(trials)) if decides else None
        records = _records(team, trials)
        if records is not None:
            records.take(0, filter_setup.start_of(setup, readings), flown.path)
        robust = team.options.filter_model.finds_start
        streams = [filter_stream(team.options.seed, trial) for trial in trials] if robust else []
        given = filter_setup.FilterRun(setup, readings, truth, statistics)
        run = (RobustRun if robust else LaneRun).begun(loop, given, streams)
        return cls(team, flown, run, guidance, records)

    def advance(self, end: int) -> None:
        """Fly until the filter is at step `end`."""
        rows, late = _rows_in_step(self.team), self.team.setup.mishaps.late
        leg = max(1, min(LEG_STEPS, MOST_ROWS // rows))
        if self.guidance is not None:
            leg = self.guidance.every
        # the last step before each loss
        stops = [step - 1 for step in self.team.loss_steps]
        if self.guidance is not None:
            self._fly_ahead(min(late, self.team.steps), rows)
            # a released vehicle needs a decision of its own
            stops += [step - late for step in self.team.hold_ends if step > late]
        while self.run.at < end:
            if self.run.at + 1 in self.team.loss_steps:
                self.run.base = ClosedLoop(self.team.setup_from(self.run.at + 1), self.flown)
            until = min([end, self.run.at + leg, *(s for s in stops if s > self.run.at)])
            self._make_room(rows * (until - self.run.at + late))
            self._decide()
            self._go(until)

    def _go(self, end: int) -> None:
        """Run until step `end`, and record the filter's state on the way."""
        if self.records is not None:
            for step in self.records.stops(self.run.at, end):
                self.run.advance(step)
                self.records.take(step, self.run.state, self.flown.path)
        if self.run.at < end:
            self.run.advance(end)

    def _decide(self) -> None:
        if self.guidance is not None:
            (flight, lanes), run, (x, _) = self._aloft, self.run, self.run.state
            self.guidance.command(flight, self.flown, x, run.at, run.given, lanes)

    def _fly_ahead(self, end: int, rows: int) -> None:
        """Fly until step `end` before the filter starts, as sightings are late."""
        assert self.guidance is not None
        flown, (x, _) = self.flown, self.run.state
        slopes = np.empty((12, x.shape[-1]))
        while flown.places[0] < end:
            step = int(flown.places[0])
            ends = [one for one in self.team.hold_ends if one > step]
            until = min([end, step + self.guidance.every, *ends])
            self._make_room(rows * (until - step))
            self._decide()
            flight, lanes = self._aloft
            fly_to(until, 0, x, flight, flown, self.run.given, slopes, lanes)

    @property
    def _aloft(self) -> tuple[FlightSetup, Lanes]:
        """Present set-up of the closed loop, and lanes."""
        loop = self.run.base
        assert isinstance(loop, ClosedLoop)
        return loop.flight, lanes_of(self.team.team.count, self.readings.initial.shape[-1])

    @property
    def setup(self) -> filter_setup.FilterSetup:
        """The filter's set-up, with the sightings so far."""
        return self.run.setup

    @property
    def readings(self) -> filter_setup.Readings:
        """Readings so far."""
        return self.run.readings

    @property
    def statistics(self) -> filter_setup.FilterStatistics:
        """Statistics of the filter."""
        return self.run.statistics

    def _make_room(self, further: int) -> None:
        """Make room for so many further sightings in set-up and readings."""
        used, have = int(self.flown.places[1]), len(self.readings.sightings)
        if used + further <= have:
            return
        self.run.given = with_room(self.run.given, used, max(used + further, 2 * have))


def _records(team: FlownTeam, trials: range) -> LaneRecords | None:
    if not team.options.with_series:
        return None
    steps = RecordedSteps.of(team.steps, team.setup.time, team.team.orbits.period)
    return LaneRecords.empty(steps, team.team.count, trials)


def _rows_in_step(team: FlownTeam) -> int:
    """Upper bound on the sightings of a step: of each kind by each vehicle, one of every body."""
    n = team.team.count
    kinds = np.isfinite(team.setup.eyes.sigmas)
    return int(kinds.sum()) * (n + len(team.team.landmarks)) or 1
