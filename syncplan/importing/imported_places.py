"""Places from files of the field: what each feature becomes, and a scenario of them.

    bytes -> features as their files have them -> as asked for -> one area -> scenario

A scenario holds the places themselves, in degrees; it never names files.
"""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import combinations
from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import Field

from syncplan import __version__
from syncplan.arrays import Array
from syncplan.documents import VersionedDocument
from syncplan.errors import InputError
from syncplan.importing.features import STATED, UNSTATED, Feature, Section, suits
from syncplan.importing.file_formats import features_of
from syncplan.importing.import_options import ImportOptions
from syncplan.options import lists_options
from syncplan.scenario.areas import Area, polygon_fault
from syncplan.scenario.ground import middle_of, points_of
from syncplan.scenario.loading import read_bytes, scenario_from
from syncplan.scenario.specification import Scenario

MOST_CORNERS = 1000
"""Largest number of corners of a polygon."""

LONGEST_NAME = 60

INSCRIBED_SHARE = 0.6
"""Radius of an example's circles over that of the largest circle in a narrow area."""

VEHICLES = ("v1", "v2", "v3")
"""Names of the example's vehicles, which no landmark has."""

ASKED = "asked for"

BEST_AREAS = (UNSTATED["polygon"][1], STATED, ASKED)
"""Why polygons would be the area, the best reason last."""


class ImportedPlaces(VersionedDocument):
    """The features of files of the field, and a scenario of what they become."""

    features: list[Feature]
    scenario: dict[str, Any] = Field(
        description="A scenario in degrees, whose orbit, formation and sensor are examples"
    )
    notes: list[str] = Field(description="What the files hold besides")

    def scenario_text(self) -> str:
        """Return the scenario as YAML."""
        # JSON is YAML; landmarks have a line each
        keys = dict(self.scenario)
        marks = keys.pop("landmarks_lat_lon_deg", {})
        lines = ["# orbit, formation and sensor are examples in a size that fits: give your own"]
        lines += [f"{key}: {_json(value)}" for key, value in keys.items()]
        if marks:
            lines += ["landmarks_lat_lon_deg:"]
        lines += [f"  {_json(name)}: {_json(place)}" for name, place in marks.items()]
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
    features = [feature for each in lists for feature in each.features]
    points = _points(features)
    features = _chosen(_as_asked(features, ImportOptions(**options)), points)
    notes = [f"{each.source}: {note}" for each in lists for note in each.notes]
    if all(feature.section == "left_out" for feature in features):
        notes.append("all features are left out; say what they become")
    return ImportedPlaces(
        version=__version__,
        features=features,
        scenario=_scenario(Path(lists[0].source).stem, features),
        notes=notes,
    )


# --- what each feature becomes --------------------------------------------------------------------


def _points(features: Sequence[Feature]) -> list[Array]:
    """(k, 2) points in m of each feature; raises InputError if they are too far apart."""
    places = np.array([place for feature in features for place in feature.lat_lon_deg])
    ends = np.cumsum([len(feature.lat_lon_deg) for feature in features])
    try:
        return np.split(points_of(middle_of(places), places), ends[:-1])
    except InputError:
        problem = (
            "features lie more than 1,000 km apart; keep those of one field, and check whether "
            "latitudes and longitudes are exchanged"
        )
        raise InputError(problem, source=features[0].file) from None


def _as_asked(features: Sequence[Feature], options: ImportOptions) -> list[Feature]:
    """The features, with sections as asked for; raises InputError for a name of none."""
    chosen = list(features)
    # what comes first counts where several match
    for section in reversed(get_args(Section)):
        patterns = getattr(options, section)
        for pattern in [patterns] if isinstance(patterns, str) else patterns:
            matching = [k for k, feature in enumerate(features) if _matches(feature, pattern)]
            # a folder may hold others beside
            fitting = [k for k in matching if suits(features[k].geometry, section)]
            if not matching:
                names = sorted({feature.name or feature.geometry for feature in features})
                problem = f"{pattern!r} matches none of {', '.join(names[:12])}"
                raise InputError(problem, key=section)
            for k in fitting or matching:
                chosen[k] = features[k].changed(section=section, reason=ASKED)
    return chosen


def _matches(feature: Feature, pattern: str) -> bool:
    name, folder = feature.name or feature.geometry, feature.folder
    # of special characters, there is the star alone
    wanted = pattern.casefold().replace("[", "[[]").replace("?", "[?]")
    names = (name, folder, f"{folder} / {name}")
    return any(fnmatchcase(known.casefold(), wanted) for known in names if known)


