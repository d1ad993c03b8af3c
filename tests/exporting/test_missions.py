"""Missions: read by pymavlink and MAVSDK, flown on paper, they are the plan's circles in time."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncplan.errors import InputError
from syncplan.exporting.formats import FORMATS, ExportOptions, export
from syncplan.exporting.mission_routes import px4_corner_speed, snapped_radii
from syncplan.orbits.circles import position
from syncplan.planning.plans import Plan
from tests.tools.exported import ORIGIN, contents, mixed_team, sidecar_of, team, to_plane
from tests.tools.fake_vehicle import ACCEPTED, flying, stored_loiter
from tests.tools.scenarios import circling
from tests.tools.serving import free_port

WAYPOINT, LOITER_TURNS, DELAY, CHANGE_SPEED = 16, 18, 93, 178

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

    The speed is that of the change of speed before.
    """
    speed = next(item for item in items if item.command == CHANGE_SPEED).param2
    entry, circle = items[2], items[-1]
    assert (entry.command, circle.command) == (WAYPOINT, LOITER_TURNS)
    center = to_plane([circle.x, circle.y], origin)
    start = to_plane([entry.x, entry.y], origin) - center
    return circled(center, start, circle.param3, speed, time)


def circled(center: Any, start: Any, radius: float, speed: float, time: Any) -> Any:
    """Where a vehicle is that turns about a centre from a place; positive radii are clockwise."""
    angle = math.atan2(start[1], start[0]) - speed / radius * np.asarray(time)
    return center + abs(radius) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def flown_legs(items: list[Any], time: Any) -> Any:
    """Where a vehicle is that flies the waypoints in straight legs at the speed it was given."""
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
        assert [item.seq for item in items] == [0, 1, 2, 3, 4]
        placed = [items[2], items[4]]
        assert {item.frame for item in placed} == {3}
        assert {item.z for item in placed} == {60.0}
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
    vehicles = sidecar_of(made)["vehicles"]
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
        # no yaw of its own, and passed half a leg before
        assert {item["params"][3] for item in points} == {None}
        places = to_plane([item["params"][4:6] for item in points])
        legs = np.hypot(*np.diff(places, axis=0).T)
        assert [item["params"][1] for item in points[1:]] == pytest.approx(legs / 2, abs=1e-3)
    with pytest.raises(InputError, match="choose qgc"):
        export(mixed_team(), "ardupilot", ExportOptions(autopilot="px4"))


def test_radii_that_ardupilot_cuts_off_are_reported() -> None:
    made = export(team(**LARGE), "ardupilot")
    reported = " ".join(made.notes)
    assert "v1, v2, v3 would fly smaller circles (v1 20 m instead of 20.6 m)" in reported
    assert "0.19 rad ahead after each turn" in reported  # 2 pi 0.6 / 20
    assert "v3: older ArduPilot stores no radius above 255 m" in reported
    assert "CIRCLE_RATE to -2.86479 (deg/s) on v1, v2, v3, and CIRCLE_OPTIONS to 2" in reported
    notes = export(mixed_team(), "qgc").notes
    assert not [note for note in notes if "smaller" in note]


def test_the_rate_of_each_vehicle_is_noted_with_its_sign() -> None:
    exported = export(mixed_team(), "qgc")
    (note,) = [note for note in exported.notes if "CIRCLE_RATE" in note]
    (sidecar,) = [
        json.loads(file.content) for file in exported.files if file.name.endswith(".sync.json")
    ]
    rates = {
        vehicle["name"]: vehicle["autopilot_parameters"]["CIRCLE_RATE"]
        for vehicle in sidecar["vehicles"]
    }
    assert {rate > 0.0 for rate in rates.values()} == {True, False}
    for part in note.split("CIRCLE_RATE to ")[1].split(", and CIRCLE_OPTIONS")[0].split(" and to "):
        rate, named = part.split(" (deg/s) on ")
        for name in named.split(", "):
            assert rates.pop(name) == pytest.approx(float(rate), rel=1e-5)
    assert not rates


def test_snapped_radii_are_what_ardupilot_stores_at_the_common_rate(tmp_path: Path) -> None:
    plan = team(**LARGE)
    made = export(plan, "ardupilot", ExportOptions(snap_radius=True, altitude_m=60.0))
    sidecar = sidecar_of(made)
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
    # meetings are judged afresh
    plain = sidecar_of(export(plan, "ardupilot"))
    given, snapped = (document["meetings"][0]["min_distance_m"] for document in (plain, sidecar))
    assert given != pytest.approx(snapped, abs=1e-3)


