"""Common parts of all JSON documents: strict models, version and conversion to JSON."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from syncplan.arrays import Array
from syncplan.scenario.specification import Scenario

Point = tuple[float, float]
"""x and y in m."""

LatLon = Annotated[
    tuple[float, float], Field(description="Latitude and longitude in degrees, WGS 84")
]

Window = tuple[float, float]
"""Start and end in s."""

LONGEST_WORDS = 2000


def _short(text: str) -> str:
    if len(text) > LONGEST_WORDS:
        raise ValueError(f"is longer than {LONGEST_WORDS} characters")
    return text


Words = Annotated[str, AfterValidator(_short)]
"""Text of a document that is read back, of limited length."""


_ABSENT = "absent where it is None"

Value = TypeVar("Value")

OrAbsent = Annotated[Value | None, _ABSENT]
"""Key of a Document that is in its JSON only if it has a value."""


class DocumentPart(BaseModel):
    """A part of a document: frozen, without unknown keys, infinities or NaN."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Document(DocumentPart):
    """A document, or a part of one that holds others."""

    def as_json(self) -> dict[str, Any]:
        """Return the document as JSON values, in the order of its fields.

        Left out are keys of scenarios that were not set, and `OrAbsent` keys without a value.
        """
        nested = {name: _nested(value) for name, value in self}
        nested = {name: values for name, values in nested.items() if values is not None}
        absent = {name for name in _may_be_absent(type(self)) if getattr(self, name) is None}
        own = self.model_dump(mode="json", by_alias=True, exclude={*nested, *absent})
        return {
            name: nested[name] if name in nested else own[name]
            for name in type(self).model_fields
            if name not in absent
        }


@cache
def _may_be_absent(kind: type[Document]) -> tuple[str, ...]:
    return tuple(name for name, one in kind.model_fields.items() if _ABSENT in one.metadata)


class VersionedDocument(Document):
    """A document that names the version of syncplan that wrote it."""

    version: str = Field(description="Version of syncplan that wrote the document")


def _nested(value: Any) -> Any:
    """JSON values of a scenario, a document or a list of documents; None for others."""
    if isinstance(value, Scenario):
        return value.model_dump(mode="json", exclude_none=True)
    if isinstance(value, Document):
        return value.as_json()
    if isinstance(value, list) and value and isinstance(value[0], Document):
        return [one.as_json() for one in value]
    return None


def finite_or_none(value: float) -> float | None:
    """Return a number as documents hold it: infinity and NaN as null."""
    return value if math.isfinite(value) else None


def windows_of(windows: Array) -> list[Window]:
    """Return windows (k, 2) s as documents hold them."""
    return [(float(start), float(end)) for start, end in windows]


def point_of(values: Sequence[float] | Array) -> Point:
    """Return x and y as documents hold them."""
    return float(values[0]), float(values[1])
