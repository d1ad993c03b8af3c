"""The web page in Chromium, server and browser on the same cores.

What the first load brings over the wire, and how long it takes until the map is drawn: with nothing
cached, with all cached, and over a line of 400 kbit/s with a delay of 400 ms. While a circle is
dragged: how long after a move the verdict on it is on the screen, how long after the drop that on
the whole plan, and how long frames take; and the memory that a thousand drags of six vehicles add.
With `--base PATH` the page of another checkout does the same.

    python benchmarks/page.py --base ../before
"""

import argparse
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
from tests.tools.serving import ROOT, Server, running

LOADS = 5
STEPS = 60
TEAMS = {12: 0.1, 50: 0.3, 100: 0.6}
"""Vehicles of the teams, each with the target in s from a move to its verdict."""
SLOW_LINE = {"latency": 400, "downloadThroughput": 50_000, "uploadThroughput": 50_000}
"""A line of 400 kbit/s; delays in ms, rates in bytes per second."""
DRAGS = 1000
_STEP_MS = 33
_DROPS = 5
_PATIENCE_MS = 120_000
_AT_REST = '#workspace[aria-busy="false"]'
_WIDTH_PX = 60.0
_FRAMES = """() => {
    window.frames = [];
    let last = performance.now();
    const step = (now) => { frames.push(now - last); last = now; requestAnimationFrame(step); };
    requestAnimationFrame(step);
}"""


