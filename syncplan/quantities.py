"""Types of the quantities a scenario holds: finite, within stated limits, units in key names."""

from datetime import datetime
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    Strict,
    StringConstraints,
    Tag,
)
from pydantic_core import PydanticCustomError

__all__ = [
    "Angle",
    "Duration",
    "Length",
    "ListedOrNamed",
    "Name",
    "OneOrMany",
    "Pair",
    "Point",
    "Rate",
    "Sigma",
    "Speed",
    "StartTime",
    "fault",
]

T = TypeVar("T")

Coordinate = Annotated[float, Field(ge=-1e7, le=1e7)]
Length = Annotated[float, Field(gt=0, le=1e7)]
Rate = Annotated[float, Field(ge=1e-6, le=1e4)]
Speed = Annotated[float, Field(gt=0, le=1e6)]
Sigma = Annotated[float, Field(ge=0, le=1e7)]
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]
Duration = Annotated[float, Field(gt=0, le=1e9)]
Name = Annotated[str, StringConstraints(min_length=1, max_length=64, pattern=r"^\S(.*\S)?$")]
Point = Annotated[tuple[Coordinate, Coordinate], Strict(False)]
Pair = Annotated[tuple[Name, Name], Strict(False)]
Sense = Literal["ccw", "cw"]


def _kind(value: Any) -> str:
    return "many" if isinstance(value, list | tuple) else "one"


def _named(value: Any) -> str:
    return "named" if isinstance(value, dict) else "listed"


OneOrMany = Annotated[
    Annotated[T, Tag("one")] | Annotated[list[T], Tag("many")], Discriminator(_kind)
]
ListedOrNamed = Annotated[
    Annotated[list[Point], Tag("listed")] | Annotated[dict[Name, Point], Tag("named")],
    Discriminator(_named),
]


def _rfc3339(value: Any) -> Any:
    return value.isoformat() if isinstance(value, datetime) else value


def _moment_with_zone(value: str) -> str:
    try:
        moment = datetime.fromisoformat(value)
    except ValueError:
        raise fault("", "must be a date and time of RFC 3339, like 2026-05-01T09:00:00Z") from None
    if moment.tzinfo is None:
        raise fault("", "must name its time zone, like 2026-05-01T09:00:00Z")
    return value


StartTime = Annotated[str, BeforeValidator(_rfc3339), AfterValidator(_moment_with_zone)]


def fault(key: str, problem: str, value: Any = None) -> PydanticCustomError:
    """Return the error for a rule that spans keys: `key` is relative to the model it is raised in.

    Braces are doubled because the message is a template.
    """
    context = {"key": key} if value is None else {"key": key, "value": value}
    return PydanticCustomError("rule", problem.replace("{", "{{").replace("}", "}}"), context)
