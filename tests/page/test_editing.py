"""A scenario opened and changed on the page, by mouse, by keyboard and on a phone."""

import re

import pytest
from playwright.sync_api import Page, Route, expect

from syncplan.scenario.loading import load_scenario
from tests.page.gestures import downloaded, drag, drawn, handle, middle, opened, part, pull, view
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.on_paper import plan
from tests.tools.scenarios import BAD_FILES, FILES, circling, document

ALTERNATE = "paper-grid-alternate"
SAME = "paper-grid-same"


def test_a_lost_motion_is_drawn_and_its_cure_is_a_button(visit: Visit, page: Page) -> None:
    visit.choose(ALTERNATE)
    visit.verdict("Not observable: rank 16 of 18")
    motion = page.locator(".finding.stop").first
    expect(motion).to_contain_text("stretch of v1-v2")
    expect(motion).to_contain_text("Cure: let the line of sight")
    expect(motion).to_contain_text("a small desynchronisation by orbit.desync_rad")
    assert len(drawn(page, "motion")) == 4
    drag(page, "v2", (14.0, 22.0))
    visit.settle()
    visit.verdict("Not observable: rank 17 of 18")
    expect(page.get_by_label("Centre east")).not_to_have_value("70")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Not observable: rank 16 of 18")
    expect(page.get_by_label("Centre east")).to_have_value("70")
    motion.get_by_role("button", name="Desynchronise by 0.12").press("Enter")
    visit.verdict("Observable: rank 18 of 18")
    expect(page.get_by_label("Desynchronise by")).to_have_value("0.12")
    expect(page.locator("#badge")).to_be_focused()
    expect(page.locator(".finding.stop")).to_have_count(0)
    # one that is larger, as of vehicles that are off the rule by half a turn, is not written over
    page.get_by_label("Desynchronise by").fill("3.141592653589793")
    visit.verdict("Not observable: rank 16 of 18")
    visit.settle()
    expect(motion).to_contain_text("desync_rad")
    expect(page.get_by_role("button", name="Desynchronise by")).to_have_count(0)


def test_a_quick_plan_says_what_follows_until_it_is_whole(visit: Visit, page: Page) -> None:
    predicted = page.locator("#verdict tr", has_text="Predicted RMS error").locator("td")
    left_out = page.locator('[data-code="bound-missing"]')
    whole, held = re.compile(r"/previews\?quick=false"), list[Route]()
    page.route(whole, lambda route: held.append(route))
    with page.expect_request(whole):
        drag(page, "v2", (14.0, 22.0))
    expect(predicted).to_contain_text("follows when you pause")
    expect(page.locator("#verdict")).to_contain_text("single points of failure follow")
    expect(left_out).to_have_count(0)
    for route in held:
        route.continue_()
    page.unroute(whole)
    visit.settle()
    expect(predicted).to_contain_text(" m")
    expect(predicted).not_to_contain_text("follows")


def test_the_map_shows_all_of_what_was_opened_and_no_more(visit: Visit, page: Page) -> None:
    for name in ("mixed-radii-camera", SAME, "mixed-radii-camera"):
        visit.choose(name)
        orbits = plan(load_scenario(FILES / f"{name}.yaml")).orbits
        low = (orbits.centers - orbits.radii[:, None]).min(axis=0)
        high = (orbits.centers + orbits.radii[:, None]).max(axis=0)
        west, south, east, north = view(page)
        assert west < low[0] < high[0] < east
        assert south < low[1] < high[1] < north
        assert min((east - west) / (high - low)[0], (north - south) / (high - low)[1]) < 1.5


def test_circles_and_figures_are_reached_by_keyboard(visit: Visit, page: Page) -> None:
    visit.choose(ALTERNATE)
    handle(page, "v2").focus()
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("ArrowRight")
    visit.verdict("Observable: rank 18 of 18")
    page.keyboard.press("Enter")
    assert float(page.get_by_label("Centre north").input_value()) > 0.0
    page.get_by_role("button", name="Figures").press("Enter")
    page.get_by_role("tab", name="Contacts").press("ArrowRight")
    expect(page.get_by_role("tab", name="Singular values")).to_be_focused()
    expect(page.locator("#panel-text")).not_to_be_empty()


def test_senses_radii_and_sensors_are_of_one_vehicle_or_of_all(visit: Visit, page: Page) -> None:
    visit.choose(ALTERNATE)
    page.get_by_label("Direction", exact=True).select_option("ccw")
    visit.verdict("Observable: rank 18 of 18")
    page.get_by_label("Vehicle or landmark").select_option("vehicle 1")
    page.get_by_label("Its direction").select_option("cw")
    visit.settle()
    expect(page.get_by_label("Direction", exact=True)).to_have_value("")
    page.get_by_label("Radius (m)", exact=True).fill("17")
    expect(page.get_by_label("Radius of all")).to_have_attribute("placeholder", "differs")
    page.get_by_label("Its field of view").fill("200")
    visit.fill("Range (m)", "60", exact=True)
    scenario = downloaded(page)
    assert scenario["orbit"]["radius_m"] == [20.0, 17, 20.0, 20.0, 20.0, 20.0]
    assert scenario["orbit"]["direction"] == ["ccw", "cw", "ccw", "ccw", "ccw", "ccw"]
    assert [one["fov_deg"] for one in scenario["sensor"]] == [360, 200, 360, 360, 360, 360]
    assert {one["range_m"] for one in scenario["sensor"]} == {60}


