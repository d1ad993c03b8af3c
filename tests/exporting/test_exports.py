"""Exports as a whole: the table of formats, names, poses, the sidecar, archives, the command."""

import csv
import io
import json
import math
import re
import sys
import zipfile
from pathlib import Path
from typing import Any

import jsonschema_rs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import syncplan
from syncplan.cli import command_line
from syncplan.errors import InputError
from syncplan.exporting.exported_files import LONGEST_BYTES, file_names, file_title, ros_names
from syncplan.exporting.formats import ALL, FORMATS, ExportOptions, as_archive, export, write_files
from syncplan.exporting.sidecar import SyncDocument
from syncplan.orbits.circles import heading, position
from syncplan.reports.plan_report import plan_document
from tests.tools.exported import FORCED, ORIGIN, contents, mixed_team, sidecar_of, team, to_plane
from tests.tools.scenarios import FILES, circling


@pytest.fixture
def scenario_file(tmp_path: Path) -> str:
    """The paper's grid of six vehicles, on Earth."""
    text = (FILES / "paper-grid-same.yaml").read_text()
    path = tmp_path / "grid.yaml"
    path.write_text(text + "geo_origin: {lat_deg: 47.4, lon_deg: 8.5, alt_m: 488}\n")
    return str(path)


def _sidecar(name: str = "qgc", **options: Any) -> dict[str, Any]:
    return sidecar_of(export(mixed_team(), name, ExportOptions(**options)))


# --- formats ------------------------------------------------------------------------------------


def test_equal_input_gives_equal_bytes() -> None:
    first, second = (as_archive(export(team(), ALL)) for _ in range(2))
    assert first == second


def test_six_vehicles_go_out_in_every_format_with_a_sidecar_each(scenario_file: str) -> None:
    made = syncplan.export(syncplan.plan(syncplan.load_scenario(scenario_file)), "all")
    names = [file.name for file in made.files]
    assert len(names) == len(set(names))
    for name in FORMATS:
        inside = [one for one in names if one.startswith(f"{name}/")]
        own = [one for one in inside if not one.endswith(".sync.json")]
        assert len(inside) == len(own) + 1
        # one each, or one for all, or a bag with its metadata
        assert len(own) in {6, 2 if name in {"rosbag2", "mcap"} else 1}


def test_all_leaves_out_what_the_scenario_does_not_allow() -> None:
    made = export(team(geo_origin=None), ALL)
    folders = {file.name.split("/")[0] for file in made.files}
    assert folders == {"csv", "rosbag2", "mcap", "crazyswarm"}
    assert made.notes[0] == (
        "left out, because the scenario has no geo_origin: qgc, ardupilot, geojson, kml"
    )
    px4 = export(mixed_team(), ALL, ExportOptions(autopilot="px4"))
    assert px4.notes[0] == "left out, because the autopilot is px4: ardupilot"


def test_an_unknown_format_is_refused() -> None:
    with pytest.raises(InputError, match=r"'gpx': must be one of qgc, .*kml or all"):
        export(mixed_team(), "gpx")


@pytest.mark.parametrize(
    ("options", "key"),
    [
        ({"altitude_m": math.nan}, "altitude_m"),
        ({"altitude_m": 1e6}, "altitude_m"),
        ({"duration": 0.0}, "duration"),
        ({"turns": 0}, "turns"),
        ({"turns": 2, "duration": 9.0}, "turns"),
        ({"sample_time_s": -1.0}, "sample_time_s"),
        ({"sagitta_m": 0.0}, "sagitta_m"),
        ({"autopilot": "inav"}, "autopilot"),
        ({"vehicle": "boat"}, "vehicle"),
    ],
)
def test_options_out_of_range_are_refused_by_name(options: Any, key: str) -> None:
    with pytest.raises(InputError, match=f"^{key}: "):
        ExportOptions(**options)


def test_a_flight_of_too_many_turns_is_refused() -> None:
    with pytest.raises(InputError, match="20,000 turns"):
        export(mixed_team(), "qgc", ExportOptions(duration=1e7))


