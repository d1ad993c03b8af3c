"""KML 2, KMZ and GPX 1, of any namespace."""

import io
import re
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree import ElementTree as Xml
from xml.parsers import expat

from syncplan.errors import InputError
from syncplan.importing.features import KINDS, FeatureList, Geometry, color_of

LARGEST_BYTES = 32 * 2**20
"""Largest file, also once unpacked."""

DEEPEST = 100
"""Most elements within each other."""


def read_kmz(data: bytes, into: FeatureList) -> None:
    """Add the features of the first KML file of an archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if name.lower().endswith(".kml")]
            if not names:
                raise InputError("holds no .kml file", source=into.source)
            with archive.open(names[0]) as file:
                text = file.read(LARGEST_BYTES + 1)
    except InputError:
        raise
    # of what an archive's bytes may hold, zipfile refuses some by errors of its own
    except Exception as error:
        raise InputError(f"is no readable archive: {error}", source=into.source) from None
    if len(text) > LARGEST_BYTES:
        raise InputError(f"unpacks to more than {LARGEST_BYTES // 2**20} MiB", source=into.source)
    read_xml(text, into)


def read_xml(data: bytes, into: FeatureList) -> None:
    """Add the features of a KML or GPX file."""
    root = _parsed(data, into.source)
    if root.tag == "gpx":
        _read_gpx(root, into)
    elif root.tag == "kml" or root.find(".//Placemark") is not None:
        _read_kml(root, into)
    else:
        raise InputError(f"is XML of {root.tag!r}; give KML or GPX", source=into.source)


def _parsed(data: bytes, source: str) -> Xml.Element:
    """The root element; names of elements are without namespaces, declared or not."""
    builder, parser, opened = Xml.TreeBuilder(), expat.ParserCreate(), list[str]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        opened.append(tag.rpartition(":")[2])
        if len(opened) > DEEPEST:
            raise InputError(f"nests more than {DEEPEST} elements", source=source)
        builder.start(opened[-1], attributes)

    def refuse(*_: Any) -> None:
        raise InputError("has a document type; save it without <!DOCTYPE>", source=source)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: builder.end(opened.pop())
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"is no readable XML: {error}", source=source) from None
    return builder.close()


def _text(element: Xml.Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()


# --- KML ------------------------------------------------------------------------------------------


_GEOMETRIES: Mapping[str, Geometry] = {
    "LinearRing": "polygon",
    "LineString": "line",
    "Point": "point",
}


def _read_kml(root: Xml.Element, into: FeatureList) -> None:
    styles = {style.get("id", ""): _color(style) for style in root.iter("Style")}
    for each in root.iter("StyleMap"):
        normal = _text(each, "Pair[key='normal']/styleUrl")
        styles[each.get("id", "")] = styles.get(normal.rpartition("#")[2])
    for mark, folder in _placemarks(root, ""):
        style = mark.find(".//Style")
        color = (
            styles.get(_text(mark, "styleUrl").rpartition("#")[2])
            if style is None
            else _color(style)
        )
        data = {each.get("name", ""): _text(each, "value") for each in mark.iter("Data")}
        about = {"folder": folder, "color": color, "section": KINDS.get(data.get("kind", ""))}
        name, inside = _text(mark, "name"), set[Xml.Element]()
        for polygon in mark.iter("Polygon"):
            rings = [*polygon.iterfind("outerBoundaryIs//LinearRing")]
            rings += polygon.iterfind("innerBoundaryIs//LinearRing")
            inside.update(rings)
            into.add("polygon", name, [*map(_positions, rings)] or [[]], **about)
        for tag, geometry in _GEOMETRIES.items():
            for element in mark.iter(tag):
                if element not in inside:
                    into.add(geometry, name, [_positions(element)], **about)
    for link in root.iter("NetworkLink"):
        into.notes.append(f"the network link {_text(link, 'name')} is not read")


def _placemarks(element: Xml.Element, folder: str) -> Iterator[tuple[Xml.Element, str]]:
    """Every placemark, with the names of its folders."""
    for child in element:
        if child.tag == "Placemark":
            yield child, folder
        elif child.tag in ("Document", "Folder"):
            name = _text(child, "name") if child.tag == "Folder" else ""
            yield from _placemarks(child, " / ".join(filter(None, (folder, name))))


def _positions(element: Xml.Element) -> list[list[str]]:
    """Positions of an element; blanks around commas are a common mistake."""
    text = re.sub(r"\s*,\s*", ",", element.findtext("coordinates") or "")
    return [position.split(",") for position in text.split()]


def _color(style: Xml.Element) -> tuple[int, int, int] | None:
    colors = (
        color_of(style.findtext(f"{tag}/color"), "abgr") for tag in ("PolyStyle", "LineStyle")
    )
    return next(filter(None, colors), None)


# --- GPX ------------------------------------------------------------------------------------------


def _read_gpx(root: Xml.Element, into: FeatureList) -> None:
    for point in root.iter("wpt"):
        into.add("point", _text(point, "name"), [[_position(point)]])
    for tag, part in (("rte", "rtept"), ("trk", "trkpt")):
        for track in root.iter(tag):
            into.add("line", _text(track, "name"), [map(_position, track.iter(part))])


def _position(point: Xml.Element) -> tuple[str | None, str | None]:
    return point.get("lon"), point.get("lat")
