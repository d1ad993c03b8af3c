"""Error ellipses on the map: those of the library, at the moment shown."""

from typing import Any

import numpy as np
from playwright.sync_api import Page, Route, expect

import syncplan
from syncplan.planning.plans import Plan
from tests.page.gestures import copied, drawn
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.scenarios import example

SIGMAS = np.sqrt(5.991464547107979)
"""95 % of a chi-square distribution with two degrees of freedom lies below its square."""


def _covariance(mark: dict[str, Any], sigmas: float) -> np.ndarray:
    """The covariance that an ellipse of so many sigmas is of, from its evenly spread points."""
    (ring,) = mark["at"]
    points = np.array(ring[:-1])
    off = points - points.mean(axis=0)
    return np.asarray(2.0 * off.T @ off / len(off) / sigmas**2)


def _expected(made: Plan, time: float) -> np.ndarray:
    """Covariances (n, 2, 2) so many s into the last period."""
    found, period = made.position_covariances(), made.orbits.period
    at = time + period * np.floor((found.times[-1] - time) / period)
    flat = found.values.reshape(len(found.times), -1).T
    of_one = [np.interp(at, found.times, one) for one in flat]
    return np.array(of_one).reshape(-1, 2, 2)


def test_ellipses_are_the_library_s_at_each_moment_and_size(visit: Visit, page: Page) -> None:
    asked: list[str] = []
    page.on("request", lambda sent: asked.append(f"{sent.method} {sent.url.split('/v1/')[-1]}"))
    made = syncplan.plan(example("paper-grid-same"))
    names = made.scenario.vehicle_names
    toggle = page.get_by_role("button", name="Error ellipses")
    toggle.press("Enter")
    size = page.get_by_label("Size of the error ellipses")
    expect(size.locator("option")).to_have_text(["95 %, \u00d7 2", "95 %, true size"])
    assert "POST previews?quick=true&covariances=true" in asked
    for moment, option, factor in ((0, "2", 2.0), (200, "2", 2.0), (450, "1", 1.0)):
        page.get_by_label("Moment in the period").fill(str(moment))
        size.select_option(option)
        marks = {one["body"]: one for one in drawn(page, "ellipse")}
        places = {one["body"]: one["at"] for one in drawn(page, "vehicle")}
        expected = _expected(made, made.orbits.period * moment / 600)
        for name, own in zip(names, expected, strict=True):
            middle = np.mean(marks[name]["at"][0][:-1], axis=0)
            np.testing.assert_allclose(middle, places[name], atol=1e-6)
            found = _covariance(marks[name], factor * SIGMAS)
            np.testing.assert_allclose(found, own, atol=2e-3 * np.trace(own))
    assert accessibility_faults(page) == []
    copied(page)
    toggle.press("Enter")
    assert drawn(page, "ellipse") == []
    toggle.press("Enter")
    expect(size).to_be_visible()
    assert any(one.startswith("GET plans/") and one.endswith("/covariances") for one in asked)


def test_ellipses_follow_edits_and_say_where_they_keep_growing(visit: Visit, page: Page) -> None:
    page.get_by_role("button", name="Error ellipses").click()
    size = page.get_by_label("Size of the error ellipses")
    expect(size).to_be_visible()
    before = drawn(page, "ellipse")
    page.get_by_label("Duration").fill("20")
    expect(size).to_be_hidden()
    assert drawn(page, "ellipse") == []
    visit.settle()
    expect(size).to_be_visible()
    after = drawn(page, "ellipse")
    assert len(after) == len(before)
    assert after[0]["at"] != before[0]["at"]
    visit.choose("paper-grid-alternate")
    expect(page.locator("#ellipses-text")).to_contain_text("they keep growing")
    assert len(drawn(page, "ellipse")) == 6
    assert accessibility_faults(page) == []


def test_ellipses_show_whenever_flights_arrive(visit: Visit, page: Page) -> None:
    visit.verdict("GO in 31 simulated flights")
    toggle = page.get_by_role("button", name="Error ellipses")
    toggle.click()
    size = page.get_by_label("Size of the error ellipses")
    expect(size).to_be_visible()
    toggle.click()
    # now flights arrive while the ellipses are being asked for
    answers: list[Route] = []
    page.route("**/v1/previews?quick=true&covariances=true", lambda answer: answers.append(answer))
    visit.fill("Duration", "150")
    visit.verdict("GO in 31 simulated flights")
    page.get_by_label("Duration").fill("160")
    toggle.click()
    visit.settle()
    visit.verdict("GO in 31 simulated flights")
    expect(page.locator("#ellipses-text")).to_contain_text("follow")
    for answer in answers:
        answer.continue_()
    expect(size).to_be_visible()
    assert len(drawn(page, "ellipse")) == 6


def test_the_page_says_why_a_plan_has_no_ellipses(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    refusal = {"title": "Unprocessable", "detail": "100 vehicles are too many", "status": 422}
    page.route(
        "**/v1/previews?quick=true&covariances=true",
        lambda to: to.fulfill(status=422, json=refusal),
    )
    page.get_by_role("button", name="Error ellipses").click()
    expect(page.locator("#ellipses-text")).to_have_text("100 vehicles are too many")
    expect(page.get_by_label("Size of the error ellipses")).to_be_hidden()
