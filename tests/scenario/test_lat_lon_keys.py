"""Places in degrees: each key stands for one in metres, and says so where it is refused."""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.landmarks.site_choice import named_candidates
from syncplan.planning.planner import plan
from syncplan.reports.plan_report import plan_document
from syncplan.scenario.brief import Brief, brief_of
from syncplan.scenario.ground import lat_lon_of
from syncplan.scenario.loading import scenario_from, with_landmarks
from syncplan.scenario.models import Formation, GeoOrigin
from syncplan.scenario.specification import Scenario
from tests.tools.briefs import FIELD
from tests.tools.exported import to_plane
from tests.tools.stories import shown

ORIGIN = GeoOrigin(lat_deg=47.3977, lon_deg=8.5456)
TEAM: dict[str, Any] = {
    "orbit": {"radius_m": 20.0, "speed_mps": 5.0},
    "formation": {"centers_m": {"a": [0.0, 0.0], "b": [50.0, 10.0]}},
    "landmarks_m": {"mast": [30.0, -30.0], "tree": [-30.0, 25.0]},
    "sensor": {"range_m": 90.0, "bearing_sigma_rad": 0.03, "sample_time_s": 0.25},
    "area_m": [[-100.0, -100.0], [100.0, -100.0], [100.0, 90.0], [-100.0, 100.0]],
    "keep_out_m": [[[60.0, 60.0], [70.0, 60.0], [65.0, 70.0]]],
    "obstacles_m": [[[-60.0, 60.0], [-50.0, 60.0], [-55.0, 70.0]]],
    "purpose": {"visit_m": [[20.0, 0.0]], "within_m": 10.0},
}
SITED: dict[str, Any] = {**FIELD, "landmarks": {"given": {"A": [0.0, 0.0], "B": [90.0, 0.0]}}}


def degrees(points: Any) -> Any:
    """Latitudes and longitudes for metres, in lists and mappings."""
    if isinstance(points, Mapping):
        return {name: degrees(inner) for name, inner in points.items()}
    if isinstance(points[0], float):
        return lat_lon_of(ORIGIN, np.array(points)).tolist()
    return [degrees(inner) for inner in points]


def in_degrees(keys: Mapping[str, Any], **others: Any) -> dict[str, Any]:
    """Keys with every place in degrees."""
    placed: dict[str, Any] = {}
    for key, value in keys.items():
        if key in ("given", "candidates_m", "centers_m", "landmarks_m", "area_m", "keep_out_m") or (
            key in ("obstacles_m", "visit_m")
        ):
            placed[f"{key.removesuffix('_m')}_lat_lon_deg"] = degrees(value)
        else:
            placed[key] = in_degrees(value) if isinstance(value, Mapping) else value
    return {**placed, **others}


def places_in(section: Scenario | Brief) -> Array:
    """Every point (k, 2) m of a scenario or a brief."""
    sites = (
        [*section.landmarks, *section.centers]
        if isinstance(section, Scenario)
        else section.landmarks.listed
    )
    polygons = [section.area_m or [], *(section.keep_out_m or []), *(section.obstacles_m or [])]
    visited = section.purpose.visit_m if section.purpose else None
    corners = itertools.chain.from_iterable(polygons)
    return np.array([*sites, *(visited or []), *corners])


def test_a_scenario_in_degrees_is_the_one_in_metres() -> None:
    origin = ORIGIN.model_dump()
    placed = scenario_from(in_degrees(TEAM, geo_origin=origin))
    given = scenario_from({**TEAM, "geo_origin": origin})
    assert np.abs(places_in(placed) - places_in(given)).max() < 1e-5
    assert placed.vehicle_names == ["a", "b"]
    assert placed.landmark_names == ["mast", "tree"]
    assert not any(key.endswith("lat_lon_deg") for key in placed.model_dump())


def test_a_brief_in_degrees_is_the_one_in_metres() -> None:
    origin = ORIGIN.model_dump()
    placed, given = brief_of(in_degrees(SITED, geo_origin=origin)), brief_of(SITED)
    assert np.abs(places_in(placed) - places_in(given)).max() < 1e-5
    assert placed.shared_keys()["geo_origin"] == origin


