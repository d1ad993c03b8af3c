"""GeoJSON (RFC 7946), and the fences of QGroundControl plans."""

from collections.abc import Mapping
from typing import Any

from syncplan.errors import InputError
from syncplan.importing.features import KINDS, FeatureList, Geometry, Section, color_of
from syncplan.scenario.loading import parse_document

_NAMES = ("name", "Name", "NAME", "title", "label", "landmark", "id")
_GEOMETRIES: Mapping[str, Geometry] = {
    "Polygon": "polygon",
    "LineString": "line",
    "Point": "point",
}


def read_json(text: str, into: FeatureList) -> None:
    """Add the features of a GeoJSON text, or the fences of a QGroundControl plan."""
    document = parse_document(text, into.source, "json")
    if document.get("fileType") == "Plan":
        _read_plan(document, into)
        return
    reference = str(document.get("crs") or "CRS84")
    if "CRS84" not in reference and "4326" not in reference:
        raise InputError(
            f"has coordinates of {reference[:80]}; save it in degrees (WGS 84, EPSG:4326)",
            key="crs",
            source=into.source,
        )
    whole = document.get("type") == "FeatureCollection"
    for feature in _list(document.get("features")) if whole else [document]:
        given = _section(feature)
        about = _section(given.get("properties"))
        name = next((about[key] for key in _NAMES if about.get(key)), given.get("id"))
        color = color_of(about.get("fill")) or color_of(about.get("stroke"))
        shape = given.get("geometry") if given.get("type") == "Feature" else given
        if shape is not None:
            keys = {"color": color, "section": KINDS.get(str(about.get("kind")))}
            _read_geometry(_section(shape), name, into, keys)


def _read_geometry(
    shape: Mapping[str, Any], name: Any, into: FeatureList, about: Mapping[str, Any]
) -> None:
    for inner in _list(shape.get("geometries")):
        _read_geometry(_section(inner), name, into, about)
    kind = str(shape.get("type"))
    single = kind.removeprefix("Multi")
    if single in _GEOMETRIES:
        parts = _list(shape.get("coordinates"))
        for part in parts if kind != single else [parts]:
            rings = {"Polygon": _list(part), "LineString": [part], "Point": [[part]]}[single]
            into.add(_GEOMETRIES[single], name, rings or [[]], **about)
    elif kind != "GeometryCollection":
        raise into.fault(name, f"has a geometry of type {kind[:40]}; give points or polygons")


def _read_plan(document: Mapping[str, Any], into: FeatureList) -> None:
    """Add the fences of a plan: inclusions are areas, exclusions keep-outs."""
    fences = _section(document.get("geoFence"))
    for key in ("polygons", "circles"):
        for each in map(_section, _list(fences.get(key))):
            section: Section = "area" if each.get("inclusion", True) else "keep_out"
            if key == "polygons":
                ring = [_list(corner)[1::-1] for corner in _list(each.get("polygon"))]
                into.add("polygon", into.fence_name(section), [ring], section=section)
            else:
                circle = _section(each.get("circle"))
                into.add_circle(circle.get("center"), circle.get("radius"), section)
    for key, words in (("mission", "items"), ("rallyPoints", "points")):
        if _section(document.get(key)).get(words):
            into.notes.append(f"{key}.{words} is left out")


def _section(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