def test_a_missing_library_is_one_line_that_names_the_extra(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(InputError) as caught:
        export(mixed_team(), "mcap")
    assert str(caught.value) == "needs rosbags: pip install 'syncplan[export]'"


# --- names --------------------------------------------------------------------------------------

NAMES = st.lists(st.text(min_size=1, max_size=64), min_size=1, max_size=8, unique=True)


@given(NAMES)
def test_names_of_files_are_safe_and_distinct_even_without_case(names: list[str]) -> None:
    files = file_names(names)
    assert len({name.casefold() for name in files}) == len(names)
    for name in files:
        assert re.fullmatch(r"[\w-]+", name), name
        assert len(name.encode()) <= LONGEST_BYTES + 4


@given(NAMES)
def test_tokens_of_topics_are_what_ros_allows(names: list[str]) -> None:
    tokens = ros_names(names)
    assert len(set(tokens)) == len(names)
    for token in tokens:
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", token), token


@pytest.mark.parametrize(
    ("names", "files", "tokens"),
    [
        (["a b", "a/b", "A_B"], ["a_b", "a_b-2", "A_B-3"], ["a_b", "a_b_2", "A_B_3"]),
        (["../up", "..", "x.plan"], ["up", "vehicle", "x_plan"], ["up", "vehicle", "x_plan"]),
        (["Müller", "无人机", "7"], ["Müller", "无人机", "7"], ["Muller", "vehicle", "vehicle_7"]),
    ],
)
def test_names_stay_recognisable(names: list[str], files: list[str], tokens: list[str]) -> None:
    assert file_names(names) == files
    assert ros_names(names) == tokens


def test_titles_avoid_what_systems_reserve() -> None:
    titles = {"": "plan", "con": "con_", "LPT1": "LPT1_", "a/../b": "a____b"}
    assert {one: file_title(one) for one in titles} == titles


# --- poses --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["=cmd|calc", "+1", "-v", "@v"])
def test_names_that_a_spreadsheet_would_compute_are_refused_for_csv(name: str) -> None:
    plan = team(formation={"centers_m": {name: [-40, 10], "mid": [30, 0], "c": [90, 40]}})
    with pytest.raises(InputError, match=f"{re.escape(repr(name))} would be a formula.*rename"):
        export(plan, "csv", ExportOptions(altitude_m=5.0))
    assert contents(export(plan, "qgc", ExportOptions(altitude_m=5.0)), ".plan")


def test_poses_read_by_csv_are_the_plan() -> None:
    plan = team(formation={"centers_m": {'a, "b"': [-40, 10], "mid": [30, 0], "c": [90, 40]}})
    made = export(plan, "csv", ExportOptions(altitude_m=5.0, sample_time_s=0.5, turns=1))
    (text,) = contents(made, ".csv").values()
    rows = list(csv.DictReader(io.StringIO(text.decode(), newline="")))
    count = int(plan.orbits.period / 0.5) + 1
    assert [row["vehicle"] for row in rows] == plan.scenario.vehicle_names * count
    times = np.array([float(row["time_s"]) for row in rows]).reshape(count, 3)
    assert np.array_equal(times[:, 0], 0.5 * np.arange(count))
    at = [[float(row["x_m"]), float(row["y_m"])] for row in rows]
    expected = position(plan.orbits, times[:, 0])
    assert np.abs(np.reshape(at, (count, 3, 2)) - expected).max() < 1e-6
    places = [[float(row["lat_deg"]), float(row["lon_deg"])] for row in rows]
    assert np.abs(to_plane(places).reshape(count, 3, 2) - expected).max() < 0.01
    angles = np.array([float(row["heading_rad"]) for row in rows]).reshape(count, 3)
    assert np.abs(np.exp(1j * angles) - np.exp(1j * heading(plan.orbits, times[:, 0]))).max() < 1e-8
    assert {row["z_m"] for row in rows} == {"5.000000"}
    assert [rows[k]["utc"] for k in (0, 3)] == [
        "2026-05-01T09:00:00.250000Z",
        "2026-05-01T09:00:00.750000Z",
    ]


def test_columns_that_nothing_is_known_for_are_left_out() -> None:
    made = export(team(geo_origin=None, start_time=None), "csv")
    (text,) = contents(made, ".csv").values()
    assert text.split(b"\n")[0] == b"time_s,vehicle,x_m,y_m,z_m,heading_rad"


# --- the sidecar --------------------------------------------------------------------------------


def test_the_sidecar_says_where_when_and_how_fast_each_vehicle_joins() -> None:
    plan, reported = mixed_team(), _sidecar(altitude_m=40.0)
    assert reported["start_time"] == "2026-05-01T09:00:00.250000Z"
    assert reported["period_s"] == pytest.approx(10.0 * math.pi)
    for k, vehicle in enumerate(reported["vehicles"]):
        entry = vehicle["entry"]
        assert np.allclose(entry["position_m"], position(plan.orbits, 0.0)[k])
        assert np.allclose(
            to_plane([entry["lat_deg"], entry["lon_deg"]]), entry["position_m"], atol=1e-6
        )
        east, north = math.cos(entry["heading_rad"]), math.sin(entry["heading_rad"])
        course = math.radians(entry["course_deg"])
        assert (math.sin(course), math.cos(course)) == pytest.approx((east, north))
        # where it is a moment later lies that way, as far as its speed says
        moved = position(plan.orbits, 1e-4)[k] - position(plan.orbits, 0.0)[k]
        assert moved / 1e-4 == pytest.approx(
            vehicle["speed_mps"] * np.array([east, north]), abs=1e-3
        )
        assert (entry["time_s"], entry["time"]) == (0.0, reported["start_time"])
        assert entry["altitude_m"] == 40.0
        assert vehicle["direction"] == plan.scenario.orbit.direction[k]
    files = [one["file"] for one in reported["vehicles"]]
    assert files == ["team-left.plan", "team-mid.plan", "team-far_out.plan"]
    assert [one["topic"] for one in _sidecar("mcap")["vehicles"]][2] == "/far_out/path"


def test_the_sidecar_says_who_meets_whom_and_when() -> None:
    plan, reported = mixed_team(), _sidecar()
    links = [*plan_document(plan).links, *plan_document(plan).incidental_links]
    assert reported["meetings"]
    assert [(one["a"], one["b"], one["windows_s"]) for one in reported["meetings"]] == [
        (one.a, one.b, [list(window) for window in one.windows_s]) for one in links
    ]
    for meeting, link in zip(reported["meetings"], links, strict=True):
        assert meeting["tolerance_s"] == pytest.approx(link.phase_tolerance_s)
    least = min(link.phase_tolerance_s for link in links if "left" in (link.a, link.b))
    assert reported["vehicles"][0]["tolerance_s"] == pytest.approx(least)
    assert {(one["vehicle"], one["landmark"]) for one in reported["landmark_sightings"]} == {
        (one.vehicle, one.landmark) for one in plan_document(plan).landmark_links
    }


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("qgc", {}, "It waits for entry.time by the vehicle's own UTC clock"),
        ("qgc", {"autopilot": "px4"}, "A mission does not wait"),
        ("ardupilot", {"waypoints": True}, "Between waypoints the mission commands leg_speed_mps"),
        ("crazyswarm", {}, "start all trajectories by one broadcast"),
        ("mcap", {}, "Be at entry.position_m at start_time, under way"),
        ("csv", {}, "flies one turn at speed_mps period_s / (period_s - s);"),
    ],
)
def test_the_procedure_is_one_that_can_be_followed_with_these_files(
    name: str, options: dict[str, Any], words: str
) -> None:
    steps = _sidecar(name, **options)["procedure"]
    assert sum(words in step for step in steps) == 1
    assert sum("separation_tolerance_s" in step for step in steps) == 1