@pytest.mark.quick
def test_vehicles_come_and_go_and_an_unsteady_click_moves_none(visit: Visit, page: Page) -> None:
    drag(page, "v2", (2.0, -1.0))
    expect(page.get_by_label("Centre east")).to_have_value("70")
    expect(page.get_by_role("button", name="Undo")).to_have_attribute("aria-disabled", "true")
    page.get_by_role("button", name="Add vehicle").click()
    visit.verdict("rank 21 of 21")
    page.get_by_role("button", name="Add landmark").click()
    expect(handle(page, "L3")).to_be_visible()
    handle(page, "v7").click()
    page.get_by_role("button", name="Remove").click()
    visit.verdict("rank 18 of 18")
    handle(page, "v4").click()
    page.get_by_role("button", name="Remove").click()
    visit.verdict("of 15")
    expect(page.locator("#handles button.vehicle")).to_have_count(5)


def test_a_fault_is_reported_next_to_its_field(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    visit.choose(SAME)
    field = page.get_by_label("Range (m)", exact=True)
    field.fill("-5")
    expect(field).to_have_attribute("aria-invalid", "true")
    reported = page.locator("#field-sensor-range-m-fault")
    expect(reported).to_contain_text("must be greater than 0")
    expect(reported).to_have_attribute("role", "alert")
    visit.doubt(
        "Before the fault: ✓ GO in 31 simulated flights: 6 vehicles know where they are to 1.89 m"
    )
    expect(page.locator("#verdict")).to_contain_text("of the scenario before the fault")
    assert dimmed(page)
    assert accessibility_faults(page) == []
    field.fill("50")
    expect(reported).to_be_empty()
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator("#workspace")).not_to_contain_class("doubtful")
    assert not dimmed(page)


def dimmed(page: Page) -> bool:
    """Whether the figures are shown as of something else; the map never is."""
    fade = "id => Number(getComputedStyle(document.getElementById(id)).opacity) < 1"
    assert not page.evaluate(fade, "map-plot")
    return bool(page.evaluate(fade, "figures"))


