"""The links of a formation: listed ones that come out of reach, and those that follow it."""

from playwright.sync_api import Page, expect

from tests.page.gestures import downloaded, drag, drawn
from tests.tools.browsing import Visit, accessibility_faults

ALTERNATE = "paper-grid-alternate"


def _links(page: Page) -> list[str]:
    return page.get_by_role("list", name="Links").get_by_role("listitem").all_inner_texts()


def test_a_link_out_of_reach_is_reported_and_cured_in_its_group(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    visit.choose(ALTERNATE)
    group = page.locator("details.links")
    expect(group).not_to_have_attribute("open", "")
    drag(page, "v3", (120.0, 200.0))
    expect(group).to_have_attribute("open", "")
    reported = group.locator("li.bad")
    expect(reported).to_have_count(1)
    expect(reported.first).to_contain_text("v2-v3")
    expect(reported.first).to_contain_text("out of the sensors' range of 50 m")
    expect(reported.first.get_by_role("alert")).to_be_visible()
    expect(page.locator("#fault-rest")).to_be_empty()
    # it turns red on the map, too, and is a finding with its cure
    assert [one for one in drawn(page, "link") if one["rank"] == 0]
    finding = page.locator("#findings .finding.stop").first
    expect(finding).to_contain_text("out of the sensors' range")
    assert accessibility_faults(page) == []
    page.get_by_role("button", name="Remove v2-v3").focus()
    page.keyboard.press("Enter")
    visit.settle()
    # the next link has its place, and the focus with it
    expect(page.get_by_role("button", name="Remove v3-v4")).to_be_focused()
    expect(reported).to_contain_text("v3-v4")
    finding.get_by_role("button", name="Remove the link").click()
    visit.verdict("of 18")
    assert [one for one in drawn(page, "link") if one["rank"] == 0] == []
    visit.settle()
    expect(reported).to_have_count(0)
    expect(page.locator("#notice.bad")).to_have_count(0)
    assert downloaded(page)["formation"]["links"] == [
        ["v1", "v2"],
        ["v4", "v5"],
        ["v5", "v6"],
        ["v6", "v1"],
        ["v2", "v5"],
    ]


def test_links_follow_reach_or_are_fixed_by_keyboard(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    visit.choose(ALTERNATE)
    page.locator("summary", has_text="Links").press("Enter")
    assert len(_links(page)) == 7
    assert accessibility_faults(page) == []
    page.get_by_role("button", name="Let links follow reach").press("Enter")
    visit.verdict("Not observable: rank 16 of 18")
    visit.settle()
    group = page.locator("details.links")
    expect(group).to_contain_text("linked, 7 links just now")
    drag(page, "v3", (120.0, 200.0))
    visit.settle()
    expect(page.locator("#notice.bad")).to_have_count(0)
    expect(group).to_contain_text("linked, 5 links just now")
    assert "links" not in downloaded(page)["formation"]
    assert accessibility_faults(page) == []
    fix = page.get_by_role("button", name="List them")
    fix.press("Enter")
    visit.settle()
    expect(page.get_by_role("button", name="Let links follow reach")).to_be_focused()
    assert len(downloaded(page)["formation"]["links"]) == 5
    page.get_by_role("button", name="Undo").click()
    expect(fix).to_be_visible()
