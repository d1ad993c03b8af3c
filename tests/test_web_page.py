"""The web page in Chromium: what a planner does there, by mouse, by keyboard and on a phone."""

import io
import json
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from playwright.sync_api import Browser, Download, Locator, Page, expect

from syncplan.exports import FORMATS
from tests.api_servers import key_of, serving
from tests.browsing import DESKTOP, PHONE, Visit, accessibility_faults, chromium, visiting
from tests.scenarios import BAD_FILES, FILES, document
from tests.serving import Server, running, settings_of

pytestmark = pytest.mark.slow

ALTERNATE = "paper-grid-alternate"
SAME = "paper-grid-same"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser."""
    with chromium() as one:
        yield one


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that asks nobody for a key, its filter's kernels compiled."""
    folder = tmp_path_factory.mktemp("page")
    one = Server(folder / "log", port=None, **settings_of(folder / "data"))
    with running(one):
        yield one


@pytest.fixture
def visit(browser: Browser, server: Server) -> Iterator[Visit]:
    """A visit to the page, with its first plan made."""
    with visiting(browser, server.url) as one:
        one.verdict("Observable: rank 18 of 18")
        yield one


def handle(page: Page, name: str) -> Locator:
    """What moves a circle or a landmark."""
    return page.locator(f'#handles button[title="{name}"]')


def drag(page: Page, name: str, by: tuple[float, float]) -> None:
    """Drag a circle or a landmark by so many pixels."""
    box = handle(page, name).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for share in (0.25, 0.5, 0.75, 1.0):
        page.mouse.move(x + share * by[0], y + share * by[1])
    page.mouse.up()


def saved(download: Download) -> bytes:
    """The content of what was downloaded."""
    return Path(download.path()).read_bytes()


def plan_id_of(page: Page) -> str:
    """The identifier of the plan in the page's address."""
    found = re.search(r"[?&]plan=([0-9a-f-]{36})", page.url)
    assert found, page.url
    return found[1]


# --- what holds of the page ---------------------------------------------------------------------


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_page_has_no_accessibility_faults(
    browser: Browser, server: Server, size: tuple[int, int], dark: bool
) -> None:
    with visiting(browser, server.url, size=size, dark=dark) as visit:
        visit.choose(ALTERNATE)
        visit.page.locator("summary").first.click()
        handle(visit.page, "v2").click()
        assert accessibility_faults(visit.page) == []
        for name in ("Singular values", "Predicted error"):
            visit.page.get_by_role("tab", name=name).click()
            assert accessibility_faults(visit.page) == []


def test_the_page_fits_a_phone(browser: Browser, server: Server) -> None:
    with visiting(browser, server.url, size=PHONE, touch=True) as visit:
        visit.choose(ALTERNATE)
        wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert visit.page.evaluate(wide) <= 0
        handle(visit.page, "v2").tap()
        expect(visit.page.get_by_label("Centre east")).to_have_value("70")


def test_nothing_comes_from_elsewhere_and_no_style_or_script_is_inline(server: Server) -> None:
    answer = httpx2.get(server.url)
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy
    assert " style=" not in answer.text
    assert "<style" not in answer.text
    assert re.findall(r'(?:src|href)="(?:https?:)?//', answer.text) == []


def test_a_violation_of_the_policy_would_be_noticed(browser: Browser, server: Server) -> None:
    with visiting(browser, server.url) as visit:
        visit.verdict("Observable")
        visit.page.evaluate("document.body.setAttribute('style', 'color: red')")
        visit.page.evaluate("fetch('http://127.0.0.2:9/').catch(() => 0)")
        assert any("Content Security Policy" in one for one in visit.unexpected)
        assert len(visit.unexpected) >= 2
        visit.expect_complaints("Content Security Policy", "127.0.0.2")


