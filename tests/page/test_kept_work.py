"""Plans, jobs and recordings that the service keeps, listed on the page."""

import re
from pathlib import Path
from typing import Any

import httpx2
import pytest
from playwright.sync_api import Page, Route, expect

from tests.page.gestures import box_of, copied, drawn, menu, part, plan_id_of, stored, validate
from tests.tools.browsing import DESKTOP, PHONE, Tabs, Visit, accessibility_faults, visiting
from tests.tools.kept_databases import restore_sqlite
from tests.tools.processes import wait_until
from tests.tools.record_examples import RECORDED
from tests.tools.recordings import zipped
from tests.tools.scenarios import document
from tests.tools.serving import Server, open_server

SMALL = zipped({f"hall/{name}": text.encode() for name, text in RECORDED.items()})
AREA = [[-30.0, -50.0], [100.0, -50.0], [100.0, 50.0], [-30.0, 50.0]]


def kept(page: Page, kind: str) -> Any:
    """Open the list of a kind of work."""
    if page.get_by_role("dialog").count() == 0:
        menu(page, "Kept work")
    part(page, kind)
    return page.get_by_role("dialog")


def test_plans_are_listed_and_dealt_with(visit: Visit, page: Page, server: Server) -> None:
    team = document(name="kept pair", landmarks_m=[[35.0, 40.0], [35.0, -40.0]])
    made = httpx2.post(f"{server.url}/v1/plans", json=team).json()
    dialogue = kept(page, "Plans")
    row = dialogue.get_by_role("row", name="kept pair").first
    expect(row).to_contain_text("GO")
    assert accessibility_faults(page) == []
    page.once("dialog", lambda asked: asked.accept("renamed pair"))
    row.get_by_role("button", name="Rename").click()
    renamed = dialogue.get_by_role("row", name="renamed pair").first
    expect(renamed).to_be_visible()
    found = httpx2.get(f"{server.url}/v1/plans/{made['id']}").json()
    assert found["scenario"]["name"] == "renamed pair"
    renamed.get_by_role("button", name="Compare").click()
    expect(page.locator("#map")).to_contain_text("Dashed: renamed pair, worst error")
    assert len(drawn(page, "beside")) == 2
    kept(page, "Plans").get_by_role("button", name="renamed pair").first.click()
    visit.verdict("rank 6 of 6")
    assert plan_id_of(page) == made["id"]
    assert drawn(page, "beside") == []
    row = kept(page, "Plans").get_by_role("row", name="renamed pair")
    expect(row).to_have_count(1)
    page.once("dialog", lambda asked: asked.accept())
    row.get_by_role("button", name="Delete").click()
    expect(row).to_have_count(0)
    assert httpx2.get(f"{server.url}/v1/plans/{made['id']}").status_code == 404


def test_earlier_plans_of_a_name_are_folded_below_the_newest(page: Page, server: Server) -> None:
    teams = [
        document(name=name, landmarks_m=[[35.0, 40.0], [35.0, -y]], area_m=AREA)
        for name, y in [("folded", 40.0), ("folded", 30.0), ("alone", 40.0), ("folded", 35.0)]
    ]
    plans = [httpx2.post(f"{server.url}/v1/plans", json=team).json() for team in teams]
    dialogue = kept(page, "Plans")
    expect(dialogue.get_by_role("columnheader")).to_have_text(
        ["Name", "Verdict", "Worst error", "Vehicles", "Date"]
    )
    rows = dialogue.get_by_role("row", name="folded")
    expect(rows).to_have_count(1)
    worst = max(plans[3]["predicted_rms_m"]["vehicles"].values())
    expect(rows.get_by_role("cell")).to_contain_text(["GO", f"{worst:.3g} m", "2"])
    map_of_row = rows.locator("svg[aria-hidden=true]")
    assert map_of_row.evaluate("svg => [svg.clientWidth, svg.clientHeight]") == [64, 48]
    expect(map_of_row.locator("circle.ring")).to_have_count(2)
    expect(map_of_row.locator("circle.landmark")).to_have_count(2)
    expect(map_of_row.locator("polygon")).to_have_count(1)
    expect(dialogue.get_by_role("row", name="alone").locator("button")).to_have_count(4)
    earlier = rows.get_by_role("button", name="2 earlier")
    expect(earlier).to_have_attribute("aria-expanded", "false")
    earlier.press("Enter")
    expect(earlier).to_have_attribute("aria-expanded", "true")
    expect(rows).to_have_count(3)
    assert accessibility_faults(page) == []
    rows.nth(2).get_by_role("button", name="folded").click()
    expect(dialogue).to_have_count(0)
    assert plan_id_of(page) == plans[0]["id"]
    for plan in plans:
        httpx2.delete(f"{server.url}/v1/plans/{plan['id']}")


