"""Sweeps: one key of a scenario varied, each value planned and validated."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Self

from pydantic import ConfigDict, Field, GetJsonSchemaHandler, create_model, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from api.job_kinds.filter_requests import FilterRequest
from api.job_kinds.job_kind import JobKind, JobOperation, JobReport, JobSpec, TrialTask
from api.limits import RequestLimits, check_at_most, check_size, check_trials
from syncplan.errors import InputError
from syncplan.planning.plan_files import Loaded
from syncplan.planning.swept_keys import SWEPT_KEYS, SweptKey
from syncplan.planning.validation import TrialRun, Validation
from syncplan.reports.run_schemas import SweepReport
from syncplan.scenario.chunked_validation import Many
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.quantities import fault
from syncplan.scenario.specification import Scenario

__all__ = ["SWEEP", "SweepRequest"]

_SWEPT = {one.request: one for one in SWEPT_KEYS.values()}
"""What a sweep may vary, by the name of its list in requests."""


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


class _ScenarioRequest(FilterRequest):
    scenario: Annotated[dict[str, Any], _DescribedAsScenario()] = Field(
        description="The scenario that is varied"
    )


def _values(key: SweptKey) -> Any:
    examples = [list(key.example)] if key.example else None
    return Many[float] | None, Field(default=None, description=key.many, examples=examples)


if TYPE_CHECKING:
    _SweptRequest = _ScenarioRequest
else:
    _SweptRequest = create_model(
        "_SweptRequest",
        __base__=_ScenarioRequest,
        **{name: _values(key) for name, key in _SWEPT.items()},
    )


class SweepRequest(_SweptRequest):
    """One key of a scenario varied, each value planned and validated by the same trials."""

    model_config = ConfigDict(json_schema_extra=_just_one(_SWEPT))

    connected: bool = Field(
        default=False,
        description="Add a row with a range that connects the team at every instant",
    )

    @model_validator(mode="after")
    def _one_key(self) -> Self:
        given = [key for key in _SWEPT if getattr(self, key) is not None]
        if len(given) != 1:
            named = " and ".join(given) or "none"
            first, *_ = _SWEPT
            raise fault(first, f"give exactly one of {', '.join(_SWEPT)}; {named} given")
        if not getattr(self, given[0]):
            raise fault(given[0], "is empty; give a list such as [0.2, 0.4]")
        return self

    def work(self, subject: Loaded | None, limits: RequestLimits) -> int:
        """Return the number of trials of all rows; raises InputError if it exceeds a limit."""
        key, values = self.swept()
        rows = len(values) + self.connected
        check_at_most(self._key(), rows, limits.sweep_values, " rows")
        with _within("scenario"):
            scenario = scenario_from(self.scenario, max_vehicles=limits.vehicles)
            check_size(scenario, limits)
        check_trials(rows * self.trials, scenario.size, limits)
        for value in values:
            with _within(self._key()):
                one = key.varied(scenario, value)
            self.check_run(one, limits)
            check_size(one, limits)
        return rows * self.trials

    def swept(self) -> tuple[SweptKey, list[float]]:
        """Return the key that is swept and its values."""
        key = self._key()
        return _SWEPT[key], getattr(self, key)

    def _key(self) -> str:
        return next(key for key in _SWEPT if getattr(self, key) is not None)


@contextmanager
def _within(section: str) -> Iterator[None]:
    """Name the section of the request that holds what is at fault."""
    try:
        yield
    except InputError as error:
        raise error.within(section) from None


@lru_cache(maxsize=2)
def _planned(spec: JobSpec) -> list[Any]:
    from syncplan.planning.sweeps import planned_rows

    request = SweepRequest.model_validate_json(spec.request)
    scenario = scenario_from(request.scenario)
    key, values = request.swept()
    return planned_rows(scenario, key.name, values, connected=request.connected)


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> list[TrialRun]:
    from syncplan.planning.validation import trial_run

    options = SweepRequest.model_validate_json(spec.request).run_options()
    return [trial_run(row.plan, options) for row in _planned(spec)]


def _report(spec: JobSpec, concluded: Sequence[Validation]) -> JobReport:
    from syncplan.planning.sweeps import ValidatedRow
    from syncplan.reports.validation_report import sweep_document, validation_document
    from syncplan.runtime.files import as_text

    request = SweepRequest.model_validate_json(spec.request)
    rows = [
        ValidatedRow(row.label, row.value, one)
        for row, one in zip(_planned(spec), concluded, strict=True)
    ]
    reports = [validation_document(one) for one in concluded]
    return JobReport(as_text(sweep_document(request.swept()[0].name, rows, reports).as_json()))


SWEEP = JobKind(
    name="sweep",
    title="sweep",
    plural="sweeps",
    unit="trials",
    request=SweepRequest,
    operation=JobOperation(
        id="sweepScenario",
        path="/sweeps",
        summary="Sweep a scenario",
        description="Vary one key of a scenario, plan and validate each value: a job that reports "
        "them all.",
        body="The scenario, what is varied, and how to fly",
        body_required=True,
    ),
    task=TrialTask(runs=_runs, report=_report),
    report=SweepReport,
    has_figures=True,
)
