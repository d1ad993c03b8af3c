"""Places in degrees: files of the field on the page, and positions shown and typed as degrees."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.page.gestures import (
    download,
    downloaded,
    drawn,
    handle,
    on_screen,
    opened,
    part,
    sheet,
    unzipped,
)
from tests.page.test_ground import ORIGIN, PLACED, place
from tests.tools.browsing import DESKTOP, PHONE, Tabs, Visit, faults_by_day_and_night, visiting
from tests.tools.scenarios import document
from tests.tools.serving import Server

PLACES = Path(__file__).parents[2] / "examples/places"

CORNERS = [[47.397, 8.544], [47.397, 8.548], [47.3995, 8.544], [47.3995, 8.548]]
"""Of the boundary in field.kml."""


def ring(west: float, south: float, east: float, north: float) -> list[tuple[float, float]]:
    """The corners of a rectangle, in m about the origin of PLACED, as GeoJSON has them."""
    corners = [(west, south), (east, south), (east, north), (west, north), (west, south)]
    return [place(*corner)[::-1] for corner in corners]


def feature(name: str, kind: str, coordinates: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": {"name": name}, "geometry": geometry}


FIELD = {
    "type": "FeatureCollection",
    "features": [
        feature("Meadow", "Polygon", [ring(-60, -60, 130, 100), ring(30, 80, 40, 90)]),
        feature("No fly: barn", "Polygon", [ring(-55, 80, -45, 90)]),
        feature("Wood", "Polygon", [ring(110, -50, 120, -40)]),
        feature("Mast", "Point", place(35.0, 30.0)[::-1]),
        feature("Gate", "Point", place(0.0, 60.0)[::-1]),
    ],
}


def sent(page: Page, name: str, content: str) -> None:
    upload: Any = {"name": name, "mimeType": "", "buffer": content.encode()}
    page.get_by_label("Open a file").set_input_files(upload)


def dropped(page: Page, name: str, content: str) -> None:
    """Drop a file on the map."""
    script = """([name, content]) => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([content], name));
        const how = { dataTransfer, bubbles: true, cancelable: true };
        const map = document.getElementById('map-plot');
        const taken = new DragEvent('dragover', how);
        map.dispatchEvent(taken);
        if (taken.defaultPrevented) map.dispatchEvent(new DragEvent('drop', how));
    }"""
    page.evaluate(script, [name, content])


def imported(page: Page) -> Locator:
    """The dialogue of a file's places."""
    return page.get_by_role("dialog", name=re.compile("Places of"))


def choice(page: Page, name: str) -> Locator:
    return imported(page).get_by_role("combobox", name=re.compile(f"^{name}.* becomes"))


def offered(choices: Locator) -> list[str]:
    return choices.locator("option").all_text_contents()


def pasted(page: Page, field: Locator, text: str) -> None:
    field.click()
    page.evaluate("text => navigator.clipboard.writeText(text)", text)
    page.keyboard.press("Control+V")


def test_places_of_a_file_are_added_as_chosen_and_undone(visit: Visit, page: Page) -> None:
    opened(page, {**PLACED, "obstacles_m": [[[0, 90], [5, 90], [5, 95]]]})
    visit.settle()
    before = downloaded(page)
    sent(page, "field.geojson", json.dumps(FIELD))
    expect(imported(page)).to_contain_text("the largest polygon")
    assert offered(choice(page, "Mast")) == ["landmark", "left out"]
    assert offered(choice(page, "Wood")) == ["area", "keep-out", "obstacle", "left out"]
    expect(choice(page, "No fly")).to_have_value("keep_out")
    # of areas there is one
    choice(page, "Wood").select_option("area")
    expect(choice(page, "Meadow")).to_have_value("left_out")
    expect(imported(page).get_by_role("row", name="Wood")).to_contain_text("your choice")
    choice(page, "Meadow").select_option("area")
    expect(choice(page, "Wood")).to_have_value("left_out")
    choice(page, "Gate").select_option("left_out")
    page.get_by_role("button", name="Add to this scenario").click()
    expect(imported(page)).to_have_count(0)
    visit.settle()
    expect(page.locator("#notice")).to_contain_text("Undo")
    after = downloaded(page)
    [(west, south), _, (east, north), _] = after["area_m"]
    assert (west, south, east, north) == pytest.approx((-60, -60, 130, 100), abs=1e-3)
    # the hole of the area is beside what was named so
    assert [corners[0][0] for corners in after["keep_out_m"]] == pytest.approx([-55, 30], abs=1e-3)
    assert list(after["landmarks_m"]) == ["Mast"]
    assert after["landmarks_m"]["Mast"] == pytest.approx([35, 30], abs=1e-3)
    assert after["geo_origin"] == ORIGIN
    # the file has none
    assert after["obstacles_m"] == before["obstacles_m"]
    page.get_by_role("button", name="Undo").click()
    visit.settle()
    assert downloaded(page) == before


