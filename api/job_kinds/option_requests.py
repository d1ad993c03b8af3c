"""Requests for runs: keys with the types, limits, defaults and texts of the library's options."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import Field, create_model

from api.job_kinds.job_kind import JobRequest
from api.limits import RequestLimits, check_at_most, check_run_work
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions, steps_in_run
from syncplan.options import Option, RunOptions, options_of
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import Truth, with_truth

Request = TypeVar("Request", bound=JobRequest)


def with_keys(keys: dict[str, Any]) -> Callable[[type[Request]], type[Request]]:
    """Return a decorator that adds keys to a request, given by name as (type, field)."""

    def extended(request: type[Request]) -> type[Request]:
        return create_model(
            request.__name__,
            __base__=request,
            __module__=request.__module__,
            __doc__=request.__doc__,
            **keys,
        )

    return extended


def takes_options(
    kind: type[RunOptions], *, without: tuple[str, ...] = (), **narrower: Any
) -> Callable[[type[Request]], type[Request]]:
    """Return a decorator that adds a key for each option of a kind, except those in `without`.

    `narrower` gives types, by name, for options that a request limits further than the library.
    """
    return with_keys(
        {
            one.key: (narrower.get(one.name, one.type), _field(one))
            for one in options_of(kind)
            if one.name not in without
        }
    )


def _field(one: Option) -> Any:
    words: dict[str, Any] = {
        **one.limits,
        "default": list(one.default) if isinstance(one.default, tuple) else one.default,
        "description": one.sentence,
        "examples": None if one.example is None else [one.example],
        "deprecated": one.former or None,
    }
    return Field(**words)


class TrialRequest(JobRequest):
    """Base class of requests for trials of the filter."""

    limited: ClassVar[Mapping[str, str]] = {"trials": "trials", "duration_s": "run_s"}

    def run_options(self) -> FilterOptions:
        """Return the options of the runs."""
        raise NotImplementedError

    def length(self, scenario: Scenario) -> float:
        """Return the length in s of each run of a scenario."""
        asked = self.run_options().duration
        return scenario.duration_s if asked is None else asked

    def in_world(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the request's truth added to its own; raises InputError."""
        truth = self.run_options().truth
        return scenario if truth is None else with_truth(scenario, truth)

    def check_run(self, scenario: Scenario, limits: RequestLimits) -> None:
        """Raise InputError if a run of a scenario is too long, or too short to be measured."""
        length = self.length(scenario)
        check_at_most("duration_s", length, limits.run_s, " s")
        check_at_most("duration_s", length / scenario.sample_time, limits.samples, " samples")
        check_run_work(scenario, length, limits)
        self.in_world(scenario)
        with our_keys(FilterOptions):
            steps_in_run(length, scenario.sample_time, scenario.period, scenario.size)


TRUTH = Truth | None
"""Type of the truth in requests, whose sections are checked."""

SUBSTEPS = Annotated[int, Field(ge=1, le=1000)]
"""Type of the sub-steps in requests: more would keep the service from its other jobs."""


@contextmanager
def our_keys(kind: type[RunOptions]) -> Iterator[None]:
    """Name the request's key in errors in which the library names its own option."""
    try:
        yield
    except InputError as error:
        key = kind.request_keys().get(error.key, error.key)
        raise InputError(error.problem, key=key) from None
