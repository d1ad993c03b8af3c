"""Handles of circles and landmarks: on what they move, and within the map."""

from functools import partial

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.page.gestures import box_of, drag, drawn, handle, middle, on_screen, pull, view
from tests.tools.browsing import DESKTOP, PHONE, Visit
from tests.tools.processes import wait_until


def _middle(page: Page, name: str) -> tuple[float, float]:
    return middle(handle(page, name))


def _is_within(page: Page, name: str) -> bool:
    """Whether the middle of a handle lies on the map."""
    box = box_of(page.locator("#map-plot"))
    x, y = _middle(page, name)
    inside = -1.0 <= x - box["x"] <= box["width"] + 1.0
    return bool(inside and -1.0 <= y - box["y"] <= box["height"] + 1.0)


def _circle(page: Page, name: str) -> tuple[float, float]:
    """The middle of a vehicle's circle as it is drawn, in m."""
    (ring,) = (np.array(one["at"]) for one in drawn(page, "circle") if one["body"] == name)
    x, y = (ring.min(axis=0) + ring.max(axis=0)) / 2.0
    return float(x), float(y)


def _center(page: Page) -> tuple[float, float]:
    """The centre of the selected vehicle as its fields have it."""
    east, north = (page.get_by_label(f"Centre {way}") for way in ("east", "north"))
    return float(east.input_value()), float(north.input_value())


