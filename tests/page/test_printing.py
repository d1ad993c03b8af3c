"""The printed report: two sheets of paper whatever the team, opened from the page."""

import math
import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

import syncplan
from syncplan.scenario.loading import scenario_from
from tests.page.gestures import opened, part, stored
from tests.tools.browsing import Tabs, Visit, accessibility_faults
from tests.tools.on_paper import plan
from tests.tools.scenarios import circling, document
from tests.tools.serving import Server


def grid(count: int, **changes: Any) -> dict[str, Any]:
    """A grid of vehicles beside landmarks."""
    return document(
        name=f"grid of {count}",
        orbit=circling(direction="alternate", desync_rad=0.2),
        formation={"shape": "grid", "count": count, "spacing_m": 70.0},
        landmarks_m=[[-50.0, 0.0], [-50.0, 70.0], [0.0, -50.0]],
        **changes,
    )


def sheets(page: Page, paper: str) -> int:
    """Number of sheets that a page prints on."""
    return len(re.findall(rb"/Type\s*/Page\b", page.pdf(format=paper)))


TURNS = [2.0 * math.pi * k / 48 for k in range(48)]
CORNERS = [[9.0 * math.cos(turn), 9.0 * math.sin(turn)] for turn in TURNS]

TROUBLED: dict[str, Any] = {
    "orbit": circling(direction="alternate"),
    "area_m": [[-60.0, -60.0], [500.0, -60.0], [500.0, 600.0], [-60.0, 600.0]],
    "wind": {"sigma_mps": 1.0, "gust_sigma_mps": 0.2},
    "heading_sigma_rad": 0.05,
    "altitude_m": 60.0,
    "keep_out_m": [[[600.0 + x, y] for x, y in CORNERS]],
    "geo_origin": {"lat_deg": 47.3977, "lon_deg": 8.5456, "alt_m": 488.0},
    "start_time": "2026-05-01T09:00:00Z",
}


@pytest.mark.parametrize(
    ("count", "changes"), [(4, {}), (4, TROUBLED), (50, {}), (50, TROUBLED), (60, TROUBLED)]
)
def test_a_report_prints_on_two_sheets(count: int, changes: dict[str, Any], tabs: Tabs) -> None:
    made = plan(scenario_from({**grid(count), **changes}), bound="never")
    page = tabs.browser.new_page()
    heard: list[str] = []
    page.on("console", lambda message: heard.append(message.text))
    page.set_content(syncplan.report_page(made))
    for paper in ("A4", "Letter"):
        assert sheets(page, paper) == 2
        # all of it: nothing is cut at the edge of the paper
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for sheet in ("#vehicles", "#circles"):
        rows = page.locator(f"section:has({sheet}) tbody tr")
        expect(rows).to_have_count(count if count <= 50 else 0)
    assert heard == []
    page.close()


def test_the_report_of_a_plan_opens_in_a_tab(visit: Visit, page: Page, server: Server) -> None:
    opened(page, grid(12, geo_origin=TROUBLED["geo_origin"]))
    visit.settle()
    part(page, "Preflight")
    with page.expect_popup() as waiting:
        page.get_by_role("button", name="Print report").click()
    report = waiting.value
    expect(report.locator("h1")).to_have_text("grid of 12")
    made = stored(page, server)
    expect(report.locator("header")).to_contain_text(made["id"])
    rows = report.locator("section:has(#vehicles) tbody tr")
    for one, row in zip(made["vehicles"], rows.all(), strict=True):
        error = made["predicted_rms_m"]["vehicles"][one["name"]]
        expect(row).to_contain_text(f"{one['phase_rad']:.4f}{error:.3g}")
    # its style holds under the policy of the page that opened it
    first = report.locator(".sheet").first
    assert first.evaluate("one => getComputedStyle(one).display") == "flex"
    assert sheets(report, "A4") == 2
    for scheme in ("light", "dark"):
        report.emulate_media(color_scheme=scheme)
        assert accessibility_faults(report) == []
    report.set_viewport_size({"width": 390, "height": 844})
    assert report.evaluate("document.documentElement.scrollWidth <= innerWidth")
    report.close()
