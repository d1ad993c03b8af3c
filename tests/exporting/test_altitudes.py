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


def _poses(made: Export) -> list[float]:
    (text,) = contents(made, ".csv").values()
    rows = csv.DictReader(io.StringIO(text.decode()))
    return list({row["vehicle"]: float(row["z_m"]) for row in rows}.values())


def _polynomials(made: Export) -> list[float]:
    each = contents(made, ".trajectory.csv").values()
    return [float(text.decode().splitlines()[1].split(",")[17]) for text in each]


def _plans(made: Export) -> list[float]:
    found = []
    for text in contents(made, ".plan").values():
        items = json.loads(text)["mission"]["items"]
        (height,) = {item["Altitude"] for item in items if "Altitude" in item}
        found.append(height)
    return found


def _waypoints(made: Export) -> list[float]:
    found = []
    for text in contents(made, ".waypoints").values():
        rows = [line.split("\t") for line in text.decode().splitlines()[2:]]
        (height,) = {float(row[10]) for row in rows if row[2] == "3"}
        found.append(height)
    return found


def _geojson(made: Export) -> list[float]:
    (text,) = contents(made, ".geojson").values()
    about = [one["properties"] for one in json.loads(text)["features"]]
    return [one["altitude_m"] for one in about if one["kind"] == "circle"]


def _kml(made: Export) -> list[float]:
    from fastkml import KML
    from fastkml.features import Placemark
    from fastkml.utils import find_all

    (text,) = contents(made, ".kml").values()
    marks: list[Any] = list(find_all(KML.parse(io.BytesIO(text)), of_type=Placemark))
    return [mark.geometry.coords[0][2] for mark in marks if mark.name.endswith(" entry")]


def _bag(made: Export, folder: Path) -> list[float]:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    write_files(made, folder)
    store, heights = get_typestore(Stores.ROS2_JAZZY), []
    with Reader(next(one for one in folder.iterdir() if one.is_dir())) as reader:
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
    made = export(team(altitude_m=LISTED), name, options)
    expected = [40.0, 57.0, 51.5]
    assert (READERS[name](made) if name in READERS else _bag(made, tmp_path)) == expected
    vehicles = sidecar_of(made)["vehicles"]
    assert [one["entry"]["altitude_m"] for one in vehicles] == expected
    assert not any(NOTE in note for note in made.notes)


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
    made = export(team(altitude_m=scenario), "geojson", ExportOptions(**options))
    assert _geojson(made) == expected
    stated = scenario is not None or "altitude_m" in options
    assert any(NOTE in note for note in made.notes) is not stated


@pytest.mark.parametrize("name", FORMATS)
def test_a_default_altitude_is_noted_where_the_format_has_one(name: str) -> None:
    made, default = export(team(), name), FORMATS[name].altitude_m
    notes = [note for note in made.notes if NOTE in note]
    assert sidecar_of(made)["notes"] == list(made.notes)
    assert len(notes) == (default > 0.0)
    assert all(f"vehicles fly at {default:g} m, the default of this format; " in n for n in notes)


def test_a_step_from_the_default_is_noted_too() -> None:
    made = export(team(), "qgc", ExportOptions(altitude_step_m=5.0))
    assert made.notes[0].startswith(
        "no altitude is given: vehicles fly at 50 m, the default of this format, each a step above "
        "the last; state altitude_m in the scenario, or --altitude-m"
    )


def test_all_formats_fly_the_altitude_of_the_scenario() -> None:
    made = export(team(altitude_m=LISTED), ALL)
    for text in contents(made, ".sync.json").values():
        vehicles = json.loads(text)["vehicles"]
        assert [one["entry"]["altitude_m"] for one in vehicles] == LISTED
