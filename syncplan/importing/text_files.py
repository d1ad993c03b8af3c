"""ArduPilot's fence lists, of either kind, and survey points as CSV."""

import csv
import re
from collections.abc import Sequence

from syncplan.errors import InputError
from syncplan.importing.features import FeatureList, Section

_PAIR = re.compile(r"[-+]?\d+(\.\d*)?\s+[-+]?\d+(\.\d*)?")
_FENCES: dict[str, tuple[Section, str]] = {
    "5001": ("area", "polygon"),
    "5002": ("keep_out", "polygon"),
    "5003": ("area", "circle"),
    "5004": ("keep_out", "circle"),
}
"""Section and shape of each MAVLink command of a fence."""

_COLUMNS = {
    "latitude": {"latitude", "lat", "latdeg", "latitudedeg", "y"},
    "longitude": {"longitude", "lon", "lng", "long", "londeg", "longitudedeg", "x"},
    "name": {"name", "label", "id", "point", "pointid", "pointname", "title", "landmark"},
}
"""Heads of columns: their letters and digits, lower case, without what is in brackets."""


def read_text(text: str, into: FeatureList) -> None:
    """Add the fences of an ArduPilot list, or the points of a CSV file."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if lines and lines[0].startswith("QGC WPL"):
        _read_items(lines[1:], into)
    elif lines and all(_PAIR.fullmatch(line.strip()) for line in lines):
        # the point of return, and the corners
        into.notes.append(f"the point of return, {' '.join(lines[0].split())}, is left out")
        corners = [line.split()[::-1] for line in lines[1:] or lines]
        into.add("polygon", "inclusion fence", [corners], section="area")
    else:
        _read_points(lines, into)


def _read_items(lines: Sequence[str], into: FeatureList) -> None:
    """Add the fences of a list of MAVLink items, whose first parameter counts a fence's corners."""
    items = [[*line.split(), *[""] * 12] for line in lines]
    at = left_out = 0
    while at < len(items):
        command, count = items[at][3:5]
        section, shape = _FENCES.get(command, ("left_out", ""))
        size = _count(count, len(items)) if shape == "polygon" else 1
        part, at = items[at : at + size], at + size
        if shape == "circle":
            into.add_circle(part[0][8:10], count, section)
        elif shape == "polygon":
            if len(part) < size or any(item[3] != command for item in part):
                problem = f"has fewer corners than the {count} that it counts"
                raise into.fault(into.fence_name(section), problem)
            ring = [item[9:7:-1] for item in part]
            into.add("polygon", into.fence_name(section), [ring], section=section)
        else:
            left_out += 1
    if left_out:
        into.notes.append(f"{left_out} items that are no fences are left out")


def _count(text: str, most: int) -> int:
    """The number of corners that a text counts: at least one, and one beyond the most if more."""
    try:
        return int(min(max(float(text), 1.0), most + 1))
    except ValueError:
        return most + 1


def _read_points(lines: Sequence[str], into: FeatureList) -> None:
    """Add the points of a table with a head: latitude, longitude and name, in any order."""
    head = lines[0] if lines else ""
    delimiter = max(";\t,", key=head.count)
    heads = [re.split(r"[\[(]", each.lower())[0] for each in head.split(delimiter)]
    columns = [re.sub(r"[^a-z0-9]", "", each) for each in heads]
    latitude, longitude, name = (
        next((k for k, column in enumerate(columns) if column in heads_of), len(columns))
        for heads_of in _COLUMNS.values()
    )
    if max(latitude, longitude) == len(columns):
        raise InputError(
            f"has the columns {', '.join(columns)[:80] or 'none'}; its first line must name "
            "latitude and longitude, in degrees, not eastings and northings",
            source=into.source,
        )
    try:
        rows = [row for row in csv.reader(lines[1:], delimiter=delimiter) if any(row)]
    except csv.Error as error:
        raise InputError(f"is no readable table: {error}", source=into.source) from None
    for number, row in enumerate(rows, start=1):
        cells = [*row, *[""] * len(columns)]
        # where semicolons part columns, commas may part decimals
        place = [cells[k].replace(",", ".") for k in (longitude, latitude)]
        into.add("point", cells[name] if name < len(columns) else f"P{number}", [[place]])
