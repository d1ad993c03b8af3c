"""Files of the field: each gives the places that it describes, or is refused with what to do."""

import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from syncplan.errors import InputError
from syncplan.exporting.formats import export
from syncplan.importing.imported_places import ImportedPlaces, import_places
from syncplan.placement.centers import place
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


def collected(name: str, *rings: Any, **properties: str) -> dict[str, Any]:
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
    assert sections["pylon"] == ("keep_out", "drawn in red")
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
    with pytest.raises(InputError, match="mast: is a point, not keep-out: landmarks are points"):
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
        "tests/data/places/fences.waypoints: items that are no fences, and left out: 1",
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
        "P3",
    ]


def test_holes_of_keep_outs_are_closed_and_said_to_be() -> None:
    outer = [[8.5, 47.4], [8.51, 47.4], [8.51, 47.41], [8.5, 47.41], [8.5, 47.4]]
    inner = [[8.504, 47.404], [8.506, 47.404], [8.506, 47.406], [8.504, 47.404]]
    shape = {"type": "Polygon", "coordinates": [outer, inner]}
    feature = {"type": "Feature", "properties": {"name": "no-fly"}, "geometry": shape}
    places = import_places({"zone.json": json.dumps(feature).encode()})
    assert keys_of(places)[1] == 1
    assert places.features[0].reason == "named as no-fly; its holes are closed"


def as_collection(*features: dict[str, Any]) -> bytes:
    """A GeoJSON file of features."""
    return json.dumps({"type": "FeatureCollection", "features": features}).encode()


def marked(name: str, style: str = "", shape: str = "") -> str:
    """A placemark of KML: a square field of its own, or another shape."""
    ring = " ".join(f"{x},{y}" for x, y in square(8.5 + 0.002 * (len(name) % 7)))
    line = f"<LinearRing><coordinates>{ring}</coordinates></LinearRing>"
    polygon = f"<Polygon><outerBoundaryIs>{line}</outerBoundaryIs></Polygon>"
    return f"<Placemark><name>{name}</name>{style}{shape or polygon}</Placemark>"


def sections_of(text: bytes | str, **options: Any) -> dict[str, str]:
    """What the features of a file become, by name."""
    data = text.encode() if isinstance(text, str) else text
    return {each.name: each.section for each in import_places({"file": data}, **options).features}


@pytest.mark.parametrize(
    ("properties", "section"),
    [
        ({"fill": "#f00"}, "keep_out"),
        ({"fill": "red"}, "keep_out"),
        ({"fill": "#555555", "stroke": "#ff0000"}, "keep_out"),
        ({"fill": "#E65100"}, "area"),
        ({"fill": "#555555"}, "area"),
        ({"name": "Unrestricted flying"}, "area"),
        ({"name": "Casino Flyover"}, "area"),
        ({"name": "my_nofly_zone"}, "keep_out"),
        ({"name": "TFR: flight restricted"}, "keep_out"),
        ({"kind": "obstacle"}, "obstacle"),
        ({"kind": "landmark"}, "area"),
    ],
)
def test_names_and_colours_say_what_a_polygon_is(properties: dict[str, str], section: str) -> None:
    feature = collected("field", square(8.5))
    feature["properties"] |= properties
    assert [*sections_of(as_collection(feature)).values()] == [section]


def test_styles_of_kml_add_to_those_they_refer_to() -> None:
    red = "<LineStyle><color>ff0000ff</color></LineStyle>"
    grey = "<PolyStyle><color>ff555555</color></PolyStyle>"
    shared = f"<Style id='r'>{grey}{red}</Style>"
    web = f"<CascadingStyle kml:id='w'><Style>{red}</Style></CascadingStyle>"
    icon = "<styleUrl>#r</styleUrl><Style><IconStyle/></Style>"
    marks = [
        marked("a", "<styleUrl>#r</styleUrl>"),
        marked("bb", icon),
        marked("ccc", "<styleUrl>#w</styleUrl>"),
        marked("dddd", f"<styleUrl>#r</styleUrl><Style>{grey}</Style>"),
    ]
    text = f"<kml><Document>{shared}{web}{''.join(marks)}</Document></kml>"
    assert sections_of(text) == {
        "a": "keep_out",
        "bb": "keep_out",
        "ccc": "keep_out",
        "dddd": "area",
    }