def test_a_number_half_typed_leaves_no_verdict_that_looks_current(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    # a field that is typed anew moves nothing meanwhile
    handle(page, "v4").click()
    page.get_by_label("Centre east").fill("")
    page.wait_for_timeout(600)
    visit.doubt(
        "unfinished field: ✓ GO in 31 simulated flights: 6 vehicles know where they are to 1.89 m"
    )
    visit.fill("Centre east", "141")
    visit.verdict("Observable: rank 18 of 18")
    expect(handle(page, "v4")).to_have_attribute("aria-label", "Circle of v4, centre at 141, 70 m")
    # what is typed at one go is one step to undo
    visit.stop_time()
    radius = page.get_by_label("Radius of all")
    radius.press("Control+A")
    page.keyboard.type("18.5")
    visit.settle()
    page.get_by_role("button", name="Undo").click()
    expect(radius).to_have_value("20")
    expect(page.get_by_label("Centre east")).to_have_value("141")
    field = page.get_by_label("Field of view (°)", exact=True)
    field.fill("72")
    visit.settle()
    badge = page.locator("#badge").text_content()
    visit.verdict("bservable: rank")
    field.press("End")
    field.press("0")
    visit.doubt(f"Before the fault: {badge}")
    field.press("Backspace")
    visit.verdict("bservable: rank")
    visit.settle()
    field.press("e")
    visit.doubt(f"unfinished field: {badge}")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Observable: rank 18 of 18")


def test_escape_takes_a_drag_back(visit: Visit, page: Page) -> None:
    # on its way v4 may lose the link it needs, if a preview is as quick as that
    visit.expect_complaints("422")
    x, y = middle(handle(page, "v4"))
    pull(page, (x, y), (x + 45, y + 45), release=False)
    expect(handle(page, "v4")).not_to_have_attribute("aria-label", re.compile("140, 70 m"))
    page.keyboard.press("Escape")
    page.mouse.move(x + 75, y + 45)
    page.mouse.up()
    visit.settle()
    expect(handle(page, "v4")).to_have_attribute("aria-label", re.compile("140, 70 m"))
    expect(page.get_by_role("button", name="Undo")).to_have_attribute("aria-disabled", "true")


def test_keys_undo_and_redo_and_arrows_in_a_row_are_one_step(visit: Visit, page: Page) -> None:
    moved = handle(page, "v4")
    moved.focus()
    # a step is a hundredth of what the map shows, in whole metres here, and stays so in a row,
    # though the view changes a little
    page.keyboard.press("ArrowUp")
    expect(moved).not_to_have_attribute("aria-label", re.compile("140, 70 m"))
    west, _, east, _ = view(page)
    shown = east - west
    step = int(re.findall(r"\d+", moved.get_attribute("aria-label") or "")[-1]) - 70
    assert step == pytest.approx(shown / 100.0, abs=0.7)
    raised = re.compile(f"140, {70 + 3 * step} m")
    for _ in range(2):
        page.keyboard.press("ArrowUp")
    expect(moved).to_have_attribute("aria-label", raised)
    page.keyboard.press("Control+z")
    expect(moved).to_have_attribute("aria-label", re.compile("140, 70 m"))
    expect(page.get_by_role("button", name="Undo")).to_have_attribute("aria-disabled", "true")
    page.keyboard.press("Control+Shift+Z")
    expect(moved).to_have_attribute("aria-label", raised)
    visit.settle()
    # in a text field they are the browser's own
    page.get_by_label("Name", exact=True).focus()
    page.keyboard.press("Control+z")
    page.wait_for_timeout(300)
    expect(moved).to_have_attribute("aria-label", raised)


def test_the_chosen_one_of_two_on_one_place_lies_above(page: Page) -> None:
    opened(
        page,
        document(name="shared", formation={"centers_m": [[0.0, 0.0], [0.0, 0.0], [70.0, 0.0]]}),
    )
    top = """() => {
        const box = document.querySelector('#handles button').getBoundingClientRect();
        const at = [box.left + box.width / 2, box.top + box.height / 2];
        return document.elementFromPoint(...at).closest('button').title;
    }"""
    for name, value in (("v1", "vehicle 0"), ("v2", "vehicle 1")):
        page.get_by_label("Vehicle or landmark").select_option(value)
        # handles follow with the next frame
        page.wait_for_function(f"name => ({top})() === name", arg=name)


def test_half_an_origin_is_no_fault_and_its_altitude_stays(visit: Visit, page: Page) -> None:
    part(page, "Preflight")
    altitude = page.get_by_label("Ground above sea level")
    latitude = page.get_by_label("Latitude of the origin")
    altitude.fill("412")
    latitude.fill("47.4")
    part(page, "Scenario")
    visit.fill("Radius of all", "21")
    part(page, "Preflight")
    expect(page.locator("#notice.bad")).to_have_count(0)
    expect(latitude).to_have_value("47.4")
    assert "geo_origin" not in downloaded(page)
    visit.fill("Longitude of the origin", "8.5")
    assert downloaded(page)["geo_origin"] == {"lat_deg": 47.4, "lon_deg": 8.5, "alt_m": 412}
    latitude.fill("")
    visit.settle()
    expect(altitude).to_have_value("412")
    assert "geo_origin" not in downloaded(page)
    latitude.fill("47.5")
    visit.settle()
    assert downloaded(page)["geo_origin"]["alt_m"] == 412
    visit.choose(SAME)
    expect(altitude).to_have_value("")


def test_vehicles_named_by_numbers_keep_their_order(visit: Visit, page: Page) -> None:
    scenario = document(
        name="numbers",
        orbit=circling(radius_m=[20.0, 15.0], direction="ccw"),
        formation={"centers_m": {"10": [0.0, 0.0], "2": [65.0, 0.0]}},
    )
    opened(page, scenario)
    visit.fill("Least separation", "5")
    found = downloaded(page)
    assert found["formation"]["names"] == ["10", "2"]
    assert found["formation"]["centers_m"] == [[0, 0], [65, 0]]
    assert found["orbit"]["radius_m"] == [20, 15]


def test_a_given_window_stays_and_one_of_a_period_follows_it(visit: Visit, page: Page) -> None:
    for window, kept in ((60.0, 60), (None, None)):
        opened(page, document(name=f"window {window}", window_s=window))
        visit.fill("Angular rate", "0.25")
        assert downloaded(page).get("window_s") == kept


def test_undo_goes_back_over_an_opened_file_and_its_fields(visit: Visit, page: Page) -> None:
    page.get_by_label("Open a file").set_input_files(FILES / "four-ground-robots.yaml")
    visit.verdict("rank 12 of 12")
    expect(page.get_by_label("Speed (m/s)")).to_have_value("0.4")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Observable: rank 18 of 18")
    expect(page.get_by_label("Angular rate")).to_have_value("0.2")
    expect(page.get_by_label("Speed (m/s)")).to_be_hidden()


def test_a_bad_file_is_refused_in_words(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    reported = page.locator("#notice.bad")
    for name in ("misspelt-key", "not-yaml", "nan-rate"):
        page.get_by_label("Open a file").set_input_files(BAD_FILES / f"{name}.yaml")
        expect(reported).not_to_be_empty()
        assert "Traceback" not in (reported.text_content() or "")
        visit.verdict("Observable: rank 18 of 18")
        page.get_by_role("button", name="Dismiss the message").click()
