"""The animation of one period, and the files to take along."""

import json
import math
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.page.gestures import copied, download, saved, sidecar_of, stored, unzipped
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.serving import Server

SAME = "paper-grid-same"
ALTERNATE = "paper-grid-alternate"


def test_the_animation_moves_vehicles_sightings_and_a_line_in_the_timeline(page: Page) -> None:
    play = page.get_by_role("button", name="Play")
    play.click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    expect(page.locator("#moment-text")).not_to_have_text("0 s")
    page.get_by_role("button", name="Pause").click()
    slider = page.get_by_label("Moment in the period")
    traces = "JSON.stringify(document.getElementById('map-plot').data.map(t => [t.x, t.y]))"
    lines = (
        "document.getElementById('panel-plot').layout.shapes"
        ".filter(s => s.name === 'moment').map(s => s.x0)"
    )
    for moment in (0, 20, 45):
        before = page.evaluate(traces)
        slider.fill(str(moment))
        page.wait_for_function(f"before => {traces} !== before", arg=before)
        at = 31.41592653589793 * moment / 60
        page.wait_for_function(f"at => {lines}.every(x => Math.abs(x - at) < 1e-6)", arg=at)
        assert page.evaluate(lines) == [pytest.approx(at)]
    page.get_by_label("Radius of all").fill("21")
    expect(page.locator("#moment-text")).to_have_text("0 s")


def test_time_0_is_the_plans_own_figure_and_the_legend_stays_as_it_is_while_time_goes_on(
    visit: Visit, page: Page
) -> None:
    visit.choose("paper-grid-alternate")
    uids = "document.getElementById('map-plot').data.map(t => t.uid).sort()"
    entries = page.locator("#map-plot .legendtext")
    slider = page.get_by_label("Moment in the period")
    plan = page.evaluate(uids)
    drawn = entries.all_text_contents()
    assert {"motion-0", "motion-1", "link-rank-2"} <= set(plan)
    slider.fill("30")
    expect(entries.filter(has_text="in contact: link, rank 2 of 3")).to_have_count(1)
    assert "motion-0" not in page.evaluate(uids)
    reported = entries.all_text_contents()
    marks = "[...document.querySelectorAll('#map-plot .layers path')].map(p => p.outerHTML)"
    drawn_marks = page.evaluate(marks)
    weak = page.locator("#map-plot .traces").filter(has_text="rank 2 of 3").locator(".js-line")
    expect(weak).to_have_css("stroke", "rgb(213, 94, 0)")
    for moment in ("15", "22", "40"):
        slider.fill(moment)
        page.wait_for_timeout(200)
        assert entries.all_text_contents() == reported
        assert page.evaluate(marks) == drawn_marks
    slider.focus()
    page.keyboard.press("Home")
    expect(entries).to_have_text(drawn)
    assert page.evaluate(uids) == plan
    # the same after playing, and for an edit that can't be planned
    page.get_by_role("button", name="Play").click()
    expect(entries).to_have_text(reported)
    page.get_by_role("button", name="Pause").click()
    visit.expect_complaints("422")
    page.get_by_label("Radius of all").fill("-1")
    expect(entries).to_have_text(drawn)
    visit.settle()
    assert page.evaluate(uids) == plan


def test_playing_can_be_paused_however_fast_it_was_begun_and_shows_the_newest_plan(
    visit: Visit, page: Page
) -> None:
    page.locator("#play").dblclick()
    expect(page.locator("#play")).to_have_text("Pause")
    page.locator("#play").click()
    reported = page.locator("#moment-text").text_content()
    page.wait_for_timeout(500)
    expect(page.locator("#moment-text")).to_have_text(reported or "")
    page.get_by_label("Radius of all").fill("19")
    expect(page.locator("#moment-text")).to_have_text("0 s")
    # before the whole plan has followed the quick one
    page.locator("#play").click()
    visit.settle()
    page.wait_for_timeout(800)
    expect(page.locator("#play")).to_have_text("Pause")
    uids = "document.getElementById('map-plot').data.map(t => t.uid)"
    assert {"vehicles", "sight-link-certified", "circles-ccw"} <= set(page.evaluate(uids))
    circles = "document.getElementById('map-plot').data.find(t => t.uid === 'circles-ccw').x[0]"
    assert page.evaluate(circles) == pytest.approx(19.0)