def test_assets_are_compressed_once_and_not_sent_again(server: Server) -> None:
    with httpx2.Client(base_url=server.url) as http:
        script = http.get("/assets/plotly.min.js")
        assert script.headers["content-encoding"] == "gzip"
        assert int(script.headers["content-length"]) < 1_600_000
        tag = {"if-none-match": script.headers["etag"]}
        assert http.get("/assets/plotly.min.js", headers=tag).status_code == 304
        plain = http.get("/assets/main.js", headers={"accept-encoding": "gzip;q=0"})
        assert "content-encoding" not in plain.headers
        assert plain.headers["content-type"] == "text/javascript; charset=utf-8"
        for name in ("../main.py", "..%2fmain.py", "examples/../../main.py", "examples", "none.js"):
            missing = http.get(f"/assets/{name}")
            assert missing.status_code == 404, name
            assert missing.headers["content-type"] == "application/problem+json"


def test_the_page_offers_every_format_of_exports_and_only_examples_there_are(
    visit: Visit, server: Server
) -> None:
    def values(chosen: str) -> list[str]:
        return [
            one
            for one in visit.page.eval_on_selector_all(chosen, "a => a.map(o => o.value)")
            if one
        ]

    assert values("#format option") == list(FORMATS)
    for name in values("#examples option"):
        answer = httpx2.get(f"{server.url}/assets/examples/{name}.yaml")
        assert answer.content == (FILES / f"{name}.yaml").read_bytes()


# --- editing ------------------------------------------------------------------------------------


def test_a_lost_motion_is_drawn_and_its_cure_told_and_cures_it(
    visit: Visit,
) -> None:
    page = visit.page
    visit.choose(ALTERNATE)
    visit.verdict("Not observable: rank 16 of 18")
    expect(page.locator(".motion").first).to_contain_text("stretch of v1-v2")
    expect(page.locator(".motion").first).to_contain_text("Cure: let the line of sight")
    arrows = "document.getElementById('map-plot').data.filter(t => /motion/.test(t.uid)).length"
    assert page.evaluate(arrows) > 0
    drag(page, "v2", (14.0, 22.0))
    visit.settle()
    visit.verdict("Not observable: rank 17 of 18")
    expect(page.get_by_label("Centre east")).not_to_have_value("70")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Not observable: rank 16 of 18")
    expect(page.get_by_label("Centre east")).to_have_value("70")
    page.get_by_role("button", name="Redo").click()
    visit.verdict("Not observable: rank 17 of 18")
    page.get_by_label("Desynchronise by").fill("0.2")
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator(".motion")).to_have_count(0)


def test_a_landmark_moves_by_mouse_and_the_view_stays_while_it_does(visit: Visit) -> None:
    page = visit.page
    before = page.evaluate("document.getElementById('map-plot').layout.xaxis.range")
    box = handle(page, "L1").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 15, box["y"] + 15)
    page.mouse.down()
    page.mouse.move(box["x"] + 35, box["y"] - 25)
    page.mouse.move(box["x"] + 45, box["y"] - 45)
    visit.settle()
    assert page.evaluate("document.getElementById('map-plot').layout.xaxis.range") == before
    page.mouse.up()
    visit.settle()
    assert float(page.get_by_label("East (m)", exact=True).input_value()) > 190.0
    assert float(page.get_by_label("North (m)", exact=True).input_value()) > 0.0


def test_everything_can_be_done_by_keyboard(visit: Visit) -> None:
    page = visit.page
    visit.choose(ALTERNATE)
    handle(page, "v2").focus()
    page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("ArrowRight")
    visit.verdict("Observable: rank 18 of 18")
    page.keyboard.press("Enter")
    assert float(page.get_by_label("Centre north").input_value()) > 0.0
    page.get_by_role("tab", name="Contacts").focus()
    page.keyboard.press("ArrowRight")
    expect(page.get_by_role("tab", name="Singular values")).to_be_focused()
    expect(page.locator("#panel-text")).not_to_be_empty()
    page.keyboard.press("End")
    expect(page.get_by_role("tab", name="Predicted error")).to_have_attribute(
        "aria-selected", "true"
    )
    page.get_by_label("Moment in the period").focus()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#moment-text")).not_to_have_text("0 s")


