"""Files of the field: each gives the places that it describes, or is refused with what to do."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from syncplan.errors import InputError
from syncplan.exporting.formats import export
from syncplan.importing.imported_places import ImportedPlaces, import_places
from syncplan.scenario.loading import parse_document, scenario_from
from tests.exporting.test_fences import AREA, KEEP_OUT, fenced
from tests.tools.exported import FORCED, ORIGIN, to_plane

FILES = Path("tests/data/places")
FIELD = [(47.397, 8.544), (47.397, 8.548), (47.3995, 8.548), (47.3995, 8.544)]
"""Corners of the field in most of the files."""

HERE = {"lat_deg": 47.398, "lon_deg": 8.546}


def keys_of(places: ImportedPlaces) -> tuple[Any, int, int, list[str]]:
    """The area, the numbers of keep-outs and obstacles, and the names of landmarks."""
    keys = places.scenario
    return (
        keys.get("area_lat_lon_deg"),
        len(keys.get("keep_out_lat_lon_deg", [])),
        len(keys.get("obstacles_lat_lon_deg", [])),
        list(keys.get("landmarks_lat_lon_deg", {})),
    )


def kmz(text: bytes, name: str = "doc.kml") -> bytes:
    """An archive of a KML text and a picture."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("files/picture.png", b"\x89PNG")
        archive.writestr(name, text)
    return packed.getvalue()


def square(west: float, side: float = 0.001) -> list[list[float]]:
    """The ring of a square of some degrees, north of the 47th parallel."""
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side), (0.0, 0.0)]
    return [[west + x, 47.0 + y] for x, y in corners]


def collected(name: str, *rings: list[list[float]], **properties: str) -> dict[str, Any]:
    """A feature of GeoJSON."""
    shape = {"type": "Polygon", "coordinates": rings}
    return {"type": "Feature", "properties": {"name": name, **properties}, "geometry": shape}


def field_file(name: str) -> Path:
    """A real file of the field; skips where the folder is absent."""
    path = Path("../shared/places") / name
    if not path.exists():
        pytest.skip("the folder of real files is not there")
    return path


@pytest.mark.parametrize("packed", [False, True], ids=["kml", "kmz"])
def test_kml_folders_styles_holes_and_multigeometries(packed: bool) -> None:
    text = (FILES / "survey.kml").read_bytes()
    places = import_places({"survey": kmz(text) if packed else text})
    # the hole, the red pylon and both parts of the school; a barn and a road are neither
    assert keys_of(places) == (FIELD, 4, 0, ["mast", "mast 2"])
    sections = {each.name: (each.section, each.reason) for each in places.features}
    assert sections["barn"] == ("left_out", "another polygon is the area")
    assert sections["road"] == ("left_out", "a line that is not closed")
    assert sections["pylon"] == ("keep_out", "as its file has it")
    assert {each.folder for each in places.features} == {"Field & fences", "Marks"}


def test_the_normal_style_of_a_map_counts_in_any_order() -> None:
    text = (FILES / "survey.kml").read_text()
    pairs = text[text.index("<Pair>") : text.index("</StyleMap>")]
    normal, highlight = pairs.split("</Pair>")[:2]
    turned = text.replace(pairs, f"{highlight}</Pair>{normal}</Pair>")
    sections = {each.name: each.section for each in import_places({"k": turned.encode()}).features}
    assert sections["pylon"] == "keep_out"


def test_names_choose_what_features_become() -> None:
    places = import_places(
        FILES / "survey.kml",
        area=("BARN",),
        obstacle=("field 7", "pylon"),
        landmark=("marks / mast",),
        left_out=("no-fly*", "mast"),
    )
    area, keep_outs, obstacles, landmarks = keys_of(places)
    assert (len(area), keep_outs, obstacles, landmarks) == (3, 0, 2, ["mast", "mast 2"])
    with pytest.raises(InputError, match="area: 'shed' matches none of Field 7, No-fly: school"):
        import_places(FILES / "survey.kml", area=("shed",))
    with pytest.raises(InputError, match="mast: is a point, not keep_out: landmarks are points"):
        import_places(FILES / "survey.kml", keep_out=("mast",))


