"""Features of files: polygons, lines and points in degrees, and what their files say they are."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.orbits.circles import unit
from syncplan.scenario.ground import WIDEST_M, lat_lon_of
from syncplan.scenario.models import GeoOrigin

Geometry = Literal["polygon", "line", "point"]
Section = Literal["area", "keep_out", "obstacle", "landmark", "left_out"]

MOST_POSITIONS = 100_000
"""Largest number of positions of a file."""

CIRCLE_CORNERS = 48
"""Number of corners of a polygon in place of a circular fence."""

KINDS: dict[str, Section] = {
    "area": "area",
    "keep_out": "keep_out",
    "obstacle": "obstacle",
    "landmark": "landmark",
    "circle": "left_out",
    "center": "left_out",
    "entry": "left_out",
}
"""Sections by the `kind` that exports of plans give their features."""

_NO_FLY = re.compile(
    r"no[\W_]*fl(y|ight)|nfz|keep[\W_]*out|exclu|restrict|prohibit|forbid|danger", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Feature:
    """A feature of a file.

    Attributes
    ----------
    file, geometry, name : name is empty if it has none
    places : (k, 2) latitudes and longitudes in degrees; corners of a polygon are not closed
    holes : corners of the holes of a polygon
    folder : names of the folders that hold it
    color : red, green and blue, 0 to 255; None if it has no style
    section : what the format says that it is; None if it says nothing
    """

    file: str
    geometry: Geometry
    name: str
    places: Array
    holes: tuple[Array, ...] = ()
    folder: str = ""
    color: tuple[int, int, int] | None = None
    section: Section | None = None

    @property
    def meant(self) -> Section | None:
        """What the format, the name or the style says that the feature is."""
        red, *others = self.color or (0, 0, 0)
        no_fly = _NO_FLY.search(f"{self.folder} {self.name}") or (red > 150 and max(others) < 90)
        return self.section or ("keep_out" if no_fly and self.geometry == "polygon" else None)

    @property
    def label(self) -> str:
        """Name in messages."""
        return self.name or f"a {self.geometry} without a name"


@dataclass(slots=True)
class FeatureList:
    """The features of a file as they are read, with notes on what is left out."""

    source: str
    features: list[Feature] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    positions: int = 0

    def fault(self, name: Any, problem: str) -> InputError:
        """Return the error of a feature."""
        label = str(name or f"feature {len(self.features) + 1}")
        return InputError(problem, key=label, source=self.source)

    def fence_name(self, section: Section) -> str:
        """Return a name for the next fence, as these have none."""
        kind = "inclusion" if section == "area" else "exclusion"
        return f"{kind} fence {len(self.features) + 1}"

    def add(self, geometry: Geometry, name: Any, rings: Iterable[Any], **others: Any) -> None:
        """Add a feature whose rings, outer first, hold positions: longitude, latitude, any others.

        A line that ends where it began is a polygon. Raises InputError for positions that are none.
        """
        title = "".join(filter(str.isprintable, " ".join(str(name or "").split())))
        places, *holes = (self._places(title, ring) for ring in rings)
        if geometry == "line" and len(places) > 3 and np.array_equal(places[0], places[-1]):
            geometry = "polygon"
        if geometry == "polygon":
            places, *holes = map(_opened, (places, *holes))
        self.features.append(Feature(self.source, geometry, title, places, tuple(holes), **others))

    def add_circle(self, center: Any, radius: Any, section: Section) -> None:
        """Add a circular fence about a latitude and longitude, with a radius in m.

        Its polygon lies within the circle where vehicles stay inside, else around it.
        """
        name = self.fence_name(section)
        try:
            latitude, longitude, size = float(center[0]), float(center[1]), float(radius)
        except (TypeError, ValueError, IndexError):
            raise self.fault(name, "is a circle without a center and a radius") from None
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and 0.0 < size < WIDEST_M):
            raise self.fault(name, f"is {size:g} m about {latitude:g}, {longitude:g}: no circle")
        reach = size if section == "area" else size / np.cos(np.pi / CIRCLE_CORNERS)
        points = reach * unit(2.0 * np.pi / CIRCLE_CORNERS * np.arange(CIRCLE_CORNERS))
        places = lat_lon_of(GeoOrigin(lat_deg=latitude, lon_deg=longitude), points)
        self.add("polygon", name, [places[:, ::-1]], section=section)

    def _places(self, name: str, positions: Iterable[Any]) -> Array:
        try:
            listed = list(positions)
            self.positions += len(listed)
            if self.positions > MOST_POSITIONS:
                raise self.fault(name, f"is beyond {MOST_POSITIONS:,} positions; simplify the file")
            values = [[float(position[1]), float(position[0])] for position in listed]
        except (TypeError, ValueError, LookupError, OverflowError):
            raise self.fault(name, "has a position that is no pair of numbers") from None
        if not values:
            raise self.fault(name, "has no positions")
        places = np.array(values)
        beyond = ~((np.abs(places[:, 0]) <= 90.0) & (np.abs(places[:, 1]) <= 360.0))
        for latitude, longitude in places[beyond][:1].tolist():
            raise self.fault(
                name,
                f"has the longitude {longitude:g} and the latitude {latitude:g}; give degrees "
                "(WGS 84, EPSG:4326), not metres of a projection",
            )
        places[:, 1] = (places[:, 1] + 180.0) % 360.0 - 180.0
        return places


def _opened(ring: Array) -> Array:
    """The ring without its last corner, if that is the first one."""
    return ring[:-1] if len(ring) > 1 and np.array_equal(ring[0], ring[-1]) else ring


def color_of(text: Any, order: str = "rgb") -> tuple[int, int, int] | None:
    """Return red, green and blue of hexadecimal digits in an order such as rgb; None if none."""
    digits = str(text or "").strip().lstrip("#")
    if not re.fullmatch(rf"[0-9a-fA-F]{{{2 * len(order)}}}", digits):
        return None
    red, green, blue = (int(digits[2 * order.index(part) :][:2], 16) for part in "rgb")
    return red, green, blue