def test_patterns_are_exact_but_for_stars_and_take_what_fits_of_a_folder() -> None:
    fields = as_collection(collected("Field [1]", square(8.5)), collected("Field 1", square(8.6)))
    assert sections_of(fields, area="field [1]") == {"Field [1]": "area", "Field 1": "left_out"}
    point = "<Point><coordinates>8.5,47</coordinates></Point>"
    marks = f"{marked('barn')}{marked('label', shape=point)}"
    folder = f"<kml><Folder><name>No fly zones</name>{marks}</Folder></kml>"
    assert sections_of(folder, keep_out="no fly*") == {"barn": "keep_out", "label": "landmark"}
    nameless = as_collection(collected("", square(8.5)), collected("b", square(8.6)))
    assert sections_of(nameless, left_out="polygon") == {"": "left_out", "b": "area"}


@pytest.mark.parametrize(
    ("text", "landmarks"),
    [
        ("name,x,y,latitude,longitude\nmast,1.5,2.5,47.1,8.5\n", {"mast": (47.1, 8.5)}),
        ("# survey\nname,lat,lon\n#1,47.1,8.5\n", {"#1": (47.1, 8.5)}),
        ('"Name, local",lat,lon,height\nmast,47.1,8.5,120\n', {"P1": (47.1, 8.5)}),
        ("id,name,lat,lon\n1,mast,47.1,8.5\n", {"mast": (47.1, 8.5)}),
        ("name;lat;lon\nmast;47,1;8,5\n", {"mast": (47.1, 8.5)}),
        ("PKT,lat,lon\nmast,47.1,8.5\n", {"P1": (47.1, 8.5)}),
    ],
)
def test_columns_are_chosen_by_their_heads(
    text: str, landmarks: dict[str, tuple[float, float]]
) -> None:
    scenario = import_places({"marks.csv": text.encode()}).scenario
    assert scenario["landmarks_lat_lon_deg"] == landmarks


def test_what_is_left_out_is_noted() -> None:
    empty = {"type": "Feature", "properties": {"name": "draft"}, "geometry": None}
    places = import_places({"a.json": as_collection(empty, collected("b", square(8.5)))})
    assert places.notes == ["a.json: draft has no geometry"]
    track = marked("walk", shape="<gx:Track/>")
    places = import_places({"a.kml": f"<kml>{track}{marked('b')}<NetworkLink/></kml>".encode()})
    assert places.notes == [
        "a.kml: elements that are left out: 1 NetworkLink",
        "a.kml: elements that are left out: 1 Track",
    ]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name in ("__MACOSX/._doc.kml", "doc.kml", "other.kml"):
            archive.writestr(name, f"<kml>{marked('b')}</kml>" if name == "doc.kml" else "x")
    places = import_places({"a.kmz": packed.getvalue()}, left_out="b")
    assert places.notes == [
        "a.kmz: of 2 .kml files, the first is read",
        "all features are left out; say what they become",
    ]


