"""Types of the quantities a scenario holds: finite, within stated limits, units in key names."""

import math
import re
from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
    Tag,
    TypeAdapter,
    ValidationError,
    WrapValidator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from syncplan.scenario.chunked_validation import Many, as_template, in_portions
from syncplan.scenario.faults import validation_fault

T = TypeVar("T")


_ANY_SIZE = {"max_vehicles": math.inf}
"""A team that was loaded under a larger limit is copied under it."""


class Section(BaseModel):
    """Base of everything a user writes: frozen, strict, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some keys replaced, checked as those of a file are.

        Raises InputError naming the key, its value and what is allowed.
        """
        if not update:
            return super().model_copy(deep=deep)
        kept = super().model_copy(deep=True) if deep else self
        values = {key: getattr(kept, key) for key in self.model_fields_set}
        try:
            return type(self).model_validate({**values, **update}, context=_ANY_SIZE)
        except ValidationError as error:
            validation_fault(error, type(self), "")

    @classmethod
    def from_mapping(cls, keys: Mapping[str, Any]) -> Self:
        """Return what a mapping of keys says, checked as a file is.

        Raises InputError naming the key, its value and what is allowed.
        """
        try:
            return cls.model_validate(dict(keys))
        except ValidationError as error:
            validation_fault(error, cls, "")

    def following(self, **keys: Any) -> Self:
        """Return a copy with keys replaced by what follows from valid ones: nothing is checked."""
        return super().model_copy(update=keys)


FURTHEST_M = 1e7
"""Largest coordinate and length: beyond it the Earth is no plane."""

SMALLEST_M = 1e-6
"""Smallest length."""

Coordinate = Annotated[float, Field(ge=-FURTHEST_M, le=FURTHEST_M)]
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
_PRINTING = r"[^\x00-\x1f\x7f]"
# the next-line character is white space here, but not to every reader of JSON Schema
_SOLID = r"[^\s\x00-\x1f\x7f\x85]"
Name = Annotated[
    str,
    StringConstraints(min_length=1, max_length=64, pattern=rf"^{_SOLID}({_PRINTING}*{_SOLID})?$"),
]
Title = Annotated[str, StringConstraints(max_length=200, pattern=rf"^{_PRINTING}*$")]
Point = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Polygon = Many[Point]
Pair = Annotated[tuple[Name, Name], Strict(False)]
Sense = Literal["ccw", "cw"]


def _kind(value: Any) -> str:
    return "many" if isinstance(value, list | tuple) else "one"


def _named(value: Any) -> str:
    return "named" if isinstance(value, dict) else "listed"


class _WithNamesDescribed:
    """Of a mapping by names: its schema says of every key that it must be a name."""

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        described = handler(schema)
        # pydantic writes patternProperties, which lets other keys hold anything
        ((_, value),) = described.pop("patternProperties").items()
        names = TypeAdapter(Name).json_schema()
        return {**described, "propertyNames": names, "additionalProperties": value}


OneOrMany = Annotated[
    Annotated[T, Tag("one")] | Annotated[Many[T], Tag("many")], Discriminator(_kind)
]
ListedOrNamed = Annotated[
    Annotated[Many[Point], Tag("listed")]
    | Annotated[dict[Name, Point], _WithNamesDescribed(), WrapValidator(in_portions), Tag("named")],
    Discriminator(_named),
]


def _no_speck(value: float) -> float:
    if value < SMALLEST_M:
        raise fault("", f"must be at least {SMALLEST_M:g}", value)
    return value


Length = Annotated[float, Field(gt=0, le=FURTHEST_M), AfterValidator(_no_speck)]

_RFC3339 = re.compile(r"\d{4}-\d\d-\d\d[Tt ]\d\d:\d\d:\d\d(\.\d+)?([Zz]|[+-]\d\d:\d\d)", re.ASCII)


def _rfc3339(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime) else value


def _moment_with_zone(value: str) -> str:
    if not _RFC3339.fullmatch(value):
        raise fault(
            "",
            "must be an RFC 3339 date and time with its time zone, such as 2026-05-01T09:00:00Z",
            value,
        )
    try:
        datetime.fromisoformat(value)
    except ValueError as error:
        raise fault("", f"is not a date and time: {error}", value) from None
    return value


StartTime = Annotated[str, BeforeValidator(_rfc3339), AfterValidator(_moment_with_zone)]


def fault(key: str, problem: str, value: Any = None) -> PydanticCustomError:
    """Return the error for a rule that spans keys: `key` is relative to the model it is raised in.

    Braces are doubled because the message is a template. The value is held in a tuple: a text by
    itself would have to be UTF-8, which a lone surrogate is not.
    """
    context = {"key": key} if value is None else {"key": key, "value": (value,)}
    return PydanticCustomError("rule", as_template(problem), context)
