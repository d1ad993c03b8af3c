"""Formats of files of the field: what is in their bytes, as features.

KML, KMZ and GPX 1 of any namespace, GeoJSON (RFC 7946), QGroundControl plans, fence lists of
ArduPilot, of either kind, and survey points as CSV. The first bytes of a file decide.
"""

import csv
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count, islice
from typing import Any
from xml.etree import ElementTree as Xml
from xml.parsers import expat

from syncplan.errors import InputError
from syncplan.importing.features import GEOMETRIES, FeatureList, Geometry, Labels, is_red, titled
from syncplan.scenario.loading import parse_document, text_of

LARGEST_BYTES, LARGEST_ARCHIVE = 5 * 2**20, 16 * 2**20
"""Largest file, also once unpacked, and largest archive, which may hold pictures."""

MOST_ITEMS = 500_000
"""Most lines of a file, and most elements of XML."""

FORMATS = "KML, KMZ, GeoJSON, GPX, a QGroundControl plan, a fence list or CSV"
"""What may be given, in messages."""

LONGEST_HEAD = 10_000
"""Number of characters of a table's head that are read."""

DEEPEST = 100
"""Most XML elements within each other."""


def features_of(data: bytes, source: str) -> FeatureList:
    """Return the features of a file's bytes, with notes on what is left out.

    Raises InputError naming the file, the feature and the remedy.
    """
    into = FeatureList(source)
    start = data.removeprefix(b"\xef\xbb\xbf").lstrip()
    packed = start.startswith(b"PK\x03\x04")
    most = LARGEST_ARCHIVE if packed else LARGEST_BYTES
    try:
        if len(data) > most:
            raise InputError(f"is larger than {most // 2**20} MiB; simplify it")
        if packed:
            _read_kml(_parsed(_unpacked(start, into)), into)
        elif start.startswith((b"<", b"\xff\xfe<\0", b"\xfe\xff\0<")):
            root = _parsed(start)
            _read_kml(root, into)
            _read_gpx(root, into)
        else:
            _read_text(data, into)
        if not into.features:
            raise InputError(f"holds no polygons, lines or points; give {FORMATS}")
    except InputError as error:
        raise InputError(error.problem, key=error.key, source=source) from None
    except csv.Error as error:
        raise InputError(f"is no readable table: {error}", source=source) from None
    return into


# --- archives and XML -----------------------------------------------------------------------------