def test_a_circle_dragged_beyond_the_map_stops_at_its_edge(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    before = view(page)
    for by in ((600.0, 300.0), (-500.0, -400.0), (0.0, 2000.0)):
        x, y = _middle(page, "v3")
        pull(page, (x, y), (x + by[0], y + by[1]), release=False)
        assert _is_within(page, "v3")
        page.mouse.up()
        visit.settle()
        # its circle is where it was left, though links do not reach that far
        assert _circle(page, "v3") == pytest.approx(_center(page), abs=1e-6)
        assert _middle(page, "v3") == pytest.approx(on_screen(page, *_center(page)), abs=1.5)
        assert view(page) == before
        page.get_by_role("button", name="Undo").click()
        visit.verdict("Observable: rank 18 of 18")
        assert _circle(page, "v3") == pytest.approx((140.0, 0.0), abs=1e-6)


def test_what_is_out_of_view_has_no_handle(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    before = view(page)
    handle(page, "v3").click()
    visit.fill("Centre east", "600")
    assert view(page) == before
    expect(handle(page, "v3")).to_be_hidden()
    # where its handle waited, a drag moves the map
    box = box_of(page.locator("#map-plot"))
    y = on_screen(page, 600.0, 0.0)[1]
    pull(page, (box["x"] + box["width"] - 3.0, y), (box["x"] + box["width"] - 43.0, y))
    expect(page.get_by_label("Centre east")).to_have_value("600")
    page.get_by_role("button", name="Fit").click()
    expect(handle(page, "v3")).to_be_visible()
    assert view(page)[2] >= 620.0
    assert _middle(page, "v3") == pytest.approx(on_screen(page, 600.0, 0.0), abs=1.5)


def test_the_next_handle_comes_into_view_and_nothing_else_scrolls(visit: Visit, page: Page) -> None:
    x, y = on_screen(page, 0.0, 0.0)
    page.mouse.move(x, y)
    for _ in range(20):
        page.mouse.wheel(0.0, -300.0)
        page.wait_for_timeout(300)
        if handle(page, "v2").is_hidden():
            break
    page.wait_for_timeout(500)
    expect(handle(page, "v2")).to_be_hidden()
    handle(page, "v1").focus()
    page.keyboard.press("PageDown")
    expect(handle(page, "v2")).to_be_focused()
    assert _is_within(page, "v2")
    assert _middle(page, "v2") == pytest.approx(on_screen(page, 70.0, 0.0), abs=1.5)
    scrolled = "['#map', '#handles', 'html'].map(one => document.querySelector(one).scrollTop)"
    assert page.evaluate(scrolled) == [0, 0, 0]


def test_circles_that_were_moved_together_stay_selected(visit: Visit, page: Page) -> None:
    for name in ("v1", "v2", "v6"):
        handle(page, name).click(modifiers=["Shift"] if name != "v1" else [])
    selected = page.locator("#handles [aria-pressed=true]")
    expect(selected).to_have_count(3)
    drag(page, "v2", (6.0, 9.0))
    visit.settle()
    expect(selected).to_have_count(3)
    page.keyboard.press("Control+c")
    page.keyboard.press("Control+v")
    expect(handle(page, "v9")).to_be_visible()
    expect(selected).to_have_count(3)


def test_corners_of_the_selected_area_are_handles(visit: Visit, page: Page) -> None:
    page.get_by_role("button", name="Add area").click()
    visit.settle()
    corners = page.get_by_label("Corners")
    expect(corners).to_have_value("-22, -22; 192, -22; 192, 92; -22, 92")
    assert len(drawn(page, "length")) == 4
    drag(page, "corner 3 of area", (0.0, -40.0))
    visit.settle()
    assert float((corners.input_value()).split("; ")[2].split(", ")[1]) > 95.0
    # by keyboard: a corner moves, one goes, and all are typed
    handle(page, "corner 4 of area").focus()
    page.keyboard.press("ArrowLeft")
    visit.settle()
    assert corners.input_value().split("; ")[3] != "-22, 92"
    page.keyboard.press("Delete")
    expect(handle(page, "corner 4 of area")).to_have_count(0)
    corners.fill("-40, -40; 200, -40; 200, 110; 60, 110; 60, 120; -40, 120")
    page.keyboard.press("Tab")
    expect(handle(page, "corner 6 of area")).to_be_visible()
    visit.settle()
    corners.fill("1, 2; 3")
    page.keyboard.press("Tab")
    expect(page.locator("#editor .fault", has_text="three corners or more")).to_be_visible()


@pytest.mark.quick
def test_keys_move_a_circle_and_the_next_one_is_a_key_away(visit: Visit, page: Page) -> None:
    visit.expect_complaints("net::ERR")
    page.route("**/v1/previews*", lambda route: route.abort())
    before = view(page)
    handle(page, "v1").focus()
    expect(page.locator("#handles button[tabindex='0']")).to_have_count(1)
    for _ in range(2):
        page.keyboard.press("PageDown")
    expect(handle(page, "v3")).to_be_focused()
    for _ in range(15):
        page.keyboard.press("Shift+ArrowDown")
    assert _is_within(page, "v3")
    expect(handle(page, "v3")).to_be_focused()
    # the view went along
    assert _circle(page, "v3")[1] < before[1]
    page.unroute("**/v1/previews*")


@pytest.mark.quick
def test_the_view_is_zoomed_panned_and_kept_and_limits_a_drag(visit: Visit, page: Page) -> None:
    whole = view(page)
    x, y = on_screen(page, 70.0, 0.0)
    page.mouse.move(x, y)
    page.mouse.wheel(0.0, -600.0)
    page.wait_for_function(
        "w => document.getElementById('map-plot').map.getView().getResolution() < w",
        arg=0.7 * (whole[2] - whole[0]) / page.locator("#map-plot").evaluate("f => f.clientWidth"),
    )
    page.wait_for_timeout(500)
    near = view(page)
    # what lay under the pointer lies there still
    assert on_screen(page, 70.0, 0.0) == pytest.approx((x, y), abs=2.0)
    visit.fill("Radius of all", "19")
    assert view(page) == near
    pull(page, (x + 40.0, y + 60.0), (x + 90.0, y + 60.0))
    page.wait_for_timeout(500)
    assert view(page)[0] < near[0]
    page.get_by_role("button", name="Fit").click()
    assert view(page) == pytest.approx(whole, abs=3.0)
    # what is dragged stops at its edge
    limit = view(page)[2]
    drag(page, "L1", (900.0, 0.0))
    visit.settle()
    assert 190.0 < float(page.get_by_label("East (m)", exact=True).input_value()) <= limit + 0.5
    assert _is_within(page, "L1")


def _is_at(page: Page, name: str, place: tuple[float, float]) -> bool:
    return bool(_middle(page, name) == pytest.approx(on_screen(page, *place), abs=1.5))


def test_handles_stay_on_their_circles_when_the_window_changes(visit: Visit, page: Page) -> None:
    places = {"v1": (0.0, 0.0), "v4": (140.0, 70.0), "L1": (190.0, 0.0)}
    for width, height in ((900, 900), (720, 450), PHONE, DESKTOP):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(400)
        for name, place in places.items():
            wait_until(partial(_is_at, page, name, place))


_AFRESH = """async () => {
    const { map } = document.getElementById("map-plot");
    const picture = () => [...map.getViewport().querySelectorAll("canvas")].map((one) =>
        one.getContext("2d").getImageData(0, 0, one.width, one.height).data);
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const shown = picture();
    map.renderSync();
    const afresh = picture();
    return shown.flatMap((one, k) => one.reduce((most, value, at) => at % 4 < 3 ? most
        : Math.max(most, Math.abs(value - afresh[k][at])), 0));
}"""
"""How far the opacity of a pixel is from that with all drawn afresh, for each canvas of the map."""

# browsers smooth the edge of a line a little otherwise where only a part of it is drawn
SMOOTHED = 64


def test_a_drag_shows_what_drawing_all_afresh_shows(visit: Visit, page: Page) -> None:
    visit.expect_complaints("willReadFrequently", "422")
    # names are drawn anew once their typeface is there
    page.evaluate("document.fonts.ready")
    visit.settle()
    x, y = _middle(page, "v2")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(7):
        page.mouse.move(x + 12.0 * step, y - 9.0 * step)
        (apart,) = page.evaluate(_AFRESH)
        assert apart < SMOOTHED
    page.mouse.up()
    visit.settle()
    assert page.evaluate(_AFRESH) == [0]
