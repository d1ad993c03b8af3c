"""GeoJSON (RFC 7946), and the fences of QGroundControl plans."""

from collections.abc import Mapping
from typing import Any

from syncplan.errors import InputError
from syncplan.importing.features import (
    FeatureList,
    Geometry,
    Section,
    color_of,
    fence_name,
    section_of,
)
from syncplan.importing.fence_circles import add_circle
from syncplan.scenario.loading import parse_document

_NAMES = ("name", "Name", "NAME", "title", "label", "landmark", "id")
_PARTS: Mapping[str, Geometry] = {"Polygon": "polygon", "LineString": "line", "Point": "point"}


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
    features = (
        document.get("features") if document.get("type") == "FeatureCollection" else [document]
    )
    if not isinstance(features, list):
        raise InputError("must be a list", key="features", source=into.source)
    for feature in features:
        _read_feature(feature, into)


def _read_feature(feature: Any, into: FeatureList) -> None:
    given = feature if isinstance(feature, dict) else {}
    properties = given.get("properties")
    about = properties if isinstance(properties, dict) else {}
    name = next((about[key] for key in _NAMES if about.get(key) not in (None, "")), "")
    color = color_of(about.get("fill")) or color_of(about.get("stroke"))
    geometry = given.get("geometry") if given.get("type") == "Feature" else given
    if geometry is not None:
        keys = {"color": color, "section": section_of(about.get("kind"))}
        _read_geometry(geometry, name or given.get("id", ""), into, keys, depth=0)


def _read_geometry(
    geometry: Any, name: Any, into: FeatureList, about: dict[str, Any], depth: int
) -> None:
    given = geometry if isinstance(geometry, dict) else {}
    kind, parts = str(given.get("type")), given.get("coordinates")
    if kind == "GeometryCollection" and depth < 10:
        for inner in given.get("geometries") or []:
            _read_geometry(inner, name, into, about, depth + 1)
        return
    single = kind.removeprefix("Multi")
    if single not in _PARTS or not isinstance(parts, list):
        raise into.fault(str(name), f"has a geometry of type {kind}; give points or polygons")
    try:
        for part in parts if kind != single else [parts]:
            rings = {"Polygon": part, "LineString": [part], "Point": [[part]]}[single]
            into.add(_PARTS[single], name, rings, **about)
    except (TypeError, ValueError):
        raise into.fault(str(name), "has a position that is no pair of numbers") from None


def _read_plan(document: Mapping[str, Any], into: FeatureList) -> None:
    """Add the fences of a plan: inclusions are areas, exclusions keep-outs."""
    fence = document.get("geoFence")
    fences = fence if isinstance(fence, dict) else {}
    for key in ("polygons", "circles"):
        for each in fences.get(key) or []:
            if not isinstance(each, dict):
                raise into.fault("geoFence", f"{key} must be sections of keys")
            section: Section = "area" if each.get("inclusion", True) else "keep_out"
            title = fence_name(section, len(into.features) + 1)
            if key == "polygons":
                corners = each.get("polygon") or []
                if not all(isinstance(corner, list) and len(corner) > 1 for corner in corners):
                    raise into.fault(title, "has a position that is no pair of numbers")
                into.add("polygon", title, [[corner[1::-1] for corner in corners]], section=section)
            else:
                circle = each.get("circle")
                given = circle if isinstance(circle, dict) else {}
                add_circle(into, title, given.get("center"), given.get("radius"), section)
    for key, words in (("mission", "items"), ("rallyPoints", "points")):
        part = document.get(key)
        if isinstance(part, dict) and part.get(words):
            into.notes.append(f"{key}.{words} is left out")
