"""Flights of a plan: set-up, results, and the record that its verdict takes into account."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.documents import finite_or_none
from syncplan.estimation.consistency import (
    Consistency,
    anees,
    coverage,
    interval_of_rms,
    nis,
)
from syncplan.estimation.divided_runs import RunOfTrials
from syncplan.estimation.filter_options import steps_in_run
from syncplan.estimation.filter_setup import judged_from
from syncplan.estimation.trials import (
    Accuracy,
    TrialErrors,
    accuracy,
    check_whole,
    trial_errors,
)
from syncplan.guidance.flight_events import FlightEvents, events_of
from syncplan.guidance.flight_options import DEFAULT_GATE, FlightOptions
from syncplan.guidance.flight_results import (
    FlightResult,
    joined_flights,
    pack_flight,
    unpack_flight,
)
from syncplan.guidance.flight_setup import FlightLimits, FlownWorld
from syncplan.guidance.flights import fly_trials
from syncplan.guidance.flown_figures import Meetings, meetings_of
from syncplan.guidance.flown_team import FlownTeam, team_in_flight
from syncplan.orbits.contacts import find_windows
from syncplan.planning.filter_choice import FilterChoice
from syncplan.planning.judged_team import (
    PlanVerdict,
    bound_is_affordable,
    expected_in_world,
    separation_limit,
)
from syncplan.planning.plan_records import (
    FlownPlan,
    MeetingsFlown,
    PhasesFlown,
    flight_digest,
)
from syncplan.planning.plans import Plan
from syncplan.planning.share_test import share_of
from syncplan.results.result import Result
from syncplan.runtime.machine import single_threaded_blas

LOST_FACTOR = 5.0
"""Multiple of its bound above which a vehicle's error means that the filter is lost."""

OUT_OF_CONTACT_PERIODS = 2.0
"""Periods without a sighting after which a vehicle is out of contact."""


