"""Flights of a plan: many trials in closed loop, and their results."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from syncplan.arrays import Array, Flags
from syncplan.estimation.consistency import Consistency, anees, coverage, nis
from syncplan.estimation.filter_options import steps_in_run
from syncplan.estimation.filter_setup import judged_from
from syncplan.estimation.trials import Accuracy, accuracy, check_whole
from syncplan.guidance.flight_events import FlightEvents, events_of
from syncplan.guidance.flight_options import FlightOptions
from syncplan.guidance.flight_results import FlightResult, joined_flights
from syncplan.guidance.flight_setup import FlightLimits, FlownWorld
from syncplan.guidance.flights import fly_trials
from syncplan.guidance.flown_figures import Meetings, meetings_of
from syncplan.guidance.flown_team import FlownTeam, team_in_flight
from syncplan.orbits.contacts import find_windows
from syncplan.planning.judged_team import expected_in_world
from syncplan.planning.plan_files import PlanSubject, in_world, planned
from syncplan.planning.plan_records import FlownPlan, MeetingsFlown, PhasesFlown
from syncplan.planning.planner import Plan, bound_is_affordable
from syncplan.planning.validation import FilterChoice, asked_filter
from syncplan.results import Result
from syncplan.runtime.machine import single_threaded_blas

LOST_FACTOR = 5.0
"""Multiple of its bound above which a vehicle's error means that the filter is lost."""

OUT_OF_CONTACT_PERIODS = 2.0
"""Periods without a sighting after which a vehicle is out of contact."""

ROBUST_IN_FLIGHT = FilterChoice(
    "robust", "vehicles that steer by a lost filter are lost too; robust looks for its start"
)


