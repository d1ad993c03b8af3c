"""Flights: a plan flown many times in closed loop, in wind, with losses."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, Strict

from api.documents import loaded_plan
from api.job_kinds.filter_requests import FilterRequest, our_keys
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
from api.limits import RequestLimits, check_flights
from syncplan.estimation.filters import FlightFilterChoice
from syncplan.flight.flight_events import events_of
from syncplan.flight.flight_options import (
    DEFAULT_GATE,
    GUIDANCES,
    MOST_LATE,
    FlightOptions,
    GuidanceChoice,
)
from syncplan.planning.plan_files import Loaded
from syncplan.planning.validation import asked_filter
from syncplan.reports.flight_schemas import FlightDocument
from syncplan.scenario.specification import Scenario

if TYPE_CHECKING:
    from syncplan.flight.flying import Flight, FlightRun

MOST_EVENTS = 1000

USUAL = FlightOptions()

Share = Annotated[float, Field(ge=0, lt=1)]
Speed = Annotated[float, Field(ge=-1000, le=1000)]
Velocity = Annotated[tuple[Speed, Speed], Strict(False)]
Event = Annotated[str, Field(min_length=1, max_length=200)]
Events = Annotated[list[Event], Field(max_length=MOST_EVENTS)]


class FlightRequest(FilterRequest):
    """Flights of a plan in closed loop."""

    trials: Annotated[int, Field(ge=1)] = Field(
        default=USUAL.trials, description="Number of flights", examples=[100]
    )
    filter: FlightFilterChoice = Field(
        default=USUAL.filter,
        description="The filter. auto is the scenario's filter.kind, or robust where it has none",
    )
    substeps: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=USUAL.substeps, description="Euler sub-steps per sample"
    )
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        default=None,
        description="Probability of the innovation gate; if not given, no gate, or "
        f"{DEFAULT_GATE:g} where bearings may be false",
        examples=[0.999],
    )
    guidance: GuidanceChoice = Field(
        default=USUAL.guidance,
        description="How vehicles steer. "
        + " ".join(f"{name}: {one.sentence}" for name, one in GUIDANCES.items()),
    )
    lose: Events = Field(
        default=[],
        description="What is lost, and when in s: a vehicle (v3@60), its sensor (sensor:v3@60) or "
        "a landmark (L1@60)",
        examples=[["v2@30"]],
    )
    hold: Events = Field(
        default=[],
        description="Vehicles that are held: v2@100:20, from 100 s on for 20 s. They stand still "
        "in the air, or circle where speed has a least, and drift with the wind",
        examples=[["v1@20:5"]],
    )
    dropout: Share = Field(
        default=USUAL.dropout, description="Share of sightings that are lost on their way"
    )
    outliers: Share = Field(
        default=USUAL.outliers, description="Share of bearings that are false, anywhere in view"
    )
    mistaken: Share = Field(
        default=USUAL.mistaken,
        description="Share of sightings that are of another vehicle in sight than is thought",
    )
    late: Annotated[int, Field(ge=0, le=MOST_LATE)] = Field(
        default=USUAL.late, description="Samples after which sightings arrive"
    )
    wind_mps: Velocity | None = Field(
        default=None,
        description="True wind, x and y; drawn by the scenario's wind.sigma_mps if not given",
        examples=[[1.5, 0.0]],
    )
    series: bool = Field(default=False, description="Add figures over time, and tracks")

    def run_options(self) -> FlightOptions:
        """Return the options of the flights."""
        return FlightOptions.of_request(self.model_dump(exclude_none=True))

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of trials; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        length, guidance = self.length(scenario), GUIDANCES[self.guidance]
        check_flights(self.trials, scenario, length, guidance, limits)
        self._check_events(scenario)
        return self.trials

    def _check_events(self, scenario: Scenario) -> None:
        """Raise InputError for a filter that can't fly, and for events that can't happen."""
        with our_keys(FlightOptions.request_keys):
            options = self.run_options()
            choice = asked_filter(scenario, options)
            if choice is not None:
                replace(options, filter=choice.name)
            events_of(options, scenario, self.length(scenario))


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> "list[FlightRun]":
    from syncplan.flight.flying import flight_run
    from syncplan.planning.plan_files import plan_of

    assert spec.plan is not None
    options = FlightRequest.model_validate_json(spec.request).run_options()
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
