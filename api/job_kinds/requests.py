"""Requests for jobs: the keys that set a study's options, and the limits that they keep."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Any, Self

from pydantic import Field, Strict, create_model

from api.job_kinds.job_kind import JobRequest, JobSubject
from api.limits import (
    RequestLimits,
    check_at_most,
    check_flights,
    check_replay_work,
    check_run_work,
    check_trials,
)
from syncplan.designs.candidates import check_samples
from syncplan.designs.ladder import orders_of
from syncplan.errors import InputError
from syncplan.estimation.filter_options import steps_in_run
from syncplan.estimation.replay_settings import ReplayOptions
from syncplan.guidance.flight_events import events_of
from syncplan.guidance.flight_options import GUIDANCES, FlightOptions
from syncplan.options import Option, RunOptions, options_of
from syncplan.planning.filter_choice import asked_filter
from syncplan.planning.plan_files import Loaded
from syncplan.recordings.log import Overview, chosen_landmarks
from syncplan.refinement.refiner import options_for
from syncplan.scenario.brief import Brief
from syncplan.scenario.quantities import Many, Name
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import Truth, optional_keys, with_truth
from syncplan.studies.study import Study, TrialStudy

MOST_NAMES = 1000

Speed = Annotated[float, Field(ge=-1000, le=1000)]
Coordinate = Annotated[float, Field(ge=-1e12, le=1e12)]
Pose = Annotated[tuple[Coordinate, Coordinate, Coordinate], Strict(False)]


NAMED_TYPES: Mapping[Any, Any] = {
    tuple[str, ...]: Annotated[
        list[Annotated[str, Field(min_length=1, max_length=200)]], Field(max_length=MOST_NAMES)
    ],
    tuple[float, float] | None: Annotated[tuple[Speed, Speed], Strict(False)] | None,
    tuple[int | str, ...] | None: Many[int | Name] | None,
    Sequence[Sequence[float]] | None: Many[Pose] | None,
    Mapping[str, Any] | None: Truth | None,
}
"""Types of keys that are limited further than the options that they set, by the options' types."""


def _field(option: Option) -> Any:
    default = option.default
    words: dict[str, Any] = {
        **option.limits,
        "default": list(default) if isinstance(default, tuple) else default,
        "description": option.sentence,
        "examples": None if option.example is None else [option.example],
        "deprecated": option.former or None,
    }
    return Field(**words)


def request_for(study: Study, base: type[JobRequest]) -> type[JobRequest]:
    """Return the class of requests for a study: that of `base`, with its keys."""
    request = create_model(
        f"{study.name.capitalize()}Request",
        __base__=base,
        __module__=base.__module__,
        __doc__=base.__doc__ if base is not PlanRequest else study.__doc__,
        **base.further_keys(study),
    )
    request.study = study
    return request


class OptionRequest(JobRequest):
    """Base class of requests whose keys are the options of a study."""

    @classmethod
    def further_keys(cls, study: Study) -> dict[str, Any]:
        """Return a key for each option, with its type, limits, default and text."""
        return {
            option.key: (NAMED_TYPES.get(option.type, option.type), _field(option))
            for option in options_of(study.options)
            if option.name not in study.left_out
        }


# --- of plans -------------------------------------------------------------------------------------


class PlanRequest(OptionRequest):
    """Base class of requests for studies of a plan."""

    @classmethod
    def limited(cls) -> dict[str, str]:
        """Return the keys of numbers that the service limits."""
        keys = {"trials": "trials", "duration_s": "run_s"}
        return {key: limit for key, limit in keys.items() if key in cls.model_fields}

    def length(self, scenario: Scenario) -> float:
        """Return the length in s of each run of a scenario."""
        asked: float | None = getattr(self, "duration_s", None)
        return scenario.duration_s if asked is None else asked

    def check_run(self, scenario: Scenario, limits: RequestLimits) -> None:
        """Raise InputError if a run of a scenario is too long, or too short to be measured."""
        length = self.length(scenario)
        check_at_most("duration_s", length, limits.run_s, " s")
        check_at_most("duration_s", length / scenario.sample_time, limits.samples, " samples")
        check_run_work(scenario, length, limits)
        truth = getattr(self.options(), "truth", None)
        if truth is not None:
            with_truth(scenario, truth)
        with request_keys(self.study.options):
            steps_in_run(length, scenario.sample_time, scenario.period, scenario.size)

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the study's work; raises InputError if a run, or their number, is too large."""
        assert isinstance(subject, Loaded)
        trials = isinstance(self.study, TrialStudy)
        if trials or "duration_s" in type(self).model_fields:
            self.check_run(subject.scenario, limits)
        work = super().work(subject, limits)
        if trials:
            check_trials(work, subject.scenario.size, limits)
        return work


