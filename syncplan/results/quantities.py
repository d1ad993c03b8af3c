"""Quantities: what tables show of the fields of results, declared with the fields.

    class CandidateSite(DocumentPart):
        share: float = quantity("share", "In the convex relaxation, 0 to 1", form=".3f", drop=1)

Tables in terminals, in notebooks and on the page have a column for each such field.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self, get_args

from pydantic import BaseModel, Field

from syncplan.phrases import percent

Words = Callable[[Sequence[Any]], Iterable[str]]
"""Function from the rows of a table to the marked-up texts of a column's cells."""


MISSING = "-"


@dataclass(frozen=True, slots=True)
class Quantity:
    """Column of a table for a field of its rows.

    Attributes
    ----------
    label, unit : words of its head
    form : format of numbers; "%" for a share in per cent
    missing : text where there is no value, or no part that has it
    words : texts of the cells, where these are not the plain values
    text : whether the cells are words, which stand at the left
    folds : whether long words go on in further lines; such a column has what room is left
    drop : when the column is left out of a table that is too wide, from 1 on; others go later
    order : place among the columns; those of equal order stand as the fields do
    """

    label: str
    unit: str = ""
    form: str = ".3g"
    missing: str = MISSING
    words: Words | None = None
    text: bool = False
    folds: bool = False
    drop: int = 0
    order: int = 0

    @property
    def head(self) -> str:
        """Head of the column: the label with its unit."""
        return f"{self.label} {self.unit}".rstrip()

    def without_unit(self, unit: str) -> Self:
        """Return the same without a unit that is stated elsewhere."""
        return replace(self, unit="") if self.unit == unit else self

    def cells(self, path: str, rows: Sequence[Any]) -> list[str]:
        """Return the marked-up texts of the values at a dotted path of fields."""
        above, _, name = path.rpartition(".")
        parts = [value_at(row, above) for row in rows] if above else rows
        there = [getattr(part, name, None) is not None for part in parts]
        known = [part for part, has_value in zip(parts, there, strict=True) if has_value]
        values = (self._text(getattr(part, name)) for part in known)
        texts = iter(values if self.words is None else self.words(known))
        return [next(texts) if has_value else self.missing for has_value in there]

    def _text(self, value: Any) -> str:
        if not isinstance(value, float):
            return plain(str(value))
        return percent(value) if self.form == "%" else format(value, self.form).replace("%", " %")


def value_at(row: Any, path: str) -> Any:
    """Return the value at a dotted path of fields; None where a part of the path is missing."""
    for name in path.split("."):
        row = getattr(row, name, None)
    return row


def quantity(
    label: str,
    sentence: str | None = None,
    unit: str = "",
    *,
    default: Any = ...,
    examples: list[Any] | None = None,
    **shown: Any,
) -> Any:
    """Return the field of a model that tables show; `shown` as in Quantity.

    The sentence describes it in the schema.
    """
    field = Field(default, description=sentence, examples=examples)
    field.metadata.append(Quantity(label, unit, **shown))
    return field


def plain(text: str) -> str:
    """Return text in which brackets are no marks."""
    # not at the top: it takes time, which no result needs that is not shown
    from rich.markup import escape

    return escape(text)


def each(words: Callable[[Any], str]) -> Words:
    """Return the words of a column from those of a single row."""
    return lambda rows: map(words, rows)


@cache
def quantities_of(model: type[BaseModel]) -> dict[str, Quantity]:
    """Return the quantities of a model, and of its parts, by the dotted paths of their fields."""
    quantities: dict[str, Quantity] = {}
    for name, field in model.model_fields.items():
        stated = next((item for item in field.metadata if isinstance(item, Quantity)), None)
        if stated is not None:
            quantities[name] = stated
            continue
        for part in (field.annotation, *get_args(field.annotation)):
            if isinstance(part, type) and issubclass(part, BaseModel):
                inner = quantities_of(part).items()
                quantities |= {f"{name}.{path}": quantity for path, quantity in inner}
    return dict(sorted(quantities.items(), key=lambda item: item[1].order))