def test_senses_radii_ranges_and_fields_of_view_of_one_vehicle_and_of_all(visit: Visit) -> None:
    page = visit.page
    visit.choose(ALTERNATE)
    page.get_by_label("Turn", exact=True).select_option("ccw")
    visit.verdict("Observable: rank 18 of 18")
    page.get_by_label("Vehicle or landmark").select_option("vehicle 1")
    page.get_by_label("Turns").select_option("cw")
    visit.settle()
    expect(page.get_by_label("Turn", exact=True)).to_have_value("")
    page.get_by_label("Radius (m)", exact=True).fill("17")
    expect(page.get_by_label("Radius of all")).to_have_attribute("placeholder", "differs")
    page.get_by_label("Its field of view").fill("200")
    page.get_by_label("Range (m)", exact=True).fill("60")
    visit.settle()
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Scenario").click()
    scenario = json.loads(saved(waiting.value))
    assert scenario["orbit"]["radius_m"] == [20.0, 17, 20.0, 20.0, 20.0, 20.0]
    assert scenario["orbit"]["direction"] == ["ccw", "cw", "ccw", "ccw", "ccw", "ccw"]
    assert [one["fov_deg"] for one in scenario["sensor"]] == [360, 200, 360, 360, 360, 360]
    assert {one["range_m"] for one in scenario["sensor"]} == {60}


def test_vehicles_and_landmarks_come_and_go(visit: Visit) -> None:
    page = visit.page
    page.get_by_role("button", name="Add vehicle").click()
    visit.verdict("rank 21 of 21")
    page.get_by_role("button", name="Add landmark").click()
    expect(handle(page, "L3")).to_be_visible()
    handle(page, "v7").click()
    page.get_by_role("button", name="Remove").click()
    visit.verdict("rank 18 of 18")
    handle(page, "v4").click()
    page.get_by_role("button", name="Remove").click()
    visit.verdict("of 15")
    expect(page.locator("#handles button.vehicle")).to_have_count(5)


def test_a_fault_is_told_next_to_its_field(visit: Visit) -> None:
    visit.expect_complaints("422")
    page = visit.page
    visit.choose(SAME)
    field = page.get_by_label("Range (m)", exact=True)
    field.fill("-5")
    expect(field).to_have_attribute("aria-invalid", "true")
    told = page.locator("#field-sensor-range-m-fault")
    expect(told).to_contain_text("must be greater than 0")
    expect(told).to_have_attribute("role", "alert")
    assert accessibility_faults(page) == []
    field.fill("50")
    expect(told).to_be_empty()
    visit.verdict("Observable: rank 18 of 18")


@pytest.mark.parametrize("name", ["misspelt-key", "not-yaml", "nan-rate"])
def test_a_bad_file_is_refused_in_words(visit: Visit, name: str) -> None:
    visit.expect_complaints("422")
    page = visit.page
    page.get_by_label("Open a file").set_input_files(BAD_FILES / f"{name}.yaml")
    told = page.locator("#notice.bad")
    expect(told).not_to_be_empty()
    assert "Traceback" not in (told.text_content() or "")
    visit.verdict("Observable: rank 18 of 18")


def test_a_file_of_a_scenario_or_of_a_plan_opens(visit: Visit, server: Server) -> None:
    page = visit.page
    page.get_by_label("Open a file").set_input_files(FILES / "four-ground-robots.yaml")
    visit.verdict("Observable: rank 12 of 12")
    body = (FILES / f"{ALTERNATE}.yaml").read_bytes()
    yaml = {"content-type": "application/yaml"}
    plan = httpx2.post(f"{server.url}/v1/plans", content=body, headers=yaml).content
    upload: Any = {"name": "plan.json", "mimeType": "application/json", "buffer": plan}
    page.get_by_label("Open a file").set_input_files(upload)
    visit.verdict("Not observable: rank 16 of 18")


def test_a_click_by_an_unsteady_hand_chooses_and_moves_nothing(visit: Visit) -> None:
    page = visit.page
    drag(page, "v2", (2.0, -1.0))
    expect(page.get_by_label("Centre east")).to_have_value("70")
    expect(page.get_by_role("button", name="Undo")).to_have_attribute("aria-disabled", "true")


def test_a_field_that_is_typed_anew_moves_nothing_meanwhile(visit: Visit) -> None:
    page = visit.page
    handle(page, "v4").click()
    page.get_by_label("Centre east").fill("")
    page.wait_for_timeout(600)
    visit.verdict("Observable: rank 18 of 18")
    page.get_by_label("Centre east").fill("141")
    visit.settle()
    expect(handle(page, "v4")).to_have_attribute("aria-label", "Circle of v4, centre at 141, 70 m")


