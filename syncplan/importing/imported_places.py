"""Places from files of the field: what each feature becomes, and the keys in degrees.

bytes -> features -> section of each: as asked for, as its file has it, or by rule -> keys
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.importing.features import Feature, FeatureList, Section
from syncplan.importing.json_files import read_json
from syncplan.importing.text_files import read_text
from syncplan.importing.xml_files import LARGEST_BYTES, read_kmz, read_xml
from syncplan.results import Result
from syncplan.scenario.areas import joined_polygons, polygon_fault
from syncplan.scenario.ground import DEGREE_DIGITS, lat_lon_of, middle_of, points_of
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.models import GeoOrigin

MOST_CORNERS = 1000
"""Largest number of corners of a polygon."""

SAME_PLACE_M = 0.01
"""Distance up to which points are one landmark."""

LONGEST_NAME = 60

Patterns = Mapping[Section, Sequence[str]]
"""Patterns of names, such as `no fly*`, by the section that matching features become."""


@dataclass(frozen=True, slots=True)
class PlacedFeature:
    """A feature, and what it becomes.

    Attributes
    ----------
    feature, file : as read, and the name of its file
    section : area, keep_out, obstacle, landmark or none
    reason : why, in words
    points : (k, 2) m in a plane about the middle of all features
    """

    feature: Feature
    file: str
    section: Section
    reason: str
    points: Array = field(repr=False)

    @property
    def label(self) -> str:
        """Name in messages."""
        return self.feature.name or f"a {self.feature.geometry} without a name"

    def becoming(self, section: Section, reason: str) -> "PlacedFeature":
        """Return the feature as another section."""
        return replace(self, section=section, reason=reason)


@dataclass(frozen=True, slots=True)
class ImportedPlaces(Result):
    """Places of files.

    Attributes
    ----------
    features : each with what it becomes
    keys : area_lat_lon_deg and so on, as a scenario has them; those without places are left out
    notes : what the files hold besides
    """

    features: tuple[PlacedFeature, ...]
    keys: Mapping[str, Any]
    notes: tuple[str, ...]

    def scenario(self, title: str = "") -> dict[str, Any]:
        """Return the keys of a scenario with the places; what flies and sees is an example.

        Circles are an eighth of the widest extent, and sensors see as far as half of it. Raises
        InputError naming the key that is not valid.
        """
        used = [each.points for each in self.features if each.section in ("area", "landmark")]
        size = max(float(np.max(np.ptp(np.concatenate(used), axis=0))) if used else 0.0, 10.0)
        radius, reach = (float(f"{size / part:.2g}") for part in (8.0, 2.0))
        keys = {
            "name": title,
            "orbit": {"radius_m": radius, "speed_mps": 5.0},
            "formation": {"count": 3, "links": [["v1", "v2"], ["v2", "v3"], ["v1", "v3"]]},
            "sensor": {"range_m": reach, "bearing_sigma_rad": 0.03, "sample_time_s": 0.2},
            **self.keys,
        }
        scenario_from(keys)
        return keys

    def scenario_text(self, title: str = "") -> str:
        """Return that scenario as YAML; raises InputError as `scenario` does."""
        lines = ["# orbit, formation and sensor are examples in a size that fits: give your own"]
        for key, value in self.scenario(title).items():
            # JSON is YAML; landmarks have a line each
            if key.startswith("landmarks"):
                lines += [f"{key}:", *(f"  {_json(name)}: {_json(value[name])}" for name in value)]
            else:
                lines.append(f"{key}: {_json(value)}")
        return "\n".join([*lines, ""])


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def import_places(
    files: str | Path | Iterable[str | Path] | Mapping[str, bytes], patterns: Patterns | None = None
) -> ImportedPlaces:
    """Return the places of files: KML, KMZ, GeoJSON, GPX, QGroundControl plans, fences, CSV.

    `files` may be paths, or the bytes of each by its name. Polygons that are named or coloured as
    no-fly, exclusions and holes are keep-outs, the largest other polygon is the area, and points
    are landmarks, unless `patterns` match their names. Raises InputError naming file and feature.
    """
    paths = [files] if isinstance(files, str | Path) else files
    contents = paths if isinstance(paths, Mapping) else {str(path): _bytes(path) for path in paths}
    lists = [features_of(data, name) for name, data in contents.items()]
    origin = middle_of(np.concatenate([each.places for read in lists for each in read.features]))
    features = [
        PlacedFeature(feature, read.source, "none", "", points_of(origin, feature.places))
        for read in lists
        for feature in read.features
    ]
    placed = _named(_chosen(_joined(features, origin), patterns or {}))
    notes = [f"{read.source}: {note}" for read in lists for note in read.notes]
    return ImportedPlaces(tuple(placed), _keys(placed), tuple(notes))


def features_of(data: bytes, source: str) -> FeatureList:
    """Return the features of a file's bytes, whose form decides how they are read.

    Raises InputError naming the file, the feature and the remedy.
    """
    into = FeatureList(source)
    if len(data) > LARGEST_BYTES:
        raise InputError(f"is larger than {LARGEST_BYTES // 2**20} MiB; simplify it", source=source)
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:4]
    if start.startswith(b"PK"):
        read_kmz(data, into)
    elif start.startswith(b"<") or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        read_xml(data.lstrip(b" \t\r\n"), into)
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise InputError(
                f"is not text: byte {error.start} is not UTF-8; give KML, KMZ, GeoJSON, GPX, a "
                "QGroundControl plan, a fence list or CSV",
                source=source,
            ) from None
        (read_json if start.startswith((b"{", b"[")) else read_text)(text, into)
    if not into.features:
        raise InputError("holds no polygons, lines or points", source=source)
    return into


def _bytes(path: str | Path) -> bytes:
    try:
        with Path(path).open("rb") as file:
            return file.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"can't be read: {reason}", source=str(path)) from None


# --- what each feature becomes --------------------------------------------------------------------


def _joined(features: Sequence[PlacedFeature], origin: GeoOrigin) -> list[PlacedFeature]:
    """The features, with polygons that were cut at the antimeridian made whole."""
    whole: list[PlacedFeature] = []
    for each in features:
        cut = each.feature.geometry == "polygon" and 180.0 in np.abs(each.feature.places[:, 1])
        same = [k for k, other in enumerate(whole) if cut and _parts(other.feature, each.feature)]
        corners = joined_polygons(whole[same[-1]].points, each.points) if same else None
        if corners is None:
            whole.append(each)
            continue
        feature = replace(each.feature, places=lat_lon_of(origin, corners))
        whole[same[-1]] = replace(each, feature=feature, points=corners)
    return whole


def _parts(a: Feature, b: Feature) -> bool:
    return (a.geometry, a.name, a.folder, a.section) == (b.geometry, b.name, b.folder, b.section)


def _chosen(features: Sequence[PlacedFeature], patterns: Patterns) -> list[PlacedFeature]:
    """The features with their sections: asked for, meant by the file, or by rule."""
    chosen = [_asked(each, patterns) for each in features]
    for section, listed in patterns.items():
        for pattern in listed:
            if not any(_matches(each.feature, pattern) for each in features):
                labels = ", ".join(sorted({each.label for each in features})[:12])
                problem = f"{pattern!r} matches no feature; there are {labels}"
                raise InputError(problem, key=section)
    open_ = [k for k, each in enumerate(chosen) if not each.reason]
    areas = [k for k, each in enumerate(chosen) if each.section == "area"]
    polygons = areas or [k for k in open_ if chosen[k].feature.geometry == "polygon"]
    largest = max(polygons, key=lambda k: _size(chosen[k].points), default=-1)
    for k in {*areas, *open_}:
        each = chosen[k]
        if k == largest:
            chosen[k] = each.becoming("area", each.reason or "the largest polygon")
        elif each.feature.geometry == "polygon":
            chosen[k] = each.becoming("none", "another polygon is the area")
        elif each.feature.geometry == "point":
            chosen[k] = each.becoming("landmark", "a point")
        else:
            chosen[k] = each.becoming("none", "a line that is not closed")
    return chosen


def _asked(each: PlacedFeature, patterns: Patterns) -> PlacedFeature:
    """The feature as the patterns or its file have it; without a reason where neither says."""
    for section, listed in patterns.items():
        if any(_matches(each.feature, pattern) for pattern in listed):
            if (each.feature.geometry == "point") != (section == "landmark") and section != "none":
                raise InputError(
                    f"is a {each.feature.geometry}, which can't be {section}; landmarks are "
                    "points, all else is polygons",
                    key=each.label,
                    source=each.file,
                )
            return each.becoming(section, "asked for")
    meant = each.feature.meant
    return each.becoming(meant, "as its file has it") if meant else each


def _matches(feature: Feature, pattern: str) -> bool:
    names = feature.name, feature.folder, f"{feature.folder} / {feature.name}"
    return any(fnmatchcase(name.casefold(), pattern.casefold()) for name in names if name)


def _size(points: Array) -> float:
    """Area in m^2 of a polygon's corners."""
    x, y = points.T
    return abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2.0


