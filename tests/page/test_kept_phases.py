"""Phases that no rule gives, refined or of a file: they stay over edits, undo, files and Back."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest
from playwright.sync_api import Page, Route, expect

from syncplan.reports.plan_report import plan_document
from tests.page.gestures import (
    copied,
    download,
    downloaded,
    figures,
    handle,
    part,
    phases,
    plan_id_of,
    refine,
    sidecar_of,
    stored,
)
from tests.tools.api_servers import done
from tests.tools.browsing import Tabs, Visit, visiting
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import FILES, planned
from tests.tools.serving import Server

Tree = dict[str, Any]

ALTERNATE = "paper-grid-alternate"


@pytest.fixture(scope="module")
def refined(server: Server) -> Tree:
    """A refined plan as the service keeps it."""
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        body = (FILES / f"{ALTERNATE}.yaml").read_bytes()
        made = http.post("/v1/plans", content=body, headers={"content-type": "application/yaml"})
        request = {"starts": 1, "seed": 1}
        job = http.post(f"/v1/plans/{made.json()['id']}/refinements", json=request)
        at = job.headers["location"]
        done(http, at)
        plan: Tree = http.get(f"{at}/result").json()
    assert plan["refinement"]["improved"]
    return plan


@pytest.fixture
def at_refined(tabs: Tabs, server: Server, refined: Tree) -> Any:
    """A visit to the refined plan."""
    with visiting(tabs, f"{server.url}/?plan={refined['id']}") as one:
        one.verdict("Observable: rank 18 of 18")
        one.settle()
        expect(phases(one.page)).to_have_text("refined")
        yield one


def error_of(plan: Tree) -> str:
    """The predicted error of a plan as the page shows it."""
    return f"{plan['predicted_rms_m']['overall']:.3g} m"


def predicted(page: Page) -> Any:
    """Where the page shows the predicted error."""
    return page.locator("#verdict tr", has_text="Predicted RMS error")


def phases_of(plan: Tree) -> list[float]:
    """Where the vehicles of a plan begin."""
    return [one["phase_rad"] for one in plan["vehicles"]]


def test_an_edit_that_moves_nothing_keeps_a_refined_plan(
    at_refined: Visit, server: Server, refined: Tree
) -> None:
    page = at_refined.page
    at_refined.fill("Name", "another name", exact=True)
    expect(phases(page)).to_have_text("refined")
    expect(predicted(page)).to_contain_text(error_of(refined))
    assert "plan=" not in page.url
    # half an origin waits for its other half
    part(page, "Preflight")
    page.get_by_label("Latitude of the origin").fill("47.1")
    expect(phases(page)).to_have_text("refined")
    page.get_by_label("Longitude of the origin").fill("8.5")
    at_refined.verdict("Observable: rank 18 of 18")
    at_refined.settle()
    expect(predicted(page)).to_contain_text(error_of(refined))
    archive = download(page, "Export")
    assert "qgc" in archive.suggested_filename
    exported = stored(page, server)
    assert phases_of(exported) == phases_of(refined)
    assert exported["predicted_rms_m"] == refined["predicted_rms_m"]
    assert sidecar_of(archive)["vehicles"]
    handle(page, "v2").press("F2")
    page.keyboard.type("leader")
    page.keyboard.press("Enter")
    expect(handle(page, "leader")).to_be_visible()
    at_refined.settle()
    expect(phases(page)).to_have_text("refined")
    page.locator("summary", has_text="Noise").click()
    page.get_by_label("Bearing sigma").fill("0.02")
    at_refined.fill("Initial position sigma", "3")
    expect(phases(page)).to_have_text("refined")
    expect(predicted(page)).not_to_contain_text(error_of(refined))
    copied(page)
    kept = stored(page, server)
    assert kept["id"] not in (refined["id"], exported["id"])
    assert phases_of(kept) == phases_of(refined)
    assert kept["scenario"]["name"] == "another name"


def test_what_is_put_back_is_the_refined_plan_again(at_refined: Visit, refined: Tree) -> None:
    page = at_refined.page
    page.get_by_label("Duration").press("ControlOrMeta+A")
    page.keyboard.type(f"{refined['scenario']['duration_s']:g}")
    at_refined.settle()
    assert plan_id_of(page) == refined["id"]
    expect(predicted(page)).to_contain_text(error_of(refined))
    handle(page, "v2").click()
    north = page.get_by_label("Centre north")
    before = north.input_value()
    north.fill("1")
    expect(phases(page)).to_contain_text("synchronised")
    north.fill(before)
    expect(phases(page)).to_have_text("refined")
    at_refined.settle()
    assert plan_id_of(page) == refined["id"]


def test_undo_brings_a_refined_plan_and_its_address_back(at_refined: Visit, refined: Tree) -> None:
    page = at_refined.page
    handle(page, "v2").click()
    east = page.get_by_label("Centre east")
    before = float(east.input_value())
    east.fill(str(before + 0.1))
    at_refined.settle()
    # the message goes by itself, the finding stays
    expect(page.locator("#findings")).to_contain_text("Undo brings the refined plan back")
    expect(phases(page)).to_contain_text("synchronised")
    expect(phases(page)).to_contain_text("Undo brings the refined plan back")
    expect(predicted(page)).not_to_contain_text(error_of(refined))
    at_refined.fill("Name", "still reported", exact=True)
    expect(phases(page)).to_contain_text("Undo brings the refined plan back")
    assert "plan=" not in page.url
    for _ in range(2):
        page.get_by_role("button", name="Undo").click()
    at_refined.settle()
    expect(phases(page)).not_to_contain_text("Undo")
    expect(phases(page)).to_have_text("refined")
    expect(predicted(page)).to_contain_text(error_of(refined))
    expect(page.locator("#notice")).to_be_empty()
    figures(page)
    expect(page.get_by_role("tab", name="Before and after")).to_be_visible()
    assert plan_id_of(page) == refined["id"]
    page.get_by_role("button", name="Redo").click()
    expect(phases(page)).to_contain_text("synchronised")
    assert "plan=" not in page.url


def test_a_figure_that_arrives_while_figures_open_is_drawn(at_refined: Visit) -> None:
    page = at_refined.page
    held: dict[str, Route] = {}
    for name in ("comparison", "timeline"):
        page.route(f"**/figures/{name}?*", partial(held.__setitem__, name))
    at_refined.fill("Name", "another name", exact=True)
    with page.expect_request("**/figures/comparison?*"):
        page.get_by_role("button", name="Undo").click()
    with page.expect_request("**/figures/timeline?*"):
        page.get_by_role("button", name="Figures").click()
    held["comparison"].continue_()
    expect(page.get_by_role("tab", name="Before and after")).to_be_visible()
    held["timeline"].continue_()
    page.locator("#panel-plot .main-svg").first.wait_for()


def test_a_plan_file_has_the_phases_that_a_scenario_file_lacks(
    at_refined: Visit, server: Server, refined: Tree, tmp_path: Path
) -> None:
    page = at_refined.page
    downloaded(page)
    expect(page.locator("#notice")).to_contain_text("its phases are computed anew")
    file = tmp_path / "given.plan.json"
    download(page, "Plan file").save_as(file)
    page.get_by_label("Open a file").set_input_files(file)
    expect(phases(page)).to_have_text("from a file")
    expect(predicted(page)).to_contain_text(error_of(refined))
    expect(page.locator("#notice")).to_contain_text("given.plan.json: the plan with its own phases")
    page.get_by_label("Moment in the period").press("ArrowRight")
    expect(page.locator("#moment-text")).not_to_have_text("0 s")
    copied(page)
    assert phases_of(stored(page, server)) == phases_of(refined)
    page.reload()
    expect(phases(page)).to_have_text("as given")
    expect(predicted(page)).to_contain_text(error_of(refined))


@pytest.mark.quick
def test_a_fault_in_a_plan_file_has_a_path(visit: Visit, page: Page, tmp_path: Path) -> None:
    visit.expect_complaints("422")
    file = tmp_path / "bad.plan.json"
    broken = plan_document(planned()).as_json()
    broken["vehicles"][1]["phase_rad"] = "north"
    file.write_text(json.dumps(broken))
    page.get_by_label("Open a file").set_input_files(file)
    expect(page.locator("#notice.bad")).to_contain_text("vehicles[1].phase_rad")
    visit.verdict("Observable: rank 18 of 18")


def test_back_leads_from_a_refined_plan(visit: Visit, page: Page, server: Server) -> None:
    visit.choose(ALTERNATE)
    refine(page)
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator("#job-outcome")).to_contain_text("predicted error")
    refined = plan_id_of(page)
    page.go_back()
    visit.verdict("Not observable: rank 16 of 18")
    assert plan_id_of(page) != refined
    assert "job=" not in page.url
    page.go_forward()
    visit.verdict("Observable: rank 18 of 18")
    assert plan_id_of(page) == refined
    expect(page.locator("#job-outcome")).to_contain_text("predicted error")
    page.reload()
    expect(page.locator("#job-outcome")).to_contain_text("predicted error")
    expect(phases(page)).to_have_text("refined")
    # without its parent it opens as well
    parent = stored(page, server)["parent_id"]
    assert httpx2.delete(f"{server.url}/v1/plans/{parent}").status_code == 204
    visit.expect_complaints("404")
    page.reload()
    visit.verdict("Observable: rank 18 of 18")
    figures(page)
    expect(page.get_by_role("tab", name="Refinement")).to_be_visible()
    expect(page.get_by_role("tab", name="Before and after")).to_be_hidden()
    expect(page.locator("#notice.bad")).to_have_count(0)
