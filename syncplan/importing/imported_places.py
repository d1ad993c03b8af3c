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
from syncplan.importing.features import STATED, UNSTATED, Feature, Section
from syncplan.importing.file_formats import features_of
from syncplan.importing.import_options import ImportOptions
from syncplan.options import lists_options
from syncplan.scenario.areas import polygon_fault
from syncplan.scenario.ground import middle_of, points_of
from syncplan.scenario.loading import read_bytes, scenario_from

MOST_CORNERS = 1000
"""Largest number of corners of a polygon."""

LONGEST_NAME = 60

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
    return ImportedPlaces(
        version=__version__,
        features=features,
        scenario=_scenario(Path(lists[0].source).stem, features, points),
        notes=[f"{each.source}: {note}" for each in lists for note in each.notes],
    )


# --- what each feature becomes --------------------------------------------------------------------


def _points(features: Sequence[Feature]) -> list[Array]:
    """(k, 2) points in m of each feature; raises InputError if they are too far apart."""
    places = np.array([place for feature in features for place in feature.lat_lon_deg])
    ends = np.cumsum([len(feature.lat_lon_deg) for feature in features])
    try:
        return np.split(points_of(middle_of(places), places), ends[:-1])
    except InputError:
        problem = "features lie more than 1,000 km apart; keep those of one field"
        raise InputError(problem, source=features[0].file) from None


def _as_asked(features: Sequence[Feature], options: ImportOptions) -> list[Feature]:
    """The features, with sections as asked for; raises InputError for a name of none."""
    chosen = list(features)
    # what comes first counts where several match
    for section in reversed(get_args(Section)):
        for pattern in getattr(options, section):
            matching = [k for k, feature in enumerate(features) if _matches(feature, pattern)]
            if not matching:
                names = sorted({feature.name or feature.geometry for feature in features})
                problem = f"{pattern!r} matches none of {', '.join(names[:12])}"
                raise InputError(problem, key=section)
            for k in matching:
                chosen[k] = features[k].changed(section=section, reason=ASKED)
    return chosen


def _matches(feature: Feature, pattern: str) -> bool:
    names = feature.name, feature.folder, f"{feature.folder} / {feature.name}"
    return any(fnmatchcase(name.casefold(), pattern.casefold()) for name in names if name)


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
    if section != "left_out" and (geometry == "point") != (section == "landmark"):
        problem = f"is a {geometry}, not {section}: landmarks are points, all else is polygons"
    elif section not in ("landmark", "left_out"):
        problem = polygon_fault(points.tolist())
        if len(points) > MOST_CORNERS:
            problem = f"has {len(points):,} corners, more than {MOST_CORNERS:,}"
    if problem:
        problem = f"{problem}; correct the file, or leave the feature out"
        raise InputError(problem, key=feature.name or feature.geometry, source=feature.file)


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


def _scenario(title: str, features: Sequence[Feature], points: Sequence[Array]) -> dict[str, Any]:
    """The keys of a scenario; what flies and sees is an example in a size that fits.

    Circles are an eighth of the widest extent, flown in less than a minute, and sensors see as far
    as half of it.
    """
    areas, keep_outs, obstacles, marks = (
        [feature for feature in features if feature.section == section]
        for section in ("area", "keep_out", "obstacle", "landmark")
    )
    holes = [hole for area in areas for hole in area.holes_lat_lon_deg]
    used = [points[k] for k, each in enumerate(features) if each.section in ("area", "landmark")]
    extent = float(np.max(np.ptp(np.concatenate(used), axis=0))) if used else 0.0
    # places of less than a metre say nothing
    size = extent if extent > 1.0 else 300.0
    radius, speed, reach = (float(f"{size / part:.2g}") for part in (8.0, 60.0, 2.0))
    keys = {
        "name": title if title.isprintable() and len(title) <= LONGEST_NAME else "",
        "orbit": {"radius_m": radius, "speed_mps": speed},
        "formation": {"count": len(VEHICLES), "links": [*map(list, combinations(VEHICLES, 2))]},
        "sensor": {"range_m": reach, "bearing_sigma_rad": 0.03, "sample_time_s": 0.2},
        "area_lat_lon_deg": [place for area in areas for place in area.lat_lon_deg],
        "keep_out_lat_lon_deg": [keep_out.lat_lon_deg for keep_out in keep_outs] + holes,
        "obstacles_lat_lon_deg": [obstacle.lat_lon_deg for obstacle in obstacles],
        "landmarks_lat_lon_deg": {mark.name: mark.lat_lon_deg[0] for mark in marks},
    }
    keys = {key: value for key, value in keys.items() if value}
    scenario_from(keys)
    return keys