def _unpacked(data: bytes, into: FeatureList) -> bytes:
    """The first KML file of an archive."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            # what Finder adds begins so
            hidden = re.compile(r"__MACOSX/|(.*/)?\._")
            names = [name for name in archive.namelist() if not hidden.match(name)]
            names = [name for name in names if name.lower().endswith(".kml")]
            texts = [archive.open(name).read(LARGEST_BYTES + 1) for name in names[:1]]
    # of what an archive's bytes may hold, zipfile refuses some by errors of its own
    except Exception as error:
        raise InputError(f"is no readable archive: {error}") from None
    if not texts:
        raise InputError("holds no .kml file")
    if len(texts[0]) > LARGEST_BYTES:
        raise InputError(f"unpacks to more than {LARGEST_BYTES // 2**20} MiB")
    if len(names) > 1:
        into.notes.append(f"of {len(names)} .kml files, the first is read")
    return texts[0]


def _parsed(data: bytes) -> Xml.Element:
    """The root element; names of elements are without namespaces, declared or not."""
    builder, parser, opened = Xml.TreeBuilder(), expat.ParserCreate(), list[str]()
    number = count(1)

    def start(tag: str, attributes: dict[str, str]) -> None:
        opened.append(tag.rpartition(":")[2])
        if len(opened) > DEEPEST:
            raise InputError(f"nests more than {DEEPEST} elements")
        if next(number) > MOST_ITEMS:
            raise InputError(f"has more than {MOST_ITEMS:,} elements; simplify it")
        named = {name.rpartition(":")[2]: value for name, value in attributes.items()}
        builder.start(opened[-1], named)

    def refuse(*_: Any) -> None:
        raise InputError("has a document type; save it without <!DOCTYPE>")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: builder.end(opened.pop())
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"is no readable XML: {error}") from None
    return builder.close()


def _read_gpx(root: Xml.Element, into: FeatureList) -> None:
    # a waypoint is a position itself
    for tag, place in (("wpt", "wpt"), ("rte", "rtept"), ("trk", "trkpt")):
        for element in root.iter(tag):
            ring = [(point.get("lon"), point.get("lat")) for point in element.iter(place)]
            geometry: Geometry = "point" if tag == place else "line"
            into.add(geometry, Labels(_text(element, "name")), [ring])


def _text(element: Xml.Element, path: str) -> str:
    return (element.findtext(path) or "").strip()


# --- KML ------------------------------------------------------------------------------------------


def _read_kml(root: Xml.Element, into: FeatureList) -> None:
    reds = {
        style.get("id"): _is_red(style)
        for tag in ("Style", "CascadingStyle")
        for style in root.iterfind(f".//{tag}[@id]")
    }
    for styles in root.iterfind(".//StyleMap[@id]"):
        reds[styles.get("id")] = reds.get(_style(styles, "Pair[key='normal']/styleUrl"))
    for mark, folder in _placemarks(root, ""):
        style, kind = mark.find(".//Style"), _text(mark, ".//Data[@name='kind']/value")
        red = None if style is None else _is_red(style)
        if red is None:
            red = reds.get(_style(mark, "styleUrl"))
        labels = Labels(_text(mark, "name"), kind, folder, bool(red))
        for tag, geometry in GEOMETRIES.items():
            into.add(geometry, labels, *map(_rings, mark.iter(tag)))
        # rings that are part of no polygon
        for path in ("LinearRing", ".//MultiGeometry/LinearRing"):
            into.add("polygon", labels, *map(_rings, mark.iterfind(path)))
    for tag in ("NetworkLink", "GroundOverlay", "Track", "Model"):
        if number := len(root.findall(f".//{tag}")):
            into.notes.append(f"elements that are left out: {number} {tag}")


def _placemarks(element: Xml.Element, folder: str) -> Iterator[tuple[Xml.Element, str]]:
    """Every placemark, with the names of its folders."""
    for child in element:
        if child.tag == "Placemark":
            yield child, folder
        elif child.tag in ("Document", "Folder"):
            name = _text(child, "name") if child.tag == "Folder" else ""
            yield from _placemarks(child, " / ".join(filter(None, (folder, name))))


def _rings(shape: Xml.Element) -> list[Iterable[list[str]]]:
    """Positions of the rings of a polygon, outer first, or of a shape that has none."""
    outer = shape.findall("outerBoundaryIs//LinearRing")
    rings = [*outer, *shape.iterfind("innerBoundaryIs//LinearRing")]
    if shape.tag != "Polygon":
        rings = [shape]
    elif len(outer) != 1:
        rings = []
    # blanks around commas are a common mistake
    texts = (ring.findtext("coordinates") or "" for ring in rings)
    lists = [",".join(map(str.strip, text.split(","))) for text in texts]
    return [(position.split(",") for position in text.split()) for text in lists]


def _style(element: Xml.Element, path: str) -> str:
    """The identifier of a style that is referred to."""
    return _text(element, path).rpartition("#")[2]


def _is_red(style: Xml.Element) -> bool | None:
    """Whether a style fills or draws in red; None if it has no colors of polygons."""
    colors = [
        part.text for tag in ("Poly", "Line") for part in style.iterfind(f".//{tag}Style/color")
    ]
    return is_red(*colors, order="abgr") if colors else None


# --- text -----------------------------------------------------------------------------------------

_PAIR = re.compile(r"\s*[-+]?\d+(\.\d*)?\s+[-+]?\d+(\.\d*)?\s*")
_NAMES = ("name", "label", "title", "landmark", "pointname", "pointid", "point", "id")
_LATITUDES = ("latitude", "lat", "latdeg", "latitudedeg", "y")
_LONGITUDES = ("longitude", "lon", "lng", "long", "londeg", "longitudedeg", "x")
_WEST_OR_SOUTH = ("w", "s", "west", "south")


def _read_text(data: bytes, into: FeatureList) -> None:
    text = text_of(data, "", "UTF-8 text, or an archive (KMZ)")
    if text.lstrip().startswith(("{", "[")):
        document = parse_document(text, "", "json")
        (_read_plan if document.get("fileType") == "Plan" else _read_geojson)(document, into)
        return
    lines = _lines(text)
    head = next((line for line in lines if not line.startswith("#")), "")
    if head.startswith("QGC WPL"):
        _read_items(lines, into)
    elif _PAIR.fullmatch(head):
        # the point of return, and the corners
        into.notes.append(f"the point of return, {' '.join(head.split())}, is left out")
        into.add_fence(True, map(str.split, lines))
    else:
        _read_points(head, lines, into)


def _lines(text: str) -> Iterator[str]:
    """The lines that are not blank."""
    for number, line in enumerate(io.StringIO(text, None)):
        if number >= MOST_ITEMS:
            raise InputError(f"has more than {MOST_ITEMS:,} lines; simplify it")
        if line.strip():
            yield line


def _key(head: str) -> str:
    """The letters and digits of a head, lower case, without what is in brackets."""
    return re.sub(r"[\[(].*|[^a-z0-9]", "", head.lower())


def _first(values: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """The value of the first key that has one; None without."""
    return next(filter(None, map(values.get, keys)), None)


def _as(kind: type, value: Any) -> Any:
    """A value if it is of a kind, else an empty one."""
    return value if isinstance(value, kind) else kind()


# --- GeoJSON and plans ----------------------------------------------------------------------------

_COLLECTIONS = {"FeatureCollection": "features", "GeometryCollection": "geometries"}


def _read_geojson(document: Mapping[str, Any], into: FeatureList) -> None:
    reference = str(document.get("crs") or "CRS84")
    if not re.search(r"CRS84|\b4326\b", reference):
        problem = f"has coordinates of {reference[:80]}; save it in degrees (WGS 84, EPSG:4326)"
        raise InputError(problem, key="crs")
    objects: list[tuple[Any, Labels]] = [(document, Labels())]
    while objects:
        value, labels = objects.pop()
        member = _as(dict, value)
        kind = str(member.get("type"))
        single = kind.removeprefix("Multi")
        if kind == "Feature":
            properties = _as(dict, member.get("properties"))
            fields = {_key(head): text for head, text in properties.items()}
            name = _first(fields, _NAMES) or member.get("id")
            red = is_red(fields.get("fill"), fields.get("stroke"))
            objects.append((member.get("geometry"), Labels(name, fields.get("kind"), red=red)))
        elif kind in _COLLECTIONS:
            members = _as(list, member.get(_COLLECTIONS[kind]))
            objects += [(inner, labels) for inner in reversed(members)]
        elif single in GEOMETRIES:
            parts = _as(list, member.get("coordinates"))
            shapes = [
                {"Polygon": part, "LineString": [part], "Point": [[part]]}[single]
                for part in (parts if kind != single else [parts])
            ]
            into.add(GEOMETRIES[single], labels, *shapes)
        elif value is None:
            into.notes.append(f"{titled(labels.name) or 'a feature'} has no geometry")
        else:
            problem = f"has a geometry of type {kind[:40]}; give points or polygons"
            raise into.fault(labels, problem)


def _read_plan(document: Mapping[str, Any], into: FeatureList) -> None:
    fences = _as(dict, document.get("geoFence"))
    for value in (*_as(list, fences.get("polygons")), *_as(list, fences.get("circles"))):
        fence = _as(dict, value)
        inclusion, circle = fence.get("inclusion", True), _as(dict, fence.get("circle"))
        if "circle" in fence:
            into.add_circle(inclusion, circle.get("center"), circle.get("radius"))
        else:
            into.add_fence(inclusion, _as(list, fence.get("polygon")))
    for key, part in (("mission", "items"), ("rallyPoints", "points")):
        if _as(dict, document.get(key)).get(part):
            into.notes.append(f"{key}.{part} is left out")


# --- fence lists and survey points ----------------------------------------------------------------

# whether vehicles stay inside, by the MAVLink command of a fence
_POLYGONS = {"5001": True, "5002": False}
_CIRCLES = {"5003": True, "5004": False}


def _read_items(lines: Iterable[str], into: FeatureList) -> None:
    """Add the fences of MAVLink items, whose first parameter counts corners, or is a radius."""
    items, left_out = ([*line.split(), *[""] * 12] for line in lines), 0
    for item in items:
        command, size = item[3:5]
        if command in _POLYGONS:
            counted = int(float(size)) if re.fullmatch(r"\d{1,5}(\.0*)?", size) else 10**5
            corners = [item, *islice(items, max(counted - 1, 0))]
            if len(corners) < counted or any(corner[3] != command for corner in corners):
                problem = f"has fewer corners than the {size} that it counts"
                raise into.fault(into.fence(_POLYGONS[command]), problem)
            into.add_fence(_POLYGONS[command], (corner[8:10] for corner in corners))
        elif command in _CIRCLES:
            into.add_circle(_CIRCLES[command], item[8:10], size)
        else:
            left_out += 1
    if left_out:
        into.notes.append(f"items that are no fences, and left out: {left_out}")


def _read_points(head: str, lines: Iterable[str], into: FeatureList) -> None:
    """Add the points of a table: latitude, longitude and name, in columns in any order."""
    delimiter = max(";\t,", key=head.count)
    heads = next(csv.reader([head[:LONGEST_HEAD]], delimiter=delimiter))
    columns = [_key(column) for column in heads]
    latitude, longitude = (
        next(filter(columns.__contains__, keys), "") for keys in (_LATITUDES, _LONGITUDES)
    )
    if not (latitude and longitude):
        problem = f"has the columns {', '.join(columns)[:80] or 'none'}; its first line must name"
        remedy = "latitude and longitude, in degrees, not eastings and northings"
        raise InputError(f"{problem} {remedy}")
    for number, row in enumerate(filter(any, csv.reader(lines, delimiter=delimiter)), start=1):
        cells = dict(zip(columns, row, strict=False))
        labels = Labels(_first(cells, _NAMES) or f"P{number}")
        if any(row[len(columns) :]):
            raise into.fault(labels, "has more cells than its table has columns")
        if any(
            text.strip().lower() in _WEST_OR_SOUTH
            for key, text in cells.items()
            if key not in _NAMES
        ):
            problem = "has its hemisphere in a column of its own; write -33.5, not 33.5 and S"
            raise into.fault(labels, problem)
        # where semicolons part columns, commas may part decimals
        place = [cells.get(key, "").replace(",", ".") for key in (longitude, latitude)]
        into.add("point", labels, [[place]])