@dataclass(frozen=True, slots=True)
class FlightRun:
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

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.options.trials

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
    expected : (n,) m, expected RMS error of the filter in the true world, along the circles; None
        where the scenario has no truth, or not computed
    coverage : (n,) share of coordinates within three sigma
    anees, nis : consistency figures, with intervals from the spread over trials
    """

    run: FlightRun
    result: FlightResult
    accuracy: Accuracy
    bound: Array
    expected: Array | None
    coverage: Array
    anees: Consistency
    nis: Consistency

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
        return replace(self.run.plan, flight=self.record)

    @property
    def record(self) -> FlownPlan:
        """Record of the flight that a plan's verdict takes into account."""
        figures, asked = self.result.figures, self.run.limits.separation
        apart, options = figures.separations, self.run.options
        known = bool(np.isfinite(apart).all())
        return FlownPlan(
            trials=self.result.trials,
            seed=self.result.estimates.seed,
            duration_s=self.run.duration,
            guidance=options.guidance,
            filter=options.filter,
            events=list(self.run.happenings),
            filter_lost_share=float(self.filter_lost.mean()),
            out_of_contact_share=float(self.out_of_contact.mean()),
            least_separation_m=(float(np.median(apart)), float(apart.min())) if known else None,
            too_close_share=float(np.mean(apart < asked)) if known and asked > 0.0 else None,
            vehicles=[self._flown(k) for k in np.flatnonzero(self.there).tolist()],
            meetings_kept=self._pairs,
            saturated_share=float(figures.saturated.mean()),
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

    def _flown(self, k: int) -> PhasesFlown:
        figures = self.result.figures
        return PhasesFlown(
            name=self.run.plan.scenario.vehicle_names[k],
            phase_rms_s=float(np.sqrt(figures.phase_squares[:, k].mean())),
            phase_worst_s=float(figures.worst_phases[:, k].max()),
            tracking_rms_m=float(np.sqrt(figures.tracking_squares[:, k].mean())),
            speed_mps=(float(figures.slowest[:, k].min()), float(figures.fastest[:, k].max())),
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
    def filter_lost(self) -> Flags:
        """(trials,) whether a vehicle's error, second half, is over LOST_FACTOR times its bound.

        The bound is the one along the vehicle's true path.
        """
        late = self.result.estimates.late_mean_squares
        bound = self.result.figures.bound_squares
        return np.asarray((late[..., 0] + late[..., 1] > LOST_FACTOR**2 * bound).any(axis=1))

    @property
    def out_of_contact(self) -> Flags:
        """(trials,) whether a vehicle had no sighting for over OUT_OF_CONTACT_PERIODS."""
        longest = self.result.figures.longest_unseen
        limit = OUT_OF_CONTACT_PERIODS * self.run.plan.orbits.period
        return np.asarray((longest > limit).any(axis=1))


def fly(
    subject: PlanSubject,
    options: FlightOptions | None = None,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    **changes: Any,
) -> Flight:
    """Fly a plan many times, with vehicles that steer by their own estimates.

    Give `options`, or changes of it by name: trials=100, seed=0, duration=None (s, the
    scenario's), guidance="track" (or "mpc", or "none" for open loop), filter="auto" (the
    scenario's, or robust), gate_probability=None, with_series=False. Faults and disturbances are
    truth=None (keys of the simulated world, beside those of the scenario's truth),
    lose=("v3@60",), hold=("v2@100:20",), dropout=0, outliers=0, mistaken=0, late=0 and wind=None
    (m/s; drawn by the scenario's sigma). The same seed gives the same bytes on any number of
    threads. `progress` is called with the number of trials done. Raises InputError naming the
    argument at fault.
    """
    run = flight_run(subject, options, **changes)
    return conclude_flight(run, [fly_part(run, 0, run.trials, threads=threads, progress=progress)])


def flight_run(
    subject: PlanSubject, options: FlightOptions | None = None, **changes: Any
) -> FlightRun:
    """Return the set-up of a flight; fly_part flies its parts, conclude_flight joins them."""
    chosen = replace(options or FlightOptions(), **changes)
    plan = in_world(planned(subject, pilot=False), chosen.truth)
    scenario, true = plan.scenario, plan.scenario.in_truth
    duration = scenario.duration_s if chosen.duration is None else chosen.duration
    steps = steps_in_run(duration, plan.sensors.sample_time, plan.orbits.period, plan.team.count)
    choice = asked_filter(scenario, chosen) or ROBUST_IN_FLIGHT
    chosen = replace(chosen, filter=choice.name)
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


@single_threaded_blas
def fly_part(
    run: FlightRun,
    first_trial: int,
    trials: int,
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> FlightResult:
    """Return `trials` trials of a flight from `first_trial` on, a multiple of CHUNK_TRIALS."""
    return fly_trials(run.team, first_trial, trials, threads=threads, progress=progress)


@single_threaded_blas
def conclude_flight(run: FlightRun, parts: Sequence[FlightResult]) -> Flight:
    """Return the flight from all parts of a run, in order.

    The bytes do not depend on the division into parts. Raises InputError where parts are missing,
    and NoSolutionError where the filter diverged.
    """
    result = joined_flights(parts)
    found, gate = result.estimates, run.options.gate_probability
    check_whole(found, run.trials, run.team.present[-1])
    return Flight(
        run=run,
        result=result,
        accuracy=accuracy(found),
        bound=np.sqrt(result.figures.bound_squares.mean(axis=0)),
        expected=_expected(run),
        coverage=coverage(found.covered.mean(axis=0), found.coverage_samples),
        anees=anees(found.nees, 3 * run.plan.team.count),
        nis=nis(found.nis_sums, found.accepted, gate),
    )


def _expected(run: FlightRun) -> Array | None:
    """Expected errors of the estimates in a differing true world, along circles flown exactly."""
    plan, true = run.plan, run.team.true_team
    if true is plan.team or not bound_is_affordable(plan.team, run.duration):
        return None
    return expected_in_world(plan.team, true, find_windows(true), run.duration)