def test_a_scenario_without_an_origin_takes_the_middle_of_the_places(
    visit: Visit, page: Page
) -> None:
    assert "geo_origin" not in downloaded(page)
    dropped(page, "field.geojson", json.dumps(FIELD))
    expect(imported(page)).to_be_visible()
    page.get_by_role("button", name="Add to this scenario").click()
    visit.settle()
    origin = downloaded(page)["geo_origin"]
    assert (origin["lat_deg"], origin["lon_deg"]) == pytest.approx(place(35.0, 20.0), abs=1e-6)
    expect(page.get_by_role("button", name="Degrees")).to_be_enabled()


def test_a_file_of_the_field_begins_a_scenario_and_undo_brings_the_last_one_back(
    visit: Visit, page: Page
) -> None:
    sent(page, "field.geojson", json.dumps(FIELD))
    choice(page, "No fly").select_option("obstacle")
    page.get_by_role("button", name="Start a new scenario").click()
    expect(page.locator("#map-name")).to_have_text("field")
    visit.settle()
    scenario = downloaded(page)
    assert set(scenario["landmarks_m"]) == {"Mast", "Gate"}
    assert [len(scenario[key]) for key in ("area_m", "keep_out_m", "obstacles_m")] == [4, 1, 1]
    assert len(drawn(page, "obstacle")) == 1
    page.get_by_role("button", name="Undo").click()
    expect(page.locator("#map-name")).to_have_text("paper-grid-same")


def test_scenarios_are_dropped_too_and_what_is_no_file_of_the_field_is_refused_in_words(
    visit: Visit, page: Page
) -> None:
    visit.expect_complaints("422")
    dropped(page, "team.json", json.dumps(document(name="a dropped team")))
    expect(page.locator("#map-name")).to_have_text("a dropped team")
    visit.settle()
    sent(page, "points.csv", "north,south\n1,2\n")
    expect(page.locator("#notice.bad")).to_contain_text("latitude and longitude, in degrees")
    sent(page, "points.csv", "name,lat,lon\nfar,47.4,8.5\n")
    # all may be left out, and then nothing is added
    choice(page, "far").select_option("left_out")
    page.get_by_role("button", name="Add to this scenario").click()
    expect(imported(page).get_by_role("alert")).to_contain_text("left out")
    page.keyboard.press("Escape")
    opened(page, {**PLACED, "geo_origin": {"lat_deg": -33.9, "lon_deg": 151.2}})
    sent(page, "points.csv", "name,lat,lon\nfar,47.4,8.5\n")
    page.get_by_role("button", name="Add to this scenario").click()
    expect(imported(page).get_by_role("alert")).to_contain_text("within 1000 km")


def test_a_field_and_its_marks_become_missions_with_fences_in_seven_actions(
    visit: Visit, page: Page
) -> None:
    dropped(page, "field.kml", (PLACES / "field.kml").read_text())
    page.get_by_role("button", name="Start a new scenario").click()
    expect(page.locator("#map-name")).to_have_text("field")
    visit.settle()
    dropped(page, "marks.csv", (PLACES / "marks.csv").read_text())
    page.get_by_role("button", name="Add to this scenario").click()
    visit.verdict("GO")
    visit.settle()
    part(page, "Preflight")
    page.get_by_label("Format", exact=True).select_option("qgc")
    files = unzipped(download(page, "Export"))
    plans = [json.loads(text) for name, text in files.items() if name.endswith(".plan")]
    assert len(plans) == 3
    for plan in plans:
        fences = plan["geoFence"]["polygons"]
        assert [fence["inclusion"] for fence in fences] == [True, False]
        corners = sorted(fences[0]["polygon"])
        assert np.array(corners) == pytest.approx(np.array(CORNERS), abs=1e-8)


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_the_dialogue_of_places_is_accessible_and_fits(
    tabs: Tabs, server: Server, size: tuple[int, int]
) -> None:
    with visiting(tabs, server.url, size=size) as visit:
        page = visit.page
        visit.verdict("Observable: rank 18 of 18")
        opened(page, PLACED)
        visit.settle()
        page.get_by_role("button", name="Degrees").click()
        handle(page, "v2").click()
        sheet(page)
        expect(page.get_by_label("Centre latitude")).to_be_visible()
        assert faults_by_day_and_night(page) == []
        sent(page, "field.geojson", json.dumps(FIELD))
        expect(imported(page)).to_be_visible()
        assert faults_by_day_and_night(page) == []
        over = "region => region.scrollWidth - region.clientWidth"
        assert imported(page).evaluate(over) <= 0
        assert imported(page).get_by_role("region").evaluate(over) <= 0
        expect(page.get_by_role("button", name="Add to this scenario")).to_be_in_viewport(ratio=1)