class FlightRequest(PlanRequest):
    """Flights of a plan in closed loop."""

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of flights; raises InputError if it exceeds a limit."""
        flights = super().work(subject, limits)
        assert isinstance(subject, Loaded)
        scenario, options = subject.scenario, self.options()
        length, guidance = self.length(scenario), GUIDANCES[options.guidance]
        check_flights(flights, scenario, length, guidance, limits)
        # a filter that can't fly and events that can't happen are refused too
        with request_keys(FlightOptions):
            choice = asked_filter(scenario, options)
            if choice is not None:
                replace(options, filter=choice.name)
            events_of(options, scenario, length)
        return flights


@contextmanager
def request_keys(options: type[RunOptions]) -> Iterator[None]:
    """Name the request's key in errors in which the library names its own option."""
    try:
        yield
    except InputError as error:
        key = options.request_keys().get(error.key, error.key)
        raise InputError(error.problem, key=key) from None


class RefinementRequest(JobRequest):
    """Changes of a refinement to the options in the plan's scenario; see its refine section."""

    @classmethod
    def further_keys(cls, study: Study) -> dict[str, Any]:
        """Return the keys of the refine section, each of which may be left out."""
        return optional_keys(study.options)

    @classmethod
    def limited(cls) -> dict[str, str]:
        """Return the key of the time limit."""
        return {"time_limit_s": "refine_s"}

    def options(self) -> dict[str, Any]:
        """Return the given options, as arguments of syncplan.refinement.refiner.refine."""
        return self.model_dump(exclude_none=True)

    def settled(self, subject: JobSubject, limits: RequestLimits) -> Self:
        """Return the request; without a time limit of its own, it gets at most this service's."""
        assert isinstance(subject, Loaded)
        planned = options_for(subject.scenario, None, {}).time_limit_s
        if "time_limit_s" in self.options() or planned <= limits.refine_s:
            return self
        return self.model_copy(update={"time_limit_s": limits.refine_s})

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of starts; raises InputError if the time exceeds the limit."""
        assert isinstance(subject, Loaded)
        options = options_for(subject.scenario, None, self.options())
        check_at_most("time_limit_s", options.time_limit_s, limits.refine_s, " s")
        return options.starts


# --- of recordings, and of briefs -----------------------------------------------------------------


class ReplayRequest(OptionRequest):
    """Settings of a replay: the filter's assumptions and the sightings it is given."""

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the largest number of sightings that may be filtered.

        Raises InputError if that exceeds a limit.
        """
        assert isinstance(subject, Overview)
        asked: ReplayOptions = self.options()
        chosen_landmarks(subject.landmarks, asked.landmarks)
        asked.check_start(subject.name, has_truth=subject.has_truth)
        sightings = subject.bearings + subject.distances * asked.distances
        check_replay_work(sightings, len(subject.robots), limits)
        return super().work(subject, limits)


class DesignRequest(JobRequest, Brief):
    """What a team must do, what it may consist of, and the error that is allowed."""

    def options(self) -> Brief:
        """Return the brief, which other processes can be sent."""
        return Brief.model_validate_json(self.model_dump_json(exclude_none=True))

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of searches; raises InputError if they exceed a limit."""
        check_at_most("team.max", self.team.max, limits.vehicles, " vehicles")
        check_samples(self)
        evaluations = sum(order.evaluations for order in orders_of(self))
        check_at_most("effort", evaluations, limits.design_evaluations, " candidates of all teams")
        return super().work(subject, limits)
