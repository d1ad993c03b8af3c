"""What if, on the page: every loss judged by the service, the most harmful first."""

from playwright.sync_api import Page, expect

from tests.page.gestures import part
from tests.tools.browsing import Visit, accessibility_faults


def test_losses_are_judged_shown_and_forgotten_with_the_scenario(visit: Visit, page: Page) -> None:
    visit.choose("paper-grid-same")
    visit.settle()
    part(page, "Verdict")
    page.get_by_role("button", name="Judge every loss").press("Enter")
    found = page.locator("#losses-found")
    expect(found).to_contain_text("6 of 14 losses end observability.")
    rows = found.get_by_role("row")
    expect(rows.nth(1)).to_contain_text("nothing")
    expect(rows.nth(2)).to_contain_text("v4")
    expect(rows.nth(2)).to_contain_text("turn of everything about L1")
    expect(rows.nth(2)).to_contain_text("NO-GO")
    expect(found).to_contain_text("sensor of v3")
    assert accessibility_faults(page) == []
    part(page, "Scenario")
    page.get_by_label("Radius of all").fill("21")
    visit.settle()
    expect(found).to_be_empty()
