"""The truth: noise, errors and sensors of the simulated world that replace the scenario's own.

The plan, its prediction and the filter keep the scenario's own. A section of the truth is that of
the scenario with every key optional, so a key added there is available here as well.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar, Union, get_args, get_origin

from pydantic import Field, ValidationError, create_model

from syncplan.errors import InputError
from syncplan.scenario.disturbances import WALKS, InitialSigma, Motion, Wind
from syncplan.scenario.models import Interval, Limits, Sensor
from syncplan.scenario.quantities import OneOrMany, Section, fault, validation_fault

IN_BOTH = frozenset({"sample_time_s"})
"""Keys of these sections that filter and world share."""

CompassSigma = Annotated[float, Field(ge=1e-6, le=math.pi)]


def _optional(annotation: Any) -> Any:
    """A type with every section in it partial."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return _partial(annotation)
    if get_origin(annotation) in (Union, UnionType):
        return Union[tuple(map(_optional, get_args(annotation)))]  # noqa: UP007 - not known here
    return annotation


def optional_keys(section: type[Section]) -> dict[str, Any]:
    """Return type and field of each key of a section, every key made optional."""
    keys: dict[str, Any] = {}
    for name, field in section.model_fields.items():
        kept = _optional(field.annotation)
        if field.metadata:
            kept = Annotated[(kept, *field.metadata)]
        described = Field(default=None, description=field.description, examples=field.examples)
        keys[name] = (kept | None, described)
    return keys


def _partial(section: type[Section]) -> type[Section]:
    """A section whose keys are all optional: those left out are the scenario's."""
    keys = {name: one for name, one in optional_keys(section).items() if name not in IN_BOTH}
    words = f"{(section.__doc__ or '').strip()} As in the simulated world."
    return create_model(f"True{section.__name__}", __base__=Section, __doc__=words, **keys)


if TYPE_CHECKING:
    TrueSensor: TypeAlias = Sensor
    TrueMotion: TypeAlias = Motion
    TrueWind: TypeAlias = Wind
    TrueLimits: TypeAlias = Limits
    TrueInitialSigma: TypeAlias = InitialSigma
else:
    TrueSensor, TrueMotion, TrueWind = map(_partial, (Sensor, Motion, Wind))
    TrueLimits, TrueInitialSigma = map(_partial, (Limits, InitialSigma))


class Truth(Section):
    """Keys of the simulated world that replace the scenario's own, which plan and filter keep."""

    sensor: OneOrMany[TrueSensor] | None = Field(
        default=None,
        description="Keys of the true sensor, one for all or one per vehicle",
        examples=[{"bearing_sigma_rad": 0.1}],
    )
    heading_sigma_rad: OneOrMany[CompassSigma | None] | None = Field(
        default=None,
        description="True standard deviation of a compass, one value or one per vehicle",
        examples=[0.1],
    )
    heading_interval_s: Interval | None = Field(
        default=None, description="True time between readings of a compass", examples=[1.0]
    )
    motion: TrueMotion | None = Field(default=None, description="Keys of the true motion")
    wind: TrueWind | None = Field(default=None, description="Keys of the true wind")
    limits: TrueLimits | None = Field(
        default=None, description="In flight, true limits of the vehicles"
    )
    initial_sigma: TrueInitialSigma | None = Field(
        default=None, description="True sigmas of the poses at time 0"
    )
    false_bearings: Annotated[float, Field(ge=0, lt=1)] | None = Field(
        default=None,
        description="Share of the bearings that are false: of no target, anywhere in view",
        examples=[0.01],
    )


@dataclass(frozen=True, slots=True)
class ChangedKey:
    """A key whose true value differs from the scenario's.

    Attributes
    ----------
    key : dotted name
    assumed, true : value in the scenario, None if not given, and in the world
    """

    key: str
    assumed: Any
    true: Any


World = TypeVar("World", bound=Section)


IN_TRUTH_ALONE = frozenset({"false_bearings"})
"""Keys that exist in a truth only."""

_FILTERS_OWN = ("truth", "filter", "refine")


