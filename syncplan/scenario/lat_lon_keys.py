"""Keys in degrees, each instead of one in metres: `area_lat_lon_deg` for `area_m`, and so on.

    degrees given -> geo_origin, or the middle of them -> metres, which are checked and kept

The keys are fields of the models, so that they are described and known, but are never set: a
section that is loaded is in metres from its geo_origin.
"""

import contextlib
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
from syncplan.scenario.quantities import Section, dotted, fault, model_in, with_keys

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
    degrees, metres : values as given; None where there is none
    places : the degrees, checked; None where they are not valid
    """

    sections: tuple[str, ...]
    key: str
    twin: str
    degrees: Any
    metres: Any
    places: Any

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
        keys = list(place_keys(given, cls))
        used = [each for each in keys if each.degrees is not None]
        origin = _origin(given, keys, used)
        document = dict(given)
        for each in used:
            section = document
            for name in each.sections:
                section[name] = section = dict(section[name])
            if each.places is None or origin is None:
                # the fault is reported as any other: until then the twin must not be missing
                section[each.twin] = each.places or []
            else:
                section[each.twin] = _in_plane(origin, each)
            if each.places is not None:
                del section[each.key]
        if origin is not None:
            document["geo_origin"] = origin
        try:
            return check(document)
        except ValidationError as error:
            raise with_keys(error, {each.twin_name: each.name for each in used}) from None


def has_lat_lon(document: Any) -> bool:
    """Return whether a document gives a key in degrees, itself or in its sections."""
    return isinstance(document, Mapping) and any(
        value is not None and (str(key).endswith(ENDING) or has_lat_lon(value))
        for key, value in document.items()
    )


@cache
def _adapter(model: type[BaseModel], key: str) -> TypeAdapter[Any]:
    kind: Any = model.model_fields[key].annotation
    return TypeAdapter(kind)


def place_keys(
    document: Mapping[str, Any], model: type[BaseModel], sections: tuple[str, ...] = ()
) -> Iterator[PlaceKey]:
    """Yield the keys in degrees of a model and of the sections that a document gives."""
    for key, field in model.model_fields.items():
        value, inner = document.get(key), model_in(field.annotation)
        if key.endswith(ENDING):
            stem, places = key.removesuffix(ENDING), None
            twin = f"{stem}_m" if f"{stem}_m" in model.model_fields else stem
            with contextlib.suppress(ValidationError):
                places = _adapter(model, key).validate_python(value)
            yield PlaceKey(sections, key, twin, value, document.get(twin), places)
        elif isinstance(value, Mapping) and inner is not None:
            yield from place_keys(value, inner, (*sections, key))


def _origin(
    document: Mapping[str, Any], keys: Sequence[PlaceKey], used: Sequence[PlaceKey]
) -> GeoOrigin | None:
    """The origin that is given, or the middle of all places; None where there is neither."""
    for each in used:
        if each.metres is not None:
            raise fault(each.name, f"stands instead of {each.twin_name}; give one of the two")
    if any(each.places is None for each in used):
        return None
    given = document.get("geo_origin")
    if given is not None:
        with contextlib.suppress(ValidationError):
            return GeoOrigin.model_validate(given)
        return None
    for each in keys:
        if each.metres is not None:
            raise fault(
                "geo_origin",
                f"is missing: {each.twin_name} is in metres from it, {used[0].name} in degrees",
            )
    places = np.concatenate([_pairs(each.places) for each in used])
    if not len(places):
        return None
    try:
        return middle_of(places)
    except InputError:
        raise fault(
            used[0].name, "places lie more than 1,000 km apart; latitudes come first"
        ) from None


def _in_plane(origin: GeoOrigin, key: PlaceKey) -> Any:
    """The places of a key in m; raises the fault for one that no point of the plane stands for."""
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
    keys = place_keys(section.model_dump(exclude_none=True), type(section)) if origin else ()
    return {each.name: in_lat_lon(origin, each.metres) for each in keys if each.metres}


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
