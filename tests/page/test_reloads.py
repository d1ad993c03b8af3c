"""What a reload goes on with, the report of a validation, and the link to a plan."""

import json

import httpx2
import pytest
from playwright.sync_api import Page, Route, expect

from tests.page.gestures import (
    copied,
    handle,
    menu,
    opened,
    part,
    phases,
    plan_id_of,
    saved,
    stored,
    validate,
)
from tests.tools.browsing import Visit
from tests.tools.scenarios import document
from tests.tools.serving import Server

ALTERNATE = "paper-grid-alternate"


def test_a_reload_goes_on_with_a_fault_and_undo_leads_out_of_it(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    visit.choose(ALTERNATE)
    page.get_by_label("Range (m)", exact=True).fill("-5")
    visit.doubt("Before the fault")
    page.reload()
    visit.doubt("Before the fault: ✗ NO-GO")
    visit.doubt("Not observable: rank 16 of 18")
    expect(page.get_by_label("Range (m)", exact=True)).to_have_value("-5")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Not observable: rank 16 of 18")


def test_a_reload_keeps_given_phases(visit: Visit, page: Page, server: Server) -> None:
    plan = httpx2.post(f"{server.url}/v1/plans", json=document(name="of a file")).json()
    for one, phase in zip(plan["vehicles"], (0.25, 2.5), strict=True):
        # where it is at time 0 and its speed follow from these
        for key in set(one) - {"name", "center_m", "radius_m", "direction"}:
            del one[key]
        one["phase_rad"] = phase
    opened(page, {**plan, "name": "of a file"})
    expect(phases(page)).to_have_text("from a file")
    visit.fill("Name", "mine", exact=True)
    page.reload()
    expect(page.locator("#map-name")).to_have_text("mine")
    expect(phases(page)).to_have_text("from a file")
    handle(page, "v2").click()
    page.get_by_label("Centre north").fill("1")
    expect(phases(page)).to_contain_text("synchronised")
    visit.settle()
    page.reload()
    expect(phases(page)).to_contain_text("Undo brings the plan as it was back")
    page.get_by_role("button", name="Undo").click()
    expect(phases(page)).to_have_text("from a file")


def test_what_a_tab_kept_and_can_t_be_planned_is_forgotten(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    kept = {"state": {"scenario": {"orbit": 1}, "anchor": {"scenario": {}, "planId": None}}}
    page.add_init_script(f"sessionStorage.setItem('syncplan-edit', '{json.dumps(kept)}')")
    page.reload()
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator("#map-name")).to_have_text("paper-grid-same")
    # no other visit may have this tab and its script
    page.close()


def test_a_reload_shows_a_validation_and_its_report_again(page: Page, server: Server) -> None:
    part(page, "Preflight")
    report = page.get_by_role("button", name="Report file", exact=True)
    expect(report).to_be_disabled()
    validate(page, "20")
    expect(page.locator("#job-outcome")).to_contain_text(": 20 trials of")
    assert "job=" in page.url
    page.reload()
    expect(page.locator("#job-outcome")).to_contain_text(": 20 trials of")
    expect(page.get_by_role("tab", name="Error found")).to_be_visible()
    # what came of the job is on show again
    expect(page.locator("#job-outcome")).to_be_visible()
    part(page, "Preflight")
    with page.expect_download() as waiting:
        report.click()
    job = httpx2.get(f"{server.url}/v1/jobs").json()["items"][0]["id"]
    assert saved(waiting.value) == httpx2.get(f"{server.url}/v1/jobs/{job}/result").content
    assert waiting.value.suggested_filename == "paper-grid-same.report.json"
    part(page, "Scenario")
    page.get_by_label("Name", exact=True).fill("edited")
    part(page, "Preflight")
    expect(report).to_be_disabled()
    assert page.url.rpartition("/")[2] == ""


def test_a_link_is_of_the_plan_that_an_edit_overtook(page: Page, server: Server) -> None:
    held: list[Route] = []
    page.route("**/v1/plans", lambda route: held.append(route))
    menu(page, "Copy link")
    page.get_by_label("Name", exact=True).fill("edited meanwhile")
    expect(page.locator("#map-name")).to_have_text("edited meanwhile")
    assert len(held) == 1
    held[0].continue_()
    expect(page.locator("#notice")).to_contain_text("/?plan=")
    link = (page.locator("#notice").text_content() or "").split()[-1]
    found = httpx2.get(f"{server.url}/v1/plans/{link.rpartition('=')[2]}")
    assert found.json()["scenario"]["name"] == "paper-grid-same"
    assert "plan=" not in page.url


@pytest.mark.quick
def test_the_link_is_to_one_plan_until_deleted(visit: Visit, page: Page, server: Server) -> None:
    visit.expect_complaints("404")
    before = len(httpx2.get(f"{server.url}/v1/plans?limit=200").json()["items"])
    # two quick presses
    page.evaluate("for (let k = 0; k < 2; k += 1) document.getElementById('share').click()")
    expect(page.locator("#notice")).to_contain_text("Link copied")
    visit.settle()
    assert len(httpx2.get(f"{server.url}/v1/plans?limit=200").json()["items"]) == before + 1
    gone = plan_id_of(page)
    assert httpx2.delete(f"{server.url}/v1/plans/{gone}").status_code == 204
    expect(page.locator("#notice")).to_be_empty()
    assert copied(page) != gone
    assert stored(page, server)["id"] == plan_id_of(page)
    # one that can't be copied is shown
    page.evaluate("() => { navigator.clipboard.writeText = () => Promise.reject('denied') }")
    menu(page, "Copy link")
    expect(page.locator("#notice")).to_contain_text("Link to this plan: http")


def test_undo_goes_on_where_a_reload_broke_it_off(visit: Visit, page: Page) -> None:
    for radius in ("19", "18"):
        visit.fill("Radius of all", radius)
        # edits of one field that follow each other at once are one step
        page.wait_for_timeout(1100)
    copied(page)
    page.reload()
    visit.verdict("Observable: rank 18 of 18")
    undo = page.get_by_role("button", name="Undo")
    expect(undo).to_have_attribute("aria-disabled", "false")
    undo.click()
    expect(page.get_by_label("Radius of all")).to_have_value("19")
    visit.settle()
    undo.click()
    expect(page.get_by_label("Radius of all")).to_have_value("20")
    visit.settle()
