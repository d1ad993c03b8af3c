"""Fields of the world as it is: folded away until used, kept when others are edited."""

from typing import Any

from playwright.sync_api import Page, expect

from tests.page.gestures import downloaded, opened
from tests.tools.browsing import Visit, accessibility_faults

WORLD: dict[str, Any] = {
    "name": "world",
    "orbit": {"radius_m": 20, "angular_rate_rad_s": 0.2},
    "formation": {"centers_m": [[0, 0], [70, 0]]},
    "landmarks_m": [[0, 40], [70, 40]],
    "sensor": {"range_m": 50, "range_sigma_m": 0.3},
    "heading_sigma_rad": [0.1, 0.2],
    "wind": {"sigma_mps": 0.5},
    "motion": {"position_random_walk_m_sqrt_s": 0.03, "angle_random_walk_rad_sqrt_s": 0.003},
    "filter": {"estimate": ["wind"]},
    "obstacles_m": [[[35, 200], [40, 200], [40, 210]]],
    "truth": {"wind": {"sigma_mps": 1.0}},
    "duration_s": 60,
}


def test_fields_of_the_world_are_folded_until_used(visit: Visit, page: Page) -> None:
    visit.choose("paper-grid-same")
    expect(page.get_by_label("Wind sigma")).to_be_hidden()
    page.locator("summary", has_text="Wind or current").click()
    visit.fill("Wind sigma", "1")
    visit.verdict("Observable: rank 18 of 18")
    expect(page.locator("#workspace")).to_contain_text("Predicted error, wind x")
    visit.fill("Wind sigma", "")
    assert "wind" not in downloaded(page)
    page.locator("summary", has_text="Errors of motion readings").click()
    visit.fill("Position random walk", "0.03")
    motion = downloaded(page)["motion"]
    assert motion["position_random_walk_m_sqrt_s"] == 0.03
    assert "speed_sigma_mps" not in motion
    assert accessibility_faults(page) == []


def test_a_scenario_of_the_world_opens_its_groups_and_is_kept(visit: Visit, page: Page) -> None:
    opened(page, WORLD)
    visit.settle()
    visit.verdict("Observable: rank 6 of 6")
    for label, value in (
        ("Distance sigma", "0.3"),
        ("Wind sigma", "0.5"),
        ("Position random walk", "0.03"),
    ):
        expect(page.get_by_label(label)).to_have_value(value)
    expect(page.get_by_label("Compass sigma")).to_have_attribute("placeholder", "differs")
    visit.fill("Radius of all", "21")
    kept = downloaded(page)
    assert kept["wind"]["sigma_mps"] == 0.5
    for key in ("heading_sigma_rad", "filter", "obstacles_m", "truth"):
        assert kept[key] == WORLD[key]
    page.get_by_label("Vehicle or landmark").select_option("obstacle 1")
    page.get_by_label("Corners").fill("35, 200; 40, 200; 40, 220")
    page.keyboard.press("Tab")
    visit.settle()
    assert downloaded(page)["obstacles_m"] == [[[35, 200], [40, 200], [40, 220]]]
    page.get_by_label("Keys that are true instead").fill('{"wind": {"sig')
    expect(page.get_by_text("is no JSON yet")).to_be_visible()
    visit.fill("Keys that are true instead", '{"wind": {"sigma_mps": 2}}')
    expect(page.get_by_text("is no JSON yet")).to_have_count(0)
    assert downloaded(page)["truth"] == {"wind": {"sigma_mps": 2}}
    page.get_by_label("Estimated errors").select_option("none")
    visit.settle()
    expect(page.locator("#workspace")).to_contain_text("Expected RMS error")
