"""Types of a scenario's quantities and sections, and the faults found in them.

Values are finite and within stated limits; the names of keys carry the units. Every fault becomes
one line of an InputError: its key, its value and what is allowed.
"""

import difflib
import itertools
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, Literal, NoReturn, Self, TypeVar

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
    ValidatorFunctionWrapHandler,
    WrapValidator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError

from syncplan.errors import Fault, InputError
from syncplan.phrases import limit_in_words

# --- long lists -----------------------------------------------------------------------------------


T = TypeVar("T")
Location = tuple[int | str, ...]

PORTION = 1000
"""Number of values in a chunk; the check ends with the first chunk that has faults."""


def in_portions(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Return a list or mapping, checked in chunks; a wrap validator.

    A body of a megabyte can hold half a million faults, each an object of a kilobyte.
    """
    if not isinstance(value, list | dict) or len(value) <= PORTION:
        return check(value)
    if isinstance(value, dict):
        checked: dict[Any, Any] = {}
        items = iter(value.items())
        while portion := dict(itertools.islice(items, PORTION)):
            checked.update(check(portion))
        return checked
    return [
        one
        for start in range(0, len(value), PORTION)
        for one in _portion(value[start : start + PORTION], start, check)
    ]


def _portion(values: list[Any], start: int, check: ValidatorFunctionWrapHandler) -> list[Any]:
    """Check part of a list; faults carry their positions in the whole list."""
    try:
        checked: list[Any] = check(values)
    except ValidationError as error:
        raise with_locations(error, lambda loc: (int(loc[0]) + start, *loc[1:])) from None
    return checked


def with_keys(error: ValidationError, names: Mapping[str, str]) -> ValidationError:
    """Return an error with dotted keys, and keys below them, exchanged for others."""

    def exchanged(location: Location, inner: str) -> str:
        key = dotted(location, inner)
        for name, other in names.items():
            if key == name or key.startswith((f"{name}[", f"{name}.")):
                section = dotted(location)
                return (other + key.removeprefix(name)).removeprefix(f"{section}.")
        return inner

    return with_locations(error, lambda location: location, exchanged)


def with_locations(
    error: ValidationError,
    located: Callable[[Location], Location],
    keyed: Callable[[Location, str], str] = lambda _, inner: inner,
) -> ValidationError:
    """Return an error with its locations, and the keys below them, changed."""
    faults: list[InitErrorDetails] = []
    for item in error.errors(include_url=False):
        context = dict(item.get("ctx") or {})
        if "key" in context:
            context["key"] = keyed(item["loc"], context["key"])
        # the text is a template
        kind = PydanticCustomError(item["type"], as_template(item["msg"]), context or None)
        faults.append({"type": kind, "loc": located(item["loc"]), "input": item["input"]})
    return ValidationError.from_exception_data(error.title, faults)


def as_template(text: str) -> str:
    """Return a text as the message of a PydanticCustomError, which is a template."""
    return text.replace("{", "{{").replace("}", "}}")


Many = Annotated[list[T], WrapValidator(in_portions)]
"""A list of any length."""


# --- faults of a model ----------------------------------------------------------------------------


LARGEST_LIST = 20
"""Most faults that one error lists."""

_TAGS = {"one", "many", "listed", "named"}
_VALUE_LENGTH = 60


def validation_fault(error: ValidationError, model: type[BaseModel], source: str) -> NoReturn:
    """Raise the InputError for a model's faults, unknown keys first.

    Its message states the first fault and their number; `faults` holds up to LARGEST_LIST of them.
    """
    faults = error.errors(include_url=False)
    faults.sort(key=lambda item: item["type"] != "extra_forbidden")
    listed = [_fault(dict(item), model) for item in faults[:LARGEST_LIST]]
    raise InputError.of(listed, source=source, more=len(faults) - len(listed)) from None


def _fault(item: dict[str, Any], model: type[BaseModel]) -> Fault:
    key = dotted(item["loc"], item.get("ctx", {}).get("key", ""))
    return Fault(key, *_remedy(item, model))


def dotted(location: Location, inner: str = "") -> str:
    """Return the key at a location as users write it; `inner` is one below it."""
    key = ""
    for part in location:
        if part in _TAGS or part == "[key]":
            continue
        if isinstance(part, int):
            key += f"[{part}]"
        else:
            key += f".{part}" if key else str(part)
    joint = "" if inner.startswith("[") else "."
    return f"{key}{joint}{inner}" if key and inner else key or inner


def _remedy(fault: dict[str, Any], model: type[BaseModel]) -> tuple[str, str]:
    """Return the fault with the allowed values, and the given value where it is worth repeating."""
    kind, message = fault["type"], fault["msg"]
    if kind == "extra_forbidden":
        allowed = list(_model_at(model, fault["loc"][:-1]).model_fields)
        near = difflib.get_close_matches(str(fault["loc"][-1]), allowed, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        return f"unknown key; {hint}allowed: {', '.join(allowed)}", ""
    if kind == "missing":
        return "is missing", ""
    if kind == "rule":
        (value,) = fault["ctx"].get("value", (None,))
        return message, "" if value is None else described(value)
    if kind == "model_type":
        return "must be a section of keys", described(fault["input"])
    for old, new in (
        ("Input should be", "must be"),
        ("Input should have", "must have"),
        ("String should", "must"),
        ("List should", "must"),
        ("Tuple should", "must"),
        ("a valid tuple", "a pair, as [x, y] or [v1, v2]"),
        (" after validation, not", ", not"),
    ):
        message = message.replace(old, new)
    return limit_in_words(message), described(fault["input"])


def _model_at(model: type[BaseModel], location: Location) -> type[BaseModel]:
    """The innermost model that contains a location, by its field names."""
    for part in location:
        field = model.model_fields.get(str(part))
        inner = model_in(field.annotation) if field is not None else None
        if inner is not None:
            model = inner
    return model


def model_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model that an annotation names, if it does."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = model_in(argument)
        if found is not None:
            return found
    return None


def described(value: Any) -> str:
    """Return a value as short JSON, or in words if it has no JSON."""
    if value is None:
        return "nothing"
    try:
        text = repr(value) if isinstance(value, str) else json.dumps(value, default=str)
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__} that contains itself"
    except TypeError:
        text = f"a {type(value).__name__} with keys that are not text"
    return text if len(text) <= _VALUE_LENGTH else text[: _VALUE_LENGTH - 3] + "..."


# --- sections and quantities ----------------------------------------------------------------------


_ANY_SIZE = {"max_vehicles": math.inf}
"""Validation context of a copy: the team may have been loaded under a larger limit."""


class Section(BaseModel):
    """Base of all sections of user input: frozen, strict, no unknown keys, finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some keys replaced, checked like a file.

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
    def from_mapping(cls, keys: Mapping[str, Any], *, source: str = "") -> Self:
        """Return the section of a mapping of keys, checked like a file that `source` names.

        Raises InputError naming the key, its value and what is allowed.
        """
        try:
            return cls.model_validate(dict(keys))
        except ValidationError as error:
            validation_fault(error, cls, source)

    def following(self, **keys: Any) -> Self:
        """Return a copy with keys replaced by values derived from valid ones, unchecked."""
        return super().model_copy(update=keys)


FURTHEST_M = 1e7
"""Largest coordinate and length: beyond it, no plane can represent the Earth."""

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
Latitude = Annotated[float, Field(ge=-90, le=90)]
Longitude = Annotated[float, Field(ge=-180, le=180)]
Place = Annotated[tuple[Latitude, Longitude], Strict(False)]
Pair = Annotated[tuple[Name, Name], Strict(False)]
Sense = Literal["ccw", "cw"]


def _kind(value: Any) -> str:
    return "many" if isinstance(value, list | tuple) else "one"


def _named(value: Any) -> str:
    return "named" if isinstance(value, dict) else "listed"


class _WithNamesDescribed:
    """JSON Schema of a mapping by names, in which every key must be a name."""

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
OneOrRange = Annotated[
    Annotated[T, Tag("one")] | Annotated[tuple[T, T], Strict(False), Tag("many")],
    Discriminator(_kind),
]
"""A value, or the least and the largest."""

_ListedOrNamed = Annotated[
    Annotated[Many[T], Tag("listed")]
    | Annotated[dict[Name, T], _WithNamesDescribed(), WrapValidator(in_portions), Tag("named")],
    Discriminator(_named),
]
ListedOrNamed = _ListedOrNamed[Point]
ListedOrNamedPlaces = _ListedOrNamed[Place]


def instead_of(twin: str) -> Any:
    """Return the field of places in degrees, instead of a key in metres."""
    return Field(
        default=None,
        description=f"[latitude, longitude] of each place, instead of {twin}",
        exclude=True,
    )


def points_of(given: Sequence[Point] | Mapping[str, Point]) -> list[Point]:
    """Return listed or named points as a list."""
    return list(given.values()) if isinstance(given, Mapping) else list(given)


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
