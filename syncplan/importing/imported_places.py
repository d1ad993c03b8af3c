"""Places from files of the field: what each feature becomes, and a scenario of them.

    bytes -> features -> section of each: as asked for, as its file has it, or by rule -> scenario

A scenario holds the places themselves, in degrees; it never names files.
"""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import combinations
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.documents import DocumentPart, LatLon, VersionedDocument
from syncplan.errors import InputError
from syncplan.importing.features import Feature, FeatureList, Geometry, Section
from syncplan.importing.import_options import ImportOptions
from syncplan.importing.json_files import read_json
from syncplan.importing.text_files import read_text
from syncplan.importing.xml_files import LARGEST_BYTES, read_kmz, read_xml
from syncplan.options import lists_options
from syncplan.scenario.areas import joined_polygons, polygon_fault
from syncplan.scenario.ground import DEGREE_DIGITS, lat_lon_of, middle_of, points_of
from syncplan.scenario.loading import read_bytes, scenario_from

MOST_CORNERS = 1000
"""Largest number of corners of a polygon."""

SAME_PLACE_M = 0.01
"""Distance up to which points are one landmark."""

LONGEST_NAME = 60

VEHICLES = ("v1", "v2", "v3")
"""Names of the example's vehicles, which no landmark has."""

SMALLEST_M, USUAL_M = 1.0, 300.0
"""Extent of places below which it says nothing, and the one that is then assumed."""


# --- the document ---------------------------------------------------------------------------------


class ImportedFeature(DocumentPart):
    """A feature of a file, and what it becomes."""

    file: str
    folder: str = Field(description="Names of the folders that hold it; empty without")
    name: str = Field(description="Its name; landmarks have one that no other has")
    geometry: Geometry
    section: Section
    reason: str = Field(description="Why it becomes that", examples=["the largest polygon"])
    lat_lon_deg: list[LatLon] = Field(description="Its places; corners of polygons are not closed")
    holes_lat_lon_deg: list[list[LatLon]] = Field(description="Corners of its holes")


class ImportedPlaces(VersionedDocument):
    """The features of files of the field, and a scenario of what they become."""

    features: list[ImportedFeature]
    scenario: dict[str, Any] = Field(
        description="A scenario in degrees, whose orbit, formation and sensor are examples"
    )
    notes: list[str] = Field(description="What the files hold besides")

    def scenario_text(self) -> str:
        """Return the scenario as YAML."""
        lines = ["# orbit, formation and sensor are examples in a size that fits: give your own"]
        for key, value in self.scenario.items():
            # JSON is YAML; landmarks have a line each
            named = key.startswith("landmarks")
            each = {f"  {_json(name)}": value[name] for name in value} if named else {key: value}
            lines += [f"{key}:"] * named + [f"{name}: {_json(part)}" for name, part in each.items()]
        return "\n".join([*lines, ""])


