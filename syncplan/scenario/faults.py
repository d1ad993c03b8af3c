"""Faults of a model as the error of syncplan: each with its key, its value and what is allowed."""

import difflib
import json
from typing import Any, NoReturn

from pydantic import BaseModel, ValidationError

from syncplan.errors import Fault, InputError

LARGEST_LIST = 20
"""Most faults that one error lists."""

_TAGS = {"one", "many", "listed", "named"}
_VALUE_LENGTH = 60


def validation_fault(error: ValidationError, model: type[BaseModel], source: str) -> NoReturn:
    """Raise the InputError for a model's faults, unknown keys before all others.

    Its message is that of the first and their number; `faults` holds all, up to LARGEST_LIST of
    them.
    """
    faults = error.errors(include_url=False)
    faults.sort(key=lambda item: item["type"] != "extra_forbidden")
    listed = tuple(_fault(dict(item), model) for item in faults[:LARGEST_LIST])
    first, more = listed[0], len(faults) - 1
    problem = first.problem if more == 0 else f"{first.problem} (and {more} more)"
    message = f"{first.value}: {problem}" if first.value else problem
    raise InputError(
        message, key=first.key, source=source, faults=listed, more=len(faults) - len(listed)
    ) from None


def _fault(item: dict[str, Any], model: type[BaseModel]) -> Fault:
    key = _dotted(item["loc"], item.get("ctx", {}).get("key", ""))
    return Fault(key, *_remedy(item, model))


def _dotted(location: tuple[int | str, ...], inner: str) -> str:
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
    """What is wrong and what is allowed, and the value at fault where it is worth repeating."""
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
    return message, described(fault["input"])


def _model_at(model: type[BaseModel], location: tuple[int | str, ...]) -> type[BaseModel]:
    """The model a location lies in: the deepest one its field names lead to."""
    for part in location:
        field = model.model_fields.get(str(part))
        inner = _model_in(field.annotation) if field is not None else None
        if inner is not None:
            model = inner
    return model


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        found = _model_in(argument)
        if found is not None:
            return found
    return None


def described(value: Any) -> str:
    """Return a value as short JSON, or in words where it has none."""
    if value is None:
        return "nothing"
    try:
        text = repr(value) if isinstance(value, str) else json.dumps(value, default=str)
    except (ValueError, RecursionError):
        text = f"a {type(value).__name__} that contains itself"
    except TypeError:
        text = f"a {type(value).__name__} with keys that are not text"
    return text if len(text) <= _VALUE_LENGTH else text[: _VALUE_LENGTH - 3] + "..."
