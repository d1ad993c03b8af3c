"""What the page says, where it is seen, and what a link that leads nowhere offers."""

import json
from collections.abc import Callable

import httpx2
import pytest
from playwright.sync_api import Page, Route, expect

from tests.page.gestures import box_of, copied, drag, menu, part, place_on_earth, plan_id_of, sheet
from tests.tools.browsing import (
    DESKTOP,
    PHONE,
    Tabs,
    Visit,
    accessibility_faults,
    faults_by_day_and_night,
    visiting,
)
from tests.tools.scenarios import document
from tests.tools.serving import Server

GONE = "00000000-0000-4000-8000-000000000000"
NO_PLAN = "There is no such plan, or it belongs to another key."


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_a_confirmation_is_seen_wherever_one_has_scrolled(
    tabs: Tabs, server: Server, size: tuple[int, int]
) -> None:
    with visiting(tabs, server.url, size=size) as visit:
        page = visit.page
        visit.verdict("GO")
        sheet(page)
        part(page, "Preflight")
        place_on_earth(page)
        visit.settle()
        with page.expect_download():
            page.locator("#before-flight").get_by_role("button", name="Export").click()
        reported = page.locator("#notice")
        expect(reported).to_contain_text("Exported")
        # what goes with it is not covered by its confirmation
        note, toast = box_of(page.locator("#export-notes")), box_of(page.locator(".toast"))
        assert note["height"] > 0.0
        assert toast["y"] + toast["height"] <= note["y"] or size == DESKTOP
        for place in (0, 10_000):
            page.evaluate("y => document.querySelector('.inspector').scrollTo(0, y)", place)
            expect(reported).to_be_in_viewport(ratio=1.0)
        expect(reported).to_have_attribute("aria-live", "polite")
        assert accessibility_faults(page) == []
        expect(reported).to_be_empty()


def test_a_message_goes_by_itself_and_covers_no_control(visit: Visit, page: Page) -> None:
    menu(page, "Copy link")
    reported = page.locator("#notice")
    expect(reported).to_contain_text("Link copied")
    expect(page.get_by_role("button", name="Dismiss the message")).to_be_hidden()
    covered = """() => [...document.querySelectorAll('button, select, input, summary, [role=tab]')]
        .filter(one => one.checkVisibility())
        .map(one => [one, one.getBoundingClientRect()])
        .filter(([, box]) => box.width > 0 && box.top >= 0 && box.bottom < innerHeight)
        .map(([one, box]) => [one, box.x + box.width / 2, box.y + box.height / 2])
        .filter(([, x, y]) => document.elementFromPoint(x, y)?.closest('.toast'))
        .map(([one]) => one.outerHTML)"""
    assert page.evaluate(covered) == []
    toast = box_of(page.locator(".toast"))
    assert toast["y"] < 120.0
    page.locator("#play").click()
    expect(page.locator("#play")).to_have_text("Pause")
    expect(reported).to_be_empty(timeout=6000.0)


