"""The animation of one period, and the files to take along."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from playwright.sync_api import Page, expect

from tests.page.gestures import (
    box_of,
    copied,
    download,
    drawn,
    figures,
    part,
    place_on_earth,
    saved,
    sidecar_of,
    stored,
    unzipped,
)
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.serving import Server

SAME = "paper-grid-same"
ALTERNATE = "paper-grid-alternate"


def test_playing_moves_the_timeline_and_shows_the_newest_plan(visit: Visit, page: Page) -> None:
    figures(page)
    page.locator("#play").click()
    expect(page.locator("#play")).to_have_text("Pause")
    expect(page.locator("#moment-text")).not_to_have_text("0 s")
    page.locator("#play").click()
    reported = page.locator("#moment-text").text_content()
    page.wait_for_timeout(500)
    expect(page.locator("#moment-text")).to_have_text(reported or "")
    lines = (
        "document.getElementById('panel-plot').layout.shapes"
        ".filter(s => s.name === 'moment').map(s => s.x0)"
    )
    for moment in (0, 200, 450):
        page.get_by_label("Moment in the period").fill(str(moment))
        at = 31.41592653589793 * moment / 600
        page.wait_for_function(f"at => {lines}.every(x => Math.abs(x - at) < 1e-6)", arg=at)
        assert page.evaluate(lines) == [pytest.approx(at)]
    page.get_by_label("Radius of all").fill("19")
    expect(page.locator("#moment-text")).to_have_text("0 s")
    # before the whole plan has followed the quick one
    page.locator("#play").click()
    visit.settle()
    page.wait_for_timeout(800)
    expect(page.locator("#play")).to_have_text("Pause")
    ring = np.array(drawn(page, "circle")[0]["at"])
    assert float(np.ptp(ring[:, 0])) == pytest.approx(38.0)


def test_buttons_of_the_play_bar_stay_where_they_are(visit: Visit, page: Page) -> None:
    bar = page.locator(".player > :is(button, input)")
    places = [box_of(control) for control in bar.all()]
    page.locator("#play").click()
    expect(page.locator("#play")).to_have_text("Pause")
    page.locator("#ellipses").click()
    expect(page.locator("#magnified")).to_be_visible()
    assert [box_of(control) for control in bar.all()] == places


def test_vehicles_and_sight_follow_the_plan(visit: Visit, page: Page, server: Server) -> None:
    visit.choose("mixed-radii-camera")
    assert drawn(page, "sight") == []
    page.get_by_label("Vehicle or landmark").select_option("vehicle 1")
    assert len(drawn(page, "sight")) == 1
    copied(page)
    plan = stored(page, server)
    directed = [one for link in plan["links"] for one in link["directed"]]
    seen = next(one for one in directed if (one["from"], one["to"]) == ("v2", "v1"))
    period = plan["period_s"]
    found = []
    for moment in (*range(0, 600, 40), 130, 444):
        page.get_by_label("Moment in the period").fill(str(moment))
        time = period * moment / 600
        expect(page.locator("#moment-text")).to_have_text(f"{float(f'{time:.3g}'):g} s")
        placed = {one["body"]: one["at"] for one in drawn(page, "vehicle")}
        assert placed.keys() == {one["name"] for one in plan["vehicles"]}
        for one in plan["vehicles"]:
            turned = 2.0 * math.pi * time / period * (1 if one["direction"] == "ccw" else -1)
            angle = one["phase_rad"] + turned
            x, y = one["center_m"]
            wanted = (x + one["radius_m"] * math.cos(angle), y + one["radius_m"] * math.sin(angle))
            assert placed[one["name"]] == pytest.approx(wanted, abs=1e-6)
        expected = any(
            start <= time + turn <= end for start, end in seen["windows_s"] for turn in (0, period)
        )
        (shape,) = drawn(page, "sight")
        assert shapely.Polygon(shape["at"][0]).contains(shapely.Point(placed["v1"])) == expected
        found.append(expected)
    assert {True, False} == set(found)


def test_contacts_all_around_are_those_of_the_plan(page: Page, server: Server) -> None:
    copied(page)
    plan = stored(page, server)
    slider, period = page.get_by_label("Moment in the period"), plan["period_s"]
    links = [*plan["links"], *plan["landmark_links"]]
    for moment in range(0, 600, 37):
        slider.fill(str(moment))
        time = period * moment / 600
        expected = sum(
            any(start <= time + turn <= end for start, end in one["windows_s"])
            for one in links
            for turn in (0.0, period)
        )
        assert len(drawn(page, "sighting")) == expected


def test_an_export_says_what_it_lacks(visit: Visit, page: Page, server: Server) -> None:
    plan = json.loads(saved(download(page, "Plan file")))
    assert plan == stored(page, server)
    part(page, "Preflight")
    page.get_by_label("Format", exact=True).select_option("csv")
    archive = download(page, "Export")
    assert archive.suggested_filename == f"{SAME}-csv.zip"
    assert sorted(Path(name).suffix for name in unzipped(archive)) == [".csv", ".json"]
    # what a format needs is asked for beforehand
    page.get_by_label("Format", exact=True).select_option("qgc")
    button = page.locator("#before-flight").get_by_role("button", name="Export")
    expect(button).to_be_disabled()
    place = box_of(button)
    place_on_earth(page)
    expect(button).to_be_enabled()
    # it does not go away under the pointer as a place is typed
    assert box_of(button) == place
    visit.settle()
    assert sum(name.endswith(".plan") for name in unzipped(download(page, "Export"))) == 6
    reported = page.locator("#export-notes")
    expect(reported).to_contain_text("set CIRCLE_RATE to -11.4592 (deg/s) on v1, v2")
    assert accessibility_faults(page) == []
    page.get_by_label("For", exact=True).select_option("PX4 multicopter")
    files = unzipped(download(page, "Export"))
    first = next(files[name] for name in files if name.endswith(".plan"))
    assert json.loads(first)["mission"]["firmwareType"] == 12
    expect(reported).not_to_contain_text("CIRCLE_RATE")
    page.get_by_label("Format", exact=True).select_option("kml")
    expect(page.get_by_label("For", exact=True)).to_be_disabled()


def test_a_plan_that_is_no_go_is_exported_only_when_forced(visit: Visit, page: Page) -> None:
    visit.expect_complaints("409")
    force = page.get_by_label("Export although the verdict is NO-GO")
    expect(force).to_be_hidden()
    visit.choose(ALTERNATE)
    visit.verdict("✗ NO-GO")
    part(page, "Preflight")
    page.get_by_label("Format", exact=True).select_option("csv")
    page.locator("#before-flight").get_by_role("button", name="Export").click()
    expect(page.locator("#download-fault")).to_contain_text("NO-GO: 2 reasons; unobservable")
    expect(page.locator("#export-count")).to_contain_text("2 stops")
    reported = page.locator("#export-findings .remark").all_inner_texts()
    force.check()
    findings = sidecar_of(download(page, "Export"))["verdict"]["findings"]
    # what goes with the files was on show before they were asked for, word for word
    assert reported == [f"Stop: {one['message']}" for one in findings]
    assert accessibility_faults(page) == []
    visit.choose(SAME)
    visit.verdict("✓ GO")
    expect(page.locator("#export-findings")).to_be_empty()
    expect(page.locator("#export-count")).to_have_text(
        "Findings: 0 stops, 0 warnings, all stated in the files."
    )
    expect(force).to_be_hidden()
