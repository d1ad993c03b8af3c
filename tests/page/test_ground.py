"""The earth below the map: a graticule, the place of the pointer, tiles that an operator sets."""

import base64
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx2
from playwright.sync_api import expect
from pymap3d import enu2geodetic

from api.routes.page_routes import Tiles, edition, policy
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


def test_a_map_with_an_origin_has_a_graticule_and_the_pointer_a_place(visit: Visit) -> None:
    page = visit.page
    page.mouse.move(*on_screen(page, 20.0, 30.0))
    expect(page.locator("#pointer")).to_have_text(re.compile(r"^-?[\d.]+, -?[\d.]+ m$"))
    assert drawn(page, "graticule") == []
    opened(page, PLACED)
    visit.settle()
    wait_until(lambda: bool(drawn(page, "graticule")))
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
    wait_until(lambda: not drawn(page, "graticule"))


@contextmanager
def tile_server() -> Iterator[tuple[str, list[str]]]:
    """A server of tiles: the template of their addresses, and the paths that were asked for."""
    asked: list[str] = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(200)
            self.send_header("Content-Type", "image/gif")
            self.end_headers()
            self.wfile.write(PIXEL)

        def log_message(self, *_: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/{{z}}/{{x}}/{{y}}.gif", asked
    finally:
        server.shutdown()
        server.server_close()


def tile_of(lat: float, lon: float, zoom: int) -> tuple[float, float]:
    """Number of the tile with a place, from west and from north."""
    from math import asinh, pi, radians, tan

    count = 2**zoom
    return (lon + 180) / 360 * count, (1 - asinh(tan(radians(lat))) / pi) / 2 * count


def test_tiles_that_an_operator_sets_lie_below_a_placed_formation(
    tabs: Tabs, tmp_path: Path
) -> None:
    with (
        tile_server() as (template, asked),
        open_server(
            tmp_path,
            "--no-worker",
            SYNCPLAN_TILES=template,
            SYNCPLAN_TILES_ATTRIBUTION="© Tiles Example",
        ) as server,
        visiting(tabs, server.url) as visit,
    ):
        elsewhere = template.removesuffix("/{z}/{x}/{y}.gif")
        visit.expect_complaints(f"asked elsewhere: {elsewhere}/")
        page = visit.page
        visit.verdict("Observable")
        assert asked == []
        opened(page, PLACED)
        expect(page.locator("#attribution")).to_have_text("© Tiles Example")
        wait_until(lambda: len(asked) > 3)
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
        assert f'"assets/{edition(Tiles(template, "© Tiles Example"))}/main.js"' in answer.text
        assert accessibility_faults(page) == []
