"""Features of files: polygons, lines and points in degrees, and what they become."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, Literal, Self, get_args

import numpy as np
from pydantic import Field

from syncplan.documents import DocumentPart, LatLon
from syncplan.errors import InputError
from syncplan.orbits.circles import unit
from syncplan.scenario.areas import joined_polygons, polygon_fault
from syncplan.scenario.ground import DEGREE_DIGITS, WIDEST_M, lat_lon_of
from syncplan.scenario.models import GeoOrigin

Geometry = Literal["polygon", "line", "point"]
Section = Literal["area", "keep_out", "obstacle", "landmark", "left_out"]

GEOMETRIES: Mapping[str, Geometry] = {"Polygon": "polygon", "LineString": "line", "Point": "point"}
"""Geometries by their names in KML and GeoJSON."""

MOST_POSITIONS = 100_000
"""Largest number of positions of a file."""

MOST_JOINED = 1000
"""Largest number of polygons that are made whole; more take long."""

CIRCLE_CORNERS = 48
"""Number of corners of a polygon in place of a circular fence."""

KINDS: Mapping[str, Section] = {
    **{section: section for section in get_args(Section)},
    **dict.fromkeys(("circle", "center", "entry"), "left_out"),
}
"""Sections by the `kind` that exports of plans give their features."""

STATED, NAMED, DRAWN = "as its file states", "named as no-fly", "drawn in red"
"""Why features become what their files state."""

UNSTATED: Mapping[Geometry, tuple[Section, str]] = {
    "polygon": ("area", "the largest polygon"),
    "line": ("left_out", "a line that is not closed"),
    "point": ("landmark", "a point"),
}
"""Section of features whose file does not state one, and why; only one polygon stays the area."""

UNREADABLE = (TypeError, ValueError, LookupError, OverflowError)
"""Errors of values that are no numbers, or of no pair of them."""

LONGEST_TITLE = 200

_NO_FLY = re.compile(
    r"(?<![a-z])(no[\W_]*fl(y|ight)|nfz|keep[\W_]*out|exclu|restrict|prohibit|forbid|danger)",
    re.IGNORECASE,
)


class Feature(DocumentPart):
    """A feature of a file, and what it becomes."""

    file: str
    folder: str = Field(description="Names of the folders that hold it; empty without")
    name: str = Field(description="Its name; landmarks have one that no other has")
    geometry: Geometry
    section: Section
    reason: str = Field(description="Why it becomes that", examples=["the largest polygon"])
    lat_lon_deg: list[LatLon] = Field(description="Its places; corners of polygons are not closed")
    holes_lat_lon_deg: list[list[LatLon]] = Field(description="Corners of its holes")

    def changed(self, **changes: Any) -> Self:
        """Return a copy with some keys changed."""
        return self.model_copy(update=changes)


@dataclass(frozen=True, slots=True)
class Labels:
    """What a file says of a feature.

    Attributes
    ----------
    name, kind : as they are read; None or empty without
    folder : names of the folders that hold it
    red : whether it is filled or drawn in red
    """

    name: Any = None
    kind: Any = None
    folder: str = ""
    red: bool = False

    def section(self, geometry: Geometry) -> tuple[Section, str]:
        """Return what the feature becomes, and why, if nothing else is asked for."""
        stated = KINDS.get(str(self.kind))
        if stated and suits(geometry, stated):
            return stated, STATED
        no_fly = _NO_FLY.search(f"{titled(self.folder)} {titled(self.name)}")
        if geometry == "polygon" and (no_fly or self.red):
            return "keep_out", NAMED if no_fly else DRAWN
        return UNSTATED[geometry]


def suits(geometry: Geometry, section: Section) -> bool:
    """Return whether a geometry can become that: landmarks are points, all else is polygons."""
    return section == "left_out" or geometry == ("point" if section == "landmark" else "polygon")


def titled(text: Any) -> str:
    """Return a name as it is shown: in one line of printing characters, cut where it is long."""
    words = str(text or "")[: 4 * LONGEST_TITLE].split()
    return "".join(filter(str.isprintable, " ".join(words)))[:LONGEST_TITLE]


@dataclass(slots=True)
class FeatureList:
    """The features of a file as they are read, with notes on what is left out."""

    source: str
    features: list[Feature] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    positions: int = 0

    def fault(self, labels: Labels, problem: str) -> InputError:
        """Return the error of a feature."""
        return InputError(problem, key=titled(labels.name) or f"feature {len(self.features) + 1}")

    def add(self, geometry: Geometry, labels: Labels, *shapes: Iterable[Any]) -> None:
        """Add the shapes of a feature: rings, outer first, of positions: longitude, latitude, any.

        A line that ends where it began is a polygon. Raises InputError for positions that are none.
        """
        try:
            places = [[listed(self._places(labels, ring)) for ring in rings] for rings in shapes]
        except UNREADABLE:
            raise self.fault(labels, "has a position that is no pair of decimal degrees") from None
        if not all(rings and all(rings) for rings in places):
            raise self.fault(labels, "has no coordinates, or not one outer boundary")
        for rings in _whole(places) if geometry == "polygon" else places:
            outer, *holes = map(_opened, rings)
            shape = "polygon" if geometry == "line" and outer != rings[0] else geometry
            section, reason = labels.section(shape)
            self.features.append(
                Feature(
                    file=self.source,
                    folder=titled(labels.folder),
                    name=titled(labels.name),
                    geometry=shape,
                    section=section,
                    reason=reason,
                    lat_lon_deg=outer,
                    holes_lat_lon_deg=holes,
                )
            )

    def _places(self, labels: Labels, positions: Iterable[Any]) -> Iterator[LatLon]:
        for position in positions:
            if isinstance(position, str):
                raise TypeError
            latitude, longitude = float(position[1]), float(position[0])
            self.positions += 1
            if self.positions > MOST_POSITIONS:
                problem = f"is beyond {MOST_POSITIONS:,} positions; simplify the file"
                raise self.fault(labels, problem)
            if not (abs(latitude) <= 90.0 and abs(longitude) <= 360.0):
                problem = f"has the longitude {longitude:g} and the latitude {latitude:g}; give"
                remedy = "degrees (WGS 84, EPSG:4326), not metres of a projection"
                raise self.fault(labels, f"{problem} {remedy}")
            yield latitude, longitude

    def fence(self, inclusion: bool) -> Labels:
        """Return labels for the next fence, which has no name: vehicles stay inside or outside."""
        name, kind = ("inclusion", "area") if inclusion else ("exclusion", "keep_out")
        return Labels(f"{name} fence {len(self.features) + 1}", kind)

    def add_fence(self, inclusion: bool, corners: Iterable[Any]) -> None:
        """Add a fence whose corners are a latitude and a longitude."""
        self.add("polygon", self.fence(inclusion), [(place[1::-1] for place in corners)])

    def add_circle(self, inclusion: bool, center: Any, radius: Any) -> None:
        """Add a circular fence about a latitude and longitude, with a radius in m.

        Its polygon lies within the circle where vehicles stay inside, else around it.
        """
        try:
            size = float(radius)
            origin = GeoOrigin(lat_deg=float(center[0]), lon_deg=float(center[1]))
        except UNREADABLE:
            size = np.nan
        if not 0.0 < size < WIDEST_M:
            raise self.fault(self.fence(inclusion), "is a circle without a center and a radius")
        turns = 2.0 * np.pi / CIRCLE_CORNERS * np.arange(CIRCLE_CORNERS)
        reach = size if inclusion else size / np.cos(np.pi / CIRCLE_CORNERS)
        self.add_fence(inclusion, lat_lon_of(origin, reach * unit(turns)).tolist())


def listed(places: Iterable[LatLon], west: float = -180.0) -> list[LatLon]:
    """Return places as documents hold them: rounded, with longitudes from a western limit on."""
    return [
        (round(latitude, DEGREE_DIGITS), round((longitude - west) % 360.0 + west, DEGREE_DIGITS))
        for latitude, longitude in places
    ]


def _opened(ring: list[LatLon]) -> list[LatLon]:
    """The ring without its last corner, if that is the first one."""
    return ring[:-1] if len(ring) > 3 and ring[0] == ring[-1] else ring


def _whole(polygons: list[list[list[LatLon]]]) -> list[list[list[LatLon]]]:
    """Polygons, made whole where the antimeridian cut them; as they are if some are no polygons."""
    onward = [[listed(ring, west=0.0) for ring in rings] for rings in polygons]
    cut = [outer for outer, *_ in onward if any(longitude == 180.0 for _, longitude in outer)]
    if len(cut) < 2 or len(polygons) > MOST_JOINED or any(map(polygon_fault, chain(*onward))):
        return polygons
    return [[*map(listed, rings)] for rings in joined_polygons(onward, tolerance=1e-8)]


def is_red(*colors: Any, order: str = "rgb") -> bool:
    """Return whether any of the colors is red: by name, or hexadecimal digits in an order."""
    for color in colors:
        digits = str(color or "").strip().lstrip("#").lower()
        if len(digits) == 3:
            digits = "".join(2 * digit for digit in digits)
        if re.fullmatch(r"([0-9a-f]{2}){3,4}", digits):
            parts = dict(zip(order, bytes.fromhex(digits), strict=False))
            if parts["r"] > 127 and 3 * max(parts["g"], parts["b"]) < parts["r"]:
                return True
    return "red" in colors
