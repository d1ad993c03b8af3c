"""A team designed from a brief on the page: the form over the map, the front, what opens of it."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from syncplan.scenario.bounded_yaml import load_yaml
from syncplan.scenario.brief import brief_of
from tests.page.gestures import click, downloaded, opened, part, sheet, take
from tests.tools.briefs import FIELD, brief, within
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

SPARSE = {**FIELD["sensor"], "sample_time_s": 1.0}
"""Few sightings, so that a search is soon done."""
CORNERS = [[-20.0, -30.0], [170.0, -30.0], [170.0, 100.0], [60.0, 100.0], [-20.0, 60.0]]
"""An area about the first example."""


def _text(page: Page) -> Locator:
    """The brief as text, unfolded."""
    part(page, "Design")
    if page.locator("#brief-text:not([open])").count():
        page.get_by_text("As YAML").click()
    text = page.get_by_label("Brief (YAML or JSON)")
    # what writes it is loaded when it is unfolded
    expect(text).not_to_have_value("")
    return text


def _asked(page: Page) -> Any:
    """What the text says."""
    return load_yaml(_text(page).input_value())


def _handed_in(page: Page, text: str) -> None:
    _text(page).fill(text)
    page.get_by_role("button", name="Design", exact=True).click()


def _brief(**changes: Any) -> str:
    return brief(sensor=SPARSE, **changes).model_dump_json(exclude_none=True)


def _field(page: Page, label: str) -> Locator:
    """A field of the form."""
    return page.locator("#design").get_by_label(label, exact=True)


def _fault(page: Page, key: str) -> Locator:
    """What is said to be wrong with a key, at its field."""
    return page.locator(f"[id='design-{key}-fault']")


def _all_within(scenario: Any, corners: list[list[float]]) -> bool:
    """Whether all circles of a scenario lie within an area, a hair apart."""
    formation, radius = scenario["formation"]["centers_m"], scenario["orbit"]["radius_m"]
    turn = np.linspace(0.0, 2.0 * np.pi, 360)
    ring = (1.0 - 1e-4) * np.column_stack([np.cos(turn), np.sin(turn)])
    centers = np.array(formation)
    radii = np.broadcast_to(np.array(radius), len(centers))
    points = (centers[:, None] + radii[:, None, None] * ring).reshape(-1, 2)
    return bool(within(np.array(corners), points).all())


def test_an_area_drawn_on_the_map_leads_to_teams_within_it(visit: Visit, page: Page) -> None:
    part(page, "Design")
    design = page.get_by_role("button", name="Design", exact=True)
    expect(page.get_by_text("Draw an area first (tool Area).")).to_be_visible()
    expect(design).to_have_attribute("aria-disabled", "true")
    take(page, "Area")
    for x, y in [*CORNERS, CORNERS[0]]:
        click(page, x, y)
        page.wait_for_timeout(300)
    # what was drawn is selected, which shows its fields
    part(page, "Design")
    expect(page.get_by_text("Area of 5 corners, as drawn on the map.")).to_be_visible()
    _field(page, "Error of the worst vehicle (m)").focus()
    page.keyboard.press("Control+a")
    page.keyboard.type("4")
    _field(page, "Largest number of vehicles").focus()
    page.keyboard.press("Control+a")
    page.keyboard.type("3")
    _field(page, "Effort").focus()
    page.keyboard.type("quick")
    design.focus()
    page.keyboard.press("Enter")
    best = page.get_by_role("button", name=re.compile("Open the (winner|best found)"))
    best.wait_for()
    teams = page.get_by_role("region", name="Teams found").get_by_role("button")
    assert teams.count() > 1
    assert accessibility_faults(page) == []
    best.click()
    expect(page.locator("#notice")).to_contain_text("the plan with its own phases")
    visit.verdict("Observable: rank")
    scenario = downloaded(page)
    assert np.allclose(scenario["area_m"], CORNERS, atol=1.0)
    assert _all_within(scenario, scenario["area_m"])
    # it stays beside what was opened of it, over the same field
    expect(page.get_by_text("Area of 5 corners, as drawn on the map.")).to_be_visible()
    expect(teams.first).to_be_visible()


def test_a_scenario_s_field_and_values_are_those_of_the_brief(visit: Visit, page: Page) -> None:
    keep_out = [[[80.0, 20.0], [90.0, 20.0], [90.0, 40.0]]]
    area = [[-150.0, -150.0], [350.0, -150.0], [350.0, 350.0], [-150.0, 350.0]]
    opened(
        page,
        document(
            name="wide",
            area_m=area,
            keep_out_m=keep_out,
            wind={"sigma_mps": 0.5},
            min_separation_m=0.0,
        ),
    )
    part(page, "Design")
    stated = "Area of 4 corners and 1 keep-out, as drawn on the map."
    expect(page.get_by_text(stated)).to_be_visible()
    asked = _asked(page)
    assert asked["area_m"] == area
    assert asked["keep_out_m"] == keep_out
    assert asked["wind"]["sigma_mps"] == 0.5
    assert asked["min_separation_m"] == 0
    assert brief_of(asked).sensor.range_m == float(
        _field(page, "Range of the sensor (m)").input_value()
    )
    # a brief with a field of its own keeps it, until the map's is taken
    page.get_by_label("Example brief").select_option("multirotors-over-a-field")
    expect(
        page.get_by_text("Area of 4 corners and 1 keep-out, as the brief states.")
    ).to_be_visible()
    page.get_by_role("button", name="Take the area of the map").click()
    expect(page.get_by_text(stated)).to_be_visible()
    assert _asked(page)["area_m"] == area
    page.get_by_label("Example brief").select_option("The scenario on the map")
    # until the brief is changed, it is that of the scenario on show, and its field afterwards too
    part(page, "Scenario")
    visit.fill("Range (m)", "77", exact=True)
    part(page, "Design")
    expect(_field(page, "Range of the sensor (m)")).to_have_value("77")
    _field(page, "Range of the sensor (m)").fill("66")
    visit.choose("paper-grid-same")
    expect(page.get_by_text("Draw an area first (tool Area).")).to_be_visible()
    assert _asked(page)["sensor"]["range_m"] == 66
    page.get_by_label("Example brief").select_option("The scenario on the map")
    expect(_field(page, "Range of the sensor (m)")).to_have_value("50")


def test_the_text_and_the_form_are_of_one_brief(visit: Visit, page: Page) -> None:
    text = _text(page)
    text.fill(_brief(seed=7, landmarks={"max": 1, "on_edge": True}))
    expect(page.get_by_text("Area of 4 corners, as the brief states.")).to_be_visible()
    expect(_field(page, "Swath (m)")).to_have_value("50")
    expect(_field(page, "Landmarks")).to_have_value("on_edge")
    _field(page, "Smallest radius it can fly (m)").fill("12")
    _field(page, "Speed of a vehicle (m/s)").fill("3, 6")
    _field(page, "Losses withstood").select_option("1")
    _field(page, "Largest bank angle of a coordinated turn (°)").fill("30")
    changed = brief_of(_asked(page))
    assert changed.vehicle.model_dump(exclude_none=True) == {
        "speed_mps": (3.0, 6.0),
        "min_radius_m": 12.0,
        "bank_deg": 30.0,
    }
    # keys that the form lacks are kept, and one that is emptied is left out
    assert (changed.seed, changed.need.losses, changed.landmarks.on_edge) == (7, 1, True)
    _field(page, "Largest bank angle of a coordinated turn (°)").fill("")
    assert brief_of(_asked(page)).vehicle.bank_deg is None
    _field(page, "Purpose").select_option("Visit points")
    expect(_field(page, "Swath (m)")).to_be_hidden()
    _field(page, "Points to visit (m)").fill("40, 40; [120, 60]")
    _field(page, "Landmarks").select_option("Where they are already")
    expect(_field(page, "Present landmarks (m)")).to_have_value("190, 0; 190, 70")
    changed = brief_of(_asked(page))
    assert changed.purpose.visit_m == [(40.0, 40.0), (120.0, 60.0)]
    assert changed.landmarks.given == [(190.0, 0.0), (190.0, 70.0)]
    assert changed.purpose.cover is None
    # while the text can't be read, it is not lost to the form
    text.fill("need: [1")
    expect(page.locator("#brief-fault")).to_contain_text("(1:")
    expect(_field(page, "Range of the sensor (m)")).to_be_disabled()
    text.fill("need: {worst_rms_m: 3}\nteam: &team {max: 4}\n# of mine\n")
    expect(_field(page, "Error of the worst vehicle (m)")).to_have_value("3")
    expect(text).to_have_value(re.compile("of mine"))
    expect(page.locator("#brief-fault")).to_be_empty()


@pytest.mark.parametrize("unfolded", [False, True], ids=["form", "text"])
def test_faults_of_a_brief_are_shown_at_its_fields(
    visit: Visit, page: Page, unfolded: bool
) -> None:
    visit.expect_complaints("422")
    text = _text(page)
    area = [[0, 0], [200, 0], [200, 120], [0, 120]]
    text.fill(json.dumps({**json.loads(_brief()), "area_m": area, "prefer": {"vehicle": -1}}))
    if not unfolded:
        page.get_by_text("As YAML").click()
    _field(page, "Share of the area").fill("2")
    _field(page, "Speed of a vehicle (m/s)").fill("5, 3")
    _field(page, "Error of the worst vehicle (m)").fill("")
    page.get_by_role("button", name="Design", exact=True).click()
    expect(_fault(page, "purpose.cover.share")).to_contain_text("must be at most 1")
    expect(_fault(page, "need.worst_rms_m")).to_contain_text("is missing")
    expect(_field(page, "Share of the area")).to_be_focused()
    expect(page.locator("#design-form > .fault").last).to_contain_text("prefer.vehicle: must be")
    assert accessibility_faults(page) == []
    _field(page, "Share of the area").fill("0.5")
    _field(page, "Error of the worst vehicle (m)").fill("2")
    _field(page, "Purpose").select_option("Visit points")
    page.get_by_role("button", name="Design", exact=True).click()
    points = _fault(page, "purpose.visit_m")
    expect(points).to_contain_text("is empty")
    _field(page, "Points to visit (m)").fill("40, 40, 50")
    page.get_by_role("button", name="Design", exact=True).click()
    expect(points).to_contain_text("purpose.visit_m[1][1]: is missing")


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_the_form_is_accessible_with_all_its_kinds(
    tabs: Tabs, server: Server, size: tuple[int, int]
) -> None:
    with visiting(tabs, server.url, size=size) as visit:
        page = visit.page
        visit.verdict("Observable: rank 18 of 18")
        sheet(page)
        _text(page)
        for label in ("Purpose", "Landmarks"):
            choice = page.get_by_label(label, exact=True)
            for kind in choice.locator("option").all_text_contents():
                choice.select_option(kind)
                assert faults_by_day_and_night(page) == []
        wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.evaluate(wide) <= 0


def test_a_design_shows_its_front_and_opens_any_team(visit: Visit, page: Page) -> None:
    _handed_in(page, _brief())
    panel = page.locator("#design")
    expect(panel.locator("#design-job-text")).to_contain_text(
        re.compile(r"of 10 searches; searching")
    )
    expect(panel.locator(".badge")).to_contain_text("Met: need 2 m", timeout=180_000)
    assert accessibility_faults(page) == []
    panel.get_by_role("button", name=re.compile("3 vehicles and 2 landmarks")).click()
    expect(page.locator("#handles .handle")).to_have_count(5)
    visit.verdict("Observable: rank 9 of 9")
    # the front stays beside what was opened from it, also over a reload, with its brief
    panel.get_by_role("button", name="Open the winner").click()
    visit.verdict("Observable: rank 6 of 6")
    page.reload()
    expect(panel.locator(".badge")).to_contain_text("Met: need 2 m")
    visit.verdict("Observable: rank 6 of 6")
    expect(page.get_by_text("Area of 4 corners, as drawn on the map.")).to_be_visible()
    expect(_field(page, "Share of the area")).to_have_value("0.6")
    assert brief_of(_asked(page)) == brief(sensor=SPARSE)


def test_example_briefs_and_files_fill_text_and_form(visit: Visit, page: Page) -> None:
    part(page, "Design")
    for name, swath in {"multirotors-over-a-field": "60", "rovers-between-shelves": ""}.items():
        page.get_by_label("Example brief").select_option(name)
        title = re.compile(f"name: {name.replace('-', ' ')}")
        expect(page.locator("#brief")).to_have_value(title)
        expect(_field(page, "Swath (m)")).to_have_value(swath)
    expect(_field(page, "Points to visit (m)")).to_have_value(re.compile("^8, 12; 32, 12; "))
    path = Path("examples/briefs/aircraft-in-a-corridor.yaml")
    page.get_by_label("Open a brief").set_input_files(path)
    expect(_field(page, "Vehicles to keep apart")).to_have_value("4")
    expect(_text(page)).to_have_value(path.read_text("utf-8"))


def test_a_bad_brief_is_refused_in_words_where_no_field_has_its_key(
    visit: Visit, page: Page
) -> None:
    visit.expect_complaints("422")
    _handed_in(page, "{need: {worst_rms_m: -1}, area_m: [[0, 0], [1]]}")
    expect(_fault(page, "need.worst_rms_m")).to_contain_text("must be greater than 0")
    fault = page.locator("#design form .fault").last
    expect(fault).to_contain_text("area_m[1][1]: is missing")


def test_a_design_that_is_to_finish_opens_the_best_it_has(visit: Visit, page: Page) -> None:
    _handed_in(page, _brief(team={"min": 2, "max": 8}))
    panel = page.locator("#design")
    expect(panel.locator("table button, table td").first).to_be_visible(timeout=180_000)
    panel.get_by_role("button", name="Finish now").click()
    expect(panel.get_by_text("ended early")).to_be_visible(timeout=180_000)
    assert accessibility_faults(page) == []