@dataclass(frozen=True, slots=True)
class FlightRun(RunOfTrials):
    """Set-up of a flight, whose trials can be flown in parts.

    Attributes
    ----------
    plan : the plan that is flown
    duration : s
    options : those of `fly`, with the filter chosen
    chosen_because : reason for this filter
    limits : of the vehicles
    team : set-up that all trials share
    """

    plan: Plan
    duration: float
    options: FlightOptions
    chosen_because: str
    limits: FlightLimits
    team: FlownTeam

    pack = staticmethod(pack_flight)
    unpack = staticmethod(unpack_flight)

    @property
    def effort(self) -> float:
        """Number of samples of a flight."""
        return float(self.team.steps)

    @single_threaded_blas
    def part(
        self,
        first_trial: int,
        trials: int,
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> FlightResult:
        """Return `trials` flights from `first_trial` on, a multiple of CHUNK_TRIALS."""
        return fly_trials(self.team, first_trial, trials, threads=threads, progress=progress)

    @single_threaded_blas
    def concluded(self, parts: Sequence[FlightResult]) -> "Flight":
        """Return the flight from all parts, in order."""
        result = joined_flights(parts)
        check_whole(result.estimates, self.trials, self.team.present[-1])
        return Flight.of(self, result)

    @property
    def happenings(self) -> list[str]:
        """Events, faults of sightings and wind of the flight, in words."""
        return [*self.events.sentences, *self.options.conditions]

    @property
    def events(self) -> FlightEvents:
        """Losses and holds of the flight."""
        return self.team.events


@dataclass(frozen=True, slots=True, repr=False)
class Flight(Result):
    """Result of many flights of a plan, in closed loop.

    Attributes
    ----------
    run : set-up of the flights
    result : figures of each trial
    accuracy : RMS errors of the estimates by vehicle, against the truth as flown
    bound : (n,) m, of the bound along the paths flown, over the second half; NaN for a vehicle that
        is gone by then
    coverage : (n,) share of coordinates within three sigma
    anees, nis : consistency figures, with intervals from the spread over trials
    """

    run: FlightRun
    result: FlightResult
    accuracy: Accuracy
    bound: Array
    coverage: Array
    anees: Consistency
    nis: Consistency

    @classmethod
    def of(cls, run: FlightRun, result: FlightResult) -> Self:
        """Return the flights of a run from their figures; some filters may have broken down."""
        estimates, gate = result.estimates, run.options.gate_probability
        return cls(
            run=run,
            result=result,
            accuracy=accuracy(estimates),
            bound=np.sqrt(result.figures.bound_squares.mean(axis=0)),
            coverage=coverage(estimates.covered.mean(axis=0), estimates.coverage_samples),
            anees=anees(estimates.nees, 3 * run.plan.team.count),
            nis=nis(estimates.nis_sums, estimates.accepted, gate),
        )

    def __repr__(self) -> str:
        """Return one line: plan, number of trials, duration and main figures."""
        tracking = float(np.sqrt(np.nanmean(self.result.figures.tracking_squares)))
        return (
            f"<{type(self).__name__} of {self.run.plan!r}: {self.result.trials} trials over "
            f"{self.run.duration:.4g} s, {tracking:.3g} m off the plan, "
            f"{100.0 * float(self.filter_lost.mean()):.3g} % lost>"
        )

    @property
    def plan(self) -> Plan:
        """The plan that was flown, with the record of this flight."""
        return replace(self.run.plan, flight=self.record, unflown="")

    @property
    def observable(self) -> bool:
        """Whether the plan is observable."""
        return self.run.plan.observable

    @property
    def verdict(self) -> PlanVerdict:
        """The plan's verdict, with the record of this flight."""
        return self.plan.verdict

    @property
    def record(self) -> FlownPlan:
        """Record of the flight that a plan's verdict takes into account."""
        figures, options = self.result.figures, self.run.options
        apart = figures.separations
        known = bool(np.isfinite(apart).all())
        lost, away = share_of(self.filter_lost), share_of(self.out_of_contact)
        close = share_of(self.too_close) if known and self.least_distance > 0.0 else None
        late = self.trial_errors.late_squares[:, self.there].mean(axis=1)
        record = FlownPlan(
            trials=self.result.trials,
            seed=self.result.estimates.seed,
            duration_s=self.run.duration,
            guidance=options.guidance,
            filter=options.filter,
            gate_probability=options.gate_probability,
            chosen_because=self.run.chosen_because,
            events=list(self.run.happenings),
            filter_lost_share=lost[0],
            filter_lost_interval=lost[1],
            out_of_contact_share=away[0],
            out_of_contact_interval=away[1],
            least_separation_m=(float(np.median(apart)), float(apart.min())) if known else None,
            too_close_share=None if close is None else close[0],
            too_close_interval=None if close is None else close[1],
            vehicles=[self._flown(k) for k in np.flatnonzero(self.there) if self.whole.any()],
            meetings_kept=self._pairs,
            saturated_share=float(figures.saturated.mean()),
            rms_m=_root_mean(late) if self.whole.all() else None,
            rms_interval_m=interval_of_rms(late) if self.whole.all() else None,
            anees=finite_or_none(self.anees.value),
            anees_interval=None if np.isnan(self.anees.band[0]) else self.anees.band,
        )
        plan = self.run.plan
        return record.model_copy(
            update={"digest": flight_digest(plan.scenario, plan.orbits, record)}
        )

    @property
    def _pairs(self) -> list[MeetingsFlown]:
        scenario, figures = self.run.plan.scenario, self.result.figures
        names = [*scenario.vehicle_names, *scenario.landmark_names]
        planned, kept = figures.planned_meetings.tolist(), figures.kept_meetings.mean(axis=0)
        return [
            MeetingsFlown(
                between=(names[a], names[b]), meetings=times, kept_share=float(kept[k] / times)
            )
            for k, ((a, b), times) in enumerate(
                zip(self.meetings.pairs.tolist(), planned, strict=True)
            )
            if times
        ]

    def _flown(self, k: np.integer[Any]) -> PhasesFlown:
        """Figures of a vehicle over the flights whose filters did not break down."""
        figures, late, whole = (
            self.result.figures,
            self.trial_errors.late_squares[:, k],
            self.whole,
        )
        return PhasesFlown(
            name=self.run.plan.scenario.vehicle_names[k],
            phase_rms_s=_root_mean(figures.phase_squares[whole, k]),
            phase_worst_s=float(figures.worst_phases[whole, k].max()),
            tracking_rms_m=_root_mean(figures.tracking_squares[whole, k]),
            speed_mps=(
                float(figures.slowest[whole, k].min()),
                float(figures.fastest[whole, k].max()),
            ),
            rms_m=_root_mean(late) if whole.all() else None,
            rms_interval_m=interval_of_rms(late) if whole.all() else None,
            bound_rms_m=_root_mean(figures.bound_squares[whole, k]),
        )

    @property
    def judged_from(self) -> float:
        """Time in s from which ANEES, NIS and coverage count."""
        run, time = self.run, self.run.plan.sensors.sample_time
        return judged_from(run.team.steps, time, self.run.plan.orbits.period, run.options) * time

    @property
    def predicted(self) -> Array | None:
        """(n,) m, the plan's own prediction; None if the duration is not the plan's."""
        same = self.run.duration == self.run.plan.scenario.duration_s
        return self.run.plan.prediction.rms if same else None

    @property
    def there(self) -> Flags:
        """(n,) whether a vehicle takes part to the end."""
        return np.asarray(self.run.team.present[-1])

    @property
    def meetings(self) -> Meetings:
        """Planned meetings of the flight."""
        plan, steps = self.run.plan, self.run.team.steps
        return meetings_of(plan.windows, plan.sensors.sample_time, plan.orbits.period, steps)

    @property
    def expected(self) -> Array | None:
        """(n,) m, expected RMS error of the filter in the true world, along the circles.

        None where the scenario has no truth, or the errors are not computed.
        """
        plan, true = self.run.plan, self.run.team.true_team
        if true is plan.team or not bound_is_affordable(plan.team, self.run.duration):
            return None
        return expected_in_world(plan.team, true, find_windows(true), self.run.duration)

    @property
    def trial_errors(self) -> TrialErrors:
        """Errors of each flight."""
        return trial_errors(self.result.estimates)

    @property
    def whole(self) -> Flags:
        """(trials,) whether no filter of a vehicle that is there to the end broke down."""
        return np.asarray(np.isfinite(self.trial_errors.late_squares[:, self.there]).all(axis=1))

    @property
    def filter_lost(self) -> Flags:
        """(trials,) whether a vehicle's error, second half, is over LOST_FACTOR times its bound.

        The bound is the one along the vehicle's true path. A filter that broke down is lost too.
        """
        bound = self.result.figures.bound_squares
        far = (self.trial_errors.late_squares > LOST_FACTOR**2 * bound).any(axis=1)
        return np.asarray(far | ~self.whole)

    @property
    def out_of_contact(self) -> Flags:
        """(trials,) whether a vehicle had no sighting for over OUT_OF_CONTACT_PERIODS."""
        longest = self.result.figures.longest_unseen
        limit = OUT_OF_CONTACT_PERIODS * self.run.plan.orbits.period
        return np.asarray((longest > limit).any(axis=1))

    @property
    def too_close(self) -> Flags:
        """(trials,) whether two vehicles came nearer than allowed."""
        return np.asarray(self.result.figures.separations < self.least_distance)

    @property
    def least_distance(self) -> float:
        """Least distance in m that the verdict allows between two vehicles; 0 for none."""
        plan = self.run.plan
        return separation_limit(plan.scenario).least(plan.orbits.radii)

    @property
    def failed(self) -> Flags:
        """(trials, 3) whether a flight was lost, out of contact, or too close."""
        return np.stack([self.filter_lost, self.out_of_contact, self.too_close], axis=1)


def _root_mean(squares: Array) -> float:
    return float(np.sqrt(squares.mean()))


def set_up_flight(plan: Plan, options: FlightOptions, choice: FilterChoice) -> FlightRun:
    """Return the set-up of a plan's flights with a filter; raises InputError for an option."""
    scenario, true = plan.scenario, plan.scenario.in_truth
    duration = scenario.duration_s if options.duration is None else options.duration
    steps = steps_in_run(duration, plan.sensors.sample_time, plan.orbits.period, plan.team.count)
    chosen = replace(options, filter=choice.name)
    if chosen.gate_probability is None and plan.true_team.sensors.false_bearings.any():
        chosen = replace(chosen, gate_probability=DEFAULT_GATE)
    limits = FlightLimits.of(scenario, plan.orbits)
    world = FlownWorld(
        plan.true_team,
        limits if true is scenario else FlightLimits.of(true, plan.orbits),
        true.motion.lag_s or 0.0,
        true.motion.readings == "measured",
    )
    team = team_in_flight(
        plan.team,
        plan.windows,
        limits,
        world,
        steps,
        chosen,
        events_of(chosen, scenario, duration),
        scenario.motion.lag_s or 0.0,
    )
    return FlightRun(plan, duration, chosen, choice.reason, limits, team)
