"""Long lists, checked chunk by chunk: of a million wrong values only the first are reported."""

import itertools
from typing import Annotated, Any, TypeVar

from pydantic import ValidationError, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import InitErrorDetails, PydanticCustomError

T = TypeVar("T")

PORTION = 1000
"""Values in a chunk; the check ends with the first chunk that has faults."""


def in_portions(value: Any, check: ValidatorFunctionWrapHandler) -> Any:
    """Return a checked list or mapping; a wrap validator.

    A body of a megabyte can hold half a million faults, each of them an object of a kilobyte.
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
    """Check part of a list; faults carry their positions in the whole."""
    try:
        checked: list[Any] = check(values)
    except ValidationError as error:
        faults: list[InitErrorDetails] = [
            {
                # the text is a template
                "type": PydanticCustomError(
                    fault["type"], as_template(fault["msg"]), fault.get("ctx")
                ),
                "loc": (int(fault["loc"][0]) + start, *fault["loc"][1:]),
                "input": fault["input"],
            }
            for fault in error.errors(include_url=False)
        ]
        raise ValidationError.from_exception_data(error.title, faults) from None
    return checked


def as_template(text: str) -> str:
    """Return a text as the message of a PydanticCustomError, which is a template."""
    return text.replace("{", "{{").replace("}", "}}")


Many = Annotated[list[T], WrapValidator(in_portions)]
"""A list of any length."""