def worst_error(plan: Any) -> str:
    """The worst vehicle's predicted error, as the page writes it."""
    return f"{max(plan['predicted_rms_m']['vehicles'].values()):.3g} m"


@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_a_comparison_states_both_errors_until_it_is_ended(
    visit: Visit, page: Page, server: Server, size: tuple[int, int]
) -> None:
    team = document(name="other", landmarks_m=[[35.0, 40.0], [35.0, -40.0]])
    other = httpx2.post(f"{server.url}/v1/plans", json=team).json()
    copied(page)
    here = stored(page, server)
    page.set_viewport_size({"width": size[0], "height": size[1]})
    row = kept(page, "Plans").get_by_role("row", name="other")
    row.get_by_role("button", name="Compare").click()
    chip = page.get_by_text(
        f"Dashed: other, worst error {worst_error(other)} of 2 vehicles; here worst error"
    )
    expect(chip).to_contain_text(f"here worst error {worst_error(here)} of 6")
    # the button that opened it is gone with the dialogue
    expect(page.get_by_role("button", name="End comparison")).to_be_focused()
    expect(page.locator("#notice")).not_to_contain_text("Dashed")
    assert len(drawn(page, "beside")) == 2
    assert accessibility_faults(page) == []
    # what is here follows edits
    page.set_viewport_size({"width": DESKTOP[0], "height": DESKTOP[1]})
    visit.fill("Bearing sigma", "0.2")
    expect(chip).not_to_contain_text(worst_error(here))
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.get_by_role("button", name="End comparison").click()
    expect(chip).to_have_count(0)
    expect(page.get_by_role("button", name="More", exact=True)).to_be_focused()
    assert drawn(page, "beside") == []
    httpx2.delete(f"{server.url}/v1/plans/{other['id']}")


def test_usage_is_shown_with_its_limits(visit: Visit, page: Page, server: Server) -> None:
    made = httpx2.post(f"{server.url}/v1/plans", json=document()).json()
    used = kept(page, "Plans").locator("#usage")
    expect(used).to_have_text(
        re.compile(
            r"^Kept: [0-9.e-]+ MiB of 2048 MiB\. "
            r"Computing time of jobs in 24 hours: [0-9.e-]+ h of 720 h\.$"
        )
    )
    mebibytes = sum(httpx2.get(f"{server.url}/v1/usage").json()["bytes"].values()) / 2**20
    stated = float((used.text_content() or "").split()[1])
    # three digits are shown
    assert stated == pytest.approx(mebibytes, rel=6e-3)
    httpx2.delete(f"{server.url}/v1/plans/{made['id']}")


def test_the_kinds_of_kept_work_stay_where_they_are_as_a_list_arrives(
    visit: Visit, page: Page
) -> None:
    copied(page)
    jobs, places = page.get_by_role("tab", name="Jobs"), []

    def seen_before(route: Route) -> None:
        places.append(box_of(jobs))
        route.continue_()

    page.route("**/v1/plans?limit=20", seen_before)
    menu(page, "Kept work")
    expect(page.get_by_role("dialog").get_by_role("row")).not_to_have_count(0)
    assert places == [box_of(jobs)]


def test_jobs_are_listed_opened_and_deleted(visit: Visit, page: Page, server: Server) -> None:
    validate(page, "10")
    expect(page.locator("#job-outcome")).to_contain_text(": 10 trials of")
    job = httpx2.get(f"{server.url}/v1/jobs").json()["items"][0]["id"]
    row = kept(page, "Jobs").get_by_role("row", name="Validation").first
    expect(row).to_contain_text("succeeded")
    assert f"job={job}" in (row.get_by_role("link", name="Open").get_attribute("href") or "")
    row.get_by_role("link", name="Open").click()
    expect(page.locator("#job-outcome")).to_contain_text(": 10 trials of")
    page.once("dialog", lambda asked: asked.accept())
    row = kept(page, "Jobs").get_by_role("row", name="Validation").first
    row.get_by_role("button", name="Delete").click()
    expect(page.get_by_role("dialog").locator("tbody, p").first).to_be_visible()
    wait_until(lambda: httpx2.get(f"{server.url}/v1/jobs/{job}").status_code == 404)