def keys_over(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document with the keys of another in place of its own, section by section.

    Where a section is a list, one for each vehicle, every entry is changed. The alternative of a
    changed key is removed, such as a random walk where the sigma of each reading is changed.
    """
    instead = {**WALKS, **{sigma: walk for walk, sigma in WALKS.items()}}
    found = {
        key: value
        for key, value in document.items()
        if instead.get(key) not in changes or key in changes
    }
    for key, change in changes.items():
        if change is None:
            continue
        own = document.get(key)
        if isinstance(change, Mapping):
            each = own if isinstance(own, list) else [own or {}]
            made = [keys_over(one, change) for one in each]
            found[key] = made if isinstance(own, list) else made[0]
        elif isinstance(change, list) and change and isinstance(change[0], Mapping):
            each = own if isinstance(own, list) else [own or {} for _ in change]
            found[key] = [keys_over(*pair) for pair in zip(each, change, strict=True)]
        else:
            found[key] = change
    return found


def true_world(scenario: World, truth: Truth, size: int) -> World:
    """Return the scenario of the simulated world, of `size` vehicles, without links and filter.

    Raises the fault for a key of the truth that is invalid, or whose readings the filter lacks.
    """
    document = scenario.model_dump(exclude_none=True)
    changes = {key: value for key, value in _keys(truth).items() if key not in IN_TRUTH_ALONE}
    for key, change in changes.items():
        if isinstance(change, list) and len(change) != size:
            raise fault(f"truth.{key}", f"has {len(change)} values for {size} vehicles")
    kept = {key: value for key, value in document.items() if key not in _FILTERS_OWN}
    formation = {key: value for key, value in kept["formation"].items() if key != "links"}
    made = keys_over({**kept, "formation": formation}, changes)
    for path in (("sensor", "range_sigma_m"), ("heading_sigma_rad",)):
        own, true = (_each(_value_at(one, path), size) for one in (document, made))
        if any(a is None and b is not None for a, b in zip(own, true, strict=True)):
            name = ".".join(path)
            problem = "the scenario has no such readings for a filter to take in"
            raise fault(f"truth.{name}", f"{problem}; give {name} beside the truth too")
    try:
        return type(scenario).model_validate(made, context={"max_vehicles": size})
    except ValidationError as error:
        try:
            validation_fault(error, type(scenario), "")
        except InputError as refused:
            raise fault(f"truth.{refused.key}", refused.problem) from None


def with_truth(scenario: World, changes: Mapping[str, Any]) -> World:
    """Return a scenario with these keys set in its truth, checked like a file."""
    own: Truth | None = getattr(scenario, "truth", None)
    given = keys_over({} if own is None else _keys(own), changes)
    return scenario.model_copy(update={"truth": given})


def changed_keys(scenario: Section, in_truth: Section, truth: Truth) -> list[ChangedKey]:
    """Return the keys of a truth that differ from the scenario, in order, with both values."""
    documents = [one.model_dump(mode="json", exclude_none=True) for one in (scenario, in_truth)]
    found = []
    for path in dict.fromkeys(_paths(_keys(truth))):
        alone = path[0] in IN_TRUTH_ALONE
        assumed, true = (_value_at(one, path) for one in documents)
        true = getattr(truth, path[0]) if alone else true
        if assumed != true:
            found.append(ChangedKey(".".join(path), assumed, true))
    return found


def _keys(truth: Truth) -> dict[str, Any]:
    return truth.model_dump(exclude_none=True)


def _paths(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Paths of the values in a document; sections in a list share their paths."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _paths(inner, (*path, key))
    elif isinstance(value, list) and value and isinstance(value[0], Mapping):
        for inner in value:
            yield from _paths(inner, path)
    else:
        yield path


def _value_at(document: Any, path: tuple[str, ...]) -> Any:
    """Value at a path, or None; for a list of sections, a list of values unless all are equal."""
    if isinstance(document, list) and path:
        each = [_value_at(one, path) for one in document]
        return each[0] if all(one == each[0] for one in each) else each
    if not path:
        return document
    return _value_at(document[path[0]], path[1:]) if path[0] in (document or {}) else None


def _each(value: Any, size: int) -> list[Any]:
    """One value for each vehicle."""
    return value if isinstance(value, list) else [value] * size
