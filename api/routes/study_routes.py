"""The route that describes the studies: their options and limits, their results and figures."""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Literal

from fastapi import APIRouter
from pydantic import BaseModel, ConfigDict, Field

from api.calls import IN_JSON
from api.job_kinds.job_kind import JobKind
from api.job_kinds.job_table import JOB_KINDS
from api.limits import RequestLimits
from api.problems import problem_responses
from api.security import CurrentOwner
from api.service import CurrentService
from syncplan.options import Option, RunOptions, options_of
from syncplan.phrases import name_and_unit
from syncplan.plotting.figure_table import FIGURES
from syncplan.results.quantities import quantities_of
from syncplan.studies.study import Subject

OptionKind = Literal[
    "integer", "number", "numbers", "pair", "choice", "flag", "text", "names", "document"
]

LIMITS = ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum")
"""Limits of numbers, named as in JSON Schema."""


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class OptionDescription(_Part):
    """An option of a study: a key of its request."""

    key: str = Field(examples=["duration_s"])
    label: str = Field(examples=["Length of a run"])
    """Name of its field in a form"""
    unit: str = Field(examples=["s"])
    """Empty if it has none"""
    sentence: str
    kind: OptionKind
    """A pair is of numbers; numbers and names are lists; a document is JSON of any other form"""
    required: bool
    default: Any
    """Null where the plan or the study decides, and where there is none"""
    often: bool
    """Whether a form shows it among the first"""
    choices: list[str]
    """Names to choose from, where there are such"""
    limits: dict[str, int | float] = Field(examples=[{"minimum": 1, "maximum": 10000}])
    """Of a number, by their names in JSON Schema; those of this service are among them"""
    example: Any


class FieldDescription(_Part):
    """A field of a report that tables show."""

    path: str = Field(examples=["vehicles.tracking_rms_m"])
    """Dotted path in the report"""
    label: str
    unit: str


class FigureDescription(_Part):
    """A figure of a report."""

    name: str
    title: str
    sentence: str
    part: str
    """Dotted path of the part of a report that it needs; empty if every report has it"""


class StudyDescription(_Part):
    """A study, which is requested as a job."""

    name: str = Field(examples=["flight"])
    title: str = Field(examples=["Flight"])
    verb: str = Field(examples=["fly"])
    of: Subject
    sentence: str
    path: str = Field(examples=["/v1/plans/{plan_id}/flights"])
    """Path that takes requests"""
    unit: str = Field(examples=["flights"])
    """Of the work that a job's progress counts"""
    ends_early: bool
    """Whether its jobs can end early, with the best found so far"""
    makes_plan: bool
    """Whether its result is a plan; otherwise it is a report"""
    options: list[OptionDescription]
    fields: list[FieldDescription]
    figures: list[FigureDescription]


class Studies(_Part):
    """All studies."""

    studies: list[StudyDescription]


router = APIRouter(tags=["studies"])


@router.get(
    "/studies",
    dependencies=IN_JSON,
    operation_id="listStudies",
    summary="List studies",
    response_description="All studies",
    responses=problem_responses(401, 406, 503),
)
def read_studies(service: CurrentService, owner: CurrentOwner) -> Studies:
    """What can be asked of plans, scenarios, recordings and briefs: options with their limits in
    this service, fields of the reports that tables show, and figures."""
    return Studies(studies=described_studies(service.limits))


@cache
def described_studies(limits: RequestLimits) -> list[StudyDescription]:
    """Return the descriptions of all studies, with the limits of a service."""
    return [_described(kind, limits) for kind in JOB_KINDS.values()]


def _described(kind: JobKind, limits: RequestLimits) -> StudyDescription:
    study, report = kind.study, kind.report
    shown = {} if report is None else quantities_of(report)
    return StudyDescription(
        name=study.name,
        title=(study.document and study.document.title) or study.name.capitalize(),
        verb=study.verb,
        of=study.of,
        sentence=study.sentence,
        path=f"/v1{study.path}",
        unit=study.unit,
        ends_early=study.ends_early,
        makes_plan=report is None,
        options=list(_options_of(kind, limits)),
        fields=[
            FieldDescription(path=path, label=quantity.label, unit=quantity.unit)
            for path, quantity in shown.items()
        ],
        figures=[
            FigureDescription(
                name=name, title=figure.title, sentence=figure.sentence, part=figure.part
            )
            for name, figure in FIGURES.items()
            if figure.of == kind.figures and figure.there is None
        ],
    )


def _options_of(kind: JobKind, limits: RequestLimits) -> Iterator[OptionDescription]:
    schema = kind.request.model_json_schema()
    stated: dict[str, Option] = {}
    if issubclass(kind.study.options, RunOptions):
        stated = {option.key: option for option in options_of(kind.study.options)}
    for key in schema["properties"]:
        option = stated.get(key)
        if option is not None and option.former:
            continue
        described = described_key(schema, key)
        allowed = dict(described.limits)
        most = kind.request.limited().get(key)
        if most is not None:
            allowed["maximum"] = min(getattr(limits, most), allowed.get("maximum", float("inf")))
        changes: dict[str, Any] = {"limits": allowed}
        if option is not None:
            changes |= {"label": option.label, "often": option.often}
        yield described.model_copy(update=changes)


def described_key(schema: Mapping[str, Any], key: str) -> OptionDescription:
    """Return the description of a key by its dotted name in the JSON Schema of a request."""
    section, parts = schema, schema.get("$defs", {})
    *sections, last = key.split(".")
    for part in sections:
        section = _value_of(section["properties"][part], parts)
    field = section["properties"][last]
    value = _value_of(field, parts)
    name, unit = name_and_unit(last)
    return OptionDescription(
        key=key,
        label=name.capitalize(),
        unit=unit,
        sentence=field.get("description", ""),
        kind=_kind_of(value),
        required=last in section.get("required", []),
        default=field.get("default"),
        often=False,
        choices=[str(choice) for choice in value.get("enum", [])],
        limits={limit: value[limit] for limit in LIMITS if limit in value},
        example=next(iter(field.get("examples", [])), None),
    )


def _value_of(field: Mapping[str, Any], parts: Mapping[str, Any]) -> Mapping[str, Any]:
    """Schema of the values of a field, null left out; references are resolved."""
    either = [each for each in field.get("anyOf", [field]) if each.get("type") != "null"]
    value: Mapping[str, Any] = either[0] if len(either) == 1 else {}
    return parts[value["$ref"].rpartition("/")[2]] if "$ref" in value else value


def _kind_of(value: Mapping[str, Any]) -> OptionKind:
    kind = value.get("type", "")
    if "enum" in value:
        return "choice"
    if kind != "array":
        return _KINDS.get(kind, "document")
    items = [each.get("type") for each in value.get("prefixItems", [value.get("items", {})])]
    return _LISTS.get(tuple(items), "document")


_KINDS: Mapping[str, OptionKind] = {
    "integer": "integer",
    "number": "number",
    "boolean": "flag",
    "string": "text",
}
"""Kinds of options by their type in JSON Schema."""

_LISTS: Mapping[tuple[str | None, ...], OptionKind] = {
    ("number", "number"): "pair",
    ("number",): "numbers",
    ("string",): "names",
}
"""Kinds of options that are lists, by the types of their items."""