def test_without_a_start_time_a_copter_waits_for_its_command() -> None:
    reported = sidecar_of(export(team(start_time=None), "qgc"))
    assert any("make start_item the current item of all" in step for step in reported["procedure"])
    assert {one["start_item"] for one in reported["vehicles"]} == {3}


@pytest.mark.parametrize("direction", ["ccw", ["ccw", "cw", "ccw"]], ids=["same", "mixed"])
def test_the_sidecar_says_how_late_is_too_near(direction: Any) -> None:
    plan = team(
        orbit=circling(radius_m=[20, 20, 15], direction=direction),
        formation={"centers_m": [[0, 0], [25, 0], [90, 40]]},
        min_separation_m=5.0,
    )
    reported = sidecar_of(export(plan, "csv", FORCED))
    first, second, third = (one["separation_tolerance_s"] for one in reported["vehicles"])
    assert first == second
    assert third is None  # its circle is 28 m from the others
    time = np.linspace(0.0, plan.orbits.period, 4001)

    def nearest(slip: float) -> float:
        apart = position(plan.orbits, time + slip)[:, 0] - position(plan.orbits, time)[:, 1]
        return float(np.hypot(*apart.T).min())

    assert nearest(0.0) > 5.0
    assert min(nearest(s) for s in np.linspace(-first, first, 201)) == pytest.approx(5.0, abs=0.01)
    assert min(nearest(1.01 * first), nearest(-1.01 * first)) < 5.0


