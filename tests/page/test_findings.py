"""One verdict: command line, service, page and sidecars give the same findings, word for word."""

import json
import re
from pathlib import Path
from typing import Any

import httpx2
import pytest
from playwright.sync_api import Page, expect

from tests.page.gestures import (
    box_of,
    copied,
    download,
    drag,
    drawn,
    handle,
    menu,
    opened,
    part,
    sidecar_of,
)
from tests.tools.browsing import DESKTOP, PHONE, Tabs, Visit, visiting
from tests.tools.scenarios import document
from tests.tools.serving import Server

TROUBLED = document(
    name="troubled",
    formation={"centers_m": [[0.0, 0.0], [70.0, 0.0], [70.0, 10.0]]},
    landmarks_m={"mast": [20.5, 0.0], "gate": [60.0, 60.0]},
    keep_out_m=[[[85.0, -5.0], [95.0, -5.0], [95.0, 5.0], [85.0, 5.0]]],
    min_separation_m=65.0,
)

UNCERTAIN = document(
    name="uncertain",
    landmarks_m=[[35.0, 45.0], [35.0, -45.0]],
    initial_sigma={"position_m": 15.0, "heading_rad": 0.3},
    filter={"kind": "ekf"},
)


@pytest.mark.parametrize(
    ("scenario", "codes"),
    [
        (TROUBLED, {"unobservable", "vehicles-too-close", "landmark-too-close", "in-keep-out"}),
        (UNCERTAIN, {"error-above-prediction"}),
    ],
    ids=lambda value: value["name"] if isinstance(value, dict) else "",
)
def test_findings_are_the_same_word_for_word_everywhere(
    scenario: Any, codes: set[str], visit: Visit, server: Server, run: Any, tmp_path: Path
) -> None:
    page = visit.page
    file, plan = tmp_path / "some.json", tmp_path / "plan.json"
    file.write_text(json.dumps(scenario))
    assert run("plan", str(file), "-o", str(plan))[0] == 0
    planned = json.loads(plan.read_text())["verdict"]
    assert codes <= {one["code"] for one in planned["findings"]}
    _, table, _ = run("plan", str(plan), "--format", "table")
    on_one_line = " ".join(table.split())
    for one in planned["findings"]:
        assert " ".join(one["message"].split()) in on_one_line
    # the service
    made = httpx2.post(f"{server.url}/v1/plans", json=scenario, timeout=60.0)
    assert made.status_code == 201, made.text
    assert made.json()["verdict"] == planned
    # the page
    opened(page, scenario)
    visit.verdict("✓ GO" if planned["go"] else "✗ NO-GO")
    visit.settle()
    expect(page.locator("#findings .finding")).to_have_count(len(planned["findings"]))
    for one in planned["findings"]:
        found = page.locator(f"#findings .finding[data-code={one['code']}]")
        expect(found.filter(has_text=one["message"])).to_have_count(1)
    part(page, "Preflight")
    page.get_by_label("Format", exact=True).select_option("csv")
    if not planned["go"]:
        page.get_by_label("Export although the verdict is NO-GO").check()
    assert sidecar_of(download(page, "Export"))["verdict"] == planned


FENCED = document(
    name="fenced",
    formation={"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
    landmarks_m=[[35.0, 45.0], [35.0, -45.0]],
    area_m=[[-30.0, -30.0], [100.0, -30.0], [100.0, 30.0], [-30.0, 30.0]],
)


def test_a_go_with_warnings_counts_them(visit: Visit, page: Page) -> None:
    badge = page.locator("#badge")
    expect(badge).not_to_have_class(re.compile("warned"))
    part(page, "Preflight")
    tabs = box_of(page.locator("#parts"))
    expect(page.get_by_label("Altitude above ground")).to_have_attribute(
        "placeholder", "50 if empty"
    )
    visit.fill("Altitude above ground", "60")
    visit.verdict("⚠\ufe0e GO")
    expect(badge).to_contain_text("1 warning")
    expect(badge).to_have_class(re.compile("good warned flown"))
    expect(page.locator("#findings .warning")).to_contain_text("they never see each other")
    assert box_of(page.locator("#parts")) == tabs


@pytest.mark.parametrize("size", [DESKTOP, (768, 1024), PHONE])
def test_another_verdict_leaves_the_map_where_it_is(
    tabs: Tabs, server: Server, size: tuple[int, int]
) -> None:
    with visiting(tabs, server.url, size=size) as visit:
        visit.verdict("GO in 31 simulated flights")
        place = box_of(visit.page.locator("#map"))
        visit.choose("paper-grid-alternate")
        visit.verdict("✗ NO-GO")
        assert box_of(visit.page.locator("#map")) == place


def test_one_error_is_the_figure_of_merit_everywhere(visit: Visit, page: Page) -> None:
    visit.settle()
    badge = re.search(r"know where they are to ([\d.]+ m)", page.locator("#badge").inner_text())
    assert badge
    part(page, "Verdict")
    row = page.locator("#verdict tr", has_text="Worst error").locator("td")
    expect(row).to_contain_text(f"{badge[1]}")
    copied(page)
    menu(page, "Kept work")
    kept = page.get_by_role("dialog").get_by_role("row").nth(1)
    expect(kept).to_contain_text(badge[1])


def test_what_breaks_a_rule_is_marked_and_a_click_goes_there(visit: Visit, page: Page) -> None:
    opened(page, FENCED)
    visit.verdict("GO")
    tabs = box_of(page.locator("#parts"))
    assert [circle["rank"] for circle in drawn(page, "circle") if circle["rank"] == 0] == []
    drag(page, "v2", (90.0, 0.0))
    visit.verdict("✗ NO-GO")
    visit.settle()
    broken = [circle["body"] for circle in drawn(page, "circle") if circle.get("rank") == 0]
    assert broken == ["v2"]
    (edge,) = drawn(page, "edge")
    assert edge["at"] == [[100.0, -30.0], [100.0, 30.0]]
    # however many findings there are, what is below them stays where it is
    assert box_of(page.locator("#parts")) == tabs
    page.locator("#map").click(position={"x": 500.0, "y": 60.0})
    expect(handle(page, "v2")).to_have_attribute("aria-pressed", "false")
    part(page, "Verdict")
    page.locator("#findings .stop").get_by_role("button", name="the circle of v2 leaves").click()
    expect(handle(page, "v2")).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_label("Its name")).to_have_value("v2")
    drag(page, "v2", (-90.0, 0.0))
    visit.settle()
    assert drawn(page, "edge") == []