def _json(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


@lists_options(ImportOptions)
def import_places(
    files: str | Path | Iterable[str | Path] | Mapping[str, bytes], **options: Any
) -> ImportedPlaces:
    """Return the places of files: KML, KMZ, GeoJSON, GPX, QGroundControl plans, fences, CSV.

    `files` may be paths, "-" for standard input, or the bytes of each by its name. Polygons that
    are named or coloured as no-fly, exclusions and holes are keep-outs, the largest other polygon
    is the area, and points are landmarks, unless options match their names. Raises InputError
    naming file and feature.
    """
    paths = [files] if isinstance(files, str | Path) else files
    contents = paths if isinstance(paths, Mapping) else dict(map(read_bytes, paths))
    if not contents:
        raise InputError("give at least one file", key="files")
    lists = [features_of(data, name) for name, data in contents.items()]
    features = _whole([feature for read in lists for feature in read.features])
    features, sections = _chosen(features, ImportOptions(**options))
    return ImportedPlaces(
        version=__version__,
        features=[
            ImportedFeature(
                file=each.file,
                folder=each.folder,
                name=each.name,
                geometry=each.geometry,
                section=section,
                reason=reason,
                lat_lon_deg=_listed(each.places),
                holes_lat_lon_deg=[_listed(hole) for hole in each.holes],
            )
            for each, (section, reason) in zip(features, sections, strict=True)
        ],
        scenario=_scenario(Path(lists[0].source).stem, features, sections),
        notes=[f"{read.source}: {note}" for read in lists for note in read.notes],
    )


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


def _listed(places: Array) -> list[LatLon]:
    return [(latitude, longitude) for latitude, longitude in places.round(DEGREE_DIGITS).tolist()]


# --- what each feature becomes --------------------------------------------------------------------


Sections = list[tuple[Section, str]]
"""What each feature becomes, and why."""


def _whole(features: Sequence[Feature]) -> list[Feature]:
    """The features, with polygons that were cut at the antimeridian made whole."""
    whole: list[Feature] = []
    for each in features:
        cut = each.geometry == "polygon" and 180.0 in np.abs(each.places[:, 1])
        for k, other in enumerate(whole if cut else ()):
            if replace(other, places=each.places, holes=each.holes) == each:
                origin = middle_of(np.concatenate([other.places, each.places]))
                parts = (points_of(origin, part.places) for part in (other, each))
                if (corners := joined_polygons(*parts)) is not None:
                    whole[k] = replace(other, places=lat_lon_of(origin, corners))
                    break
        else:
            whole.append(each)
    return whole


def _chosen(features: list[Feature], options: ImportOptions) -> tuple[list[Feature], Sections]:
    """The features, landmarks with names of their own, and what each becomes."""
    places = np.concatenate([each.places for each in features])
    ends = np.cumsum([len(each.places) for each in features])
    try:
        points = np.split(points_of(middle_of(places), places), ends[:-1])
    except InputError:
        problem = "features lie more than 1,000 km apart; keep those of one field"
        raise InputError(problem, source=features[0].file) from None
    asked = _asked(features, options)
    wanted = [asked.get(k, each.meant) for k, each in enumerate(features)]
    areas = [k for k, section in enumerate(wanted) if section == "area"] or [
        k for k, each in enumerate(features) if wanted[k] is None and each.geometry == "polygon"
    ]
    largest = max(areas, key=lambda k: _size(points[k]), default=-1)
    named, sections, spots, names = [], Sections(), set[str](), Counter(VEHICLES)
    for k, each in enumerate(features):
        section, reason = wanted[k], "asked for" if k in asked else "as its file has it"
        if k == largest:
            reason = "the largest polygon" if section is None else reason
            section = "area"
        elif section == "area" or (section is None and each.geometry == "polygon"):
            section, reason = "left_out", "another polygon is the area"
        elif section is None:
            point = each.geometry == "point"
            section = "landmark" if point else "left_out"
            reason = "a point" if point else "a line that is not closed"
        spot = str(np.rint(points[k][0] / SAME_PLACE_M))
        if section == "landmark" and spot in spots:
            section, reason = "left_out", "at the place of another landmark"
        elif section == "landmark":
            spots.add(spot)
            each = replace(each, name=_new_name(each.name, names))
        if each.holes and section in ("keep_out", "obstacle"):
            reason += "; its holes are closed"
        _check(each, section, points[k])
        named.append(each)
        sections.append((section, reason))
    return named, sections


def _asked(features: Sequence[Feature], options: ImportOptions) -> dict[int, Section]:
    """What is asked for each feature, by its number; raises InputError for a name of none."""
    asked: dict[int, Section] = {}
    for section in get_args(Section):
        for pattern in getattr(options, section):
            matching = [k for k, each in enumerate(features) if _matches(each, pattern)]
            if not matching:
                labels = ", ".join(sorted({each.label for each in features})[:12])
                raise InputError(f"{pattern!r} matches none of {labels}", key=section)
            asked = {**dict.fromkeys(matching, section), **asked}
    return asked


def _matches(feature: Feature, pattern: str) -> bool:
    names = feature.name, feature.folder, f"{feature.folder} / {feature.name}"
    return any(fnmatchcase(name.casefold(), pattern.casefold()) for name in names if name)


def _check(each: Feature, section: Section, points: Array) -> None:
    """Raise InputError for a feature that can't be what it becomes."""
    problem = ""
    if section != "left_out" and (each.geometry == "point") != (section == "landmark"):
        problem = f"is a {each.geometry}, not {section}: landmarks are points, all else is polygons"
    elif section not in ("landmark", "left_out"):
        problem = polygon_fault([(x, y) for x, y in points.tolist()])
        if len(points) > MOST_CORNERS:
            problem = f"has {len(points):,} corners, more than {MOST_CORNERS:,}"
    if problem:
        raise InputError(
            f"{problem}; correct the file, or leave the feature out",
            key=each.label,
            source=each.file,
        )


def _size(points: Array) -> float:
    """Area in m^2 of a polygon's corners."""
    x, y = points.T
    return abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2.0


def _new_name(name: str, names: Counter[str]) -> str:
    """A name for a landmark that differs from those that are counted, and counts it."""
    stem = new = name[:LONGEST_NAME].strip() or "landmark"
    while names[new]:
        names[stem] += 1
        new = f"{stem} {names[stem]}"
    names[new] += 1
    return new


def _scenario(title: str, features: Sequence[Feature], sections: Sections) -> dict[str, Any]:
    """The keys of a scenario; what flies and sees is an example in a size that fits.

    Circles are an eighth of the widest extent, flown in less than a minute, and sensors see as far
    as half of it.
    """
    by: dict[str, list[Feature]] = {}
    for each, (section, _) in zip(features, sections, strict=True):
        by.setdefault(section, []).append(each)
    areas, marks = by.get("area", []), by.get("landmark", [])
    holes = [hole for area in areas for hole in area.holes]
    keep_outs = [each.places for each in by.get("keep_out", [])]
    used = [each.places for each in (*areas, *marks)]
    places = np.concatenate(used) if used else np.zeros((1, 2))
    extent = float(np.max(np.ptp(points_of(middle_of(places), places), axis=0)))
    size = extent if extent > SMALLEST_M else USUAL_M
    radius, speed, reach = (float(f"{size / part:.2g}") for part in (8.0, 60.0, 2.0))
    keys = {
        "name": title if title.isprintable() and len(title) <= LONGEST_NAME else "",
        "orbit": {"radius_m": radius, "speed_mps": speed},
        "formation": {"count": len(VEHICLES), "links": [*map(list, combinations(VEHICLES, 2))]},
        "sensor": {"range_m": reach, "bearing_sigma_rad": 0.03, "sample_time_s": 0.2},
        "area_lat_lon_deg": _listed(areas[0].places) if areas else None,
        "keep_out_lat_lon_deg": [*map(_listed, (*keep_outs, *holes))],
        "obstacles_lat_lon_deg": [_listed(each.places) for each in by.get("obstacle", [])],
        "landmarks_lat_lon_deg": {each.name: _listed(each.places)[0] for each in marks},
    }
    keys = {key: value for key, value in keys.items() if value}
    scenario_from(keys)
    return keys