def load(browser: Browser, url: str, line: dict[str, Any], again: bool = False) -> dict[str, float]:
    """Return bytes over the wire, and s until the map and the plan are drawn.

    Nothing is cached, or with `again` all that a load before it has brought.
    """
    context = browser.new_context(viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
    page = context.new_page()
    page.set_default_timeout(_PATIENCE_MS)
    if again:
        page.goto(url)
        page.wait_for_selector(_AT_REST)
    wire = context.new_cdp_session(page)
    received = []
    wire.on("Network.loadingFinished", lambda event: received.append(event["encodedDataLength"]))
    wire.send("Network.enable")
    if line:
        wire.send("Network.emulateNetworkConditions", {"offline": False, **line})
    page.goto(url)
    page.wait_for_selector(_AT_REST)
    # pages before this map have it once the plan is there
    marked = """name => (performance.getEntriesByName(name)[0]
        ?? performance.getEntriesByName('ready')[0]).startTime / 1000"""
    found = {name: float(page.evaluate(marked, name)) for name in ("map", "ready")}
    context.close()
    return {"bytes": float(sum(received)), **found}


def team(count: int, direction: str) -> dict[str, Any]:
    """Return a scenario of vehicles in rows of four, seven or ten."""
    columns = {12: 4, 50: 7, 100: 10}[count]
    east = 70.0 * (columns - 1) + 40.0
    return {
        "name": f"{count} {direction}",
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": direction},
        "formation": {"shape": "grid", "count": count, "columns": columns, "spacing_m": 70.0},
        "landmarks_m": [[east, 0.0], [east, 70.0], [-40.0, 140.0]],
        "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        "duration_s": 200.0,
    }


def drag(page: Page, count: int, direction: str) -> dict[str, list[float]]:
    """Return what a drag of a circle took, in s.

    `moved` is from each move to its verdict, `dropped` from each drop to the whole verdict on
    paper, `flown` to the flown one (empty where the team is too large or not GO),
    `frames` from frame to frame.
    """
    scenario = team(count, direction)
    buffer = json.dumps(scenario).encode()
    page.get_by_label("Open a file").set_input_files(
        {"name": "team.json", "mimeType": "application/json", "buffer": buffer}
    )
    page.locator("#map-name", has_text=scenario["name"]).wait_for()
    page.wait_for_selector(_AT_REST)
    page.evaluate("performance.clearMeasures()")
    x, y = _middle(page, "v6")
    page.evaluate(_FRAMES)
    for drop in range(_DROPS):
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(STEPS // _DROPS):
            away = _WIDTH_PX * (step + 1) / STEPS
            page.mouse.move(x + away, y - 0.3 * away)
            page.wait_for_timeout(_STEP_MS)
        if drop == 0:
            frames = page.evaluate("frames.map(one => one / 1000)")
        page.mouse.up()
        page.wait_for_selector(_AT_REST)
        x, y = x + away, y - 0.3 * away
    measured = "name => performance.getEntriesByName(name).map(one => one.duration / 1000)"
    moved = page.evaluate(measured, "moved to verdict")
    return {
        "moved": moved,
        "dropped": page.evaluate(measured, "edited to verdict"),
        "flown": page.evaluate(measured, "edited to flown"),
        "frames": frames,
    }


def growth(page: Page, url: str) -> float:
    """Return the bytes of scripts' memory that many drags of a circle to and fro add."""
    page.goto(url)
    page.wait_for_selector(_AT_REST)
    memory = page.context.new_cdp_session(page)
    memory.send("HeapProfiler.enable")
    x, y = _middle(page, "v2")
    used = []
    for drags in (DRAGS // 10, DRAGS):
        for drag in range(drags):
            way = (0.0, 3.0, 6.0, 8.0) if drag % 2 == 0 else (8.0, 5.0, 2.0, 0.0)
            page.mouse.move(x + way[0], y)
            page.mouse.down()
            for east in way[1:]:
                page.mouse.move(x + east, y)
            page.mouse.up()
        page.wait_for_selector(_AT_REST)
        memory.send("HeapProfiler.collectGarbage")
        used.append(memory.send("Runtime.getHeapUsage")["usedSize"])
    return float(used[1] - used[0])


def _middle(page: Page, vehicle: str) -> tuple[float, float]:
    """Return where on the screen the handle of a vehicle's circle lies."""
    box = page.locator(f'#handles button[title="{vehicle}"]').bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0


def measured(checkout: Path) -> dict[str, Any]:
    """Return the figures of the page of a checkout."""
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        server = Server(Path(folder) / "log", checkout=checkout, SYNCPLAN_DATA_DIR=folder)
        with running(server):
            loads = {
                "cold": [load(browser, server.url, {}) for _ in range(LOADS)],
                "warm": [load(browser, server.url, {}, again=True) for _ in range(LOADS)],
                "slow": [load(browser, server.url, SLOW_LINE)],
            }
            page = browser.new_page(viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
            page.goto(server.url)
            page.wait_for_selector(_AT_REST)
            drags = {
                (count, direction): drag(page, count, direction)
                for count in TEAMS
                for direction in ("ccw", "alternate")
            }
            grown = growth(browser.new_page(), server.url)
    return {"loads": loads, "drags": drags, "growth": grown}


def main(base: Path | None = None) -> dict[str, list[Figure]]:
    """Return the figures of the page, and of that of a base."""
    checkouts = {"page": ROOT, **({} if base is None else {"base": base})}
    return {side: figures_of(side, measured(checkout)) for side, checkout in checkouts.items()}


def figures_of(side: str, result: dict[str, Any]) -> list[Figure]:
    """Return what is shown of a page."""
    loads = result["loads"]

    def median(kind: str, what: str) -> float:
        return float(statistics.median(one[what] for one in loads[kind]))

    shown = [
        Figure(f"{side}: first load over the wire", median("cold", "bytes") / 1e3, "kB", 300.0),
        Figure(f"{side}: map drawn, nothing cached", median("cold", "map"), "s"),
        Figure(f"{side}: map drawn, all cached", median("warm", "map"), "s", 0.5),
        Figure(f"{side}: map drawn over 400 kbit/s, 400 ms", median("slow", "map"), "s", 4.0),
        Figure(f"{side}: plan drawn, nothing cached", median("cold", "ready"), "s"),
    ]
    for (count, direction), taken in result["drags"].items():
        name = f"{side}: {count} vehicles ({direction})"
        moved, dropped, frames = (taken[one] for one in ("moved", "dropped", "frames"))
        shown += [
            Figure(f"{name}: drag to verdict, median", statistics.median(moved), "s", TEAMS[count]),
            Figure(f"{name}: drag to verdict, 95 %", _most(moved), "s"),
            Figure(f"{name}: drop to whole verdict, median", statistics.median(dropped), "s"),
            *_flown(name, taken["flown"]),
            Figure(f"{name}: frame, 95 %", _most(frames), "s", 0.02),
        ]
    added = result["growth"] / 1e6
    return [*shown, Figure(f"{side}: memory that {DRAGS:,} drags add", added, "MB", 10.0)]


def _flown(name: str, seconds: list[float]) -> list[Figure]:
    label = f"{name}: drop to flown verdict, median"
    return [Figure(label, statistics.median(seconds), "s", 1.5)] if seconds else []


def _most(values: list[float]) -> float:
    """Return the 95th percentile; the largest of a page that shows a verdict now and then."""
    return statistics.quantiles(values, n=20)[-1] if len(values) > 1 else max(values)


def figures(result: dict[str, list[Figure]]) -> list[Figure]:
    """Return what is shown of a result."""
    return [one for side in result.values() for one in side]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, help="another checkout to compare with")
    print_figures(figures(main(parser.parse_args().base)))
