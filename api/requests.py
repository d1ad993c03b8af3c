"""What the bodies of POST requests ask for, and whether it can be had."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from api.limits import Limits, check_at_most, check_size, check_trials
from syncplan.errors import InputError
from syncplan.planning.plan_files import Loaded
from syncplan.planning.sweeps import varied
from syncplan.planning.validation import check_duration
from syncplan.refinement.refiner import options_for
from syncplan.scenario.chunked_validation import Many
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.quantities import Section, fault
from syncplan.scenario.refine_options import Bounds, Objective, Variable
from syncplan.scenario.specification import Scenario

__all__ = ["REQUESTS", "RefinementRequest", "SweepRequest", "ValidationRequest"]

_OURS = {"duration": "duration_s"}
"""Keys of requests, by the name of the library's argument that they set."""

_SWEPT = {
    "angular_rate_rad_s": "angular_rate",
    "range_m": "range",
    "radius_m": "radius",
    "spacing_m": "spacing",
}
"""What a sweep may vary, with its name in syncplan.planning.sweeps."""


class _Trials(Section):
    """What runs of the filter have in common."""

    trials: Annotated[int, Field(ge=1)] = Field(
        default=200, description="Number of Monte Carlo trials", examples=[200]
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = Field(
        default=0, description="Seed of all random numbers", examples=[1]
    )
    duration_s: Annotated[float, Field(gt=0)] | None = Field(
        default=None,
        description="Length of each run; the scenario's if not given",
        examples=[200.0],
    )

    def settled(self, subject: Loaded | None, limits: Limits) -> Self:
        """Return the request as it is done: as it is."""
        return self

    def _check_run(self, scenario: Scenario, limits: Limits) -> None:
        length = scenario.duration_s if self.duration_s is None else self.duration_s
        check_at_most("duration_s", length, limits.run_s, " s")
        check_at_most("duration_s", length / scenario.sample_time, limits.samples, " samples")
        with _our_keys():
            check_duration(length, scenario.sample_time, scenario.period, scenario.size)


class ValidationRequest(_Trials):
    """A Monte Carlo run of the filter on a plan."""

    model: Literal["arc", "euler"] = Field(
        default="arc", description="How the filter integrates its readings"
    )
    substeps: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=10, description="Euler sub-steps per sample"
    )
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        default=None,
        description="Probability of the innovation gate; no gate if not given",
        examples=[0.999],
    )
    series: bool = Field(default=False, description="Add errors and sigmas over time")

    def work(self, subject: Loaded | None, limits: Limits) -> int:
        """Return the number of trials; raises InputError if they can't be had."""
        assert subject is not None
        check_trials(self.trials, subject.scenario.size, limits)
        self._check_run(subject.scenario, limits)
        return self.trials

    def run_options(self) -> dict[str, Any]:
        """Return the arguments of syncplan.planning.validation.trial_run."""
        return {
            "trials": self.trials,
            "seed": self.seed,
            "duration": self.duration_s,
            "model": self.model,
            "substeps": self.substeps,
            "gate_probability": self.gate_probability,
            "with_series": self.series,
        }