def test_all_goes_without_missions_where_circles_are_too_small_for_them() -> None:
    small_circles = team(
        orbit={"radius_m": 0.5, "angular_rate_rad_s": 0.8, "direction": "ccw"},
        formation={"centers_m": [[0, 0], [2, 0]]},
    )
    made = export(small_circles, ALL, FORCED)
    folders = {file.name.split("/")[0] for file in made.files}
    assert folders == {"csv", "rosbag2", "mcap", "crazyswarm", "geojson", "kml"}
    assert "qgc is left out: v1: 0.5: loiter turns hold whole metres" in " ".join(made.notes)


@pytest.mark.parametrize("name", FORMATS)
def test_every_sidecar_has_the_name_of_its_format_and_fits_its_schema(
    name: str, printed: Any
) -> None:
    out = printed("schema", "sync")
    made = export(mixed_team(), name)
    assert list(contents(made, ".sync.json")) == [f"team.{name}.sync.json"]
    reported = sidecar_of(made)
    jsonschema_rs.validator_for(json.loads(out)).validate(reported)
    assert SyncDocument.model_validate(reported).as_json() == reported
    assert reported["format"] == name


def test_the_sidecar_separates_planned_meetings_from_others() -> None:
    places = {"left": [-40, 10], "mid": [30, 0], "right": [90, 40]}
    plan = team(formation={"centers_m": places, "links": [["left", "mid"]]})
    reported = sidecar_of(export(plan, "csv"))
    assert [(one["a"], one["b"], one["planned"]) for one in reported["meetings"]] == [
        ("left", "mid", True),
        ("mid", "right", False),
    ]


def test_one_vehicle_without_landmarks_goes_out_in_every_format() -> None:
    formation = {"centers_m": [[0, 0]]}
    alone = team(orbit=circling(direction="cw"), formation=formation, landmarks_m=[])
    made = export(alone, ALL, FORCED)
    assert {file.name.split("/")[0] for file in made.files} == set(FORMATS)
    reported = json.loads(contents(made, ".sync.json")["qgc/team.qgc.sync.json"])
    assert (reported["meetings"], reported["vehicles"][0]["tolerance_s"]) == ([], None)


# --- the scenario's key -------------------------------------------------------------------------


def test_the_origin_is_carried_to_the_plan() -> None:
    assert plan_document(mixed_team()).as_json()["scenario"]["geo_origin"] == ORIGIN
    assert "geo_origin" not in plan_document(team(geo_origin=None)).as_json()["scenario"]


# --- archive, files, command --------------------------------------------------------------------


def test_the_archive_holds_the_files() -> None:
    made = export(mixed_team(), "mcap")
    with zipfile.ZipFile(io.BytesIO(as_archive(made))) as archive:
        assert archive.testzip() is None
        assert {one: archive.read(one) for one in archive.namelist()} == {
            file.name: file.content for file in made.files
        }


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="can't be made a folder"):
        write_files(export(mixed_team(), "kml"), tmp_path / "taken")


def test_the_command_writes_what_the_library_makes(
    run: Any, scenario_file: str, tmp_path: Path
) -> None:
    plan_file = tmp_path / "plan.json"
    assert run("plan", scenario_file, "-o", str(plan_file))[0] == 0
    folder = tmp_path / "deep" / "missions"
    options = ("--format", "qgc", "--altitude-m", "60")
    status, out, err = run("export", str(plan_file), *options, "-o", str(folder))
    assert (status, out) == (0, "")
    assert f"wrote {folder}: 7 files" in err
    assert "CIRCLE_RATE" in err
    made = syncplan.export(
        syncplan.plan(syncplan.load_scenario(scenario_file)), "qgc", ExportOptions(altitude_m=60.0)
    )
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == {
        file.name: file.content for file in made.files
    }
    assert run("export", scenario_file, "--format", "qgc", "-o", f"{folder}.zip")[0] == 0
    assert zipfile.is_zipfile(f"{folder}.zip")


def test_the_command_writes_an_archive_to_standard_output(
    scenario_file: str, monkeypatch: pytest.MonkeyPatch, capsysbinary: Any
) -> None:
    given = io.TextIOWrapper(io.BytesIO(Path(scenario_file).read_bytes()))
    monkeypatch.setattr(sys, "stdin", given)
    with pytest.raises(SystemExit) as stopped:
        command_line.main(["export", "-", "--format", "csv", "-o", "-"])
    assert stopped.value.code == 0
    with zipfile.ZipFile(io.BytesIO(capsysbinary.readouterr().out)) as archive:
        assert archive.namelist() == ["paper-grid-same.poses.csv", "paper-grid-same.csv.sync.json"]