def test_what_is_typed_at_one_go_is_one_step_to_undo(visit: Visit) -> None:
    page = visit.page
    # circles of 1 m are out of each other's range
    visit.expect_complaints("422")
    field = page.get_by_label("Radius of all")
    field.focus()
    page.keyboard.press("Control+A")
    page.keyboard.type("18.5")
    visit.settle()
    page.get_by_role("button", name="Undo").click()
    expect(field).to_have_value("20")
    expect(page.get_by_role("button", name="Undo")).to_have_attribute("aria-disabled", "true")


def opened(page: Page, scenario: dict[str, Any]) -> None:
    """Open a scenario as a file."""
    buffer = json.dumps(scenario).encode()
    upload: Any = {"name": "some.json", "mimeType": "application/json", "buffer": buffer}
    page.get_by_label("Open a file").set_input_files(upload)
    expect(page.locator("#map-name")).to_have_text(scenario["name"])


def downloaded(page: Page) -> dict[str, Any]:
    """The scenario as the page saves it."""
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Scenario").click()
    found: dict[str, Any] = json.loads(saved(waiting.value))
    return found


def test_vehicles_named_by_numbers_keep_their_order(visit: Visit) -> None:
    page = visit.page
    scenario = document(
        name="numbers",
        orbit={"radius_m": [20.0, 15.0], "angular_rate_rad_s": 0.2, "direction": "ccw"},
        formation={"centers_m": {"10": [0.0, 0.0], "2": [65.0, 0.0]}},
    )
    opened(page, scenario)
    page.get_by_label("Least separation").fill("5")
    visit.settle()
    found = downloaded(page)
    assert found["formation"]["names"] == ["10", "2"]
    assert found["formation"]["centers_m"] == [[0, 0], [65, 0]]
    assert found["orbit"]["radius_m"] == [20, 15]


def test_a_window_that_was_given_stays_and_one_of_a_period_follows_it(visit: Visit) -> None:
    page = visit.page
    for window, kept in ((60.0, 60), (None, None)):
        scenario = document(name=f"window {window}")
        if window is not None:
            scenario["window_s"] = window
        opened(page, scenario)
        page.get_by_label("Angular rate").fill("0.25")
        visit.settle()
        assert downloaded(page).get("window_s") == kept


def test_undo_goes_back_over_an_opened_file_with_the_fields_it_needs(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Open a file").set_input_files(FILES / "four-ground-robots.yaml")
    visit.verdict("rank 12 of 12")
    expect(page.get_by_label("Speed (m/s)")).to_have_value("0.4")
    page.get_by_role("button", name="Undo").click()
    visit.verdict("Observable: rank 18 of 18")
    expect(page.get_by_label("Angular rate")).to_have_value("0.2")
    expect(page.get_by_label("Speed (m/s)")).to_have_count(0)


# --- jobs ---------------------------------------------------------------------------------------


def test_refine_compare_validate_and_open_the_link_again(
    visit: Visit, browser: Browser, server: Server
) -> None:
    page = visit.page
    visit.choose(ALTERNATE)
    page.get_by_label("Time limit (s)").fill("5")
    page.get_by_role("button", name="Refine").click()
    expect(page.locator("#job-text")).to_contain_text(re.compile(r"of \d+ starts"))
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator(".outcome")).to_contain_text("Predicted error")
    expect(page.locator(".outcome")).to_contain_text("Rank 16 → 18")
    expect(page.get_by_role("tab", name="Before and after")).to_have_attribute(
        "aria-selected", "true"
    )
    assert accessibility_faults(page) == []
    page.get_by_label("Trials").fill("40")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator(".outcome")).to_contain_text("RMS over the second half of 40 trials")
    for name in ("Errors over time", "Consistency", "Error found"):
        page.get_by_role("tab", name=name).click()
        assert page.evaluate("document.getElementById('panel-plot').data.length") > 0
    assert accessibility_faults(page) == []
    plan = httpx2.get(f"{server.url}/v1/plans/{plan_id_of(page)}").json()
    page.get_by_role("button", name="Copy link").click()
    expect(page.locator("#notice")).to_contain_text(plan["id"])
    assert page.evaluate("navigator.clipboard.readText()") == page.url
    with visiting(browser, page.url) as again:
        again.verdict("Observable: rank 18 of 18")
        error = f"{plan['predicted_rms_m']['overall']:.4g}".rstrip("0")
        expect(again.page.locator("#verdict")).to_contain_text(f"{error} m")
        expect(again.page.get_by_role("tab", name="Before and after")).to_be_visible()
        assert plan_id_of(again.page) == plan["id"]


