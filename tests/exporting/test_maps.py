"""Maps: GeoJSON read by geojson and shapely, KML by fastkml, both show the plan's circles."""

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from syncplan.exporting.formats import ExportOptions, export
from syncplan.orbits.circles import position
from syncplan.planning.plans import Plan
from tests.tools.exported import FORCED, contents, mixed_team, team, to_plane

ANTIMERIDIAN = {"lat_deg": -17.0, "lon_deg": 179.9998, "alt_m": 0.0}


def _collection(plan: Any) -> Any:
    import geojson

    (text,) = contents(export(plan, "geojson", FORCED), ".geojson").values()
    # the reader rounds to a decimetre if not asked otherwise
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("geojson.geometry.DEFAULT_PRECISION", 9)
        collection = geojson.loads(text.decode())
    assert isinstance(collection, geojson.FeatureCollection)
    assert collection.is_valid, collection.errors()
    return collection


def _of(collection: Any, kind: str) -> list[Any]:
    return [one for one in collection.features if one.properties["kind"] == kind]


def test_the_features_read_by_geojson_lie_where_the_plan_has_them() -> None:
    plan, collection = mixed_team(), _collection(mixed_team())
    turn = np.linspace(0.0, plan.orbits.period, 181)
    for k, (circle, center, entry) in enumerate(
        zip(*(_of(collection, kind) for kind in ("circle", "center", "entry")), strict=True)
    ):
        name = plan.scenario.vehicle_names[k]
        assert {one.properties["vehicle"] for one in (circle, center, entry)} == {name}
        places = np.array(circle.geometry.coordinates)[:, ::-1]
        # in the order of flight, from the entry point
        assert np.abs(to_plane(places) - position(plan.orbits, turn)[:, k]).max() < 0.01
        assert (
            np.abs(to_plane(center.geometry.coordinates[::-1]) - plan.orbits.centers[k]).max()
            < 0.01
        )
        assert entry.geometry.coordinates == circle.geometry.coordinates[0]
        assert circle.properties["direction"] == plan.scenario.orbit.direction[k]
        assert circle.properties["speed_mps"] == pytest.approx(plan.orbits.speeds[k])
    mast, _ = _of(collection, "landmark")
    assert mast.properties["landmark"] == "mast"
    assert np.abs(to_plane(mast.geometry.coordinates[::-1]) - [30.0, 60.0]).max() < 0.01


def _placemarks(plan: Any, **options: Any) -> dict[str, Any]:
    from fastkml import KML
    from fastkml.features import Placemark
    from fastkml.utils import find_all

    (text,) = contents(export(plan, "kml", ExportOptions(force=True, **options)), ".kml").values()
    found: list[Any] = list(find_all(KML.parse(io.BytesIO(text)), of_type=Placemark))
    return {one.name: one for one in found}


def test_the_places_read_by_fastkml_are_the_plans() -> None:
    plan, marks = mixed_team(), _placemarks(mixed_team(), altitude_m=70.0)
    for k, name in enumerate(plan.scenario.vehicle_names):
        assert {place[2] for place in marks[f"{name} circle"].geometry.coords} == {70.0}
        (entry,) = marks[f"{name} entry"].geometry.coords
        where = to_plane(entry[1::-1])
        assert np.hypot(*(where - position(plan.orbits, 0.0)[k])) < 0.01
        mode = marks[f"{name} entry"].kml_geometry.altitude_mode
        assert mode.value == "relativeToGround"
    assert "mast" in marks


def _geojson_circles(plan: Plan) -> list[Any]:
    from shapely.geometry import shape

    return [shape(one.geometry) for one in _of(_collection(plan), "circle")]


def _kml_circles(plan: Plan) -> list[Any]:
    marks = _placemarks(plan)
    return [marks[f"{name} circle"].geometry for name in plan.scenario.vehicle_names]


@pytest.mark.parametrize("circles_of", [_geojson_circles, _kml_circles])
def test_circles_are_cut_at_the_antimeridian(circles_of: Callable[[Plan], list[Any]]) -> None:
    plan = team(geo_origin=ANTIMERIDIAN)
    circles = [list(getattr(circle, "geoms", [circle])) for circle in circles_of(plan)]
    assert max(map(len, circles)) > 1
    for k, parts in enumerate(circles):
        places = [np.array(part.coords) for part in parts]
        assert all(np.ptp(one[:, 0]) < 1.0 for one in places)
        off = to_plane(np.concatenate(places)[:, 1::-1], ANTIMERIDIAN) - plan.orbits.centers[k]
        assert np.abs(np.hypot(*off.T) - plan.orbits.radii[k]).max() < 0.01


def test_tracks_read_by_fastkml_are_the_plan_in_time() -> None:
    plan, marks = mixed_team(), _placemarks(mixed_team())
    for k, name in enumerate(plan.scenario.vehicle_names):
        items = marks[f"{name} flight"].kml_geometry.track_items
        times = np.array(
            [(one.when.dt - items[0].when.dt).total_seconds() for one in items], dtype=float
        )
        assert items[0].when.dt.isoformat() == "2026-05-01T09:00:00.250000+00:00"
        assert times[-1] == pytest.approx(100.0, abs=1e-5)
        places = np.array([[one.coord.y, one.coord.x] for one in items])
        off = np.hypot(*(to_plane(places) - position(plan.orbits, times)[:, k]).T)
        assert off.max() < 0.01


def test_without_a_start_time_there_are_no_tracks() -> None:
    assert not [name for name in _placemarks(team(start_time=None)) if name.endswith("flight")]


def test_names_that_xml_would_take_for_its_own_are_kept() -> None:
    plan = team(formation={"centers_m": {"<a>": [0, 0], "b & c": [70, 0], '"d"': [150, 0]}})
    assert {"<a> circle", "b & c entry", '"d" flight'} <= set(_placemarks(plan))