def test_snapping_that_loses_a_meeting_says_so() -> None:
    # opposite phases bring these two within 10 m, just: snapped inwards they stay 10.7 m apart
    plan = team(
        orbit=circling(radius_m=20.4, direction="ccw"),
        formation={"centers_m": [[0, 0], [50.7, 0]]},
        sensor={"range_m": 10.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
    )
    assert plan.links
    made = export(plan, "qgc", ExportOptions(snap_radius=True, force=True))
    assert "v1 and v2 no longer meet with the radii snapped" in made.notes


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
    with pytest.raises(InputError, match=rf"^orbit\.radius_m: .*{words}"):
        export(plan, "qgc", ExportOptions(force=True, **options))
    assert export(plan, "qgc", ExportOptions(waypoints=True, force=True)).files


def test_more_turns_than_a_byte_holds_become_several_items(tmp_path: Path) -> None:
    made = export(mixed_team(), "ardupilot", ExportOptions(turns=600))
    items = loaded(tmp_path / "mission", contents(made, "left.waypoints")["team-left.waypoints"])
    circles = [item for item in items if item.command == LOITER_TURNS]
    assert [item.param1 for item in circles] == [255.0, 255.0, 90.0]
    assert sum(stored_loiter(item.param1, item.param3).turns for item in circles) == 600


def test_long_missions_of_waypoints_are_reported_or_refused() -> None:
    many = export(mixed_team(), "qgc", ExportOptions(waypoints=True, turns=50))
    assert any("items: some autopilots hold fewer" in note for note in many.notes)
    with pytest.raises(InputError, match=r"^sagitta_m: .*65,535"):
        export(mixed_team(), "qgc", ExportOptions(waypoints=True, turns=9000, sagitta_m=0.5))


@pytest.mark.parametrize("name", [name for name, one in FORMATS.items() if one.on_earth])
def test_a_scenario_without_a_geo_origin_is_refused_where_it_is_needed(name: str) -> None:
    with pytest.raises(InputError, match=r"^geo_origin: is missing[^\n]*lat_deg[^\n]*$"):
        export(team(geo_origin=None), name)


def test_far_from_the_origin_the_reader_is_warned_and_further_refused() -> None:
    far = team(formation={"centers_m": [[0, 0], [60e3, 0], [0, 60e3]]})
    assert "on the flat map and on the ground differ by up to 3.1 m" in " ".join(
        export(far, "geojson", ExportOptions(force=True)).notes
    )
    further = team(formation={"centers_m": [[0, 0], [2e6, 0], [0, 60]]})
    with pytest.raises(InputError, match="no ground any more"):
        export(further, "geojson", ExportOptions(force=True))


# --- what autopilots make of it -----------------------------------------------------------------


def items_of(**options: Any) -> list[dict[str, Any]]:
    """The items of the first vehicle's mission."""
    plan = options.pop("plan", mixed_team())
    (text, *_) = contents(export(plan, "qgc", ExportOptions(**options)), ".plan").values()
    found: list[dict[str, Any]] = json.loads(text)["mission"]["items"]
    return found


@pytest.mark.parametrize("waypoints", [False, True], ids=["turns", "waypoints"])
def test_copters_wait_at_the_entry_for_the_first_whole_second_of_the_plan(waypoints: bool) -> None:
    items = items_of(waypoints=waypoints)
    assert [item["command"] for item in items[:3]] == [CHANGE_SPEED, WAYPOINT, DELAY]
    wait = items[2]
    # 11:00:00.25 at +02:00, up to a whole second; -1: a time of day, not a time span
    assert (wait["frame"], wait["params"][:4]) == (2, [-1.0, 9.0, 0.0, 1.0])
    made = export(mixed_team(), "qgc", ExportOptions(waypoints=waypoints))
    assert any("all vehicles begin 0.75 s after start_time" in note for note in made.notes)
    reported = sidecar_of(made)["vehicles"]
    assert {one["start_item"] for one in reported} == {items[3]["doJumpId"]} == {4}
    whole = team(start_time="2026-05-01T23:59:59Z")
    assert items_of(plan=whole)[2]["params"][:4] == [-1.0, 23.0, 59.0, 59.0]
    assert not any("whole seconds" in note for note in export(whole, "qgc").notes)


def test_a_wait_that_goes_past_midnight_is_for_the_next_day() -> None:
    wait = items_of(plan=team(start_time="2026-05-01T23:59:59.5Z"))[2]
    assert wait["params"][:4] == [-1.0, 0.0, 0.0, 0.0]


def test_the_rate_of_each_copter_has_the_sign_of_its_radius() -> None:
    plan = mixed_team()
    made = export(plan, "qgc")
    reported = sidecar_of(made)["vehicles"]
    for vehicle, text in zip(reported, contents(made, ".plan").values(), strict=True):
        radius = json.loads(text)["mission"]["items"][-1]["params"][2]
        rate = vehicle["autopilot_parameters"]["CIRCLE_RATE"]
        assert rate == pytest.approx(math.copysign(math.degrees(0.2), radius))
    assert [one["direction"] for one in reported] == ["ccw", "cw", "ccw"]
    planes = export(plan, "qgc", ExportOptions(vehicle="fixed_wing"))
    reported = sidecar_of(planes)["vehicles"]
    assert [one["autopilot_parameters"] for one in reported] == [{}, {}, {}]


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (0.2, ""),  # 30 m: 1.2 m/s^2, and half of 2.5 is allowed
        (0.21, ": mid would turn too slowly at its default of 2.5 m/s^2; set 2.65 m/s^2 or"),
        (0.4, ": left, mid, far out would turn too slowly at its default of 2.5 m/s^2; set 9.6"),
    ],
)
def test_circles_that_take_more_than_half_a_copters_acceleration_are_reported(
    rate: float, words: str
) -> None:
    orbit = {"radius_m": [20, 30, 25], "angular_rate_rad_s": rate, "direction": "ccw"}
    reported = [one for one in export(team(orbit=orbit), "qgc").notes if "WPNAV_ACCEL" in one]
    assert [words in one for one in reported] == [True] * bool(words)
    assert ("its range ends at 5" in " ".join(reported)) == (rate == 0.4)