def test_positions_are_shown_and_typed_in_degrees(visit: Visit, page: Page) -> None:
    degrees = page.get_by_role("button", name="Degrees")
    expect(degrees).to_be_disabled()
    expect(degrees).to_have_attribute("title", re.compile("latitude and longitude of the origin"))
    opened(page, {**PLACED, "keep_out_m": [[[0, 90], [5, 90], [5, 95]]]})
    visit.settle()
    expect(degrees).to_be_enabled()
    handle(page, "v2").click()
    expect(page.get_by_label("Centre east")).to_have_value("70")
    degrees.click()
    expect(degrees).to_have_attribute("aria-pressed", "true")
    latitude, longitude = (
        page.get_by_label("Centre latitude"),
        page.get_by_label("Centre longitude"),
    )
    lat, lon = place(70.0, 0.0)
    assert float(latitude.input_value()) == pytest.approx(lat, abs=1e-8)
    assert float(longitude.input_value()) == pytest.approx(lon, abs=1e-8)
    expect(handle(page, "v2")).to_have_attribute("aria-label", re.compile(r"[\d.]+° N, [\d.]+° E"))
    page.mouse.move(*on_screen(page, 20.0, 30.0))
    expect(page.locator("#pointer")).to_have_text(re.compile(r"^[\d.]+° N, [\d.]+° E$"))
    # a number half typed moves nothing to another continent
    latitude.fill(f"{place(70.0, 5.0)[0]:.8f}")
    assert downloaded(page)["formation"]["centers_m"][1] == pytest.approx([70, 5], abs=2e-3)
    visit.settle()
    page.get_by_label("Vehicle or landmark").select_option("keep-out 1")
    field = page.get_by_label("Corners")
    first, *others = field.input_value().split("; ")
    assert [float(part) for part in first.split(", ")] == pytest.approx(place(0.0, 90.0), abs=1e-8)
    field.fill("; ".join(["{:.8f}, {:.8f}".format(*place(0.0, 91.0)), *others]))
    page.keyboard.press("Tab")
    visit.settle()
    corners = downloaded(page)["keep_out_m"][0]
    assert corners[0] == pytest.approx([0, 91], abs=1e-3)
    assert corners[1:] == [[5, 90], [5, 95]]
    page.get_by_role("button", name="Add area").click()
    area = [place(*corner) for corner in ((-60, -60), (130, -60), (130, 130), (-60, 130))]
    field.fill("; ".join(f"{lat:.8f}, {lon:.8f}" for lat, lon in area))
    page.keyboard.press("Tab")
    visit.settle()
    assert downloaded(page)["area_m"][2] == pytest.approx([130, 130], abs=1e-3)
    # it is kept, and metres come back
    page.reload()
    expect(degrees).to_have_attribute("aria-pressed", "true")
    degrees.click()
    handle(page, "v2").click()
    assert float(page.get_by_label("Centre north").input_value()) == pytest.approx(5, abs=2e-3)
    opened(page, document(name="elsewhere"))
    expect(degrees).to_be_disabled()


def test_a_pasted_pair_sets_both_numbers_of_a_position(visit: Visit, page: Page) -> None:
    opened(page, PLACED)
    visit.settle()
    handle(page, "v2").click()
    east = page.get_by_label("Centre east")
    expect(east).to_have_attribute("title", re.compile("pasted"))
    pasted(page, east, "72, 3.5")
    expect(page.get_by_label("Centre north")).to_have_value("3.5")
    expect(east).to_have_value("72")
    page.get_by_role("button", name="Degrees").click()
    lat, lon = place(75.0, -2.0)
    pasted(page, page.get_by_label("Centre longitude"), f"{lat:.9f}, {lon:.9f}")
    expect(page.get_by_label("Centre latitude")).to_have_value(re.compile(f"^{lat:.7f}"[:-1]))
    visit.settle()
    assert downloaded(page)["formation"]["centers_m"][1] == pytest.approx([75, -2], abs=1e-3)
    # a place elsewhere is refused at its field
    pasted(page, page.get_by_label("Centre latitude"), "-33.9, 151.2")
    expect(page.locator("#field-chosen-lat-fault")).to_contain_text("within 1000 km")
    assert downloaded(page)["formation"]["centers_m"][1] == pytest.approx([75, -2], abs=1e-3)
