"""Keys in degrees, each instead of one in metres: `area_lat_lon_deg` for `area_m`, and so on.

    degrees given -> geo_origin, or the middle of them -> metres, which are checked and kept

The keys are fields of the models, so that they are described and known, but are never set: a
section that is loaded is in metres from its geo_origin.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from pydantic import BaseModel, GetCoreSchemaHandler, TypeAdapter, ValidationError
from pydantic_core import CoreSchema, core_schema

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.scenario.ground import DEGREE_DIGITS, WIDEST_M, lat_lon_of, middle_of, points_of
from syncplan.scenario.models import GeoOrigin
from syncplan.scenario.quantities import (
    Section,
    dotted,
    fault,
    model_in,
    with_keys,
    with_locations,
)

ENDING = "_lat_lon_deg"

DIGITS = 6
"""Decimals of the metres that degrees become."""


@dataclass(frozen=True, slots=True)
class PlaceKey:
    """A key in degrees, and what a document gives for it and for its twin in metres.

    Attributes
    ----------
    sections : keys of the sections that hold it
    key, twin : in degrees, and in metres
    places : the degrees, checked; None where none are given
    metres : value of the twin as given; None where there is none
    """

    sections: tuple[str, ...]
    key: str
    twin: str
    places: Any
    metres: Any

    @property
    def name(self) -> str:
        """Dotted key in degrees."""
        return dotted((*self.sections, self.key))

    @property
    def twin_name(self) -> str:
        """Dotted key in metres."""
        return dotted((*self.sections, self.twin))


class PlacedSection(Section):
    """Section with a `geo_origin`, whose places may be given in degrees."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema: the conversion comes before all other rules."""
        return core_schema.no_info_wrap_validator_function(cls._in_metres, handler(source))

    @classmethod
    def _in_metres(cls, given: Any, check: core_schema.ValidatorFunctionWrapHandler) -> Any:
        # of every scenario that is read, most have none
        if not has_lat_lon(given):
            return check(given)
        document, keys = dict(_keys_of(given)), list(place_keys(given, cls))
        used = [key for key in keys if key.places is not None]
        origin = _checked(cls, (), "geo_origin", document.get("geo_origin"))
        document["geo_origin"] = origin = origin or _middle(keys, used)
        for key in used:
            section = document
            for name in key.sections:
                section[name] = section = dict(_keys_of(section[name]))
            del section[key.key]
            section[key.twin] = _in_plane(origin, key)
        try:
            return check(document)
        except ValidationError as error:
            raise with_keys(error, {key.twin_name: key.name for key in used}) from None


def has_lat_lon(document: Any) -> bool:
    """Return whether a document gives a key in degrees, itself or in its sections."""
    return any(
        value is not None and (str(key).endswith(ENDING) or has_lat_lon(value))
        for key, value in _keys_of(document).items()
    )


def _keys_of(section: Any) -> Mapping[str, Any]:
    """The keys that a section gives, be it a mapping or a model; nothing else gives any."""
    if isinstance(section, BaseModel):
        return {key: getattr(section, key) for key in section.model_fields_set}
    return section if isinstance(section, Mapping) else {}


@cache
def _adapter(model: type[BaseModel], key: str) -> TypeAdapter[Any]:
    kind: Any = model.model_fields[key].annotation
    return TypeAdapter(kind, config=Section.model_config)


def _checked(model: type[BaseModel], sections: tuple[str, ...], key: str, value: Any) -> Any:
    """The value of a model's field; raises the faults at its place in the document."""
    try:
        return _adapter(model, key).validate_python(value)
    except ValidationError as error:
        raise with_locations(error, lambda location: (*sections, key, *location)) from None


def place_keys(
    document: Any, model: type[BaseModel], sections: tuple[str, ...] = ()
) -> Iterator[PlaceKey]:
    """Yield the keys in degrees of a model and of the sections that a document gives."""
    given = _keys_of(document)
    for key, field in model.model_fields.items():
        value, inner = given.get(key), model_in(field.annotation)
        if key.endswith(ENDING):
            stem = key.removesuffix(ENDING)
            twin = f"{stem}_m" if f"{stem}_m" in model.model_fields else stem
            places = _checked(model, sections, key, value)
            yield PlaceKey(sections, key, twin, places, given.get(twin))
        elif inner is not None:
            yield from place_keys(value, inner, (*sections, key))


def _middle(keys: Sequence[PlaceKey], used: Sequence[PlaceKey]) -> GeoOrigin | None:
    """The middle of all places; None without any. Raises a fault where a key is in metres."""
    in_metres = [key.twin_name for key in keys if key.metres is not None and key not in used]
    if used and in_metres:
        problem = f"is missing: {in_metres[0]} is in metres from it, {used[0].name} in degrees"
        raise fault("geo_origin", problem)
    places = _pairs([key.places for key in used])
    try:
        return middle_of(places) if len(places) else None
    except InputError:
        usual = np.median(places, axis=0)
        far = max(used, key=lambda key: np.max(np.abs(_pairs(key.places) - usual), initial=0.0))
        problem = "holds a place more than 1,000 km from others; latitudes come first"
        raise fault(far.name, problem) from None


def _in_plane(origin: GeoOrigin | None, key: PlaceKey) -> Any:
    """The places of a key in m; raises the fault for one that no point of the plane stands for."""
    if key.metres is not None:
        raise fault(key.name, f"stands instead of {key.twin_name}; give one of the two")
    if origin is None:
        return key.places
    places = _pairs(key.places)
    points = points_of(origin, places)
    for k in np.flatnonzero(~(np.hypot(*points.T) <= WIDEST_M))[:1]:
        raise fault(
            key.name,
            f"must be within {WIDEST_M / 1000.0:g} km of geo_origin; latitudes come first",
            places[k].tolist(),
        )
    return _exchanged(key.places, iter(points.round(DIGITS).tolist()))


def lat_lon_places(section: PlacedSection) -> dict[str, Any]:
    """Return the keys in degrees, dotted, that stand for a section's places in metres.

    There are none without a geo_origin.
    """
    origin: Any = getattr(section, "geo_origin", None)
    keys = place_keys(section, type(section)) if origin else ()
    return {key.name: in_lat_lon(origin, key.metres) for key in keys if key.metres}


def in_lat_lon(origin: GeoOrigin, points: Any) -> Any:
    """Return points (x, y) in m, in lists and mappings, as latitudes and longitudes in degrees."""
    places = lat_lon_of(origin, _pairs(points)).round(DEGREE_DIGITS)
    return _exchanged(points, iter(places.tolist()))


def _pairs(value: Any) -> Array:
    """Every pair (k, 2) of a value of lists and mappings."""
    if isinstance(value, tuple):
        return np.array([value])
    inner = value.values() if isinstance(value, Mapping) else value
    return np.concatenate([np.zeros((0, 2)), *map(_pairs, inner)])


def _exchanged(value: Any, pairs: Iterator[Any]) -> Any:
    """The value with its pairs exchanged for others, in order."""
    if isinstance(value, tuple):
        return next(pairs)
    if isinstance(value, Mapping):
        return {name: _exchanged(inner, pairs) for name, inner in value.items()}
    return [_exchanged(inner, pairs) for inner in value]
