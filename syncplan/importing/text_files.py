"""ArduPilot's fence lists, of either kind, and survey points as CSV."""

import csv
import itertools
import re
from collections.abc import Sequence

from syncplan.errors import InputError
from syncplan.importing.features import FeatureList, Section, fence_name
from syncplan.importing.fence_circles import add_circle

_PAIR = re.compile(r"[-+]?\d+(\.\d*)?\s+[-+]?\d+(\.\d*)?")
_FENCES: dict[int, tuple[Section, str]] = {
    5001: ("area", "polygon"),
    5002: ("keep_out", "polygon"),
    5003: ("area", "circle"),
    5004: ("keep_out", "circle"),
}
"""Section and shape of each MAVLink command of a fence."""

_COLUMNS_OF_ITEM = ("",) * 12
"""What stands for the columns that an item lacks."""

_COLUMNS = {
    "latitude": {"latitude", "lat", "latdeg", "latitudedeg", "y", "latwgs84"},
    "longitude": {"longitude", "lon", "lng", "long", "londeg", "longitudedeg", "x", "lonwgs84"},
    "name": {
        "name",
        "label",
        "id",
        "point",
        "pointid",
        "pointname",
        "title",
        "station",
        "landmark",
    },
}
"""Heads of columns, lower case, without units and signs."""

_PROJECTED = {"easting", "northing", "e", "n", "utm", "eastingm", "northingm"}


def read_text(text: str, into: FeatureList) -> None:
    """Add the fences of an ArduPilot list, or the points of a CSV file."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if lines and lines[0].startswith("QGC WPL"):
        _read_items(lines[1:], into)
    elif lines and all(_PAIR.fullmatch(line.strip()) for line in lines):
        _read_pairs(lines, into)
    else:
        _read_points(lines, into)


def _read_items(lines: Sequence[str], into: FeatureList) -> None:
    """Add the fences of a list of MAVLink items, whose first parameter counts a fence's corners."""
    items = [[*line.split(), *_COLUMNS_OF_ITEM] for line in lines]
    at = left_out = 0
    while at < len(items):
        command = _whole(items[at], 3, into)
        section, shape = _FENCES.get(command, ("none", ""))
        title = fence_name(section, len(into.features) + 1)
        size = max(_whole(items[at], 4, into), 1) if shape == "polygon" else 1
        part, at = items[at : at + size], at + size
        if shape == "circle":
            add_circle(into, title, part[0][8:10], part[0][4], section)
        elif shape == "polygon":
            if len(part) < size or any(_whole(item, 3, into) != command for item in part):
                raise into.fault(title, f"has fewer corners than the {size} that it counts")
            into.add("polygon", title, [[item[9:7:-1] for item in part]], section=section)
        else:
            left_out += 1
    if left_out:
        into.notes.append(f"{left_out} items that are no fences are left out")


def _whole(item: Sequence[str], column: int, into: FeatureList) -> int:
    try:
        return int(float(item[column]))
    except (ValueError, IndexError, OverflowError):
        raise InputError(
            f"item {' '.join(item).strip()[:60]!r} has no number in column {column + 1} of 12",
            source=into.source,
        ) from None


def _read_pairs(lines: Sequence[str], into: FeatureList) -> None:
    """Add the fence of a list of corners, which begins with the point of return."""
    corners = [line.split()[::-1] for line in lines]
    into.add("polygon", "inclusion fence", [corners[1:] or corners], section="area")
    into.notes.append(f"the point of return, {lines[0].strip()}, is left out")


def _read_points(lines: Sequence[str], into: FeatureList) -> None:
    """Add the points of a table with a head: latitude, longitude and name, in any order."""
    head = lines[0] if lines else ""
    delimiter = max(";\t,", key=head.count)
    columns = [
        re.sub(r"[^a-z0-9]", "", re.split(r"[\[(]", each.lower())[0])
        for each in head.split(delimiter)
    ]
    places = {
        key: next((k for k, column in enumerate(columns) if column in names), -1)
        for key, names in _COLUMNS.items()
    }
    if places["latitude"] < 0 or places["longitude"] < 0:
        projected = _PROJECTED & set(columns)
        raise InputError(
            f"has the columns {', '.join(columns)[:80] or 'none'}; "
            + ("convert eastings and northings to" if projected else "its first line must name")
            + " latitude and longitude, in degrees",
            source=into.source,
        )
    rows = csv.reader(lines[1:], delimiter=delimiter)
    for number, row in zip(itertools.count(2), rows):
        cells = [
            cell.strip().replace(",", ".") if delimiter == ";" else cell.strip() for cell in row
        ]
        if not any(cells):
            continue
        if len(cells) <= max(places["latitude"], places["longitude"]):
            raise InputError(f"line {number} has {len(cells)} columns", source=into.source)
        name = row[places["name"]] if 0 <= places["name"] < len(row) else f"P{number - 1}"
        into.add("point", name, [[(cells[places["longitude"]], cells[places["latitude"]])]])
