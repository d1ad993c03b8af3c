"""Validations and flights of a plan: Monte Carlo runs of its filter.

In flights the filter steers the vehicles: in closed loop, in wind, with losses.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, Strict

from api.documents import loaded_plan
from api.job_kinds.job_kind import (
    JobKind,
    JobReport,
    JobSpec,
    JobSubject,
    TrialMethod,
    TrialProgress,
    TrialTask,
)
from api.job_kinds.option_requests import SUBSTEPS, TRUTH, TrialRequest, our_keys, takes_options
from api.limits import RequestLimits, check_flights, check_trials
from syncplan.estimation.filter_options import ValidationOptions
from syncplan.estimation.trials import pack, unpack
from syncplan.guidance.flight_events import events_of
from syncplan.guidance.flight_options import GUIDANCES, FlightOptions
from syncplan.guidance.flight_results import pack_flight, unpack_flight
from syncplan.planning.filter_choice import asked_filter
from syncplan.planning.plan_files import Loaded, plan_of
from syncplan.planning.validation import TrialRun, Validation, conclude, run_part, trial_run
from syncplan.planning.variations import joined_worlds, stress_runs, stress_worlds
from syncplan.reports.flight_report import FlightDocument, flight_document
from syncplan.reports.validation_report import (
    ValidationDocument,
    stress_document,
    validation_document,
)
from syncplan.runtime.files import as_text

if TYPE_CHECKING:
    from syncplan.planning.plan_flights import Flight, FlightRun


# --- validations ----------------------------------------------------------------------------------


@takes_options(ValidationOptions, substeps=SUBSTEPS, truth=TRUTH)
class ValidationRequest(TrialRequest):
    """A Monte Carlo run of the filter on a plan."""

    def run_options(self) -> ValidationOptions:
        """Return the options of the trials."""
        return ValidationOptions.of_request(self.model_dump(exclude_none=True))

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of trials in all worlds; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        world = self.in_world(scenario)
        options = self.run_options()
        trials = options.trials * (1 + len(stress_worlds(world)) if options.stress else 1)
        check_trials(trials, scenario.size, limits)
        return trials


def _validation_computed(run: TrialRun, first: int, trials: int, progress: TrialProgress) -> bytes:
    return pack(run_part(run, first, trials, threads=1, progress=progress))


def _validation_concluded(run: TrialRun, parts: Sequence[bytes]) -> Validation:
    return conclude(run, [unpack(one) for one in parts])


FILTER_TRIALS: TrialMethod[TrialRun, Validation] = TrialMethod(
    _validation_computed,
    _validation_concluded,
    # samples and sightings of a trial
    effort=lambda run: run.steps + len(run.sightings.observers),
)


@lru_cache(maxsize=2)
def _validation_runs(spec: JobSpec) -> list[TrialRun]:
    assert spec.plan is not None
    options = ValidationOptions.of_request(json.loads(spec.request))
    plan = plan_of(loaded_plan(spec.plan))
    if options.stress:
        return list(stress_runs(plan, options).values())
    return [trial_run(plan, options)]


def _validation_report(spec: JobSpec, concluded: Sequence[Validation]) -> JobReport:
    nominal, *others = concluded
    if others:
        worlds = ["", *stress_worlds(nominal.plan.scenario)]
        report = stress_document(joined_worlds(worlds, concluded))
    else:
        report = validation_document(nominal)
    return JobReport(as_text(report.as_json()), trials=pack(nominal.result))


VALIDATION = JobKind(
    name="validation",
    unit="trials",
    request=ValidationRequest,
    operation="validatePlan",
    summary="Validate a plan",
    description="Fly a plan many times with the filter: a job that reports errors and consistency.",
    body="How to fly; defaults if empty",
    about="plan",
    task=TrialTask(runs=_validation_runs, method=FILTER_TRIALS, report=_validation_report),
    report=ValidationDocument,
    figures="run",
    keeps_trials=True,
)


# --- flights --------------------------------------------------------------------------------------

MOST_EVENTS = 1000

Speed = Annotated[float, Field(ge=-1000, le=1000)]
Velocity = Annotated[tuple[Speed, Speed], Strict(False)]
Event = Annotated[str, Field(min_length=1, max_length=200)]
Events = Annotated[list[Event], Field(max_length=MOST_EVENTS)]


@takes_options(
    FlightOptions,
    without=("model",),
    substeps=SUBSTEPS,
    truth=TRUTH,
    lose=Events,
    hold=Events,
    wind=Velocity | None,
)
class FlightRequest(TrialRequest):
    """Flights of a plan in closed loop."""

    def run_options(self) -> FlightOptions:
        """Return the options of the flights."""
        return FlightOptions.of_request(self.model_dump(exclude_none=True))

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of flights; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        options = self.run_options()
        length, guidance = self.length(scenario), GUIDANCES[options.guidance]
        check_flights(options.trials, scenario, length, guidance, limits)
        # a filter that can't fly and events that can't happen are refused too
        with our_keys(FlightOptions):
            choice = asked_filter(scenario, options)
            if choice is not None:
                replace(options, filter=choice.name)
            events_of(options, scenario, length)
        return options.trials


@lru_cache(maxsize=2)
def _flight_runs(spec: JobSpec) -> "list[FlightRun]":
    from syncplan.flight.flying import flight_run

    assert spec.plan is not None
    options = FlightOptions.of_request(json.loads(spec.request))
    return [flight_run(plan_of(loaded_plan(spec.plan)), options)]


def _flight_computed(run: "FlightRun", first: int, trials: int, progress: TrialProgress) -> bytes:
    from syncplan.planning.plan_flights import fly_part

    return pack_flight(fly_part(run, first, trials, threads=1, progress=progress))


def _flight_concluded(run: "FlightRun", parts: Sequence[bytes]) -> "Flight":
    from syncplan.planning.plan_flights import conclude_flight

    return conclude_flight(run, [unpack_flight(one) for one in parts])


def _flight_report(_: JobSpec, concluded: "Sequence[Flight]") -> JobReport:
    (flight,) = concluded
    return JobReport(as_text(flight_document(flight).as_json()), trials=pack_flight(flight.result))


FLIGHT = JobKind(
    name="flight",
    unit="trials",
    request=FlightRequest,
    operation="flyPlan",
    summary="Fly a plan",
    description="Fly a plan many times in closed loop, by vehicles that steer by their own "
    "estimates, in wind, with losses: a job that reports errors, separation and meetings kept.",
    body="How to fly, and what goes wrong; defaults if empty",
    about="plan",
    task=TrialTask(
        runs=_flight_runs,
        # samples of a flight
        method=TrialMethod(_flight_computed, _flight_concluded, lambda run: run.team.steps),
        report=_flight_report,
    ),
    report=FlightDocument,
    figures="flight",
    keeps_trials=True,
)
