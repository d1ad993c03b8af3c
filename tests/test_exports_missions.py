"""Missions: read back by pymavlink, and flown on paper, they are the plan's circles in time."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.exporting.missions import snapped_radii
from syncplan.exports import FORMATS, ExportOptions, export
from syncplan.orbits import position
from syncplan.planner import Plan
from tests.exported import ORIGIN, contents, mixed_team, team, to_plane
from tests.fake_vehicle import stored_loiter

WAYPOINT, LOITER_TURNS, CHANGE_SPEED = 16, 18, 178

LARGE = {
    "orbit": {"radius_m": [20.6, 150.4, 304.0], "angular_rate_rad_s": 0.05, "direction": "ccw"},
    "formation": {"centers_m": [[0, 0], [230, 0], [700, 0]]},
    "sensor": {"range_m": 400.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
}


def loaded(path: Path, text: bytes) -> list[Any]:
    """Items of a WPL file, as pymavlink reads them."""
    from pymavlink import mavwp

    path.write_bytes(text)
    loader = mavwp.MAVWPLoader()
    loader.load(str(path))
    return [loader.wp(k) for k in range(loader.count())]


def flown_circle(items: list[Any], time: Any, origin: dict[str, float] = ORIGIN) -> Any:
    """Where a vehicle is that flies the last item from the waypoint before it, as MAVLink says.

    A positive radius is clockwise; the speed is that of the change of speed before.
    """
    speed = next(item for item in items if item.command == CHANGE_SPEED).param2
    entry, circle = items[-2], items[-1]
    assert (entry.command, circle.command) == (WAYPOINT, LOITER_TURNS)
    center = to_plane([circle.x, circle.y], origin)
    start = to_plane([entry.x, entry.y], origin) - center
    turned = -np.sign(circle.param3) * speed / abs(circle.param3) * np.asarray(time)
    angle = math.atan2(start[1], start[0]) + turned
    return center + abs(circle.param3) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def flown_legs(items: list[Any], time: Any) -> Any:
    """Where a vehicle is that flies the waypoints in straight legs at the speed it was told."""
    speed = next(item for item in items if item.command == CHANGE_SPEED).param2
    corners = to_plane([[one.x, one.y] for one in items[1:] if one.command == WAYPOINT])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    gone = speed * np.asarray(time)
    return np.stack([np.interp(gone, along, corners[:, axis]) for axis in (0, 1)], axis=-1)


def furthest(flown: Any, plan: Plan, k: int, time: Any) -> float:
    """Largest distance in m between where vehicle k is flown and where the plan has it."""
    return float(np.max(np.hypot(*(flown - position(plan.orbits, time)[:, k]).T)))


@pytest.mark.parametrize(
    "origin",
    [
        ORIGIN,
        {"lat_deg": -33.9, "lon_deg": 179.9999, "alt_m": 3.0},
        {"lat_deg": 89.9999, "lon_deg": -30.0, "alt_m": 0.0},
        {"lat_deg": -90.0, "lon_deg": 0.0, "alt_m": 2800.0},
    ],
    ids=["Zurich", "antimeridian", "near the pole", "at the pole"],
)
def test_loiter_turns_read_by_pymavlink_fly_the_plan(origin: Any, tmp_path: Path) -> None:
    plan = team(geo_origin=origin)
    made = export(plan, "ardupilot", ExportOptions(altitude_m=60.0))
    time = np.linspace(0.0, 100.0, 401)
    files = contents(made, ".waypoints")
    assert list(files) == ["team-left.waypoints", "team-mid.waypoints", "team-far_out.waypoints"]
    for k, text in enumerate(files.values()):
        items = loaded(tmp_path / "mission", text)
        home = items[0]
        assert (home.command, home.frame, home.current) == (WAYPOINT, 0, 1)
        assert (home.x, home.y, home.z) == tuple(origin.values())
        assert [item.seq for item in items] == [0, 1, 2, 3]
        assert {item.frame for item in items[2:]} == {3}
        assert {item.z for item in items[2:]} == {60.0}
        assert items[-1].param1 == 4.0  # whole turns that cover 100 s of 31.4 s each
        assert furthest(flown_circle(items, time, origin), plan, k, time) < 0.01


@pytest.mark.parametrize("sagitta", [0.05, 0.5])
def test_waypoints_read_by_pymavlink_keep_the_plan_in_place_and_in_time(
    sagitta: float, tmp_path: Path
) -> None:
    plan = mixed_team()
    made = export(plan, "ardupilot", ExportOptions(waypoints=True, sagitta_m=sagitta))
    time = np.linspace(0.0, 100.0, 2001)
    for k, text in enumerate(contents(made, ".waypoints").values()):
        items = loaded(tmp_path / "mission", text)
        flown = flown_legs(items, time)
        # to the sagitta in place; along the path half a leg's chord and arc differ far less
        assert furthest(flown, plan, k, time) < 1.05 * sagitta
        offset = np.hypot(*(flown - plan.orbits.centers[k]).T) - plan.orbits.radii[k]
        assert np.abs(offset).max() > 0.5 * sagitta  # no more waypoints than it takes


def test_the_speed_of_the_legs_is_in_the_sidecar() -> None:
    made = export(mixed_team(), "qgc", ExportOptions(waypoints=True))
    vehicles = json.loads(contents(made, ".sync.json")["team.sync.json"])["vehicles"]
    for vehicle, text in zip(vehicles, contents(made, ".plan").values(), strict=True):
        assert vehicle["leg_speed_mps"] == json.loads(text)["mission"]["items"][0]["params"][1]
        assert 0.98 < vehicle["leg_speed_mps"] / vehicle["speed_mps"] < 1.0


def test_a_plan_for_qgroundcontrol_has_the_documented_keys() -> None:
    made = export(mixed_team(), "qgc", ExportOptions(vehicle="fixed_wing"))
    for text in contents(made, ".plan").values():
        plan = json.loads(text)
        assert (plan["fileType"], plan["version"]) == ("Plan", 1)
        assert plan["geoFence"] == {"circles": [], "polygons": [], "version": 2}
        assert plan["rallyPoints"] == {"points": [], "version": 2}
        mission = plan["mission"]
        assert (mission["version"], mission["firmwareType"], mission["vehicleType"]) == (2, 3, 1)
        assert mission["plannedHomePosition"] == list(ORIGIN.values())
        assert [item["doJumpId"] for item in mission["items"]] == [1, 2, 3]
        for item in mission["items"]:
            assert item["type"] == "SimpleItem"
            assert item["autoContinue"] is True
            assert len(item["params"]) == 7
        speed, entry, circle = mission["items"]
        assert (speed["frame"], speed["params"][0]) == (2, 0.0)  # airspeed
        for item in (entry, circle):
            assert item["params"][6] == item["Altitude"] == 50.0
            assert (item["AltitudeMode"], item["frame"]) == (1, 3)


def test_px4_gets_no_loiter_turns() -> None:
    made = export(mixed_team(), "qgc", ExportOptions(autopilot="px4"))
    for text in contents(made, ".plan").values():
        mission = json.loads(text)["mission"]
        assert mission["firmwareType"] == 12
        speed, *points = mission["items"]
        assert speed["command"] == CHANGE_SPEED
        assert {item["command"] for item in points} == {WAYPOINT}
        # no yaw of its own, and passed within the sagitta
        assert {(item["params"][1], item["params"][3]) for item in points} == {(0.5, None)}
    with pytest.raises(InputError, match="take qgc for PX4"):
        export(mixed_team(), "ardupilot", ExportOptions(autopilot="px4"))


def test_radii_that_ardupilot_cuts_off_are_told() -> None:
    made = export(team(**LARGE), "ardupilot")
    told = " ".join(made.notes)
    assert "v1, v2, v3 would fly smaller circles (v1 20 m instead of 20.6 m)" in told
    assert "0.19 rad ahead after each turn" in told  # 2 pi 0.6 / 20
    assert "v3: older ArduPilot stores no radius above 255 m" in told
    assert "CIRCLE_RATE to 2.86479" in told
    assert not [note for note in export(mixed_team(), "qgc").notes if "smaller" in note]


def test_snapped_radii_are_what_ardupilot_stores_at_the_common_rate(tmp_path: Path) -> None:
    plan = team(**LARGE)
    made = export(plan, "ardupilot", ExportOptions(snap_radius=True))
    sidecar = json.loads(contents(made, ".sync.json")["team.sync.json"])
    radii = []
    time = np.linspace(0.0, 100.0, 101)
    for k, text in enumerate(contents(made, ".waypoints").values()):
        items = loaded(tmp_path / "mission", text)
        circle = items[-1]
        kept = stored_loiter(circle.param1, circle.param3)
        radii.append(kept.radius)
        assert kept.radius == abs(circle.param3)
        assert kept.ccw
        assert items[1].param2 / kept.radius == pytest.approx(plan.orbits.rate, rel=1e-6)
        assert (
            furthest(flown_circle(items, time), plan, k, time)
            < abs(kept.radius - plan.orbits.radii[k]) + 0.02
        )
        assert sidecar["vehicles"][k]["radius_m"] == kept.radius
    assert radii == [21, 150, 300]
    assert "at most by 4 m (v3: 304 to 300 m)" in made.notes[0]


def test_meetings_of_snapped_circles_are_judged_afresh() -> None:
    snapped = export(team(**LARGE), "ardupilot", ExportOptions(snap_radius=True))
    plain = export(team(**LARGE), "ardupilot")
    name = "team.sync.json"
    told = [json.loads(contents(made, name)[name])["meetings"][0] for made in (plain, snapped)]
    assert told[0]["min_distance_m"] != pytest.approx(told[1]["min_distance_m"], abs=1e-3)


def test_snapping_that_loses_a_meeting_says_so() -> None:
    # opposite phases bring these two within 10 m, just: snapped inwards they stay 10.7 m apart
    plan = team(
        orbit={"radius_m": 20.4, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        formation={"centers_m": [[0, 0], [50.7, 0]]},
        sensor={"range_m": 10.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    )
    assert plan.links
    made = export(plan, "qgc", ExportOptions(snap_radius=True))
    assert "v1 and v2 meet no more with the radii snapped" in made.notes


@given(st.floats(0.2, 2550.0))
def test_no_stored_radius_is_nearer_than_the_snapped_one(radius: float) -> None:
    (snapped,) = snapped_radii(np.array([radius])).tolist()
    assert stored_loiter(1.0, snapped).radius == snapped
    storable = np.concatenate([np.arange(1.0, 256.0), np.arange(260.0, 2551.0, 10.0)])
    assert abs(snapped - radius) == pytest.approx(np.abs(storable - radius).min(), abs=1e-9)


@pytest.mark.parametrize(
    ("radius", "options", "words"),
    [
        (3000.0, {}, "at most 2550 m; fly waypoints"),
        (3000.0, {"snap_radius": True}, "at most 2550 m; fly waypoints"),
        (0.7, {}, "whole metres; fly waypoints"),
    ],
)
def test_circles_that_loiter_turns_cannot_hold_are_refused(
    radius: float, options: Any, words: str
) -> None:
    plan = team(
        orbit={"radius_m": radius, "angular_rate_rad_s": 0.01, "direction": "ccw"},
        formation={"centers_m": [[0, 0]]},
    )
    with pytest.raises(InputError, match=words) as caught:
        export(plan, "qgc", ExportOptions(**options))
    assert caught.value.key == "orbit.radius_m"
    assert export(plan, "qgc", ExportOptions(waypoints=True)).files


def test_more_turns_than_a_byte_holds_become_several_items(tmp_path: Path) -> None:
    made = export(mixed_team(), "ardupilot", ExportOptions(turns=600))
    items = loaded(tmp_path / "mission", contents(made, "left.waypoints")["team-left.waypoints"])
    circles = [item for item in items if item.command == LOITER_TURNS]
    assert [item.param1 for item in circles] == [255.0, 255.0, 90.0]
    assert sum(stored_loiter(item.param1, item.param3).turns for item in circles) == 600


def test_long_missions_of_waypoints_are_told_or_refused() -> None:
    many = export(mixed_team(), "qgc", ExportOptions(waypoints=True, turns=50))
    assert any("items: some autopilots hold fewer" in note for note in many.notes)
    with pytest.raises(InputError, match="65,535") as caught:
        export(mixed_team(), "qgc", ExportOptions(waypoints=True, turns=9000, sagitta_m=0.5))
    assert caught.value.key == "sagitta_m"


@pytest.mark.parametrize("name", [name for name, one in FORMATS.items() if one.on_earth])
def test_a_scenario_without_a_geo_origin_is_refused_where_it_is_needed(name: str) -> None:
    with pytest.raises(InputError, match=r"geo_origin: is missing.*lat_deg") as caught:
        export(team(geo_origin=None), name)
    assert caught.value.key == "geo_origin"
    assert "\n" not in str(caught.value)


def test_far_from_the_origin_the_reader_is_told_and_further_refused() -> None:
    far = team(formation={"centers_m": [[0, 0], [60e3, 0], [0, 60e3]]})
    assert "60.03 km from geo_origin, where plane and ground differ by 1.8 m" in " ".join(
        export(far, "geojson").notes
    )
    with pytest.raises(InputError, match="no ground any more"):
        export(team(formation={"centers_m": [[0, 0], [2e6, 0], [0, 60]]}), "geojson")
