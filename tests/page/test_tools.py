"""What people do on the map with its tools, and new teams."""

import itertools
import math

import pytest
from playwright.sync_api import Page, expect

import syncplan
from tests.page.gestures import (
    box_of,
    click,
    downloaded,
    drag,
    drawn,
    handle,
    middle,
    on_screen,
    opened,
    part,
    phases,
    pull,
    take,
    view,
)
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.scenarios import FILES, document


def test_a_new_team_keeps_a_distance_and_its_rate_when_a_radius_changes(
    visit: Visit, page: Page
) -> None:
    page.get_by_role("button", name="New").click()
    page.get_by_label("Gap between circles (m)").fill("25")
    page.get_by_role("button", name="Create").click()
    visit.verdict("✓ GO in 31 simulated flights: 4 vehicles know where they are to")
    expect(page.get_by_label("Least separation")).to_have_value("6.5")
    part(page, "Verdict")
    separation = page.locator("#verdict tr", has_text="Least separation")
    expect(separation).to_contain_text("at least 6.5 m required")
    part(page, "Scenario")
    expect(page.get_by_label("Speed (m/s)", exact=True)).to_be_visible()
    handle(page, "v2").click()
    drag(page, "radius of v2", (12.0, -12.0))
    visit.settle()
    expect(page.locator("#findings")).not_to_contain_text("angular_rate_rad_s")
    rate = float(page.get_by_label("Angular rate").input_value())
    assert rate == pytest.approx(0.2)
    assert float(page.get_by_label("Radius (m)", exact=True).input_value()) > 20.0
    visit.verdict("4 vehicles know where they are")


def test_open_opens_a_file_and_leaves_the_bar_as_it_is(visit: Visit, page: Page) -> None:
    bar = box_of(page.locator(".bar"))
    for _ in range(2):
        with page.expect_file_chooser() as waiting:
            page.get_by_role("button", name="Open").click()
        assert box_of(page.locator(".bar")) == bar
    waiting.value.set_files(FILES / "four-ground-robots.yaml")
    expect(page.locator("#map-name")).to_have_text("four-ground-robots")
    assert box_of(page.locator(".bar")) == bar
    page.get_by_role("button", name="New").click()
    expect(page.get_by_role("dialog")).to_be_visible()