def test_without_an_origin_the_middle_is_it_and_distances_stay() -> None:
    placed = scenario_from(in_degrees(TEAM))
    assert placed.geo_origin is not None
    # the polygons are widest, from -100 to 100 m
    assert to_plane(
        [placed.geo_origin.lat_deg, placed.geo_origin.lon_deg], ORIGIN.model_dump()
    ) == (pytest.approx([0.0, 0.0], abs=0.02))
    shift = places_in(placed) - places_in(scenario_from(TEAM))
    assert np.ptp(shift, axis=0).max() < 1e-5


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"area_m": TEAM["area_m"]}, "area_lat_lon_deg: stands instead of area_m; give one"),
        (
            {"area_lat_lon_deg": degrees([[0.0, 0.0], [50.0, 50.0], [50.0, 0.0], [0.0, 50.0]])},
            "area_lat_lon_deg: is not a simple polygon",
        ),
        ({"area_lat_lon_deg": [[97.0, 8.0]]}, "area_lat_lon_deg[0][0]: 97.0: must be at most"),
        (
            {"landmarks_lat_lon_deg": [[8.5, 47.4], [47.4, 8.5]]},
            "landmarks_lat_lon_deg: holds a place more than 1,000 km from others; latitudes come",
        ),
        (
            {"landmarks_lat_lon_deg": {"tree": ["47.4", 8.5]}},
            "landmarks_lat_lon_deg.tree[0]: '47.4': must be a valid number",
        ),
        (
            {"geo_origin": {"lat_deg": 10.0, "lon_deg": 8.5}},
            "must be within 1000 km of geo_origin; latitudes come first",
        ),
        ({"geo_origin": {"lat_deg": 100.0, "lon_deg": 8.5}}, "geo_origin.lat_deg: 100.0: must be"),
        (
            {"landmarks_lat_lon_deg": None, "landmarks_m": [[0.0, 0.0]]},
            "geo_origin: is missing: landmarks_m is in metres from it, formation.centers_lat_lon_",
        ),
        (
            {"landmarks_lat_lon_deg": {"a": [47.4, 8.5], "tree": [47.4, 8.501]}},
            "landmarks_lat_lon_deg: 'a': is used twice",
        ),
        ({"area_lat_lon": []}, "unknown key; did you mean area_lat_lon_deg?"),
    ],
)
def test_what_is_wrong_in_degrees_is_named_as_it_was_given(
    keys: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as caught:
        scenario_from(in_degrees(TEAM, **keys), source="team.yaml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("team.yaml: ")
    assert "\n" not in str(caught.value)


def test_sections_that_are_models_are_converted_and_compared_as_files_are() -> None:
    links = [["v1", "v2"]]
    places = degrees([[0.0, 0.0], [50.0, 10.0]])
    formation = Formation.model_validate({"centers_lat_lon_deg": places, "links": links})
    given = {key: value for key, value in in_degrees(TEAM).items() if key != "formation"}
    placed = Scenario.model_validate({**given, "formation": formation})
    assert placed == scenario_from(
        {**given, "formation": formation.model_dump() | {"centers_lat_lon_deg": places}}
    )
    assert placed.formation.centers_m is not None
    with pytest.raises(InputError, match=r"is missing: formation\.centers_m is in metres"):
        scenario_from(TEAM).model_copy(update={"keep_out_lat_lon_deg": [places * 2]})


def test_a_brief_names_its_area_in_degrees_and_not_a_missing_one() -> None:
    with pytest.raises(InputError, match=r"^area_lat_lon_deg\[0\]\[1\]: 'x': must be"):
        brief_of(in_degrees(SITED, area_lat_lon_deg=[[47.0, "x"]]))


def test_a_plan_states_its_places_in_metres_and_in_degrees() -> None:
    document = plan_document(plan(scenario_from(in_degrees(TEAM)), pilot=False))
    ground, origin = document.ground, document.scenario.geo_origin
    assert ground is not None
    assert origin is not None
    centers = [vehicle.center_m for vehicle in document.vehicles]
    places = ground.places
    stated = to_plane(list(places["formation.centers_lat_lon_deg"].values()), origin.model_dump())
    assert np.abs(stated - centers).max() < 1e-3
    assert list(places["landmarks_lat_lon_deg"]) == ["mast", "tree"]
    given = degrees(TEAM["landmarks_m"]["mast"])
    assert places["landmarks_lat_lon_deg"]["mast"] == pytest.approx(given, abs=1e-8)
    assert len(places["keep_out_lat_lon_deg"]) == 1
    assert len(places["purpose.visit_lat_lon_deg"]) == 1
    assert 0.0 < ground.map_departure_m < 1e-6
    table = shown(document, 200)
    assert f"[0, 0] at {origin.lat_deg:.7f}, {origin.lon_deg:.7f}; distances on the flat" in table
    assert "differ by up to 0.001 m" in table
    metres = plan_document(plan(scenario_from(TEAM), pilot=False))
    assert metres.ground is None


def test_a_flat_map_that_departs_by_a_tenth_of_the_error_is_a_warning() -> None:
    def codes(latitude: float) -> list[str]:
        origin = {"lat_deg": latitude, "lon_deg": ORIGIN.lon_deg}
        planned = plan(scenario_from(in_degrees(TEAM, geo_origin=origin)), pilot=False)
        return [finding.code for finding in planned.verdict.findings]

    assert "flat-map" not in codes(ORIGIN.lat_deg)
    # 220 km away, a map of 100 m is wrong by a thousandth
    assert "flat-map" in codes(ORIGIN.lat_deg - 2.0)


def test_landmarks_are_written_in_degrees_where_a_file_has_them(tmp_path: Path) -> None:
    chosen = {"mast": (1.0, 2.0), "new": (5.0, 60.0)}
    text = (
        "# a field\norbit: {radius_m: 20, speed_mps: 5}\n"
        "formation: {centers_lat_lon_deg: [[47.3977, 8.5456], [47.3980, 8.5456]]}\n"
        "sensor: {range_m: 90, bearing_sigma_rad: 0.03, sample_time_s: 0.25}\n"
    )
    edited = with_landmarks(text, "field.yaml", chosen)
    assert edited.startswith("# a field\n")
    path = tmp_path / "field.yaml"
    path.write_text(edited)
    again = scenario_from(scenario_document(edited))
    assert np.abs(np.array(again.landmarks) - list(chosen.values())).max() < 1e-3
    before = scenario_from(scenario_document(text))
    assert again.geo_origin == before.geo_origin
    assert again.formation == before.formation


def scenario_document(text: str) -> dict[str, Any]:
    """The keys of a YAML text."""
    from syncplan.scenario.loading import parse_document

    return parse_document(text, "")


def test_candidate_sites_may_be_in_degrees() -> None:
    sites = {"candidates_lat_lon_deg": {"a": degrees([10.0, 20.0])}}
    assert named_candidates(sites, ORIGIN)["a"] == pytest.approx((10.0, 20.0), abs=1e-5)
    with pytest.raises(InputError, match="geo_origin: is missing in the scenario"):
        named_candidates(sites)
