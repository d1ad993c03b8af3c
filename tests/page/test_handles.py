"""Handles of circles and landmarks: on what they move, and within the map."""

from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.page.gestures import drag, handle
from tests.tools.browsing import DESKTOP, PHONE, Tabs, Visit, visiting
from tests.tools.serving import Server

_VIEW = """() => {
    const plot = document.getElementById('map-plot');
    const { left, top, width, height } = plot.querySelector('.bglayer .bg').getBoundingClientRect();
    const { xaxis, yaxis } = plot._fullLayout;
    return { left, top, width, height, x: [...xaxis.range], y: [...yaxis.range] };
}"""


def _view(page: Page) -> dict[str, Any]:
    """Where the map's axes are on the screen, and what they span."""
    found: dict[str, Any] = page.evaluate(_VIEW)
    return found


def _on_screen(page: Page, x: float, y: float) -> tuple[float, float]:
    """Where a place of the scenario is on the screen."""
    view = _view(page)
    (west, east), (south, north) = view["x"], view["y"]
    return (
        view["left"] + view["width"] * (x - west) / (east - west),
        view["top"] + view["height"] * (north - y) / (north - south),
    )


def _middle(page: Page, name: str) -> tuple[float, float]:
    box = handle(page, name).bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def _is_within(page: Page, name: str) -> bool:
    """Whether the middle of a handle lies on the map."""
    view = _view(page)
    x, y = _middle(page, name)
    inside = -1.0 <= x - view["left"] <= view["width"] + 1.0
    return bool(inside and -1.0 <= y - view["top"] <= view["height"] + 1.0)


def _ring(page: Page, name: str) -> tuple[float, float, float]:
    """The ring that a handle draws of its own: its middle and its width."""
    ring = handle(page, name).locator(".ring")
    expect(ring).to_be_visible()
    box = ring.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, box["width"]


def _center(page: Page) -> tuple[float, float]:
    """The centre of the selected vehicle as its fields have it."""
    east, north = (page.get_by_label(f"Centre {way}") for way in ("east", "north"))
    return float(east.input_value()), float(north.input_value())


@pytest.mark.parametrize("by", [(600.0, 300.0), (-500.0, -400.0), (0.0, 2000.0)])
def test_a_circle_that_is_dragged_beyond_the_map_stops_at_its_edge_with_its_ring(
    visit: Visit, page: Page, by: tuple[float, float]
) -> None:
    visit.expect_complaints("422")
    x, y = _middle(page, "v3")
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 0.5 * by[0], y + 0.5 * by[1])
    page.mouse.move(x + by[0], y + by[1])
    assert _is_within(page, "v3")
    assert _ring(page, "v3")[:2] == pytest.approx(_middle(page, "v3"), abs=1.0)
    page.mouse.up()
    visit.doubt("Before the fault")
    visit.settle()
    # no plan draws it there: the handle's own ring does, to scale, and all of it is in view
    x, y, wide = _ring(page, "v3")
    view = _view(page)
    assert (x, y) == pytest.approx(_middle(page, "v3"), abs=1.0)
    assert (x, y) == pytest.approx(_on_screen(page, *_center(page)), abs=1.5)
    scale = view["width"] / (view["x"][1] - view["x"][0])
    assert wide == pytest.approx(40.0 * scale, abs=1.5)
    assert view["left"] - 2.0 <= x - wide / 2
    assert x + wide / 2 <= view["left"] + view["width"] + 2.0
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Observable: rank 18 of 18")
    expect(handle(page, "v3").locator(".ring")).to_be_hidden()


@pytest.mark.quick
def test_a_landmark_that_is_dragged_beyond_the_map_stops_at_its_edge(
    visit: Visit, page: Page
) -> None:
    view = _view(page)
    west, east = view["x"]
    drag(page, "L1", (900.0, 0.0))
    visit.settle()
    # a preview that comes in between may shift the map by less than a pixel
    pixel = (east - west) / view["width"]
    assert float(page.get_by_label("East (m)", exact=True).input_value()) <= east + pixel
    assert _is_within(page, "L1")


def test_a_typed_place_beyond_the_map_comes_into_view_though_it_is_at_fault(
    visit: Visit, page: Page
) -> None:
    visit.expect_complaints("422")
    handle(page, "v3").click()
    page.get_by_label("Centre east").fill("600")
    visit.doubt("Before the fault")
    visit.settle()
    assert _view(page)["x"][1] >= 620.0
    assert _middle(page, "v3") == pytest.approx(_on_screen(page, 600.0, 0.0), abs=1.5)
    page.get_by_label("Centre east").fill("140")
    visit.verdict("Observable: rank 18 of 18")
    visit.settle()
    assert _view(page)["x"][1] < 300.0
    assert _middle(page, "v3") == pytest.approx(_on_screen(page, 140.0, 0.0), abs=1.5)


@pytest.mark.quick
def test_keys_move_a_circle_no_farther_than_the_map_goes(visit: Visit, page: Page) -> None:
    visit.expect_complaints("net::ERR")
    page.route("**/v1/previews*", lambda route: route.abort())
    handle(page, "v3").focus()
    for _ in range(30):
        page.keyboard.press("Shift+ArrowDown")
    assert _is_within(page, "v3")
    expect(handle(page, "v3")).to_be_focused()
    page.unroute("**/v1/previews*")


@pytest.mark.parametrize("size", [DESKTOP, (900, 900), (720, 450), PHONE])
def test_handles_stay_on_their_circles_when_the_window_changes(
    tabs: Tabs, server: Server, size: tuple[int, int]
) -> None:
    places = {"v1": (0.0, 0.0), "v4": (140.0, 70.0), "L1": (190.0, 0.0)}
    with visiting(tabs, server.url, size=DESKTOP) as visit:
        page = visit.page
        visit.verdict("Observable")
        width, height = size
        page.set_viewport_size({"width": width, "height": height})
        expect(page.locator("#map-plot .main-svg").first).to_be_visible()
        page.wait_for_timeout(400)
        for name, place in places.items():
            assert _middle(page, name) == pytest.approx(_on_screen(page, *place), abs=1.5)
