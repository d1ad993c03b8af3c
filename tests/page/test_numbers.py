"""Numbers of the form at hand: dragged by their labels, stepped by keys, their errors charted."""

import re

import pytest
from playwright.sync_api import Page, Route, expect

from syncplan.terms import TERMS
from tests.page.gestures import box_of, downloaded, handle, part, pull, sheet
from tests.tools.browsing import PHONE, Tabs, Visit, accessibility_faults, visiting
from tests.tools.serving import Server

RANGE = "Range (m)"


def scrub(visit: Visit, label: str, by: float, *, release: bool = True) -> tuple[float, float]:
    """Drag a field by its label, so many pixels to the right; return where the drag ends."""
    # the chart that comes with a plan moves the fields below it
    visit.settle()
    page = visit.page
    place = page.locator("#editor label", has_text=label).first
    place.evaluate("one => one.scrollIntoView({ block: 'center' })")
    box = box_of(place)
    x, y = box["x"] + box["width"] / 4.0, box["y"] + box["height"] / 2.0
    pull(page, (x, y), (x + by, y), release=release)
    return x + by, y


def test_a_number_is_dragged_by_its_label_in_one_step_to_undo(visit: Visit, page: Page) -> None:
    field = page.get_by_label(RANGE, exact=True)
    with page.expect_request("**/previews?quick=true**"):
        x, y = scrub(visit, "Range", 60.0, release=False)
    expect(field).to_have_value("56")
    connected = page.locator("#verdict tr", has_text="Connectivity period")
    expect(connected).to_contain_text("—")
    # a pause: the whole plan follows, and the drag goes on as the same step
    visit.settle()
    expect(page.locator("#verdict tr", has_text="Predicted RMS error")).to_contain_text(" m")
    expect(connected).to_contain_text(" s")
    page.wait_for_timeout(1100)
    page.mouse.move(x + 20.0, y)
    page.mouse.up()
    visit.settle()
    expect(field).to_have_value("58")
    expect(field).not_to_be_focused()
    page.get_by_role("button", name="Undo").click()
    expect(field).to_have_value("50")
    expect(page.locator("#undo")).to_have_attribute("aria-disabled", "true")


def test_a_finger_drags_a_number_and_puts_no_keyboard_up(tabs: Tabs, server: Server) -> None:
    with visiting(tabs, server.url, size=PHONE, touch=True) as visit:
        page = visit.page
        visit.choose("paper-grid-same")
        sheet(page)
        label = page.locator("#editor label", has_text="Bearing sigma")
        label.scroll_into_view_if_needed()
        box = box_of(label)
        finger = page.context.new_cdp_session(page)
        for kind, by in (("touchStart", 0.0), ("touchMove", 20.0), ("touchMove", 40.0)):
            at = {"x": box["x"] + 10.0 + by, "y": box["y"] + box["height"] / 2.0}
            finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [at]})
        finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        field = page.get_by_label("Bearing sigma")
        expect(field).not_to_have_value("0.1")
        expect(field).not_to_be_focused()
        visit.settle()
        expect(page.locator("#editor .trace").get_by_role("img")).to_be_visible()
        assert accessibility_faults(page) == []


def test_shift_drags_ten_times_as_far_and_limits_hold(visit: Visit, page: Page) -> None:
    page.keyboard.down("Shift")
    scrub(visit, "Range", 20.0)
    expect(page.get_by_label(RANGE, exact=True)).to_have_value("70")
    scrub(visit, "Field of view", -4.0)
    view = page.get_by_label("Field of view (°)", exact=True)
    expect(view).to_have_value("320")
    scrub(visit, "Field of view", 200.0)
    expect(view).to_have_value("360")
    scrub(visit, "Least separation", -200.0)
    expect(page.get_by_label("Least separation")).to_have_value("0")
    page.keyboard.up("Shift")
    visit.settle()


def test_a_click_on_a_label_leads_to_a_field_that_arrows_step(visit: Visit, page: Page) -> None:
    for name, before, after in (("Angular rate", "0.2", "0.21"), (RANGE, "50", "51")):
        field = page.get_by_label(name)
        page.locator("label", has_text=name).first.click()
        expect(field).to_be_focused()
        expect(field).to_have_value(before)
        field.press("ArrowUp")
        expect(field).to_have_value(after)
    visit.settle()
    assert accessibility_faults(page) == []


def test_the_worst_error_is_charted_below_the_field_edited_last(visit: Visit, page: Page) -> None:
    chart = page.locator("#editor .trace")
    expect(chart).to_have_count(0)
    visit.stop_time()
    x, y = scrub(visit, "Bearing sigma", 50.0, release=False)
    box = page.locator(".field", has=page.get_by_label("Bearing sigma"))
    # the plan before and the plan at the pause, then some around them
    drawing = box.locator(".trace").get_by_role("img")
    expect(drawing).to_have_accessible_name(re.compile(r"Worst predicted error .* at 0\.1 rad; .*"))
    expect(drawing.locator("circle.now")).to_have_count(1)
    expect(drawing.locator("circle:not(.now)").nth(2)).to_be_attached()
    worst = page.locator("#verdict tr", has_text="Worst error").locator("td")
    shown = float((worst.text_content() or "").split()[1])
    stated = box.locator(".trace strong")
    expect(stated).to_have_text(re.compile(r"^\d+\.\d+ m at 0\.15 rad$"))
    assert float((stated.text_content() or "").split()[0]) == pytest.approx(shown, rel=5e-3)
    page.mouse.move(x + 1.0, y)
    expect(stated).to_contain_text("at 0.151 rad")
    page.mouse.up()
    visit.settle()
    assert accessibility_faults(page) == []
    # by keyboard, too
    page.get_by_label("Boresight (°)", exact=True).press("ArrowUp")
    expect(box.locator(".trace")).to_have_count(0)
    expect(page.locator(".field", has_text="Boresight").locator(".trace")).to_have_count(1)
    visit.fill("Least separation", "12")
    expect(chart).to_have_count(0)


