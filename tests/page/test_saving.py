"""Plans that are saved, and unsaved work that a closed tab leaves to the next visit."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx2
from playwright.sync_api import Locator, Page, expect

from tests.page.gestures import copied, plan_id_of, stored
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.processes import wait_until
from tests.tools.serving import Server


def plans_of(server: Server) -> list[Any]:
    """The plans that the service keeps, newest first."""
    items: list[Any] = httpx2.get(f"{server.url}/v1/plans?limit=200").json()["items"]
    return items


def test_a_plan_is_saved_once_under_its_name(visit: Visit, page: Page, server: Server) -> None:
    before = len(plans_of(server))
    save = page.get_by_role("button", name="Save", exact=True)
    visit.fill("Name", "saved team", exact=True)
    save.click()
    expect(page.locator("#notice")).to_have_text("Saved as saved team.")
    expect(save).to_have_attribute("aria-disabled", "true")
    assert stored(page, server)["scenario"]["name"] == "saved team"
    save.press("Enter")
    save.press("Control+s")
    assert copied(page) == plans_of(server)[0]["id"]
    assert len(plans_of(server)) == before + 1
    page.get_by_label("Duration (s)").fill("210")
    expect(save).to_have_attribute("aria-disabled", "false")
    page.get_by_role("button", name="Undo").click()
    expect(save).to_have_attribute("aria-disabled", "true")


def test_control_s_saves_what_is_being_typed(visit: Visit, page: Page, server: Server) -> None:
    page.evaluate("addEventListener('keydown', event => globalThis.last = event)")
    field = page.get_by_label("Duration (s)")
    field.fill("190")
    field.press("Control+s")
    expect(page.locator("#notice")).to_have_text("Saved as paper-grid-same.")
    assert page.evaluate("last.defaultPrevented")
    expect(field).to_be_focused()
    assert stored(page, server)["scenario"]["duration_s"] == 190
    first = plan_id_of(page)
    name = page.locator("#map-name")
    name.click()
    page.keyboard.press("Control+a")
    page.keyboard.type("typed name")
    page.keyboard.press("Control+s")
    expect(page.locator("#notice")).to_have_text("Saved as typed name.")
    assert stored(page, server)["scenario"]["name"] == "typed name"
    assert plan_id_of(page) != first


@contextmanager
def tab_of(visit: Visit, server: Server) -> Iterator[Visit]:
    """A visit in another tab of the same browser, which is closed at its end."""
    other = Visit(visit.page.context.new_page())
    other.page.on("console", lambda reported: other.complaints.append(reported.text))
    other.page.on("pageerror", lambda error: other.complaints.append(str(error)))
    other.page.goto(server.url)
    other.page.locator("#new:enabled").wait_for(state="attached")
    other.settle()
    locks = "async () => (await navigator.locks.query()).held.length"
    before = visit.page.evaluate(locks)
    yield other
    assert other.unexpected == []
    other.page.close()
    # its lock goes a moment after it
    wait_until(lambda: visit.page.evaluate(locks) < max(before, 1))


def offered(tab: Visit) -> Locator:
    """What is offered of another visit."""
    return tab.page.get_by_role("region", name="Unsaved work")


def see_nothing_offered(tab: Visit) -> None:
    """Fail if work of another visit is offered."""
    # all that a visit asks for has come
    tab.page.wait_for_load_state("networkidle")
    expect(offered(tab)).to_have_count(0)


def test_unsaved_work_of_a_closed_tab_is_offered_at_the_next_visit(
    visit: Visit, server: Server
) -> None:
    with tab_of(visit, server) as first:
        first.fill("Name", "left team", exact=True)
        with tab_of(visit, server) as beside:
            # it is still open
            see_nothing_offered(beside)
    with tab_of(visit, server) as second:
        expect(offered(second)).to_contain_text("left team")
        expect(offered(second)).to_contain_text(re.compile(r"\d\d?:\d\d"))
        expect(second.page.locator("#map-name")).to_have_text("paper-grid-same")
        assert accessibility_faults(second.page) == []
        offered(second).get_by_role("button", name="Continue").click()
        expect(second.page.locator("#map-name")).to_have_text("left team")
        expect(offered(second)).to_have_count(0)
        second.settle()
    with tab_of(visit, server) as third:
        offered(third).get_by_role("button", name="Discard").click()
        see_nothing_offered(third)
    with tab_of(visit, server) as fourth:
        see_nothing_offered(fourth)


def test_a_new_team_is_offered_until_it_is_saved(visit: Visit, server: Server) -> None:
    with tab_of(visit, server) as first:
        first.page.get_by_role("button", name="New …").click()
        first.page.get_by_label("Name", exact=True).last.fill("new team")
        first.page.get_by_role("button", name="Create").click()
        expect(first.page.locator("#map-name")).to_have_text("new team")
        first.settle()
    with tab_of(visit, server) as second:
        expect(offered(second)).to_contain_text("new team")
        # an edit of something else leaves it for another visit
        second.choose("mixed-radii-camera")
        expect(offered(second)).to_have_count(0)
    with tab_of(visit, server) as third:
        offered(third).get_by_role("button", name="Continue").press("Enter")
        expect(third.page.locator("#map-name")).to_have_text("new team")
        third.page.reload()
        expect(third.page.locator("#map-name")).to_have_text("new team")
        third.page.keyboard.press("Control+s")
        expect(third.page.locator("#notice")).to_have_text("Saved as new team.")
    with tab_of(visit, server) as fourth:
        see_nothing_offered(fourth)


def test_few_works_are_kept_and_broken_ones_ignored(visit: Visit, server: Server) -> None:
    page = visit.page
    scenario = {"name": "of an older page", "orbit": 1}
    work = {"state": {"scenario": scenario, "anchor": {"scenario": {}}}, "at": 1}
    texts = ["{", "null", "7", "{}", *[json.dumps(work)] * 9]
    for k, text in enumerate(texts):
        page.evaluate(f"text => localStorage.setItem('syncplan-unsaved-{k:02}', text)", text)
    visit.fill("Name", "newest", exact=True)
    kept = page.evaluate(
        "Object.keys(localStorage).filter(key => key.startsWith('syncplan-unsaved'))"
    )
    assert len(kept) == 5
    page.evaluate("localStorage.setItem('syncplan-unsaved-99', '{')")
    with tab_of(visit, server) as other:
        other.expect_complaints("422")
        expect(offered(other)).to_contain_text("of an older page")
        # beside this visit's and the last
        for _ in range(2):
            offered(other).get_by_role("button", name="Continue").click()
            expect(other.page.locator("#notice")).to_contain_text("can't be opened")
        see_nothing_offered(other)
        other.verdict("rank 18 of 18")


def test_a_full_storage_is_no_fault(visit: Visit, page: Page) -> None:
    refused = "throw new DOMException('full', 'QuotaExceededError')"
    page.evaluate(f"() => {{ Storage.prototype.setItem = () => {{ {refused} }} }}")
    visit.fill("Name", "kept nowhere", exact=True)
    visit.verdict("rank 18 of 18")
    expect(page.locator("#notice")).to_have_text("")