def test_the_example_fits_a_narrow_field() -> None:
    corners = [[8.5, 47.4], [8.513, 47.4], [8.513, 47.4005], [8.5, 47.4005], [8.5, 47.4]]
    keys = import_places({"a": as_collection(collected("a", corners))}).scenario
    # 56 m wide
    assert 10.0 < keys["orbit"]["radius_m"] < 28.0
    assert place(scenario_from(keys)).clearance > 0.0


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
        ("words.gpx", "mast: has a position that is no pair of decimal degrees"),
        ("bytes.csv", "is not text: byte 18 is not UTF-8; give UTF-8 text"),
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
    many = " ".join(f"8.5,{47.0 + k * 1e-7:.7f}" for k in range(150_000))
    line = f"<LineString><coordinates>{many}</coordinates></LineString>"
    track = f"<kml><Placemark><name>track</name>{line}</Placemark></kml>".encode()
    with pytest.raises(InputError, match="track: is beyond 100,000 positions"):
        import_places({"track.kml": track})
    with pytest.raises(InputError, match=r"track\.kml: is larger than 5 MiB; simplify it"):
        import_places({"track.kml": track + b" " * (5 * 2**20)})
    bomb = kmz(b"<kml>" + b" " * (64 * 2**20) + b"</kml>")
    with pytest.raises(InputError, match=r"bomb\.kmz: unpacks to more than 5 MiB"):
        import_places({"bomb.kmz": bomb})
    with pytest.raises(InputError, match="has more than 500,000 elements"):
        import_places({"a.kml": b"<kml>" + b"<a/>" * 600_000 + b"</kml>"})
    with pytest.raises(InputError, match="has more than 500,000 lines"):
        import_places({"a.txt": b"QGC WPL 110\n" + b"1\n" * 600_000})
    with pytest.raises(InputError, match=r"empty\.kmz: holds no \.kml file"):
        import_places({"empty.kmz": kmz(b"", name="readme.txt")})
    deep = b"<kml>" + b"<Folder>" * 5000
    with pytest.raises(InputError, match="nests more than 100 elements"):
        import_places({"deep.kml": deep})
    with pytest.raises(InputError, match="nested too deeply"):
        import_places({"deep.json": b'{"a":' * 100_000})


@pytest.mark.parametrize("row", ["33.5,S,18.5,E", "33.5, south,18.5,"])
def test_hemispheres_in_columns_of_their_own_are_refused(row: str) -> None:
    table = f"name,lat,n/s,lon,e/w\nS,{row}\n".encode()
    with pytest.raises(InputError, match=r"^a\.csv: S: has its hemisphere in a column of its own"):
        import_places({"a.csv": table})
    northern = b"name,lat,n/s,lon,e/w\nS,33.5,N,18.5,E\n"
    assert import_places({"a.csv": northern}).scenario["landmarks_lat_lon_deg"] == {
        "S": (33.5, 18.5)
    }


def test_features_on_two_continents_are_refused() -> None:
    points = b"name,lat,lon\na,0,0\nb,47,8\n"
    with pytest.raises(InputError, match=r"^points\.csv: features lie more than 1,000 km apart"):
        import_places({"points.csv": points})


@pytest.mark.parametrize("count", ["9" * 400, "nan", "-inf", "many"])
def test_a_fence_that_counts_no_corners_of_its_own_is_refused(count: str) -> None:
    text = (FILES / "fences.waypoints").read_text().replace("5001\t4", f"5001\t{count}")
    with pytest.raises(InputError, match=r"^fences: inclusion fence 1: has "):
        import_places({"fences": text.encode()})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            as_collection(collected("f", ["12", "34", "56", "12"])),
            "f: has a position that is no pair",
        ),
        (
            json.dumps({"crs": "EPSG:14326", **collected("f", square(8.5))}).encode(),
            "crs: has coordinates of EPSG:14326",
        ),
        (
            as_collection(collected("f", square(8.5, 0.01), square(8.501)[:2] + square(8.6)[2:])),
            "f: ",
        ),
        (b"name,lat,lon\nmast,47,0076,8,545\n", "mast: has more cells than its table has columns"),
        (b"name,lat,lon\nmast,47.1N,8.5E\n", "mast: has a position that is no pair of decimal deg"),
        (
            marked("f").replace("outerB", "innerB").encode(),
            "f: has no coordinates, or not one outer boundary",
        ),
        (
            marked("f")
            .replace("<Polygon>", "<Polygon><outerBoundaryIs><LinearRing/></outerBoundaryIs>")
            .encode(),
            "f: has no coordinates, or not one outer boundary",
        ),
    ],
)
def test_places_that_would_be_read_wrongly_are_refused(text: bytes, message: str) -> None:
    with pytest.raises(InputError, match=rf"^file: {re.escape(message)}"):
        import_places({"file": text if text[:1] != b"<" else b"<kml>" + text + b"</kml>"})


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