def test_terms_explain_themselves_where_they_stand(visit: Visit, page: Page) -> None:
    part(page, "Verdict")
    note = page.get_by_role("note")
    term = page.locator("#verdict").get_by_role("button", name="Certificate")
    term.click()
    expect(note).to_have_text(TERMS["certificate"].meaning)
    expect(note).to_be_focused()
    assert accessibility_faults(page) == []
    page.keyboard.press("Escape")
    expect(note).to_have_count(0)
    expect(term).to_be_focused()
    # the same button closes it again
    term.press("Enter")
    expect(note).to_be_visible()
    term.click()
    expect(note).to_have_count(0)
    page.locator("#badge").get_by_role("button", name="rank").click()
    expect(note).to_have_text(TERMS["rank"].meaning)
    page.mouse.click(5.0, 400.0)
    expect(note).to_have_count(0)
    part(page, "Scenario")
    field = page.locator(".field", has_text="Desynchronise by")
    field.get_by_role("button", name="What is “desynchronise”?").press("Enter")
    expect(note).to_have_text(TERMS["desynchronisation"].meaning)
    box = box_of(note)
    assert box["x"] >= 0.0
    assert box["x"] + box["width"] <= 1440.0
    assert accessibility_faults(page) == []


def test_flights_that_arrive_close_nothing(visit: Visit, page: Page) -> None:
    flights: list[Route] = []
    flown = "**/v1/previews?*paper=false*"
    page.route(flown, lambda answer: flights.append(answer))
    with page.expect_request(flown):
        page.get_by_label("Duration").fill("150")
    part(page, "Verdict")
    term = page.locator("#verdict").get_by_role("button", name="Certificate")
    term.click()
    note = page.get_by_role("note")
    expect(note).to_be_focused()
    for answer in flights:
        answer.continue_()
    visit.verdict("GO in 31 simulated flights")
    expect(page.locator("#verdict")).to_contain_text("Flown RMS error")
    expect(note).to_be_focused()
    page.keyboard.press("Escape")
    expect(term).to_be_focused()


def test_the_first_visit_is_greeted_once(tabs: Tabs, server: Server) -> None:
    newcomers = Tabs(tabs.browser, greeted=False)
    with visiting(newcomers, server.url, moving=True) as visit:
        page = visit.page
        greeting = page.get_by_role("region", name="Welcome")
        expect(greeting).to_contain_text("know where they are")
        # the example moves for one period
        expect(page.locator("#play")).to_have_text("Pause")
        expect(page.locator("#moment-text")).not_to_have_text("0 s")
        assert accessibility_faults(page) == []
        expect(page.locator("#play")).to_have_text("Play")
        expect(page.locator("#moment")).to_have_value(re.compile(r"^\d{1,2}$"))
        greeting.get_by_role("button", name="Plan your own team").press("Enter")
        expect(page.get_by_role("dialog")).to_contain_text("New team")
        expect(greeting).to_have_count(0)
        page.goto(f"{server.url}/healthz")
        page.evaluate("sessionStorage.clear()")
        page.goto(server.url)
        visit.verdict("Observable")
        visit.settle()
        expect(greeting).to_have_count(0)
        # nothing moves for those who prefer that
        page.emulate_media(reduced_motion="reduce")
        page.goto(f"{server.url}/healthz")
        page.evaluate("localStorage.clear(); sessionStorage.clear()")
        page.goto(server.url)
        expect(greeting).to_be_visible()
        expect(page.locator("#play")).to_have_text("Play")
        page.get_by_label(RANGE, exact=True).fill("51")
        expect(greeting).to_have_count(0)
        visit.settle()
    with visiting(newcomers, server.url, size=PHONE, dark=True) as visit:
        page = visit.page
        expect(greeting := page.get_by_role("region", name="Welcome")).to_be_visible()
        assert accessibility_faults(page) == []
        handle(page, "v2").click()
        expect(greeting).to_have_count(0)


def test_names_are_edited_in_place(visit: Visit, page: Page) -> None:
    name = page.get_by_role("textbox", name="Name of the scenario")
    name.fill("survey of the bay")
    name.press("Enter")
    expect(page.get_by_label("Name", exact=True)).to_have_value("survey of the bay")
    name.fill("nothing")
    name.press("Escape")
    expect(name).to_have_text("survey of the bay")
    handle(page, "v2").dblclick()
    field = page.get_by_label("Its name")
    expect(field).to_be_focused()
    page.keyboard.type("leader")
    page.keyboard.press("Enter")
    expect(handle(page, "leader")).to_be_visible()
    expect(field).to_be_focused()
    visit.settle()
    field.fill("v3")
    field.press("Enter")
    expect(page.locator("#notice")).to_have_text("There is a vehicle v3 already.")
    handle(page, "L1").focus()
    page.keyboard.press("F2")
    page.keyboard.type("mast")
    page.keyboard.press("Enter")
    visit.settle()
    visit.verdict("rank 18 of 18")
    scenario = downloaded(page)
    assert scenario["name"] == "survey of the bay"
    assert list(scenario["landmarks_m"]) == ["mast", "L2"]
    assert scenario["formation"]["names"][:3] == ["v1", "leader", "v3"]
    assert accessibility_faults(page) == []
