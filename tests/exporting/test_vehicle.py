"""MAVSDK reads the missions and loads them onto a small vehicle, which then flies the plan."""

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.exporting.formats import ExportOptions, export
from syncplan.orbits.circles import position
from tests.tools.exported import contents, mixed_team, to_plane
from tests.tools.fake_vehicle import ACCEPTED, UNSUPPORTED, flying, stored_loiter

mavsdk = pytest.importorskip("mavsdk", reason="this platform has no MAVSDK")

WAYPOINT, LOITER_TURNS, CHANGE_SPEED = 16, 18, 178


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def ground() -> Iterator[tuple[Any, int]]:
    """A ground station of MAVSDK's, and the port of loopback that it listens to."""
    port = _free_port()
    kind = mavsdk.ComponentType.GROUND_STATION
    station = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(kind))
    assert station.add_any_connection(f"udpin://127.0.0.1:{port}") == 0
    try:
        yield station, port
    finally:
        station.destroy()


def _uploaded(ground: tuple[Any, int], autopilot: str, plan_file: Path) -> Any:
    """The vehicle after MAVSDK has imported the plan and sent it."""
    from mavsdk.plugins.mission_raw import MissionRaw, MissionRawError

    station, port = ground
    with flying(port, autopilot) as vehicle:
        system = station.first_autopilot(20.0)
        assert system is not None
        missions = MissionRaw(system)
        read = missions.import_qgroundcontrol_mission(str(plan_file))
        assert not read.geofence_items
        assert not read.rally_items
        try:
            missions.upload_mission(read.mission_items)
        except MissionRawError:
            assert vehicle.answer == UNSUPPORTED
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
    assert vehicle.answer == ACCEPTED
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
    angle = np.arctan2(start[1], start[0]) + (1 if kept.ccw else -1) * (
        speed.param2 / kept.radius * time
    )
    flown = center + kept.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert np.hypot(*(flown - position(plan.orbits, time)[:, k]).T).max() < 0.05


def test_a_px4_keeps_waypoints_and_refuses_turns(ground: tuple[Any, int], tmp_path: Path) -> None:
    plan = mixed_team()
    path = tmp_path / "mission.plan"
    made = export(plan, "qgc", ExportOptions(autopilot="px4"))
    path.write_bytes(contents(made, "left.plan")["team-left.plan"])
    vehicle = _uploaded(ground, "px4", path)
    assert vehicle.answer == ACCEPTED
    speed, *corners = vehicle.items
    points = to_plane([[one.x / 1e7, one.y / 1e7] for one in corners])
    # each corner is reached when the plan is there
    legs = np.hypot(*np.diff(points, axis=0).T)
    time = np.concatenate([[0.0], np.cumsum(legs)]) / speed.param2
    assert time[-1] >= 100.0
    assert np.hypot(*(points - position(plan.orbits, time)[:, 0]).T).max() < 0.1
    assert np.isnan([one.param4 for one in corners]).all()


def test_a_px4_refuses_loiter_turns(ground: tuple[Any, int], tmp_path: Path) -> None:
    path = tmp_path / "mission.plan"
    path.write_bytes(contents(export(mixed_team(), "qgc"), "left.plan")["team-left.plan"])
    assert _uploaded(ground, "px4", path).answer == UNSUPPORTED
