"""Features of files: polygons, lines and points in degrees, and what their files say they are."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError

Geometry = Literal["polygon", "line", "point"]
Section = Literal["area", "keep_out", "obstacle", "landmark", "none"]

MOST_POSITIONS = 100_000
"""Largest number of positions of a file."""

_NO_FLY = re.compile(
    r"no[\W_]*fl(y|ight)|nfz|keep[\W_]*out|exclu|restrict|prohibit|forbid|danger", re.I
)
_OURS: Mapping[str, Section] = {
    **{name: name for name in ("area", "keep_out", "obstacle", "landmark")},
    **dict.fromkeys(("circle", "center", "entry"), "none"),
}
"""Sections by the `kind` that exports of plans give their features."""


@dataclass(frozen=True, slots=True)
class Feature:
    """A feature of a file.

    Attributes
    ----------
    geometry : polygon, line or point
    name : empty if it has none
    places : (k, 2) latitudes and longitudes in degrees; corners of a polygon are not closed
    holes : corners of the holes of a polygon
    folder : names of the folders that hold it
    color : red, green and blue, 0 to 255; None if it has no style
    section : what the format says that it is; empty if it says nothing
    """

    geometry: Geometry
    name: str
    places: Array
    holes: tuple[Array, ...] = ()
    folder: str = ""
    color: tuple[int, int, int] | None = None
    section: Section | Literal[""] = ""

    @property
    def meant(self) -> Section | Literal[""]:
        """What the format, the name or the style says that the feature is."""
        red, *others = self.color or (0, 0, 0)
        no_fly = _NO_FLY.search(f"{self.folder} {self.name}") or (red > 150 and max(others) < 90)
        return self.section or ("keep_out" if no_fly and self.geometry == "polygon" else "")


@dataclass(slots=True)
class FeatureList:
    """The features of a file as they are read.

    Attributes
    ----------
    source : name of the file
    features : those read so far
    notes : what was left out
    """

    source: str
    features: list[Feature] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    positions: int = 0

    def fault(self, name: str, problem: str) -> InputError:
        """Return the error of a feature."""
        return InputError(
            problem, key=name or f"feature {len(self.features) + 1}", source=self.source
        )

    def add(
        self, geometry: Geometry, name: Any, rings: Iterable[Iterable[Any]], **others: Any
    ) -> None:
        """Add a feature whose rings, outer first, hold positions: longitude, latitude, any others.

        A line that ends where it began is a polygon. Raises InputError for positions that are none.
        """
        title = " ".join(str(name or "").split())
        places, *holes = (self._places(title, ring) for ring in rings)
        closed = len(places) > 3 and np.array_equal(places[0], places[-1])
        if geometry == "line" and closed:
            geometry = "polygon"
        if geometry == "polygon":
            places, *holes = (
                ring[:-1] if len(ring) > 1 and np.array_equal(ring[0], ring[-1]) else ring
                for ring in (places, *holes)
            )
        self.features.append(Feature(geometry, title, places, tuple(holes), **others))

    def _places(self, name: str, positions: Iterable[Any]) -> Array:
        listed = list(positions)
        self.positions += len(listed)
        if self.positions > MOST_POSITIONS:
            raise self.fault(
                name, f"is beyond {MOST_POSITIONS:,} positions, the most of a file; simplify it"
            )
        try:
            places = np.array([[float(one[1]), float(one[0])] for one in listed]).reshape(-1, 2)
        except (TypeError, ValueError, IndexError, KeyError, OverflowError):
            raise self.fault(name, "has a position that is no pair of numbers") from None
        if not len(places):
            raise self.fault(name, "has no positions")
        beyond = ~((np.abs(places[:, 0]) <= 90.0) & (np.abs(places[:, 1]) <= 360.0))
        for latitude, longitude in places[beyond][:1].tolist():
            raise self.fault(
                name,
                f"has the longitude {longitude:g} and the latitude {latitude:g}; give degrees "
                "(WGS 84, EPSG:4326), not metres of a projection",
            )
        places[:, 1] = (places[:, 1] + 180.0) % 360.0 - 180.0
        return places


def fence_name(section: str, number: int) -> str:
    """Return a name for a fence, which has none in its format."""
    return f"{'inclusion' if section == 'area' else 'exclusion'} fence {number}"


def section_of(kind: Any) -> Section | Literal[""]:
    """Return the section of a `kind` that an export of a plan gives a feature."""
    return _OURS.get(str(kind), "")


def color_of(text: Any, order: str = "rgb") -> tuple[int, int, int] | None:
    """Return red, green and blue of hexadecimal digits in an order such as rgb; None if none."""
    digits = str(text or "").strip().lstrip("#")
    if not re.fullmatch(rf"[0-9a-fA-F]{{{2 * len(order)}}}", digits):
        return None
    values = {part: int(digits[2 * k : 2 * k + 2], 16) for k, part in enumerate(order)}
    return values["r"], values["g"], values["b"]