def test_a_job_can_be_cancelled(visit: Visit, server: Server) -> None:
    page = visit.page
    page.get_by_label("Trials").fill("100000")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#job-text")).to_contain_text("of 100000 trials")
    expect(page.get_by_role("button", name="Refine")).to_be_disabled()
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("#notice")).to_have_text("Validation cancelled.")
    expect(page.get_by_role("button", name="Validate")).to_be_enabled()
    found = httpx2.get(f"{server.url}/v1/jobs").json()["items"][0]
    assert found["state"] == "cancelled"


def test_wrong_numbers_of_a_job_are_told_next_to_their_fields(visit: Visit) -> None:
    page = visit.page
    visit.expect_complaints("422")
    page.get_by_label("Trials").fill("0")
    page.get_by_role("button", name="Validate").click()
    told = page.locator("#validate-trials-fault")
    expect(told).to_have_text("must be greater than or equal to 1")
    expect(page.get_by_label("Trials")).to_have_attribute("aria-invalid", "true")
    page.get_by_label("Time limit (s)").fill("")
    page.get_by_role("button", name="Refine").click()
    expect(page.locator("#refine-time-fault")).to_contain_text("is missing")
    expect(page.get_by_label("Time limit (s)")).to_be_focused()
    assert accessibility_faults(page) == []


def test_a_plan_that_was_deleted_is_stored_anew(visit: Visit, server: Server) -> None:
    page = visit.page
    visit.expect_complaints("404")
    page.get_by_label("Trials").fill("10")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator(".outcome")).to_contain_text("of 10 trials")
    httpx2.delete(f"{server.url}/v1/plans/{plan_id_of(page)}")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#work")).to_contain_text("was deleted from the service")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator(".outcome")).to_contain_text("of 10 trials")


def test_what_is_edited_while_a_job_runs_stays(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Trials").fill("4000")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#job-text")).to_contain_text("of 4000 trials")
    page.get_by_label("Radius of all").fill("21")
    visit.settle()
    assert "job=" in page.url
    assert "plan=" not in page.url
    expect(page.locator(".outcome")).to_contain_text("before your edits", timeout=60_000)
    expect(page.get_by_label("Radius of all")).to_have_value("21")
    assert page.url.rpartition("/")[2] == ""
    visit.choose("four-ground-robots")
    expect(page.locator(".outcome")).to_be_empty()


def test_a_server_that_dies_in_mid_job_and_returns_costs_nothing_but_time(
    browser: Browser, tmp_path: Path
) -> None:
    given = settings_of(tmp_path / "data")
    first = Server(tmp_path / "log", port=None, **given)
    with running(first), visiting(browser, first.url) as visit:
        page = visit.page
        visit.expect_complaints("net::ERR", "503")
        visit.verdict("Observable")
        page.get_by_label("Trials").fill("9000")
        page.get_by_role("button", name="Validate").click()
        expect(page.locator("progress")).not_to_have_attribute("value", "0", timeout=60_000)
        first.kill()
        expect(page.locator("#job-text")).to_contain_text("can't be reached")
        with running(Server(tmp_path / "log", port=first.port, **given)):
            expect(page.locator("#job-text")).to_contain_text("Validation running", timeout=60_000)
            expect(page.locator(".outcome")).to_contain_text("of 9000 trials", timeout=120_000)


def test_a_reload_goes_on_following_the_job(visit: Visit) -> None:
    page = visit.page
    page.get_by_label("Trials").fill("6000")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#job-text")).to_contain_text("of 6000 trials")
    page.reload()
    expect(page.locator(".outcome")).to_contain_text("of 6000 trials", timeout=60_000)