def test_an_area_that_is_asked_for_counts_before_one_that_a_file_states() -> None:
    fields = [collected("field", square(8.5, 0.01), kind="area"), collected("barn", square(8.5))]
    text = json.dumps({"type": "FeatureCollection", "features": fields}).encode()
    for options, sections in (
        ({}, ["area", "left_out"]),
        ({"area": ("barn",)}, ["left_out", "area"]),
    ):
        places = import_places({"fields.json": text}, **options)
        assert [each.section for each in places.features] == sections


def test_the_style_of_one_placemark_is_not_that_of_others() -> None:
    text = (FILES / "survey.kml").read_text()
    red = "<name>barn</name><Style><PolyStyle><color>ff0000ff</color></PolyStyle></Style>"
    text = text.replace("<name>barn</name>", red).replace("<styleUrl>#plain</styleUrl>", "")
    sections = {each.name: each.section for each in import_places({"k": text.encode()}).features}
    assert (sections["Field 7"], sections["barn"]) == ("area", "keep_out")


def test_geojson_collections_identifiers_and_colours() -> None:
    places = import_places(FILES / "zones.geojson")
    assert keys_of(places) == (FIELD, 1, 0, ["stones", "stones 2", "hut"])
    left_out = [each.name for each in places.features if each.section == "left_out"]
    assert left_out == ["hut"]


def test_gpx_waypoints_and_closed_tracks() -> None:
    places = import_places(FILES / "walk.gpx")
    assert keys_of(places) == (FIELD, 0, 0, ["mast", "gate", "landmark"])


def test_circular_fences_lie_within_inclusions_and_around_exclusions() -> None:
    places = import_places(FILES / "circles.plan")
    area, keep_outs, _, landmarks = keys_of(places)
    assert (keep_outs, landmarks) == (2, [])
    assert places.notes == [
        "tests/data/places/circles.plan: mission.items is left out",
        "tests/data/places/circles.plan: rallyPoints.points is left out",
    ]
    inside = np.hypot(*to_plane(area, {"lat_deg": 47.398, "lon_deg": 8.546}).T)
    assert inside == pytest.approx(150.0, abs=1e-3)
    (triangle, ring) = sorted(places.scenario["keep_out_lat_lon_deg"], key=len)
    assert len(triangle) == 3
    around = shapely.Polygon(to_plane(ring, {"lat_deg": 47.3985, "lon_deg": 8.546}))
    assert 9.9999 <= shapely.distance(around.exterior, shapely.Point(0.0, 0.0)) < 10.001


def test_fence_lists_of_ardupilot() -> None:
    places = import_places(FILES / "fences.waypoints")
    area, keep_outs, _, _ = keys_of(places)
    assert (area, keep_outs) == (FIELD, 2)
    assert places.notes == [
        "tests/data/places/fences.waypoints: 1 items that are no fences are left out",
    ]


def test_survey_points_with_decimal_commas() -> None:
    landmarks = import_places(FILES / "points.csv").scenario["landmarks_lat_lon_deg"]
    assert landmarks == {
        "101": (47.3976, 8.545),
        "102": (47.399, 8.5452),
        "north; gate": (47.3975, 8.547),
    }


@pytest.mark.parametrize(
    ("name", "corners", "keep_outs", "landmarks"),
    [
        ("building.kml", 18, 0, []),
        (
            "points-in-folders.kml",
            0,
            0,
            [
                "Мобильное ориентирование",
                'Портал "Незримый Новосибирск"',
                'Сайт "Новосибирск - детям"',
            ],
        ),
        ("field-with-hole.geojson", 6, 1, []),
        ("fence.plan", 4, 1, []),
        ("avoidance-fence.txt", 3, 0, []),
    ],
)
def test_real_files(name: str, corners: int, keep_outs: int, landmarks: list[str]) -> None:
    area, avoided, _, sites = keys_of(import_places(field_file(name)))
    assert (len(area or []), avoided, sites) == (corners, keep_outs, landmarks)


