"""What requests for runs of the filter have in common."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, ClassVar

from pydantic import Field

from api.job_kinds.job_kind import JobRequest
from api.limits import RequestLimits, check_at_most, check_run_work
from syncplan.errors import InputError
from syncplan.estimation.filter_options import (
    LARGEST_SEED,
    REQUEST_KEYS,
    FilterOptions,
    steps_in_run,
)
from syncplan.estimation.filters import FilterChoice
from syncplan.scenario.specification import Scenario
from syncplan.scenario.truths import Truth, with_truth

DEFAULTS = FilterOptions()


class FilterRequest(JobRequest):
    """What runs of the filter have in common."""

    limited: ClassVar[Mapping[str, str]] = {"trials": "trials", "duration_s": "run_s"}

    trials: Annotated[int, Field(ge=1)] = Field(
        default=DEFAULTS.trials, description="Number of Monte Carlo trials", examples=[200]
    )
    seed: Annotated[int, Field(ge=0, le=LARGEST_SEED)] = Field(
        default=DEFAULTS.seed, description="Seed of all random numbers", examples=[1]
    )
    duration_s: Annotated[float, Field(gt=0)] | None = Field(
        default=None,
        description="Length of each run; the scenario's if not given",
        examples=[200.0],
    )

    filter: FilterChoice = Field(
        default=DEFAULTS.filter,
        description="The filter. auto is the scenario's filter.kind; where it has none, a "
        "validation runs ekf where the plan's start-up index clears it and robust where not, and "
        "all rows of a sweep run ekf",
    )

    truth: Truth | None = Field(
        default=None,
        description="Keys that the simulated world has in place of the scenario's own, which plan, "
        "prediction and filter keep; beside those of the scenario's `truth`",
        examples=[{"wind": {"gust_sigma_mps": 0.6}}],
    )

    def run_options(self) -> FilterOptions:
        """Return the options of the runs."""
        return FilterOptions.of_request(self.model_dump(exclude_none=True))

    def length(self, scenario: Scenario) -> float:
        """Return the length in s of each run of a scenario."""
        return scenario.duration_s if self.duration_s is None else self.duration_s

    def in_world(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the request's truth beside its own; raises the fault of it."""
        if self.truth is None:
            return scenario
        return with_truth(scenario, self.truth.model_dump(exclude_none=True))

    def check_run(self, scenario: Scenario, limits: RequestLimits) -> None:
        """Raise InputError if a run of a scenario is too long, or too short to be measured."""
        length = self.length(scenario)
        check_at_most("duration_s", length, limits.run_s, " s")
        check_at_most("duration_s", length / scenario.sample_time, limits.samples, " samples")
        check_run_work(scenario, length, limits)
        self.in_world(scenario)
        with our_keys():
            steps_in_run(length, scenario.sample_time, scenario.period, scenario.size)


@contextmanager
def our_keys(keys: Mapping[str, str] = REQUEST_KEYS) -> Iterator[None]:
    """Name the request's key where the library names its own argument."""
    try:
        yield
    except InputError as error:
        raise InputError(error.problem, key=keys.get(error.key, error.key)) from None