class _DescribedAsScenario:
    """Of a mapping that is checked as a scenario later: its schema is that of scenarios."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(Scenario.__pydantic_core_schema__)


def _just_one(keys: Iterable[str]) -> dict[str, Any]:
    """What JSON Schema says of lists of which one is given, and not empty."""
    one: dict[str, Any] = {"type": "array", "minItems": 1}
    return {"oneOf": [{"required": [key], "properties": {key: one}} for key in keys]}


class SweepRequest(_Trials):
    """One key of a scenario varied, each value planned and validated by the same trials."""

    model_config = ConfigDict(json_schema_extra=_just_one(_SWEPT))

    scenario: Annotated[dict[str, Any], _DescribedAsScenario()] = Field(
        description="The scenario that is varied"
    )
    angular_rate_rad_s: Many[float] | None = Field(
        default=None, description="Common angular rates", examples=[[0.2, 0.4, 0.6]]
    )
    range_m: Many[float] | None = Field(default=None, description="Sensor ranges")
    radius_m: Many[float] | None = Field(default=None, description="Radii of all circles")
    spacing_m: Many[float] | None = Field(default=None, description="Spacings of the shape")
    connected: bool = Field(
        default=False,
        description="Add a row with a range that connects the team at every instant",
    )

    @model_validator(mode="after")
    def _one_key(self) -> Self:
        given = [key for key in _SWEPT if getattr(self, key) is not None]
        if len(given) != 1:
            named = " and ".join(given) or "none"
            raise fault(
                "angular_rate_rad_s", f"give exactly one of {', '.join(_SWEPT)}; {named} given"
            )
        if not getattr(self, given[0]):
            raise fault(given[0], "is empty; give a list such as [0.2, 0.4]")
        return self

    def work(self, subject: Loaded | None, limits: Limits) -> int:
        """Return the number of trials of all rows; raises InputError if they can't be had."""
        name, values = self.swept()
        rows = len(values) + self.connected
        check_at_most(self._key(), rows, limits.sweep_values, " rows")
        with _within("scenario"):
            scenario = scenario_from(self.scenario, max_vehicles=limits.vehicles)
            check_size(scenario, limits)
        check_trials(rows * self.trials, scenario.size, limits)
        for value in values:
            with _within(self._key()):
                one = varied(scenario, name, value)
            self._check_run(one, limits)
            check_size(one, limits)
        return rows * self.trials

    def swept(self) -> tuple[str, list[float]]:
        """Return what is swept, as syncplan.planning.sweeps names it, and its values."""
        key = self._key()
        return _SWEPT[key], getattr(self, key)

    def run_options(self) -> dict[str, Any]:
        """Return the arguments of syncplan.planning.validation.trial_run."""
        return {"trials": self.trials, "seed": self.seed, "duration": self.duration_s}

    def _key(self) -> str:
        return next(key for key in _SWEPT if getattr(self, key) is not None)


class RefinementRequest(Section):
    """What a refinement changes of the options in the plan's scenario; see its refine section."""

    vary: Many[Variable] | None = Field(
        default=None,
        description="What may change: phases, centers, radii",
        examples=[["phases", "centers"]],
    )
    center_box_m: Annotated[float, Field(gt=0, le=1e7)] | None = Field(
        default=None, description="How far each centre may move each way", examples=[5.0]
    )
    radius_m: Bounds | None = Field(
        default=None, description="Least and largest radius", examples=[[15.0, 25.0]]
    )
    objective: Objective | None = Field(
        default=None, description="What is improved", examples=["predicted_rms"]
    )
    margin_m: Annotated[float, Field(ge=0, le=1e7)] | None = Field(
        default=None, description="By how much meetings stay within range", examples=[1.0]
    )
    time_limit_s: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        default=None,
        description="Wall time after which the best plan so far is taken",
        examples=[30.0],
    )
    starts: Annotated[int, Field(ge=1, le=1000)] | None = Field(
        default=None, description="Starting points", examples=[4]
    )
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] | None = Field(
        default=None, description="Seed of the starting points", examples=[0]
    )

    def work(self, subject: Loaded | None, limits: Limits) -> int:
        """Return the number of starts; raises InputError if they can't be had."""
        assert subject is not None
        options = options_for(subject.scenario, None, self.changes())
        check_at_most("time_limit_s", options.time_limit_s, limits.refine_s, " s")
        return options.starts

    def settled(self, subject: Loaded | None, limits: Limits) -> Self:
        """Return the request, with the time this service gives where it names none of its own."""
        assert subject is not None
        planned = options_for(subject.scenario, None, {}).time_limit_s
        if self.time_limit_s is not None or planned <= limits.refine_s:
            return self
        return self.model_copy(update={"time_limit_s": limits.refine_s})

    def changes(self) -> dict[str, Any]:
        """Return the options that are given, as syncplan.refinement.refiner.refine takes them."""
        return self.model_dump(exclude_none=True)


REQUESTS: dict[str, type[ValidationRequest | SweepRequest | RefinementRequest]] = {
    "refinement": RefinementRequest,
    "sweep": SweepRequest,
    "validation": ValidationRequest,
}
"""The model of a job's request, by its kind."""


@contextmanager
def _our_keys() -> Iterator[None]:
    """Name the request's key where the library names its own argument."""
    try:
        yield
    except InputError as error:
        raise InputError(error.problem, key=_OURS.get(error.key, error.key)) from None


@contextmanager
def _within(section: str) -> Iterator[None]:
    """Name the section of the request that what is at fault lies in."""
    try:
        yield
    except InputError as error:
        raise error.within(section) from None