def test_several_files_make_one_scenario_that_is_valid() -> None:
    places = import_places([FILES / "fences.waypoints", FILES / "points.csv"])
    scenario = scenario_from(parse_document(places.scenario_text(), ""))
    assert (scenario.name, scenario.landmark_names) == ("fences", ["101", "102", "north; gate"])
    assert scenario.area_m is not None
    assert scenario.keep_out_m is not None
    width = np.ptp(np.array(scenario.area_m), axis=0)
    assert width == pytest.approx(np.ptp(to_plane(FIELD, HERE), axis=0), abs=1e-3)


def test_names_of_vehicles_and_signs_that_do_not_print_do_not_stay() -> None:
    points = "name,lat,lon\nv1,47.1,8.1\nma\x07st,47.2,8.2\n,47.3,8.3\n"
    assert keys_of(import_places({"points.csv": points.encode()}))[3] == [
        "v1 2",
        "mast",
        "landmark",
    ]


def test_holes_of_keep_outs_are_closed_and_said_to_be() -> None:
    outer = [[8.5, 47.4], [8.51, 47.4], [8.51, 47.41], [8.5, 47.41], [8.5, 47.4]]
    inner = [[8.504, 47.404], [8.506, 47.404], [8.506, 47.406], [8.504, 47.404]]
    shape = {"type": "Polygon", "coordinates": [outer, inner]}
    feature = {"type": "Feature", "properties": {"name": "no-fly"}, "geometry": shape}
    places = import_places({"zone.json": json.dumps(feature).encode()})
    assert keys_of(places)[1] == 1
    assert places.features[0].reason == "as its file has it; its holes are closed"


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("crossed.kml", "crossed.kml: bow tie: is not a simple polygon"),
        ("entities.kml", "entities.kml: has a document type; save it without <!DOCTYPE>"),
        ("cut.kml", "cut.kml: is no readable XML: no element found: line 1, column 101"),
        ("projected.geojson", "field: has the longitude 951114 and the latitude 6.00335e+06; give"),
        ("crs.geojson", "EPSG::2056"),
        ("nan.geojson", "field: has the longitude 8.544 and the latitude nan; give degrees"),
        ("eastings.csv", "latitude and longitude, in degrees, not eastings and northings"),
        ("short.waypoints", "inclusion fence 1: has fewer corners than the 4 that it counts"),
        ("circle.plan", "inclusion fence 1: is a circle without a center and a radius"),
        ("words.gpx", "mast: has a position that is no pair of numbers"),
        ("bytes.csv", "is not text: byte 18 is not UTF-8; give KML, KMZ, GeoJSON, GPX"),
    ],
)
def test_malformed_files_are_refused_in_one_line(name: str, message: str) -> None:
    path = FILES / "bad" / name
    with pytest.raises(InputError) as caught:
        import_places(path)
    assert message in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_too_large_are_refused_before_they_are_held() -> None:
    many = " ".join(f"8.5,{47.0 + k * 1e-7:.7f}" for k in range(1_000_000))
    line = f"<LineString><coordinates>{many}</coordinates></LineString>"
    track = f"<kml><Placemark><name>track</name>{line}</Placemark></kml>".encode()
    with pytest.raises(InputError, match="track: is beyond 100,000 positions"):
        import_places({"track.kml": track})
    bomb = kmz(b"<kml>" + b" " * (64 * 2**20) + b"</kml>")
    with pytest.raises(InputError, match=r"bomb\.kmz: unpacks to more than 32 MiB"):
        import_places({"bomb.kmz": bomb})
    with pytest.raises(InputError, match=r"empty\.kmz: holds no \.kml file"):
        import_places({"empty.kmz": kmz(b"", name="readme.txt")})
    deep = b"<kml>" + b"<Folder>" * 5000
    with pytest.raises(InputError, match="nests more than 100 elements"):
        import_places({"deep.kml": deep})
    with pytest.raises(InputError, match="nested too deeply"):
        import_places({"deep.json": b'{"a":' * 100_000})


def test_features_on_two_continents_are_refused() -> None:
    points = b"name,lat,lon\na,0,0\nb,47,8\n"
    with pytest.raises(InputError, match=r"^points\.csv: features lie more than 1,000 km apart"):
        import_places({"points.csv": points})