def test_a_confirmation_goes_with_an_edit_and_a_fault_when_mended(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    menu(page, "Copy link")
    reported = page.locator("#notice")
    expect(reported).to_contain_text("Link copied")
    page.get_by_label("Duration").fill("210")
    expect(reported).to_be_empty()
    page.get_by_label("Duration").fill("-1")
    # it is stated where findings are
    expect(page.locator("#findings")).to_contain_text("must be")
    expect(reported).to_be_empty()
    visit.settle()
    visit.fill("Name", "still at fault", exact=True)
    expect(page.locator("#findings")).to_contain_text("must be")
    page.get_by_label("Duration").fill("220")
    expect(page.locator("#findings")).not_to_contain_text("must be")


def _new_team(visit: Visit) -> None:
    page = visit.page
    page.locator("#dead-new").press("Enter")
    page.get_by_role("button", name="Create").click()


def _open_example(visit: Visit) -> None:
    visit.page.get_by_role("button", name="Open the example grid").click()


def _choose_example(visit: Visit) -> None:
    visit.begin("paper-grid-same")


@pytest.mark.parametrize(
    ("way", "size"), [(_new_team, PHONE), (_open_example, DESKTOP), (_choose_example, DESKTOP)]
)
def test_a_link_to_no_plan_says_so_and_leads_on(
    tabs: Tabs, server: Server, way: Callable[[Visit], None], size: tuple[int, int]
) -> None:
    with visiting(tabs, f"{server.url}/?plan={GONE}", size=size) as visit:
        page = visit.page
        visit.expect_complaints("404")
        card = page.get_by_role("main", name="This link leads to no plan")
        expect(card).to_contain_text(NO_PLAN)
        expect(page.locator("#workspace")).to_be_hidden()
        expect(page.get_by_role("heading", name="This link leads to no plan")).to_be_focused()
        # nothing was being edited
        expect(card.get_by_role("button")).to_have_text(["Open the example grid", "New …"])
        assert faults_by_day_and_night(page) == []
        way(visit)
        visit.verdict("✓ GO")
        expect(card).to_be_hidden()
        assert "plan=" not in page.url


def test_no_plan_leads_back_to_what_was_edited(visit: Visit, page: Page, server: Server) -> None:
    visit.expect_complaints("404")
    visit.fill("Name", "mine", exact=True)
    page.goto(f"{server.url}/?plan={GONE}")
    page.get_by_role("button", name="Continue what was being edited").click()
    expect(page.locator("#map-name")).to_have_text("mine")
    visit.verdict("Observable: rank 18 of 18")
    # Back to a plan that was deleted keeps the one on show
    kept = copied(page)
    page.evaluate(f"history.pushState(null, '', '?plan={GONE}')")
    page.evaluate(f"history.pushState(null, '', '?plan={kept}')")
    page.go_back()
    expect(page.locator("#notice.bad")).to_have_text(NO_PLAN)
    visit.verdict("Observable: rank 18 of 18")
    assert plan_id_of(page) == kept


def test_a_plan_stored_without_a_verdict_is_judged_anew(tabs: Tabs, server: Server) -> None:
    def without_verdict(route: Route) -> None:
        answer = route.fetch()
        plan = answer.json()
        del plan["verdict"]
        route.fulfill(response=answer, body=json.dumps(plan))

    # rank and separation are as they should be, and v1 passes a landmark at a metre
    scenario = document(name="named", landmarks_m=[[35.0, 40.0], [-21.0, 0.0]])
    plan = httpx2.post(f"{server.url}/v1/plans", json=scenario).json()
    assert plan["observability"]["observable"]
    stops = [one for one in plan["verdict"]["findings"] if one["level"] == "stop"]
    assert [one["code"] for one in stops] == ["landmark-too-close"]
    with visiting(tabs, server.url) as visit:
        page = visit.page
        page.route(f"**/v1/plans/{plan['id']}", without_verdict)
        # an address that names a plan comes before what was edited
        visit.fill("Name", "edited", exact=True)
        page.goto(f"{server.url}/?plan={plan['id']}")
        expect(page.locator("#map-name")).to_have_text("named")
        visit.verdict("✗ NO-GO")
        visit.verdict("Observable: rank 6 of 6")
        expect(page.locator("#badge")).to_have_class("badge bad")
        expect(page.locator("#findings")).to_contain_text("v1 passes L2 at 1 m")


def test_no_findings_go_with_the_files_of_a_scenario_at_fault(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    visit.choose("paper-grid-alternate")
    found = page.locator("#export-findings")
    expect(found.locator(".remark")).to_have_count(2)
    drag(page, "v3", (120.0, 150.0))
    visit.doubt("Before the fault")
    expect(found).to_be_empty()
    expect(page.locator("#export-count")).to_be_empty()
    page.get_by_role("button", name="Undo").click()
    expect(found.locator(".remark")).to_have_count(2)
