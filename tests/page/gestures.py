"""What people do on the page, and what they get from it."""

import json
import re
import zipfile
from pathlib import Path
from typing import Any

import httpx2
from playwright.sync_api import Download, FloatRect, Locator, Page, Route, expect

from tests.tools.serving import Server

Place = tuple[float, float]


def view(page: Page) -> Any:
    """The map's view: west, south, east and north in m."""
    script = "(map => map.getView().calculateExtent(map.getSize()))"
    return page.evaluate(f"{script}(document.getElementById('map-plot').map)")


def on_screen(page: Page, x: float, y: float) -> Place:
    """Where a place of the scenario is on the screen."""
    script = """([x, y]) => {
        const frame = document.getElementById('map-plot');
        const { left, top } = frame.getBoundingClientRect();
        const [right, down] = frame.map.getPixelFromCoordinate([x, y]);
        return [left + right, top + down];
    }"""
    right, down = page.evaluate(script, [x, y])
    return right, down


DRAWN = """kind => document.getElementById('map-plot').map.getLayers().getArray()
    .flatMap(layer => layer.getSource().getFeatures?.() ?? [])
    .filter(one => one.get('kind') === kind)
    .map(one => ({ ...one.getProperties(), geometry: null, geometryOf: one.getGeometry() }))
    .map(({ geometryOf: shape, ...one }) => {
        if (shape.getType() !== 'Circle') return { ...one, at: shape.getCoordinates() };
        const [[x, y], r] = [shape.getCenter(), shape.getRadius()];
        const { begin = 0, end = 2 * Math.PI } = one;
        const angles = Array.from({ length: 97 }, (_, k) => begin + ((end - begin) * k) / 96);
        const at = angles.map(angle => [x + r * Math.cos(angle), y + r * Math.sin(angle)]);
        return { ...one, at };
    })"""
"""The marks of a kind on the map, with their coordinates; of circles and arcs, 97 points."""


def drawn(page: Page, kind: str) -> Any:
    """The marks of a kind that are drawn on the map, with their coordinates `at` in m."""
    # what changed is drawn with the next frame
    page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.evaluate(DRAWN, kind)


def handle(page: Page, name: str) -> Locator:
    """What moves a circle or a landmark."""
    return page.locator(f'#handles button[title="{name}"]')


def click(page: Page, x: float, y: float, **how: Any) -> None:
    """Click a place of the scenario on the map."""
    page.mouse.move(*on_screen(page, x, y))
    page.mouse.click(*on_screen(page, x, y), **how)


def take(page: Page, tool: str) -> None:
    """Take a tool in hand."""
    page.get_by_role("toolbar", name="Tools").get_by_role("button", name=tool, exact=True).click()


def box_of(mark: Locator) -> FloatRect:
    """Where something is on the screen."""
    box = mark.bounding_box()
    assert box is not None
    return box


def middle(mark: Locator) -> Place:
    """The middle of something on the screen."""
    box = box_of(mark)
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def pull(page: Page, start: Place, *stops: Place, release: bool = True) -> None:
    """Press the mouse at a place of the screen and move it by way of others to the last."""
    page.mouse.move(*start)
    page.mouse.down()
    for stop in stops:
        page.mouse.move(*stop, steps=4)
    if release:
        page.mouse.up()


def drag(page: Page, name: str, by: Place) -> None:
    """Drag a circle or a landmark by so many pixels, from the middle of the window."""
    handle(page, name).evaluate("one => one.scrollIntoView({ block: 'center' })")
    x, y = middle(handle(page, name))
    pull(page, (x, y), (x + by[0], y + by[1]))


def saved(download: Download) -> bytes:
    """The content of what was downloaded."""
    return Path(download.path()).read_bytes()


def plan_id_of(page: Page) -> str:
    """The identifier of the plan in the page's address."""
    found = re.search(r"[?&]plan=([0-9a-f-]{36})", page.url)
    assert found, page.url
    return found[1]


def phases(page: Page) -> Locator:
    """Where the verdict shows where the phases come from."""
    return page.locator("#verdict tr", has_text="Phases").locator("td")


def menu(page: Page, name: str) -> None:
    """Press a button of the menu."""
    page.get_by_role("button", name="More", exact=True).click()
    page.locator("#more").get_by_role("button", name=name).click()


def copied(page: Page) -> str:
    """Copy the link to the plan on show; return the plan's identifier."""
    menu(page, "Copy link")
    expect(page.locator("#notice")).to_contain_text("Link copied")
    return plan_id_of(page)


def stored(page: Page, server: Server) -> Any:
    """The plan in the page's address, as the service keeps it."""
    return httpx2.get(f"{server.url}/v1/plans/{plan_id_of(page)}").json()


def part(page: Page, name: str) -> None:
    """Show a part of the plan beside the map."""
    page.get_by_role("tab", name=name, exact=True).click()


def sheet(page: Page) -> None:
    """Open the sheet of a narrow window."""
    button = page.locator("#sheet")
    if button.is_visible() and button.get_attribute("aria-expanded") == "false":
        button.click()


def figures(page: Page) -> None:
    """Open the figures below the map."""
    if page.locator("#figures").is_hidden():
        page.get_by_role("button", name="Figures").click()
    page.locator("#panel-plot .main-svg").first.wait_for()


def refine(page: Page) -> None:
    """Refine from one start and without a hurry, so that the same comes of it on any machine."""

    def one_start(route: Route) -> None:
        asked = json.loads(route.request.post_data or "{}")
        asked |= {"starts": 1, "time_limit_s": 600.0}
        route.continue_(post_data=json.dumps(asked))

    page.route("**/refinements", one_start)
    part(page, "Run")
    page.get_by_role("button", name="Refine").click()


def validate(page: Page, trials: str) -> None:
    """Validate the plan on show in so many trials."""
    part(page, "Run")
    page.get_by_role("spinbutton", name="Trials").fill(trials)
    page.get_by_role("button", name="Validate").click()


def opened(page: Page, scenario: dict[str, Any]) -> None:
    """Open a scenario as a file."""
    buffer = json.dumps(scenario).encode()
    upload: Any = {"name": "some.json", "mimeType": "application/json", "buffer": buffer}
    page.get_by_label("Open a file").set_input_files(upload)
    expect(page.locator("#map-name")).to_have_text(scenario["name"])


def download(page: Page, button: str) -> Download:
    """What a button saves."""
    before = page.locator("#parts [aria-selected=true]").text_content()
    part(page, "Preflight")
    with page.expect_download() as waiting:
        page.locator("#before-flight").get_by_role("button", name=button).click()
    part(page, before or "?")
    return waiting.value


def place_on_earth(page: Page) -> None:
    """State where the origin lies, which missions need."""
    page.get_by_label("Latitude of the origin").fill("47.4")
    page.get_by_label("Longitude of the origin").fill("8.5")
    page.keyboard.press("Tab")


def downloaded(page: Page) -> Any:
    """The scenario as the page saves it."""
    return json.loads(saved(download(page, "Scenario file")))


def unzipped(archive: Download) -> dict[str, bytes]:
    """The files of an archive that was downloaded, by name."""
    with zipfile.ZipFile(archive.path()) as files:
        return {name: files.read(name) for name in files.namelist()}


def sidecar_of(archive: Download) -> Any:
    """The sidecar of an exported archive."""
    files = unzipped(archive)
    return json.loads(next(files[name] for name in files if name.endswith(".sync.json")))