# --- the rest -----------------------------------------------------------------------------------


def test_the_animation_moves_vehicles_sightings_and_a_line_in_the_timeline(visit: Visit) -> None:
    page = visit.page
    play = page.get_by_role("button", name="Play")
    play.click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    expect(page.locator("#moment-text")).not_to_have_text("0 s")
    page.get_by_role("button", name="Pause").click()
    slider = page.get_by_label("Moment in the period")
    shown = {}
    for moment in (0, 20, 45):
        slider.fill(str(moment))
        page.wait_for_timeout(200)
        traces = page.evaluate(
            "JSON.stringify(document.getElementById('map-plot').data.map(t => [t.x, t.y]))"
        )
        lines = page.evaluate(
            "document.getElementById('panel-plot').layout.shapes"
            ".filter(s => s.name === 'moment').map(s => s.x0)"
        )
        assert lines == [pytest.approx(31.41592653589793 * moment / 60)]
        shown[moment] = traces
    assert len(set(shown.values())) == 3
    page.get_by_label("Radius of all").fill("21")
    expect(page.locator("#moment-text")).to_have_text("0 s")


def test_playing_can_be_paused_however_fast_it_was_begun_and_shows_the_newest_plan(
    visit: Visit,
) -> None:
    page = visit.page
    page.locator("#play").dblclick()
    expect(page.locator("#play")).to_have_text("Pause")
    page.locator("#play").click()
    told = page.locator("#moment-text").text_content()
    page.wait_for_timeout(500)
    expect(page.locator("#moment-text")).to_have_text(told or "")
    page.get_by_label("Radius of all").fill("19")
    expect(page.locator("#moment-text")).to_have_text("0 s")
    # before the whole plan has followed the quick one
    page.locator("#play").click()
    visit.settle()
    page.wait_for_timeout(800)
    expect(page.locator("#play")).to_have_text("Pause")
    uids = "document.getElementById('map-plot').data.map(t => t.uid)"
    assert {"vehicles", "sightings", "circles-ccw"} <= set(page.evaluate(uids))
    circles = "document.getElementById('map-plot').data.find(t => t.uid === 'circles-ccw').x[0]"
    assert page.evaluate(circles) == pytest.approx(19.0)


def test_plans_and_exports_are_saved_and_an_export_says_what_it_lacks(
    visit: Visit, server: Server
) -> None:
    page = visit.page
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Plan").click()
    plan = json.loads(saved(waiting.value))
    assert plan == httpx2.get(f"{server.url}/v1/plans/{plan_id_of(page)}").json()
    page.get_by_label("Format", exact=True).select_option("csv")
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Export").click()
    assert waiting.value.suggested_filename == f"{SAME}-csv.zip"
    names = zipfile.ZipFile(io.BytesIO(saved(waiting.value))).namelist()
    assert sorted(Path(name).suffix for name in names) == [".csv", ".json"]
    visit.expect_complaints("422")
    page.get_by_label("Format", exact=True).select_option("qgc")
    page.get_by_role("button", name="Export").click()
    expect(page.locator("#download-fault")).to_contain_text("geo_origin")
    page.locator("summary", has_text="Place and time").click()
    page.get_by_label("Latitude of the origin").fill("47.4")
    page.get_by_label("Longitude of the origin").fill("8.5")
    visit.settle()
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Export").click()
    names = zipfile.ZipFile(io.BytesIO(saved(waiting.value))).namelist()
    assert sum(name.endswith(".plan") for name in names) == 6


def test_a_service_with_keys_asks_for_one(browser: Browser, tmp_path: Path) -> None:
    with (
        serving(tmp_path, "ann") as server,
        visiting(browser, server.url) as visit,
    ):
        page = visit.page
        visit.expect_complaints("401")
        expect(page.get_by_label("API key")).to_be_focused()
        assert accessibility_faults(page) == []
        page.get_by_label("API key").fill("wrong")
        page.keyboard.press("Enter")
        expect(page.locator("#key-fault")).to_contain_text("not known")
        page.get_by_label("API key").fill(key_of("ann"))
        page.keyboard.press("Enter")
        visit.verdict("Observable: rank 18 of 18")
        expect(page.locator("#key-form")).to_be_hidden()
