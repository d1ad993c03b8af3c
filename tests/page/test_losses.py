"""What if, on the page: every loss judged by the service, the most harmful first."""

import re

from playwright.sync_api import Page, expect

from syncplan.planning.loss_study import what_if
from tests.page.gestures import drawn, handle, part
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.scenarios import example


def _off(page: Page, kind: str, by: str) -> set[str]:
    """What of a kind is drawn as switched off."""
    return {one[by] for one in drawn(page, kind) if one.get("off")}


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
    # a row switches its part off, and an edit ends that
    found.get_by_role("button", name="Switch off v4", exact=True).click()
    badge = page.locator("#badge")
    expect(badge).to_contain_text("Without v4: ✗ NO-GO, rank")
    assert _off(page, "circle", "body") == {"v4"}
    expect(found.get_by_role("button", name="Switch on v4", exact=True)).to_be_focused()
    part(page, "Scenario")
    visit.fill("Radius of all", "21")
    expect(found).to_be_empty()
    expect(badge).not_to_contain_text("Without")
    expect(page.get_by_role("button", name="Switch all on")).to_be_hidden()
    assert _off(page, "circle", "body") == set()


def test_the_team_is_judged_without_parts_switched_off(visit: Visit, page: Page) -> None:
    visit.choose("paper-grid-same")
    badge = page.locator("#badge")
    handle(page, "v1").press("Enter")
    page.get_by_role("button", name="Switch off v1", exact=True).press("Enter")
    (left,) = what_if(example("paper-grid-same"), ["v1"]).losses
    worst = f"worst error {left.worst_predicted_rms_m:.3g} m"
    expect(badge).to_contain_text(f"Without v1: ✓ GO on paper, rank 15 of 15, {worst}")
    expect(badge).to_contain_text("With all switched on: ✓ GO in 31 simulated flights: 6 vehicles")
    assert _off(page, "circle", "body") == _off(page, "vehicle", "body") == {"v1"}
    assert _off(page, "centre", "name") == {"v1 (off)"}
    assert len([one for one in drawn(page, "link") if one["off"]]) == 2
    expect(handle(page, "v1")).to_have_attribute("aria-label", re.compile("switched off"))
    picker = page.get_by_label("Vehicle or landmark", exact=True)
    picker.select_option("vehicle 3")
    page.get_by_role("button", name="Switch off sensor of v4").click()
    expect(badge).to_contain_text("Without v1 and sensor of v4: ✗ NO-GO, rank 14 of 15")
    expect(badge).to_contain_text("undetectable: turn of everything about L1")
    assert "v4 (sensor off)" in {one["name"] for one in drawn(page, "centre")}
    assert len([one for one in drawn(page, "link") if one["off"]]) == 3
    assert len(drawn(page, "motion")) > 0
    assert accessibility_faults(page) == []
    picker.select_option("landmark 0")
    page.get_by_role("button", name="Switch off L1").click()
    expect(badge).to_contain_text("Without v1, sensor of v4, and L1: ✗ NO-GO")
    assert _off(page, "landmark", "name") == {"L1 (off)"}
    page.get_by_role("button", name="Switch all on").press("Enter")
    visit.verdict("✓ GO in 31 simulated flights: 6 vehicles know where they are")
    expect(badge).not_to_contain_text("Without")
    expect(badge).to_be_focused()
    expect(page.get_by_role("button", name="Switch off L1")).to_be_visible()
    assert _off(page, "circle", "body") == set()
    assert drawn(page, "motion") == []
    # what can't be judged without is said
    visit.expect_complaints("422")
    for k in range(6):
        picker.select_option(f"vehicle {k}")
        page.get_by_role("button", name=f"Switch off v{k + 1}", exact=True).click()
    expect(badge).to_contain_text("leaves no vehicle")