def test_what_was_kept_before_verdicts_rested_on_flights_is_shown(
    tabs: Tabs, tmp_path: Path
) -> None:
    restore_sqlite("before-flights", tmp_path / "data" / "syncplan.db")
    settings = {"SYNCPLAN_KEEP_JOBS_S": "1e9"}
    shown = {
        "refinement": "predicted error, all",
        "validation": ": 10 trials of",
        "flight": ": 4 flights of",
    }
    with (
        open_server(tmp_path, "--no-worker", **settings) as server,
        visiting(tabs, server.url) as visit,
    ):
        page = visit.page
        plans = httpx2.get(f"{server.url}/v1/plans").json()["items"]
        for plan in plans:
            page.goto(f"{server.url}/?plan={plan['id']}")
            visit.verdict("✓ GO on paper" if plan["go"] else "✗ NO-GO")
            page.get_by_role("button", name="Error ellipses").click()
            expect(page.get_by_label("Size of the error ellipses")).to_be_visible()
        jobs = httpx2.get(f"{server.url}/v1/jobs?state=succeeded").json()["items"]
        for job in jobs:
            if job["kind"] in shown:
                page.goto(f"{server.url}/?job={job['id']}")
                expect(page.locator("#job-outcome")).to_contain_text(shown[job["kind"]])
        assert {plan["go"] for plan in plans} == {True}
        assert shown.keys() <= {job["kind"] for job in jobs}


def test_a_recording_opened_as_a_file_is_kept_and_listed(page: Page, server: Server) -> None:
    accepted = page.get_by_label("Open a file").get_attribute("accept") or ""
    assert {".zip", ".tar", ".tgz", ".gz", ".kmz"} <= set(accepted.split(","))
    archive: Any = {"name": "hall.zip", "mimeType": "application/zip", "buffer": SMALL}
    page.get_by_label("Open a file").set_input_files(archive)
    row = page.get_by_role("dialog", name="Kept work").get_by_role("row").nth(1)
    expect(row).to_contain_text("hall")
    tab = page.get_by_role("tab", name="Recordings")
    expect(tab).to_have_attribute("aria-selected", "true")
    expect(page.locator("#notice")).to_have_text("hall.zip is kept.")
    for recording in httpx2.get(f"{server.url}/v1/recordings").json()["items"]:
        httpx2.delete(f"{server.url}/v1/recordings/{recording['id']}")


def test_an_archive_that_is_no_recording_is_refused(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    archive: Any = {"name": "photos.tar.gz", "mimeType": "application/gzip", "buffer": b"none"}
    page.get_by_label("Open a file").set_input_files(archive)
    expect(page.locator("#notice.bad")).to_contain_text("neither a zip nor a tar archive")
    expect(page.get_by_role("dialog")).to_have_count(0)


def test_a_recording_is_sent_replayed_and_deleted(visit: Visit, page: Page, server: Server) -> None:
    dialogue = kept(page, "Recordings")
    archive: Any = {"name": "hall.zip", "mimeType": "application/zip", "buffer": SMALL}
    page.get_by_label("Send a recording").set_input_files(archive)
    row = dialogue.get_by_role("row").nth(1)
    expect(row).to_be_visible()
    assert accessibility_faults(page) == []
    row.get_by_role("button", name="Replay").click()
    expect(dialogue).to_contain_text("RMS over all robots")
    expect(dialogue.get_by_role("link", name="Report")).to_be_visible()
    before = drawn(page, "circle")
    dialogue.get_by_role("button", name="Show on the map").click()
    expect(page.locator("#map")).to_contain_text("dashed: estimated, RMS error")
    assert drawn(page, "circle") == []
    job = httpx2.get(f"{server.url}/v1/jobs").json()["items"][0]
    paths = httpx2.get(f"{server.url}{job['result']}").json()["paths"]
    ends = [[robot["true_x_m"][-1], robot["true_y_m"][-1]] for robot in paths["vehicles"]]
    assert [line["at"][-1] for line in drawn(page, "path")] == ends
    page.get_by_label("Moment in the period").fill("600")
    assert [mark["at"] for mark in drawn(page, "vehicle")] == ends
    assert accessibility_faults(page) == []
    page.get_by_role("button", name="End replay").click()
    assert drawn(page, "circle") == before
    kept(page, "Recordings")
    page.once("dialog", lambda asked: asked.accept())
    row.get_by_role("button", name="Delete").click()
    expect(dialogue).to_contain_text("None is kept.")
    assert httpx2.get(f"{server.url}/v1/recordings").json()["items"] == []