@pytest.mark.parametrize("count", ["9" * 400, "nan", "-inf", "many"])
def test_a_fence_that_counts_no_corners_of_its_own_is_refused(count: str) -> None:
    text = (FILES / "fences.waypoints").read_text().replace("5001\t4", f"5001\t{count}")
    with pytest.raises(InputError, match=r"^fences: inclusion fence 1: has "):
        import_places({"fences": text.encode()})


def test_a_polygon_of_too_many_corners_is_named() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 2000)
    ring = np.stack([8.5 + 1e-3 * np.cos(turn), 47.4 + 1e-3 * np.sin(turn)], axis=-1).tolist()
    text = json.dumps({"type": "Polygon", "coordinates": [ring]}).encode()
    with pytest.raises(InputError, match="has 1,999 corners, more than 1,000; correct the file"):
        import_places({"coast.json": text})


@pytest.mark.parametrize("center", [{"lat": 47.4}, [10**400, 8.5], [47.4, 181.0], None])
def test_circles_without_a_place_are_refused(center: Any) -> None:
    fence = {"circles": [{"circle": {"center": center, "radius": 10.0}}]}
    text = json.dumps({"fileType": "Plan", "geoFence": fence}).encode()
    with pytest.raises(InputError, match=r"^a\.plan: inclusion fence 1: is a circle without a"):
        import_places({"a.plan": text})


# --- out and in again -----------------------------------------------------------------------------

ANTIMERIDIAN = {"lat_deg": -17.0, "lon_deg": 179.9998, "alt_m": 0.0}
POLE = {"lat_deg": 89.9, "lon_deg": 12.0, "alt_m": 0.0}


@pytest.mark.parametrize("format_", ["qgc", "ardupilot", "geojson", "kml"])
@pytest.mark.parametrize("origin", [ORIGIN, ANTIMERIDIAN, POLE], ids=["inland", "date", "pole"])
def test_what_was_exported_comes_in_again_to_a_centimetre(
    format_: str, origin: dict[str, float]
) -> None:
    made = export(fenced(origin), format_, FORCED)
    (name, content) = next(
        (file.name, file.content)
        for file in made.files
        if ("fence" in file.name if format_ == "ardupilot" else "sync" not in file.name)
    )
    places = import_places({name: content})
    keys = places.scenario
    given = [("area_lat_lon_deg", [AREA]), ("keep_out_lat_lon_deg", [KEEP_OUT])]
    for key, polygons in given:
        again = [keys[key]] if key.startswith("area") else keys[key]
        for corners, wanted in zip(again, polygons, strict=True):
            ring = shapely.Polygon(to_plane(corners, origin))
            assert shapely.hausdorff_distance(ring, shapely.Polygon(wanted)) < 0.01
    if format_ in ("geojson", "kml"):
        assert list(keys["landmarks_lat_lon_deg"]) == ["mast", "tower"]
        mast = to_plane(keys["landmarks_lat_lon_deg"]["mast"], origin)
        assert mast == pytest.approx([30.0, 60.0], abs=0.01)


def test_halves_at_the_antimeridian_keep_their_holes() -> None:
    east, west = square(179.99, 0.01), square(-180.0, 0.01)
    # one hole within the western half, another one cut as the polygon is
    whole = square(-179.994, 0.001)
    halves = [[east, square(179.997, 0.003)], [west, square(-180.0, 0.003), whole]]
    for hole in (halves[0][1], halves[1][1], whole):
        hole[:] = [[x, y + 0.002] for x, y in hole]
    shape = {"type": "MultiPolygon", "coordinates": halves}
    places = import_places({"field.json": json.dumps(shape).encode()})
    (feature,) = places.features
    assert (feature.section, len(feature.lat_lon_deg)) == ("area", 4)
    widths = [
        np.ptp(np.array(hole)[:, 1] % 360.0) for hole in places.scenario["keep_out_lat_lon_deg"]
    ]
    assert sorted(widths) == pytest.approx([0.001, 0.006])


def test_parts_at_the_antimeridian_that_are_no_polygons_are_refused() -> None:
    flat = [[180.0, 0.0], [180.0, 0.01], [180.0, 0.0]]
    shape = {"type": "MultiPolygon", "coordinates": [[flat], [flat]]}
    with pytest.raises(InputError, match=r"^field\.json: polygon: encloses nothing"):
        import_places({"field.json": json.dumps(shape).encode()})
