"""Fences: read back by pymavlink, shapely and fastkml, they are the plan's area and keep-outs."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from syncplan.exporting.formats import export
from syncplan.planning.plans import Plan
from tests.tools.exported import FORCED, ORIGIN, contents, team, to_plane

AREA = [[-150.0, -100.0], [200.0, -100.0], [200.0, 150.0], [-150.0, 150.0]]
KEEP_OUT = [[-140.0, 100.0], [-120.0, 100.0], [-130.0, 120.0]]
OBSTACLE = [[170.0, -80.0], [180.0, -80.0], [175.0, -60.0]]
ANTIMERIDIAN = {"lat_deg": -17.0, "lon_deg": 179.9998, "alt_m": 0.0}
CENTIMETRE = 0.01


def fenced(origin: dict[str, float] = ORIGIN, **keys: Any) -> Plan:
    """A team within an area, beside a keep-out and an obstacle."""
    polygons = {"area_m": AREA, "keep_out_m": [KEEP_OUT], "obstacles_m": [OBSTACLE]}
    return team(geo_origin=origin, **{**polygons, **keys})


def is_polygon(places: Any, corners: Any, origin: dict[str, float] = ORIGIN) -> bool:
    """Whether places are the corners of a polygon, to a centimetre."""
    ring = shapely.Polygon(to_plane(places, origin))
    return bool(shapely.hausdorff_distance(ring, shapely.Polygon(corners)) < CENTIMETRE)


@pytest.mark.parametrize("origin", [ORIGIN, ANTIMERIDIAN], ids=["inland", "antimeridian"])
def test_qgroundcontrol_plans_hold_the_fences_as_its_description_has_them(
    origin: dict[str, float],
) -> None:
    for text in contents(export(fenced(origin), "qgc", FORCED), ".plan").values():
        fence = json.loads(text)["geoFence"]
        # QGroundControl developer guide, "Plan File Format", GeoFence
        assert (fence["version"], fence["circles"]) == (2, [])
        area, keep_out = fence["polygons"]
        assert [set(polygon) for polygon in (area, keep_out)] == [
            {"polygon", "inclusion", "version"}
        ] * 2
        assert (area["inclusion"], keep_out["inclusion"]) == (True, False)
        assert area["version"] == keep_out["version"] == 1
        assert is_polygon(area["polygon"], AREA, origin)
        assert is_polygon(keep_out["polygon"], KEEP_OUT, origin)


def test_pymavlink_reads_ardupilots_fences(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavutil, mavwp

    mavutil.set_dialect("ardupilotmega")
    ((name, text),) = contents(export(fenced(), "ardupilot", FORCED), "-fence.txt").items()
    (tmp_path / name).write_bytes(text)
    loader = mavwp.MissionItemProtocol_Fence()
    loader.load(str(tmp_path / name))
    items = [loader.item(k) for k in range(loader.count())]
    area = [item for item in items if item.command == 5001]
    keep_out = [item for item in items if item.command == 5002]
    assert len(area) + len(keep_out) == len(items)
    for corners, given in ((area, AREA), (keep_out, KEEP_OUT)):
        assert {item.param1 for item in corners} == {float(len(given))}
        assert is_polygon([(item.x, item.y) for item in corners], given)


def test_maps_show_areas_keep_outs_and_obstacles() -> None:
    (text,) = contents(export(fenced(), "geojson", FORCED), ".geojson").values()
    shown = {
        feature["properties"]["kind"]: np.array(feature["geometry"]["coordinates"][0])[:, ::-1]
        for feature in json.loads(text)["features"]
        if feature["geometry"]["type"] == "Polygon"
    }
    assert list(shown) == ["area", "keep_out", "obstacle"]
    for places, corners in zip(shown.values(), (AREA, KEEP_OUT, OBSTACLE), strict=True):
        assert is_polygon(places, corners)


def test_fastkml_reads_the_same_polygons() -> None:
    from fastkml import KML
    from fastkml.features import Placemark
    from fastkml.utils import find_all

    (text,) = contents(export(fenced(), "kml", FORCED), ".kml").values()
    placemarks: list[Any] = list(find_all(KML.parse(io.BytesIO(text)), of_type=Placemark))
    shown = {
        placemark.name: placemark.geometry
        for placemark in placemarks
        if placemark.geometry.geom_type == "Polygon"
    }
    assert list(shown) == ["area", "keep out", "obstacle"]
    for polygon, corners in zip(shown.values(), (AREA, KEEP_OUT, OBSTACLE), strict=True):
        places = [(latitude, longitude) for longitude, latitude, *_ in polygon.exterior.coords]
        assert is_polygon(places, corners)


def test_an_area_over_the_antimeridian_is_cut_there() -> None:
    (text,) = contents(export(fenced(ANTIMERIDIAN), "geojson", FORCED), ".geojson").values()
    (area,) = [
        feature["geometry"]
        for feature in json.loads(text)["features"]
        if feature["properties"]["kind"] == "area"
    ]
    assert area["type"] == "MultiPolygon"
    parts = [
        shapely.Polygon(to_plane(np.array(ring)[:, ::-1], ANTIMERIDIAN))
        for (ring,) in area["coordinates"]
    ]
    assert len(parts) == 2
    whole = shapely.union_all([part.buffer(1e-6) for part in parts])
    assert shapely.hausdorff_distance(whole, shapely.Polygon(AREA)) < CENTIMETRE


def test_notes_state_how_near_circles_come_to_the_fences_and_where_home_is() -> None:
    # v2, 30 m about (30, 0), passes the area's lower edge nearest of all
    near = [[-150.0, -32.5], *AREA[1:]]
    near[1] = [200.0, -32.5]
    notes = " ".join(export(fenced(area_m=near), "qgc", FORCED).notes)
    assert "circles keep 2.5 m from the fences" in notes
    assert "home" not in notes
    outside = [[-20.0 + 150.0 * x, y] for x, y in ((0.0, -100.0), (2.0, -100.0), (2.0, 150.0))]
    moved = fenced(area_m=[[x + 100.0, y] for x, y in outside])
    barred = fenced(keep_out_m=[[[-2.0, -2.0], [2.0, -2.0], [0.0, 2.0]]])
    for plan in (moved, barred):
        notes = " ".join(export(plan, "qgc", FORCED).notes)
        assert "home, at geo_origin, breaks a fence" in notes


def test_a_fence_with_more_corners_than_ardupilot_stores_is_noted() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 301)[:-1]
    round_ = (200.0 * np.stack([np.cos(turn), np.sin(turn)], axis=-1)).tolist()
    notes = export(fenced(area_m=round_), "ardupilot", FORCED).notes
    assert "a fence has 300 corners, and ArduPilot stores up to 255" in notes
    assert not any("corners" in note for note in export(fenced(), "ardupilot", FORCED).notes)
