"""The web page in Chromium, server and browser on the same cores.

What the first load brings over the wire and how long it takes until a plan is drawn, with nothing
cached; and how long after a circle has moved the verdict on the new formation is on the screen,
while a centre of twelve vehicles is dragged.

    python benchmarks/page.py
"""

import json
import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from playwright.sync_api import Browser, Page

from benchmarks import Figure, print_figures
from tests.tools.browsing import DESKTOP, chromium
from tests.tools.serving import Server, running

LOADS = 5
STEPS = 60
_STEP_MS = 33
_AT_REST = '#workspace[aria-busy="false"]'
_WIDTH_PX = 150.0


def first_load(browser: Browser, url: str) -> tuple[float, float]:
    """Return (bytes over the wire, s until a plan is drawn) of a load with nothing cached."""
    context = browser.new_context(viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
    page = context.new_page()
    wire = context.new_cdp_session(page)
    received = []
    wire.on("Network.loadingFinished", lambda event: received.append(event["encodedDataLength"]))
    wire.send("Network.enable")
    page.goto(url)
    page.wait_for_selector(_AT_REST)
    found = float(page.evaluate("performance.getEntriesByName('ready')[0].startTime")) / 1000.0
    context.close()
    return float(sum(received)), found


def team(direction: str) -> dict[str, Any]:
    """Return a scenario of twelve vehicles in three rows."""
    return {
        "name": "twelve",
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": direction},
        "formation": {"shape": "grid", "count": 12, "columns": 4, "spacing_m": 70.0},
        "landmarks_m": [[250.0, 0.0], [250.0, 70.0], [-40.0, 140.0]],
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "duration_s": 200.0,
    }


def drag(page: Page, direction: str) -> list[float]:
    """Return the seconds from each move of a circle to the verdict on it, as the page saw them."""
    buffer = json.dumps(team(direction)).encode()
    page.get_by_label("Open a file").set_input_files(
        {"name": "twelve.json", "mimeType": "application/json", "buffer": buffer}
    )
    page.locator("#map-name", has_text="twelve").wait_for()
    page.wait_for_selector(_AT_REST)
    page.evaluate("performance.clearMeasures()")
    box = page.locator('#handles button[title="v6"]').bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(STEPS):
        page.mouse.move(
            x + _WIDTH_PX * (step + 1) / STEPS, y - 0.3 * _WIDTH_PX * (step + 1) / STEPS
        )
        page.wait_for_timeout(_STEP_MS)
    page.mouse.up()
    page.wait_for_selector(_AT_REST)
    measured = "performance.getEntriesByName('moved to verdict').map(one => one.duration / 1000)"
    found: list[float] = page.evaluate(measured)
    return found


def main() -> dict[str, Any]:
    """Return the figures of the page."""
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        server = Server(Path(folder) / "log", SYNCPLAN_DATA_DIR=folder)
        with running(server):
            loads = [first_load(browser, server.url) for _ in range(LOADS)]
            page = browser.new_page(viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
            page.goto(server.url)
            page.wait_for_selector(_AT_REST)
            moved = {direction: drag(page, direction) for direction in ("ccw", "alternate")}
    return {
        "bytes": max(size for size, _ in loads),
        "ready_s": statistics.median(ready for _, ready in loads),
        "moved_s": moved,
    }


def figures(result: dict[str, Any]) -> list[Figure]:
    """Return what is shown of a result."""
    shown = [
        Figure("page: first load over the wire", result["bytes"] / 1e6, "MB", 2.0),
        Figure("page: first load until a plan is drawn, median", result["ready_s"], "s", 2.0),
    ]
    for direction, taken in result["moved_s"].items():
        name = f"page: circle of 12 ({direction}) dragged to verdict shown"
        median, slow = statistics.median(taken), statistics.quantiles(taken, n=20)[-1]
        shown += [
            Figure(f"{name}, median of {len(taken)}", median, "s", 0.25),
            Figure(f"{name}, 95 % take less than", slow, "s"),
        ]
    return shown


if __name__ == "__main__":
    print_figures(figures(main()))
