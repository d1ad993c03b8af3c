"""Altitudes of exports: an option's, else the scenario's, else the format's, which is noted."""

import csv
import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from syncplan.exporting.formats import ALL, FORMATS, Export, ExportOptions, export, write_files
from tests.tools.exported import contents, sidecar_of, team

LISTED = [40.0, 55.0, 47.5]
NOTE = "no altitude is given"


def _poses(exported: Export) -> list[float]:
    (text,) = contents(exported, ".csv").values()
    rows = csv.DictReader(io.StringIO(text.decode()))
    return list({row["vehicle"]: float(row["z_m"]) for row in rows}.values())


def _polynomials(exported: Export) -> list[float]:
    each = contents(exported, ".trajectory.csv").values()
    return [float(text.decode().splitlines()[1].split(",")[17]) for text in each]


def _plans(exported: Export) -> list[float]:
    heights = []
    for text in contents(exported, ".plan").values():
        items = json.loads(text)["mission"]["items"]
        (height,) = {item["Altitude"] for item in items if "Altitude" in item}
        heights.append(height)
    return heights


def _waypoints(exported: Export) -> list[float]:
    heights = []
    for text in contents(exported, ".waypoints").values():
        rows = [line.split("\t") for line in text.decode().splitlines()[2:]]
        (height,) = {float(row[10]) for row in rows if row[2] == "3"}
        heights.append(height)
    return heights


def _geojson(exported: Export) -> list[float]:
    (text,) = contents(exported, ".geojson").values()
    about = [feature["properties"] for feature in json.loads(text)["features"]]
    return [each["altitude_m"] for each in about if each["kind"] == "circle"]


def _kml(exported: Export) -> list[float]:
    from fastkml import KML
    from fastkml.features import Placemark
    from fastkml.utils import find_all

    (text,) = contents(exported, ".kml").values()
    marks: list[Any] = list(find_all(KML.parse(io.BytesIO(text)), of_type=Placemark))
    return [mark.geometry.coords[0][2] for mark in marks if mark.name.endswith(" entry")]


def _bag(exported: Export, folder: Path) -> list[float]:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    write_files(exported, folder)
    store, heights = get_typestore(Stores.ROS2_JAZZY), []
    with Reader(next(path for path in folder.iterdir() if path.is_dir())) as reader:
        for connection, _, raw in reader.messages():
            path: Any = store.deserialize_cdr(raw, connection.msgtype)
            (height,) = {pose.pose.position.z for pose in path.poses}
            heights.append(height)
    return heights


READERS: Mapping[str, Callable[[Export], list[float]]] = {
    "qgc": _plans,
    "ardupilot": _waypoints,
    "csv": _poses,
    "crazyswarm": _polynomials,
    "geojson": _geojson,
    "kml": _kml,
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_has_the_altitude_of_each_vehicle(name: str, tmp_path: Path) -> None:
    options = ExportOptions(turns=1, altitude_step_m=2.0)
    exported = export(team(altitude_m=LISTED), name, options)
    expected = [40.0, 57.0, 51.5]
    assert (READERS[name](exported) if name in READERS else _bag(exported, tmp_path)) == expected
    vehicles = sidecar_of(exported)["vehicles"]
    assert [vehicle["entry"]["altitude_m"] for vehicle in vehicles] == expected
    assert not any(NOTE in note for note in exported.notes)


@pytest.mark.parametrize(
    ("scenario", "options", "expected"),
    [
        (60.0, {}, [60.0, 60.0, 60.0]),
        (LISTED, {"altitude_m": 80.0}, [80.0, 80.0, 80.0]),
        (LISTED, {"altitude_m": 0.0, "altitude_step_m": 5.0}, [0.0, 5.0, 10.0]),
        (None, {"altitude_step_m": 5.0}, [50.0, 55.0, 60.0]),
        (0.0, {}, [0.0, 0.0, 0.0]),
    ],
)
def test_the_option_counts_before_the_scenario_and_the_scenario_before_the_format(
    scenario: Any, options: Any, expected: list[float]
) -> None:
    exported = export(team(altitude_m=scenario), "geojson", ExportOptions(**options))
    assert _geojson(exported) == expected
    stated = scenario is not None or "altitude_m" in options
    assert any(NOTE in note for note in exported.notes) is not stated


@pytest.mark.parametrize("name", FORMATS)
def test_a_default_altitude_is_noted_where_the_format_has_one(name: str) -> None:
    exported, default = export(team(), name), FORMATS[name].altitude_m
    notes = [note for note in exported.notes if NOTE in note]
    assert sidecar_of(exported)["notes"] == list(exported.notes)
    assert len(notes) == (default > 0.0)
    assert all(f"vehicles fly at {default:g} m, the default of this format; " in n for n in notes)


def test_a_step_from_the_default_is_noted_too() -> None:
    exported = export(team(), "qgc", ExportOptions(altitude_step_m=5.0))
    assert exported.notes[0].startswith(
        "no altitude is given: vehicles fly at 50 m, the default of this format, each a step above "
        "the last; state altitude_m in the scenario or for the export"
    )


def test_all_formats_fly_the_altitude_of_the_scenario() -> None:
    exported = export(team(altitude_m=LISTED), ALL)
    for text in contents(exported, ".sync.json").values():
        vehicles = json.loads(text)["vehicles"]
        assert [vehicle["entry"]["altitude_m"] for vehicle in vehicles] == LISTED