def _named(features: Sequence[PlacedFeature]) -> list[PlacedFeature]:
    """The features, with landmarks whose names differ, each place once, and polygons that are."""
    named, taken, places = [], set[str](), list[Array]()
    for each in features:
        if each.section == "landmark":
            if any(np.hypot(*(each.points[0] - place)) < SAME_PLACE_M for place in places):
                named.append(each.becoming("none", "at the place of another landmark"))
                continue
            places.append(each.points[0])
            name = stem = each.feature.name[:LONGEST_NAME].strip() or "landmark"
            number = 1
            while name.casefold() in taken:
                number += 1
                name = f"{stem} {number}"
            taken.add(name.casefold())
            each = replace(each, feature=replace(each.feature, name=name))
        elif each.section != "none":
            _check_polygon(each)
        named.append(each)
    return named


def _check_polygon(each: PlacedFeature) -> None:
    problem = polygon_fault([(x, y) for x, y in each.points.tolist()])
    if len(each.points) > MOST_CORNERS:
        problem = f"has {len(each.points):,} corners, more than {MOST_CORNERS:,}"
    if problem:
        raise InputError(
            f"{problem}; correct the file, or leave the feature out",
            key=each.label,
            source=each.file,
        )


def _keys(features: Sequence[PlacedFeature]) -> dict[str, Any]:
    """The keys in degrees of a scenario; holes of the area are keep-outs."""
    areas = [each.feature for each in features if each.section == "area"]
    holes = [hole for area in areas for hole in area.holes]
    keep_outs = [each.feature.places for each in features if each.section == "keep_out"]
    obstacles = [each.feature.places for each in features if each.section == "obstacle"]
    landmarks = {
        each.feature.name: _listed(each.feature.places)[0]
        for each in features
        if each.section == "landmark"
    }
    keys = {
        "area_lat_lon_deg": _listed(areas[0].places) if areas else None,
        "keep_out_lat_lon_deg": [_listed(places) for places in (*keep_outs, *holes)],
        "obstacles_lat_lon_deg": [_listed(places) for places in obstacles],
        "landmarks_lat_lon_deg": landmarks,
    }
    return {key: value for key, value in keys.items() if value}


def _listed(places: Array) -> list[list[float]]:
    listed: list[list[float]] = places.round(DEGREE_DIGITS).tolist()
    return listed