def test_what_a_chosen_sensor_covers_is_shaded_and_holds_what_it_sees_at_each_moment(
    visit: Visit, page: Page, server: Server
) -> None:
    visit.choose("mixed-radii-camera")
    expect(page.locator(".sight")).to_be_hidden()
    expect(page.locator("#sight-help")).to_be_hidden()
    page.get_by_label("Vehicle or landmark").select_option("vehicle 1")
    expect(page.locator(".sight")).to_be_visible()
    expect(page.locator("#sight-help")).to_be_visible()
    copied(page)
    plan = stored(page, server)
    other = next(one for one in plan["vehicles"] if one["name"] == "v1")
    directed = [one for link in plan["links"] for one in link["directed"]]
    seen = next(one for one in directed if (one["from"], one["to"]) == ("v2", "v1"))
    sense = 1.0 if other["direction"] == "ccw" else -1.0
    period = plan["period_s"]
    inside = """([x, y]) => {
        const { xaxis, yaxis } = document.getElementById('map-plot')._fullLayout;
        const at = new DOMPoint(xaxis.d2p(x), yaxis.d2p(y));
        return document.querySelector('.sight path').isPointInFill(at);
    }"""
    found = []
    for k in range(0, 60, 4):
        page.get_by_label("Moment in the period").fill(str(k))
        expect(page.locator("#moment-text")).to_have_text(f"{float(f'{period * k / 60:.4g}'):g} s")
        phase = other["phase_rad"] + sense * 2.0 * math.pi * k / 60
        x = other["center_m"][0] + other["radius_m"] * math.cos(phase)
        y = other["center_m"][1] + other["radius_m"] * math.sin(phase)
        time = period * k / 60
        expected = any(
            start <= time + turn <= end for start, end in seen["windows_s"] for turn in (0, period)
        )
        assert page.evaluate(inside, [x, y]) == expected, k
        found.append(expected)
    assert {True, False} == set(found)


def test_plans_and_exports_are_saved_and_an_export_says_what_it_lacks(
    visit: Visit, page: Page, server: Server
) -> None:
    plan = json.loads(saved(download(page, "Plan")))
    assert plan == stored(page, server)
    page.get_by_label("Format", exact=True).select_option("csv")
    archive = download(page, "Export")
    assert archive.suggested_filename == f"{SAME}-csv.zip"
    assert sorted(Path(name).suffix for name in unzipped(archive)) == [".csv", ".json"]
    visit.expect_complaints("422")
    page.get_by_label("Format", exact=True).select_option("qgc")
    page.get_by_role("button", name="Export").click()
    expect(page.locator("#download-fault")).to_contain_text("geo_origin")
    page.locator("summary", has_text="Place and time").click()
    page.get_by_label("Latitude of the origin").fill("47.4")
    page.get_by_label("Longitude of the origin").fill("8.5")
    visit.settle()
    assert sum(name.endswith(".plan") for name in unzipped(download(page, "Export"))) == 6
    reported = page.locator("#export-notes")
    expect(reported).to_contain_text("set CIRCLE_RATE to 11.4592 (deg/s)")
    assert accessibility_faults(page) == []
    page.get_by_label("For", exact=True).select_option("PX4 multicopter")
    files = unzipped(download(page, "Export"))
    first = next(files[name] for name in files if name.endswith(".plan"))
    assert json.loads(first)["mission"]["firmwareType"] == 12
    expect(reported).not_to_contain_text("CIRCLE_RATE")
    page.get_by_label("Format", exact=True).select_option("kml")
    expect(page.get_by_label("For", exact=True)).to_be_hidden()


def test_a_plan_that_is_no_go_is_exported_only_when_forced(visit: Visit, page: Page) -> None:
    visit.expect_complaints("409")
    force = page.get_by_label("Export although the verdict is NO-GO")
    expect(force).to_be_hidden()
    visit.choose(ALTERNATE)
    visit.verdict("✗ NO-GO")
    page.get_by_label("Format", exact=True).select_option("csv")
    page.get_by_role("button", name="Export").click()
    expect(page.locator("#download-fault")).to_contain_text("NO-GO: 2 reasons; unobservable")
    reported = page.locator("#export-findings .remark").all_inner_texts()
    force.check()
    findings = sidecar_of(download(page, "Export"))["verdict"]["findings"]
    for one in findings:
        expect(page.locator("#verdict")).to_contain_text(one["message"])
    # what goes with the files was on show before they were asked for, word for word
    assert reported == [f"Stop: {one['message']}" for one in findings]
    assert accessibility_faults(page) == []
    visit.choose(SAME)
    visit.verdict("✓ GO")
    expect(page.locator("#export-findings")).to_have_text(
        "No stop and no warning goes with the files."
    )
    expect(force).to_be_hidden()