def test_a_new_team_may_be_given_by_links_and_its_faults_are_said(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    new, create = (page.get_by_role("button", name=name) for name in ("New", "Create"))
    new.click()
    dialogue = page.get_by_role("dialog")
    vehicles = page.get_by_role("spinbutton", name="Vehicles")
    vehicles.fill("0")
    create.click()
    expect(dialogue).to_contain_text("formation.count")
    vehicles.fill("")
    create.click()
    expect(page.locator("#new-count-fault")).to_contain_text("is missing")
    page.keyboard.press("Escape")
    expect(dialogue).to_have_count(0)
    visit.verdict("Observable: rank 18 of 18")
    new.click()
    page.get_by_label("Shape").select_option(label="given by its links")
    expect(vehicles).to_be_hidden()
    links = page.locator("#new-links")
    links.fill("v1-v2 v2")
    create.click()
    expect(dialogue).to_contain_text("links")
    links.fill("v1-v2, v2-v3, v3-v4, v4-v5, v5-v1")
    assert accessibility_faults(page) == []
    create.click()
    visit.verdict("rank 15 of 15")
    made = downloaded(page)["formation"]
    assert made["links"] == [["v1", "v2"], ["v2", "v3"], ["v3", "v4"], ["v4", "v5"], ["v5", "v1"]]
    assert len(made["centers_m"]) == 5


def test_the_best_of_the_selected_landmarks_are_kept(visit: Visit, page: Page) -> None:
    page.get_by_label("Vehicle or landmark").select_option(label="L1")
    expect(page.get_by_role("button", name="Keep the best")).to_have_count(0)
    page.get_by_role("button", name="Add landmark").click()
    visit.settle()
    before = downloaded(page)
    handle(page, "v1").press("Control+a")
    expect(page.get_by_role("spinbutton", name="Landmarks to keep")).to_have_value("2")
    page.get_by_role("button", name="Keep the best").click()
    expect(page.locator("#notice")).to_contain_text("the worst vehicle's window bound is")
    visit.settle()
    choice = syncplan.choose_landmarks(before, ["L1", "L2", "L3"], 2)
    places = [before["landmarks_m"][k] for k in choice.chosen]
    assert downloaded(page)["landmarks_m"] == places
    page.get_by_role("button", name="Undo").click()
    assert downloaded(page) == before


@pytest.mark.quick
def test_radius_and_phase_of_the_selected_vehicle_are_dragged(visit: Visit, page: Page) -> None:
    handle(page, "v2").click()
    radius = handle(page, "radius of v2")
    expect(radius).to_have_attribute("aria-label", "Radius of v2, 20 m")
    drag(page, "radius of v2", (14.0, -14.0))
    visit.settle()
    radii = downloaded(page)["orbit"]["radius_m"]
    assert radii[0] == radii[2] == 20
    assert radii[1] > 22
    page.get_by_role("button", name="Undo").click()
    expect(radius).to_have_attribute("aria-label", "Radius of v2, 20 m")
    pull(page, middle(handle(page, "phase of v2")), on_screen(page, 70.0, 20.0))
    expect(handle(page, "phase of v2")).to_have_attribute("aria-label", "Phase of v2, 90°")
    expect(phases(page)).to_contain_text("set by hand")
    visit.settle()
    (there,) = [one for one in drawn(page, "vehicle") if one["body"] == "v2"]
    assert there["at"] == pytest.approx([70.0, 20.0], abs=0.5)
    page.get_by_role("button", name="Undo").click()
    expect(phases(page)).to_have_text("synchronised")


def test_several_are_selected_moved_copied_aligned_and_removed(visit: Visit, page: Page) -> None:
    opened(page, document(name="pair", landmarks_m=[[35.0, 40.0], [35.0, -40.0]]))
    visit.settle()
    handle(page, "v1").click()
    page.locator("#handles button.landmark").first.click(modifiers=["Shift"])
    expect(page.get_by_text("2 selected")).to_be_visible()
    before = downloaded(page)
    drag(page, "v1", (30.0, 10.0))
    visit.settle()
    after = downloaded(page)
    by = [b - a for a, b in zip(before["landmarks_m"][0], after["landmarks_m"][0], strict=True)]
    assert math.hypot(*by) > 1.0
    moved = zip(before["formation"]["centers_m"][0], by, strict=True)
    assert after["formation"]["centers_m"][0] == pytest.approx([a + b for a, b in moved])
    assert after["formation"]["centers_m"][1] == before["formation"]["centers_m"][1]
    page.get_by_role("button", name="Align to grid").click()
    aligned = downloaded(page)["formation"]["centers_m"][0]
    assert aligned == [round(value / 10) * 10 for value in aligned]
    page.get_by_role("button", name="Copy", exact=True).click()
    visit.settle()
    assert len(downloaded(page)["formation"]["centers_m"]) == 3
    expect(handle(page, "v3")).to_have_attribute("aria-pressed", "true")
    handle(page, "v3").press("Delete")
    visit.settle()
    left = downloaded(page)
    # the copy of the landmark was selected with it
    assert len(left["formation"]["centers_m"]) == len(left["landmarks_m"]) == 2
    for _ in range(4):
        page.get_by_role("button", name="Undo").click()
    visit.settle()
    assert downloaded(page) == before


def test_tools_place_and_link_by_clicks_and_a_box_selects(visit: Visit, page: Page) -> None:
    # a box with Shift
    page.keyboard.down("Shift")
    pull(page, on_screen(page, 45.0, 95.0), on_screen(page, 160.0, 45.0))
    page.keyboard.up("Shift")
    expect(page.locator("#notice")).to_have_text("2 selected.")
    for name, pressed in (("v4", "true"), ("v5", "true"), ("v2", "false")):
        expect(handle(page, name)).to_have_attribute("aria-pressed", pressed)
    before = view(page)
    take(page, "Vehicle")
    click(page, 70.0, 35.0)
    expect(handle(page, "v7")).to_have_attribute("aria-pressed", "true")
    take(page, "Landmark")
    click(page, 105.0, 35.0)
    expect(handle(page, "L3")).to_have_attribute("aria-pressed", "true")
    visit.settle()
    placed = downloaded(page)
    assert placed["formation"]["centers_m"][6] == pytest.approx([70.0, 35.0], abs=1.0)
    assert placed["landmarks_m"][2] == pytest.approx([105.0, 35.0], abs=1.0)
    assert view(page) == before
    page.keyboard.press("Escape")
    expect(page.locator("#map")).to_have_attribute("data-tool", "select")
    # two clicks remove a link; the keyboard draws it again
    take(page, "Link")
    handle(page, "v1").click()
    expect(page.locator("#tool-help")).to_contain_text("From v1")
    handle(page, "v2").click()
    visit.settle()
    assert ["v1", "v2"] not in downloaded(page)["formation"]["links"]
    handle(page, "v1").press("Enter")
    handle(page, "v2").press("Enter")
    visit.settle()
    assert downloaded(page)["formation"]["links"][-1] == ["v1", "v2"]


def test_polygons_are_drawn_changed_and_removed(visit: Visit, page: Page) -> None:
    take(page, "Obstacle")
    corners = [(85.0, 25.0), (125.0, 25.0), (125.0, 45.0), (85.0, 45.0)]
    for corner in [*corners, corners[0]]:
        click(page, *corner)
        page.wait_for_timeout(300)
    visit.settle()
    found = downloaded(page)["obstacles_m"]
    assert len(found) == 1
    assert all(min(math.dist(one, corner) for one in found[0]) < 1.5 for corner in corners)
    expect(page.locator("#map")).to_have_attribute("data-tool", "select")
    pull(page, on_screen(page, 125.0, 45.0), on_screen(page, 115.0, 50.0))
    visit.settle()
    changed = downloaded(page)["obstacles_m"][0]
    assert min(math.dist(one, (115.0, 50.0)) for one in changed) < 1.5
    click(page, 100.0, 35.0)
    expect(page.locator("#chosen")).to_have_value("obstacle 0")
    assert accessibility_faults(page) == []
    page.get_by_role("button", name="Remove", exact=True).click()
    visit.settle()
    assert "obstacles_m" not in downloaded(page)


def test_the_ruler_measures_and_changes_nothing(visit: Visit, page: Page) -> None:
    scenario, words = downloaded(page), page.locator("#tool-help")
    take(page, "Ruler")
    click(page, 20.0, 35.0)
    page.wait_for_timeout(300)
    click(page, 120.0, 35.0)
    expect(words).to_contain_text(" m")
    length = float((words.text_content() or "0").split()[0])
    assert length == pytest.approx(100.0, abs=1.0)
    assert downloaded(page) == scenario


def test_what_is_drawn_is_kept_when_one_turns_to_something_else(visit: Visit, page: Page) -> None:
    corners = [(-30.0, -40.0), (195.0, -40.0), (195.0, 60.0), (40.0, 110.0)]

    def draw(tool: str, places: list[tuple[float, float]]) -> None:
        take(page, tool)
        for place in places:
            click(page, *place)
            # two clicks in a row are no double click
            page.wait_for_timeout(300)

    draw("Area", corners)
    # another tool
    draw("Keep-out", [(20.0, 25.0), (50.0, 25.0), (35.0, 45.0)])
    assert [len(area["at"][0]) for area in drawn(page, "area")] == [5]
    # another part of the page
    part(page, "Preflight")
    expect(page.locator("#preflight")).to_contain_text("area of 4 corners, 1 keep-out")
    draw("Obstacle", [(90.0, 25.0), (120.0, 25.0), (105.0, 45.0)])
    page.locator("#map-plot").press("Enter")
    assert [len(wall["at"][0]) for wall in drawn(page, "obstacle")] == [4]
    expect(page.get_by_role("button", name="Select")).to_have_attribute("aria-pressed", "true")
    draw("Keep-out", [(90.0, 50.0), (100.0, 50.0)])
    take(page, "Select")
    expect(page.locator("#notice")).to_have_text("Fewer than three corners: nothing is drawn.")
    draw("Keep-out", [(90.0, 50.0), (100.0, 50.0), (95.0, 55.0)])
    page.keyboard.press("Escape")
    assert len(drawn(page, "keep-out")) == 1
    visit.settle()


def test_a_keep_out_that_is_added_touches_nothing_and_keeps_phases(
    visit: Visit, page: Page
) -> None:
    page.get_by_role("button", name="Add area").click()
    for _ in range(2):
        page.get_by_role("button", name="Add keep-out").click()
        visit.verdict("GO")
        boxes = [box_of(grip) for grip in page.locator("#handles button[title^=corner]").all()]
        assert len(boxes) == 4
        for box, other in itertools.combinations(boxes, 2):
            assert max(abs(box["x"] - other["x"]), abs(box["y"] - other["y"])) > box["width"]
    visit.settle()
    visit.verdict("GO in 31 simulated flights")