def _chosen(features: Sequence[Feature], points: Sequence[Array]) -> list[Feature]:
    """The features: one of them the area, landmarks with places and names that no other has."""
    areas = [k for k, feature in enumerate(features) if feature.section == "area"]
    sizes = {k: (BEST_AREAS.index(features[k].reason), _size(points[k])) for k in areas}
    area = max(areas, key=sizes.__getitem__, default=None)
    chosen, spots, names = [], set[tuple[float, ...]](), Counter(VEHICLES)
    for k, feature in enumerate(features):
        # to a centimetre
        spot = tuple(round(degrees, 7) for degrees in feature.lat_lon_deg[0])
        if feature.section == "area" and k != area:
            feature = feature.changed(section="left_out", reason="another polygon is the area")
        elif feature.section == "landmark" and spot in spots:
            feature = feature.changed(section="left_out", reason="at the place of another landmark")
        elif feature.section == "landmark":
            spots.add(spot)
            feature = feature.changed(name=_new_name(feature.name, names))
        elif feature.section in ("keep_out", "obstacle") and feature.holes_lat_lon_deg:
            feature = feature.changed(reason=f"{feature.reason}; its holes are closed")
        _check(feature, points[k])
        chosen.append(feature)
    return chosen


def _check(feature: Feature, points: Array) -> None:
    """Raise InputError for a feature that can't be what it becomes."""
    geometry, section, problem = feature.geometry, feature.section, ""
    if not suits(geometry, section):
        wanted = section.replace("_", "-")
        problem = f"is a {geometry}, not {wanted}: landmarks are points, all else is polygons"
    elif section not in ("landmark", "left_out"):
        rings = [points]
        if section == "area":
            origin = middle_of(np.array(feature.lat_lon_deg))
            rings += [points_of(origin, np.array(hole)) for hole in feature.holes_lat_lon_deg]
        problem = next(filter(None, map(_ring_fault, rings)), "")
    if problem:
        problem = f"{problem}; correct the file, or leave the feature out"
        raise InputError(problem, key=feature.name or geometry, source=feature.file)


def _ring_fault(points: Array) -> str:
    """What is wrong with the corners of a polygon; empty if nothing is."""
    if len(points) > MOST_CORNERS:
        return f"has {len(points):,} corners, more than {MOST_CORNERS:,}"
    return polygon_fault(points.tolist())


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


def _scenario(title: str, features: Sequence[Feature]) -> dict[str, Any]:
    """The keys of a scenario: what flies and sees is an example in a size that fits."""
    areas, keep_outs, obstacles, marks = (
        [feature for feature in features if feature.section == section]
        for section in ("area", "keep_out", "obstacle", "landmark")
    )
    holes = [hole for area in areas for hole in area.holes_lat_lon_deg]
    places = {
        "area_lat_lon_deg": [place for area in areas for place in area.lat_lon_deg],
        "keep_out_lat_lon_deg": [keep_out.lat_lon_deg for keep_out in keep_outs] + holes,
        "obstacles_lat_lon_deg": [obstacle.lat_lon_deg for obstacle in obstacles],
        "landmarks_lat_lon_deg": {mark.name: mark.lat_lon_deg[0] for mark in marks},
    }
    given = {key: value for key, value in places.items() if value}
    example = _example(scenario_from({**_sized(1.0, 1.0), **given}))
    named = {"name": title} if title.isprintable() and len(title) <= LONGEST_NAME else {}
    return {**named, **example, **given}


def _example(placed: Scenario) -> dict[str, Any]:
    """Orbit, formation and sensor in a size that fits the places of a scenario."""
    points = np.array([*(placed.area_m or []), *placed.landmarks, (0.0, 0.0)])
    extent = float(np.max(np.ptp(points, axis=0)))
    # places of less than a metre say nothing
    size = extent if extent > 1.0 else 300.0
    radius = size / 8.0
    if placed.area_m:
        area = Area.of(placed.area_m, placed.keep_out_m)
        radius = min(radius, INSCRIBED_SHARE * area.largest_radius())
    return _sized(radius, size)


def _sized(radius: float, size: float) -> dict[str, Any]:
    """An example of circles of a radius in m, flown at up to 1 m/s^2, in places of a size in m."""
    speed = min(radius / 7.5, radius**0.5)
    return {
        "orbit": {"radius_m": _rounded(radius), "speed_mps": _rounded(speed)},
        "formation": {"count": len(VEHICLES), "links": [*map(list, combinations(VEHICLES, 2))]},
        "sensor": {
            "range_m": _rounded(size / 2.0),
            "bearing_sigma_rad": 0.03,
            "sample_time_s": 0.2,
        },
    }


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
