"""Sweeps: one key of a scenario varied, each value planned and validated."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Self

from pydantic import ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from api.job_kinds.job_kind import JobSubject
from api.job_kinds.requests import PlanRequest
from api.limits import RequestLimits, check_at_most, check_size, check_trials
from syncplan.errors import InputError
from syncplan.planning.variations import planned_rows
from syncplan.scenario.dotted_keys import SWEPT_KEYS, SweptKey, numeric_keys, swept_key
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.quantities import Many, fault
from syncplan.scenario.specification import Scenario
from syncplan.studies.study import Study
from syncplan.studies.sweeps import PlannedSweep

_SWEPT = {one.request: one for one in SWEPT_KEYS.values()}
"""Keys that have their own list of values in requests, by the name of the list."""


class _DescribedAsScenario:
    """Annotation that gives a mapping, checked as a scenario later, the schema of scenarios."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(Scenario.__pydantic_core_schema__)


_NAMED = ("key", "values")
"""Fields that a request gives together in place of such a list: any other key, and its values."""


def _just_one(keys: Iterable[str]) -> dict[str, Any]:
    """JSON Schema by which exactly one of the lists, or key and values, is given and not empty."""
    one: dict[str, Any] = {"type": "array", "minItems": 1}
    none = {"type": "null"}
    lists = list(keys)
    each: list[dict[str, Any]] = [
        {"required": [key], "properties": {key: one, **dict.fromkeys(_NAMED, none)}}
        for key in lists
    ]
    given = {"key": {"type": "string"}, "values": one, **dict.fromkeys(lists, none)}
    return {"oneOf": [*each, {"required": list(_NAMED), "properties": given}]}


def _only_numeric_keys(schema: dict[str, Any]) -> None:
    schema["anyOf"][0]["enum"] = list(numeric_keys())


_LISTS: dict[str, Any] = {
    name: (
        Many[float] | None,
        Field(
            default=None,
            description=one.many,
            examples=[list(one.example)] if one.example else None,
        ),
    )
    for name, one in _SWEPT.items()
}
"""Fields of the lists of values, for the keys that have their own."""


class SweepRequest(PlanRequest):
    """Sweep of one key of a scenario; each value is planned and validated by the same trials."""

    model_config = ConfigDict(json_schema_extra=_just_one(_SWEPT))

    scenario: Annotated[dict[str, Any], _DescribedAsScenario()] = Field(
        description="The scenario that is varied"
    )
    key: str | None = Field(
        default=None,
        description="Any key of the scenario that holds a number, by its dotted name; `values` has "
        "its values",
        examples=["sensor.range_sigma_m"],
        json_schema_extra=_only_numeric_keys,
    )
    values: Many[float] | None = Field(
        default=None, description="Values of `key`", examples=[[0.1, 0.3, 1.0]]
    )

    @classmethod
    def further_keys(cls, study: Study) -> dict[str, Any]:
        """Return the lists of values, and then the options."""
        return {**_LISTS, **super().further_keys(study)}

    @model_validator(mode="after")
    def _one_key(self) -> Self:
        lists = [key for key in _SWEPT if getattr(self, key) is not None]
        pair = [name for name in _NAMED if getattr(self, name) is not None]
        if len(pair) == 1:
            other = next(name for name in _NAMED if name not in pair)
            raise fault(other, f"is missing: {pair[0]} is given; key and values go together")
        if len(lists) + len(pair) // 2 != 1:
            named = " and ".join([*lists, *pair[:1]]) or "none"
            first, *_ = _SWEPT
            raise fault(
                first,
                f"give exactly one of {', '.join(_SWEPT)}, or key with values; {named} given",
            )
        if self.key is not None:
            try:
                swept_key(self.key)
            except InputError as error:
                raise fault("key", error.problem) from None
        if not self._values():
            raise fault(self._list(), "is empty; give a list such as [0.2, 0.4]")
        return self

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of trials of all rows; raises InputError if it exceeds a limit."""
        key, values = self.swept()
        options = self.options()
        rows = len(values) + options.connected
        check_at_most(self._list(), rows, limits.sweep_values, " rows")
        with _within("scenario"):
            scenario = scenario_from(self.scenario, max_vehicles=limits.vehicles)
            check_size(scenario, limits)
        check_trials(rows * options.trials, scenario.size, limits)
        for value in values:
            with _within(self._list()):
                one = key.varied(scenario, value)
            check_trials(rows * options.trials, one.size, limits)
            self.check_run(one, limits)
            check_size(one, limits)
        return int(rows * options.trials)

    def subject(self) -> PlannedSweep:
        """Return the plans of all values."""
        key, values = self.swept()
        scenario = scenario_from(self.scenario)
        connected = self.options().connected
        return PlannedSweep(key.name, planned_rows(scenario, key.name, values, connected=connected))

    def swept(self) -> tuple[SweptKey, list[float]]:
        """Return the key that is swept and its values."""
        key = _SWEPT[self._list()] if self.key is None else swept_key(self.key)
        return key, self._values()

    def _list(self) -> str:
        """Name of the list of values."""
        return next(key for key in (*_SWEPT, "values") if getattr(self, key) is not None)

    def _values(self) -> list[float]:
        values: list[float] = getattr(self, self._list())
        return values


@contextmanager
def _within(section: str) -> Iterator[None]:
    """Name the section of the request in errors that are raised within the block."""
    try:
        yield
    except InputError as error:
        raise error.within(section) from None