@given(st.floats(1.0, 500.0), st.integers(6, 400))
def test_px4_passes_corners_within_its_limits(radius: float, legs: int) -> None:
    speed = px4_corner_speed(radius, legs)
    leg = 2.0 * radius * math.sin(math.pi / legs)
    # a circle that touches both legs in their middles has this radius, and is flown at 1.5 m/s^2
    inside = leg / 2.0 / math.tan(math.pi / legs)
    sideways = speed**2 / inside
    # braking from there takes v^2 / (2 a) and the way gone while the jerk builds it up
    braking = speed**2 / 6.0 + speed * 6.0 / 4.0
    limits = (sideways / 1.5, braking / leg, speed / (0.5 * leg))
    assert max(limits) == pytest.approx(1.0, rel=1e-9)


def test_commands_beyond_what_a_px4_dares_are_reported() -> None:
    slow = {"radius_m": 20.0, "angular_rate_rad_s": 0.1, "direction": "ccw"}
    fast = {**slow, "angular_rate_rad_s": 0.4}
    px4 = ExportOptions(autopilot="px4")
    assert not any("corners" in one for one in export(team(orbit=slow), "qgc", px4).notes)
    (reported,) = [one for one in export(team(orbit=fast), "qgc", px4).notes if "corners" in one]
    assert "turns take longer than planned and meetings are lost" in reported
    copter = export(team(orbit=slow), "qgc", ExportOptions(waypoints=True))
    assert any("Copter slows down for corners" in one for one in copter.notes)


def test_planes_are_given_their_airspeeds_and_steep_banks() -> None:
    plane = ExportOptions(vehicle="fixed_wing")
    reported = " ".join(export(mixed_team(), "qgc", plane).notes)
    assert (
        "missions command airspeeds from 4 to 6 m/s; Plane ignores one outside AIRSPEED_MIN"
        in reported
    )
    assert "would bank" not in reported
    steep = {"radius_m": 40.0, "angular_rate_rad_s": 0.55, "direction": "ccw"}
    # 22 m/s on 40 m: atan(22^2 / (9.81 40)) = 51 deg
    notes = export(team(orbit=steep), "qgc", plane).notes
    assert any(note.startswith("left would bank 51 deg") for note in notes)


