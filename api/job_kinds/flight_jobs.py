"""Flights: a plan flown many times in closed loop, in wind, with losses."""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, Strict

from api.documents import loaded_plan
from api.job_kinds.job_kind import (
    JobKind,
    JobOperation,
    JobReport,
    JobSpec,
    JobSubject,
    TrialMethod,
    TrialProgress,
    TrialTask,
)
from api.job_kinds.option_requests import (
    SUBSTEPS,
    TRUTH,
    TrialRequest,
    our_keys,
    takes_options,
)
from api.limits import RequestLimits, check_flights
from syncplan.flight.flight_events import events_of
from syncplan.flight.flight_options import GUIDANCES, FlightOptions
from syncplan.planning.plan_files import Loaded
from syncplan.planning.validation import asked_filter
from syncplan.reports.flight_report import FlightDocument
from syncplan.scenario.specification import Scenario

if TYPE_CHECKING:
    from syncplan.flight.flying import Flight, FlightRun

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
        """Return the number of trials; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        options = self.run_options()
        length, guidance = self.length(scenario), GUIDANCES[options.guidance]
        check_flights(options.trials, scenario, length, guidance, limits)
        self._check_events(options, scenario)
        return options.trials

    def _check_events(self, options: FlightOptions, scenario: Scenario) -> None:
        """Raise InputError for a filter that can't fly, and for events that can't happen."""
        with our_keys(FlightOptions):
            choice = asked_filter(scenario, options)
            if choice is not None:
                replace(options, filter=choice.name)
            events_of(options, scenario, self.length(scenario))


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> "list[FlightRun]":
    from syncplan.flight.flying import flight_run
    from syncplan.planning.plan_files import plan_of

    assert spec.plan is not None
    options = FlightOptions.of_request(json.loads(spec.request))
    return [flight_run(plan_of(loaded_plan(spec.plan), pilot=False), options)]


def _computed(run: "FlightRun", first: int, trials: int, progress: TrialProgress) -> bytes:
    from syncplan.flight.flight_archive import pack_flight
    from syncplan.flight.flying import fly_part

    return pack_flight(fly_part(run, first, trials, threads=1, progress=progress))


def _concluded(run: "FlightRun", parts: Sequence[bytes]) -> "Flight":
    from syncplan.flight.flight_archive import unpack_flight
    from syncplan.flight.flying import conclude_flight

    return conclude_flight(run, [unpack_flight(one) for one in parts])


def _effort(run: "FlightRun") -> float:
    """Samples of a flight."""
    return run.team.steps


def _report(_: JobSpec, concluded: "Sequence[Flight]") -> JobReport:
    from syncplan.flight.flight_archive import pack_flight
    from syncplan.reports.flight_report import flight_document
    from syncplan.runtime.files import as_text

    (flight,) = concluded
    return JobReport(as_text(flight_document(flight).as_json()), trials=pack_flight(flight.result))


FLIGHT = JobKind(
    name="flight",
    title="flight",
    plural="flights",
    unit="trials",
    request=FlightRequest,
    operation=JobOperation(
        id="flyPlan",
        path="/plans/{plan_id}/flights",
        summary="Fly a plan",
        description="Fly a plan many times in closed loop, by vehicles that steer by their own "
        "estimates, in wind, with losses: a job that reports errors, separation and meetings kept.",
        body="How to fly, and what goes wrong; defaults if empty",
        body_required=False,
    ),
    task=TrialTask(runs=_runs, method=TrialMethod(_computed, _concluded, _effort), report=_report),
    report=FlightDocument,
    figures="flight",
    keeps_trials=True,
)
