"""The earth below the map: a graticule, the place of the pointer, tiles that an operator sets."""

import base64
import math
import re
from pathlib import Path

import httpx2
from playwright.sync_api import Page, Route, expect
from pymap3d import enu2geodetic

from api.routes.page_routes import Site, Tiles, edition, policy
from api.settings import load_settings
from tests.page.gestures import drawn, on_screen, opened, view
from tests.tools.browsing import Tabs, Visit, accessibility_faults, visiting
from tests.tools.processes import wait_until
from tests.tools.scenarios import document
from tests.tools.serving import open_server

ORIGIN = {"lat_deg": 47.3977, "lon_deg": 8.5456, "alt_m": 488.0}
PLACED = document(name="placed", landmarks_m=[[0, 60], [70, 60]], geo_origin=ORIGIN)

PIXEL = base64.b64decode("R0lGODlhAQABAPAAAP8AAP///yH5BAAAAAAALAAAAAABAAEAAAICRAEAOw==")


def place(x: float, y: float) -> tuple[float, float]:
    """Latitude and longitude of a point, as exports have them."""
    lat, lon, _ = enu2geodetic(x, y, 0.0, ORIGIN["lat_deg"], ORIGIN["lon_deg"], 0.0)
    return float(lat), float(lon)


def test_an_origin_brings_a_graticule_and_places_the_pointer(visit: Visit, page: Page) -> None:
    page.mouse.move(*on_screen(page, 20.0, 30.0))
    expect(page.locator("#pointer")).to_have_text(re.compile(r"^-?[\d.]+, -?[\d.]+ m$"))
    # a grid of whole metres, until there is a place on the earth
    wait_until(lambda: bool(drawn(page, "graticule")))
    for line in drawn(page, "graticule"):
        (x, y), (to_x, _) = line["at"]
        assert (x if x == to_x else y) % 10.0 == 0.0
    assert drawn(page, "parallel") == []
    opened(page, PLACED)
    visit.settle()
    wait_until(lambda: bool(drawn(page, "parallel")))
    for kind, axis in (("parallel", 0), ("meridian", 1)):
        named = drawn(page, kind)
        assert 2 <= len(named) <= 12
        for one in named:
            degrees, letter = one["name"].split("° ")
            assert letter == "NE"[axis]
            assert abs(place(*one["at"])[axis] - float(degrees)) < 1e-6
    # nearer, lines are closer to each other
    before = {one["name"] for one in drawn(page, "parallel")}
    page.evaluate("document.getElementById('map-plot').map.getView().setResolution(0.05)")
    wait_until(lambda: not before >= {one["name"] for one in drawn(page, "parallel")})
    west, south, east, north = view(page)
    x, y = (west + east) / 2, (0.3 * south + 0.7 * north)
    page.mouse.move(*on_screen(page, x + 1.0, y))
    page.mouse.move(*on_screen(page, x, y))
    text = page.locator("#pointer").text_content() or ""
    lat, lon = (float(one) for one in re.findall(r"([\d.]+)° [NE]", text))
    assert abs(lat - place(x, y)[0]) < 1e-5
    assert abs(lon - place(x, y)[1]) < 1e-5
    assert accessibility_faults(page) == []
    # without an origin there is no earth
    opened(page, {**document(name="elsewhere")})
    wait_until(lambda: not drawn(page, "parallel"))


def tile_of(lat: float, lon: float, zoom: int) -> tuple[float, float]:
    """Number of the tile with a place, from west and from north."""
    count = 2**zoom
    down = (1 - math.asinh(math.tan(math.radians(lat))) / math.pi) / 2
    return (lon + 180) / 360 * count, down * count


def test_tiles_of_the_operator_lie_below_a_placed_team(tabs: Tabs, tmp_path: Path) -> None:
    elsewhere = "http://127.0.0.2:9"
    tiles = Tiles(f"{elsewhere}/{{z}}/{{x}}/{{y}}.gif", "© Tiles Example")
    site = Site(Site.of(load_settings(data_dir="/nowhere")).limits, tiles)
    settings = {"SYNCPLAN_TILES": tiles.url, "SYNCPLAN_TILES_ATTRIBUTION": tiles.attribution}
    asked: list[str] = []

    def answer_tile(route: Route) -> None:
        asked.append(route.request.url.removeprefix(elsewhere))
        route.fulfill(body=PIXEL, content_type="image/gif")

    with (
        open_server(tmp_path, "--no-worker", **settings) as server,
        visiting(tabs, server.url) as visit,
    ):
        visit.expect_complaints(f"asked elsewhere: {elsewhere}/")
        page = visit.page
        page.route(f"{elsewhere}/**", answer_tile)
        visit.verdict("Observable")
        assert asked == []
        opened(page, PLACED)
        expect(page.locator("#attribution")).to_have_text("© Tiles Example")
        # tiles are answered while the page is looked at
        wait_until(lambda: bool(drawn(page, "vehicle")) and len(asked) > 3)
        for path in asked:
            zoom, x, y = (int(one) for one in re.findall(r"\d+", path))
            # those of the place, not of anywhere else
            column, row = tile_of(*place(35.0, 30.0), zoom)
            assert abs(x - column) < 6
            assert abs(y - row) < 6
        answer = httpx2.get(server.url)
        sent = answer.headers["content-security-policy"]
        assert f"img-src 'self' data: blob: {elsewhere};" in sent
        assert sent.replace(f" {elsewhere}", "") == policy()
        # what it names is kept by browsers: it is of this edition, tiles and all
        assert f'"assets/{edition(site)}/main.js"' in answer.text
        assert accessibility_faults(page) == []
