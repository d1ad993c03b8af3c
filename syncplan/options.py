"""Options of runs, each declared once: a dataclass field with its sentence and its limits.

    @dataclass(frozen=True, slots=True, kw_only=True)
    class FlightOptions(FilterOptions):
        late: int = option(0, "Samples after which sightings arrive", ge=0, le=1000)

The library checks an option by this declaration. The command line, the service's requests and its
client take the name, the type, the default and the sentence from it.
"""

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, Literal, Self, TypeVar, cast, get_args, get_origin, get_type_hints

from syncplan.errors import InputError
from syncplan.phrases import name_and_unit

_LIMITS: Mapping[str, tuple[Callable[[Any, float], bool], str]] = {
    "ge": (operator.ge, "at least"),
    "gt": (operator.gt, "more than"),
    "le": (operator.le, "at most"),
    "lt": (operator.lt, "less than"),
}
"""Comparison and wording of each limit of an option, by its name in Pydantic."""


@dataclass(frozen=True, slots=True)
class Option:
    """An option of a run.

    Attributes
    ----------
    name, type, default : of the field; a Literal for what is chosen by name
    sentence : its description, units included
    key : in requests to the service; ends with the unit
    flag : on the command line
    limits : of a number, any of `ge`, `gt`, `le` and `lt`
    example : in the service's documentation; None for none
    former : whether it is hidden, and kept only for callers of earlier versions
    label : name of its field in a form
    often : whether a form shows it among the first
    """

    name: str
    type: Any
    default: Any
    sentence: str
    key: str
    flag: str
    limits: Mapping[str, float]
    example: Any
    former: bool
    label: str
    often: bool

    @property
    def choices(self) -> tuple[str, ...]:
        """Names to choose from; empty if it is not chosen by name."""
        either = get_args(self.type) if get_origin(self.type) is not Literal else (self.type,)
        return tuple(name for one in either if get_origin(one) is Literal for name in get_args(one))

    def check(self, value: Any) -> None:
        """Raise InputError for a value that is not allowed."""
        if value is None:
            return
        if self.choices and value not in self.choices:
            problem = f"{value!r} is unknown; choose {' or '.join(self.choices)}"
            raise InputError(problem, key=self.name)
        if not all(_LIMITS[one][0](value, limit) for one, limit in self.limits.items()):
            raise InputError(f"{_shown(value)} given; allowed is {self._allowed}", key=self.name)

    @property
    def _allowed(self) -> str:
        shown = {name: _shown(limit) for name, limit in self.limits.items()}
        if shown.keys() == {"ge", "le"}:
            return f"{shown['ge']} to {shown['le']}"
        return " and ".join(f"{_LIMITS[name][1]} {limit}" for name, limit in shown.items())


def _shown(number: float) -> str:
    return f"{number:g}" if isinstance(number, float) else str(number)


def option(
    default: Any,
    sentence: str,
    *,
    key: str = "",
    flag: str = "",
    example: Any = None,
    former: bool = False,
    label: str = "",
    often: bool = False,
    **limits: float,
) -> Any:
    """Return the field of a dataclass that declares an option; see Option.

    By default, its key is its name, its flag is its key with dashes, and its label is its key in
    words.
    """
    words = {
        "sentence": sentence,
        "key": key,
        "flag": flag,
        "limits": limits,
        "example": example,
        "former": former,
        "label": label,
        "often": often,
    }
    return field(default=default, metadata=words)


def options_of(kind: type) -> tuple[Option, ...]:
    """Return the options that a dataclass declares, in order."""
    types, found = get_type_hints(kind), []
    for one in fields(kind):
        if not one.metadata:
            continue
        key = one.metadata["key"] or one.name
        flag = one.metadata["flag"] or f"--{key.replace('_', '-')}"
        label = one.metadata["label"] or name_and_unit(key)[0].capitalize()
        words = {**one.metadata, "key": key, "flag": flag, "label": label}
        found.append(Option(name=one.name, type=types[one.name], default=one.default, **words))
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """Options of a run: a frozen dataclass whose fields are declared by `option`; itself, none."""

    def __post_init__(self) -> None:
        """Raise InputError naming an option whose value is not allowed."""
        for one in options_of(type(self)):
            one.check(getattr(self, one.name))

    def as_request(self) -> dict[str, Any]:
        """Return the options as keys of a request to the service, None left out."""
        values = {key: getattr(self, name) for name, key in self.request_keys().items()}
        return {key: value for key, value in values.items() if value is not None}

    @classmethod
    def of_request(cls, request: Mapping[str, Any]) -> Self:
        """Return the options that a request names; it may have further keys.

        Raises InputError naming the key at fault.
        """
        keys = cls.request_keys()
        given = {name: request[key] for name, key in keys.items() if key in request}
        lists = {name: tuple(one) for name, one in given.items() if isinstance(one, list)}
        try:
            return cls(**{**given, **lists})
        except InputError as error:
            raise InputError(error.problem, key=keys.get(error.key, error.key)) from None

    @classmethod
    def request_keys(cls) -> dict[str, str]:
        """Return the key of each option in requests to the service, by its name."""
        return {one.name: one.key for one in options_of(cls)}


# --- options as keywords ------------------------------------------------------------------------

F = TypeVar("F", bound=Callable[..., Any])


def lists_options(*kinds: type) -> Callable[[F], F]:
    """Return a decorator that puts the fields of classes into a signature, in place of **keywords.

    A keyword that is not in it raises TypeError, which names the nearest one that is.
    """
    listed = {
        name: parameter.replace(kind=Parameter.KEYWORD_ONLY, annotation=_type_of(kind, parameter))
        for kind in kinds
        for name, parameter in signature(kind).parameters.items()
        # of a dataclass, those that are declared as options
        if not is_dataclass(kind) or kind.__dataclass_fields__[name].metadata
    }

    def decorated(function: F) -> F:
        written = signature(function).parameters.items()
        own = {name: each for name, each in written if each.kind != Parameter.VAR_KEYWORD}
        # in that order, and with its own where both have one
        shown = {**own, **listed, **own}

        @wraps(function)
        def called(*positional: Any, **named: Any) -> Any:
            for name in (name for name in named if name not in shown):
                nearest = get_close_matches(name, shown, 1)
                meant = f"; did you mean {nearest[0]!r}?" if nearest else ""
                raise TypeError(f"{function.__name__}() has no argument {name!r}{meant}")
            return function(*positional, **named)

        called.__signature__ = Signature([*shown.values()])  # type: ignore[attr-defined]
        return cast(F, called)

    return decorated


def _type_of(kind: type, parameter: Parameter) -> Any:
    # that of a Pydantic model is full of its limits
    return parameter.annotation if is_dataclass(kind) else Parameter.empty