def test_vehicles_fly_one_above_the_other_where_that_is_asked_for() -> None:
    options = ExportOptions(altitude_m=40.0, altitude_step_m=5.0)
    for name in ("qgc", "csv", "kml", "geojson", "crazyswarm"):
        made = export(mixed_team(), name, options)
        reported = sidecar_of(made)["vehicles"]
        assert [one["entry"]["altitude_m"] for one in reported] == [40.0, 45.0, 50.0]
    for k, text in enumerate(contents(export(mixed_team(), "qgc", options), ".plan").values()):
        items = json.loads(text)["mission"]["items"]
        assert [one["Altitude"] for one in items if "Altitude" in one] == [40.0 + 5.0 * k] * 2


# --- a small vehicle flies them -------------------------------------------------------------------


@pytest.fixture
def ground() -> Iterator[tuple[Any, int]]:
    """A ground station of MAVSDK's, and the port of loopback that it listens to."""
    mavsdk = pytest.importorskip("mavsdk", reason="this platform has no MAVSDK")
    port = free_port()
    kind = mavsdk.ComponentType.GROUND_STATION
    station = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    assert station.add_any_connection(f"udpin://127.0.0.1:{port}") == 0
    try:
        yield station, port
    finally:
        station.destroy()


def _uploaded(ground: tuple[Any, int], autopilot: str, plan_file: Path) -> Any:
    """The vehicle after MAVSDK has imported the plan and sent it."""
    from mavsdk.plugins.mission_raw import MissionRaw

    station, port = ground
    with flying(port, autopilot) as vehicle:
        system = station.first_autopilot(20.0)
        assert system is not None
        missions = MissionRaw(system)
        read = missions.import_qgroundcontrol_mission(str(plan_file))
        assert not read.geofence_items
        assert not read.rally_items
        missions.upload_mission(read.mission_items)
    assert vehicle.answer == ACCEPTED
    return vehicle


@pytest.mark.parametrize("k", [0, 1], ids=["ccw", "cw"])
def test_an_ardupilot_keeps_turns_that_are_the_plans(
    k: int, ground: tuple[Any, int], tmp_path: Path
) -> None:
    plan = mixed_team()
    made = export(plan, "qgc")
    path = tmp_path / "mission.plan"
    path.write_bytes(list(contents(made, ".plan").values())[k])
    vehicle = _uploaded(ground, "ardupilot", path)
    home, speed, entry, wait, circle = vehicle.items
    assert [one.command for one in vehicle.items] == [16, CHANGE_SPEED, WAYPOINT, 93, LOITER_TURNS]
    assert (wait.param1, wait.param2, wait.param3, wait.param4) == (-1, 9, 0, 1)
    assert np.allclose(to_plane([home.x / 1e7, home.y / 1e7]), 0.0, atol=0.02)
    kept = stored_loiter(circle.param1, circle.param3)
    assert kept.ccw == (plan.orbits.senses[k] > 0)
    assert (kept.turns, kept.radius) == (4, plan.orbits.radii[k])
    center = to_plane([circle.x / 1e7, circle.y / 1e7])
    start = to_plane([entry.x / 1e7, entry.y / 1e7]) - center
    time = np.linspace(0.0, 100.0, 101)
    radius = -kept.radius if kept.ccw else kept.radius
    flown = circled(center, start, radius, speed.param2, time)
    assert furthest(flown, plan, k, time) < 0.05


def test_a_px4_keeps_waypoints(ground: tuple[Any, int], tmp_path: Path) -> None:
    plan = mixed_team()
    path = tmp_path / "mission.plan"
    made = export(plan, "qgc", ExportOptions(autopilot="px4"))
    path.write_bytes(contents(made, "left.plan")["team-left.plan"])
    vehicle = _uploaded(ground, "px4", path)
    speed, *corners = vehicle.items
    points = to_plane([[one.x / 1e7, one.y / 1e7] for one in corners])
    # each corner is reached when the plan is there
    legs = np.hypot(*np.diff(points, axis=0).T)
    time = np.concatenate([[0.0], np.cumsum(legs)]) / speed.param2
    assert time[-1] >= 100.0
    assert np.hypot(*(points - position(plan.orbits, time)[:, 0]).T).max() < 0.1
    assert np.isnan([one.param4 for one in corners]).all()
