"""A team designed from a brief on the page: the front as it grows, and what opens from it."""

import re
from typing import Any

from playwright.sync_api import Page, expect

from tests.page.gestures import part
from tests.tools.briefs import FIELD, brief
from tests.tools.browsing import Visit, accessibility_faults

SPARSE = {**FIELD["sensor"], "sample_time_s": 1.0}
"""Few sightings, so that a search is soon done."""


def _handed_in(page: Page, text: str) -> None:
    part(page, "Design")
    page.get_by_label("Brief (YAML or JSON)").fill(text)
    page.get_by_role("button", name="Design", exact=True).click()


def _brief(**changes: Any) -> str:
    return brief(sensor=SPARSE, **changes).model_dump_json(exclude_none=True)


def test_a_design_shows_its_front_and_opens_any_team(visit: Visit, page: Page) -> None:
    _handed_in(page, _brief())
    panel = page.locator("#design")
    expect(panel.locator("#design-job-text")).to_contain_text(
        re.compile(r"of 10 searches; searching")
    )
    expect(panel.locator(".badge")).to_contain_text("Met: need 2 m", timeout=180_000)
    assert accessibility_faults(page) == []
    panel.get_by_role("button", name=re.compile("3 vehicles and 2 landmarks")).click()
    expect(page.locator("#handles .handle")).to_have_count(5)
    visit.verdict("Observable: rank 9 of 9")
    # the front stays beside what was opened from it, also over a reload
    panel.get_by_role("button", name="Open the winner").click()
    visit.verdict("Observable: rank 6 of 6")
    page.reload()
    expect(panel.locator(".badge")).to_contain_text("Met: need 2 m")
    visit.verdict("Observable: rank 6 of 6")


def test_example_briefs_fill_the_text_and_a_bad_one_is_refused(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    part(page, "Design")
    for name in ("multirotors-over-a-field", "rovers-between-shelves"):
        page.get_by_label("Example brief").select_option(name)
        title = re.compile(f"name: {name.replace('-', ' ')}")
        expect(page.get_by_label("Brief (YAML or JSON)")).to_have_value(title)
    _handed_in(page, "need: {worst_rms_m: -1}")
    fault = page.locator("#design form .fault").last
    expect(fault).to_contain_text("need.worst_rms_m")
    expect(fault).to_contain_text("area_m")


def test_a_design_that_is_to_finish_opens_the_best_it_has(visit: Visit, page: Page) -> None:
    _handed_in(page, _brief(team={"min": 2, "max": 8}))
    panel = page.locator("#design")
    expect(panel.locator("table button, table td").first).to_be_visible(timeout=180_000)
    panel.get_by_role("button", name="Finish now").click()
    expect(panel.get_by_text("ended early")).to_be_visible(timeout=180_000)
    assert accessibility_faults(page) == []
