"""Refinement and validation from the page, whatever happens meanwhile."""

import json
import re
from typing import Any

import httpx2
from playwright.sync_api import Page, Route, expect

from syncplan.scenario.loading import load_scenario
from tests.page.gestures import (
    DRAWN,
    drag,
    drawn,
    figures,
    menu,
    opened,
    part,
    plan_id_of,
    refine,
    stored,
    validate,
)
from tests.tools.browsing import Visit, accessibility_faults
from tests.tools.scenarios import FILES, document
from tests.tools.serving import Server

ALTERNATE = "paper-grid-alternate"


def figures_of(page: Page, name: str) -> list[str]:
    """The figures in a row of the result on show, before and after."""
    row = page.locator("#job-outcome").get_by_role("row", name=name)
    expect(row).to_have_count(1)
    return row.get_by_role("cell").all_inner_texts()


def _past_a_mast(name: str) -> dict[str, Any]:
    """A scenario of the grid in which v1 passes a third landmark at a metre, whatever its phase."""
    scenario = load_scenario(FILES / f"{name}.yaml").model_dump(mode="json", exclude_none=True)
    return {**scenario, "name": "mast", "landmarks_m": [[190.0, 0.0], [190.0, 70.0], [-21.0, 0.0]]}


def test_refine_compare_and_validate(visit: Visit, page: Page) -> None:
    visit.choose(ALTERNATE)
    refine(page)
    expect(page.locator("#job-text")).to_contain_text(re.compile(r"of \d+ starts"))
    visit.verdict("Observable: rank 18 of 18")
    figures_of(page, "predicted error, all, m")
    assert figures_of(page, "rank") == ["16", "18"]
    figures(page)
    expect(page.get_by_role("tab", name="Before and after")).to_have_attribute(
        "aria-selected", "true"
    )
    assert accessibility_faults(page) == []
    validate(page, "40")
    expect(page.locator("#job-outcome")).to_contain_text("40 trials of 200 s")
    for name in ("Errors over time", "Consistency", "Error found"):
        page.get_by_role("tab", name=name).click()
        assert page.evaluate("document.getElementById('panel-plot').data.length") > 0
    assert accessibility_faults(page) == []


def test_what_refinement_may_move_by_suits_the_opened_team(visit: Visit, page: Page) -> None:
    box = page.get_by_label("How far a centre may move each way, in m")
    least, most = (page.get_by_label(f"{which} radius in m") for which in ("Least", "Largest"))

    def offered(*values: str) -> None:
        for field, value in zip((box, least, most), values, strict=True):
            expect(field).to_have_value(value)

    part(page, "Run")
    offered("5", "15", "25")
    visit.choose("four-ground-robots")
    offered("0.13", "0.38", "0.63")
    box.fill("0.2")
    visit.choose("mixed-radii-camera")
    expect(box).to_have_value("0.2")
    expect(least).to_have_value("11")
    asked = {"vary": ["phases", "radii"], "radius_m": [12.125, 20.0]}
    opened(page, document(name="asked", refine=asked))
    expect(least).to_have_value("12.125")
    expect(most).to_have_value("20")


def test_refining_shows_what_it_costs_in_separation(visit: Visit, page: Page) -> None:
    refine(page)
    costs = page.locator("#job-outcome .yellow")
    expect(costs.filter(has_text="least separation falls from 30 to")).to_have_count(1)
    expect(costs.filter(has_text="least phase tolerance falls from 2.094 to 1.")).to_have_count(1)
    outcome = page.locator("#job-outcome")
    expect(outcome).to_contain_text("nearer to each other; min_separation_m limits this")
    assert figures_of(page, "meetings a period") == ["7", "7"]
    visit.choose("paper-grid-same")
    part(page, "Scenario")
    visit.fill("Least separation", "29")
    refine(page)
    assert figures_of(page, "least separation, m")[1].startswith("29")
    expect(costs.filter(has_text="least separation")).to_have_count(0)
    # vehicles that keep to no more than the rule come nearer in flight
    visit.verdict("✗ NO-GO")


def test_a_validation_of_few_trials_or_a_bad_plan_is_no_proof(visit: Visit, page: Page) -> None:
    outcome = page.locator("#job-outcome")

    def validated(trials: str) -> None:
        validate(page, trials)
        expect(outcome).to_contain_text(f": {trials} trials of")

    validated("30")
    expect(outcome).to_contain_text(re.compile("ANEES .*95 % interval .*: consistent"))
    expect(outcome.locator(".green").first).to_contain_text("GO")
    validated("1")
    expect(outcome).to_contain_text("not judged, at least")
    # nor is what is not to be flown, however well its filter knows where it is
    opened(page, _past_a_mast("paper-grid-same"))
    visit.verdict("✗ NO-GO")
    validated("30")
    expect(outcome.locator(".red").first).to_have_text("NO-GO")
    visit.choose(ALTERNATE)
    validated("40")
    expect(outcome.locator(".red").first).to_have_text("NO-GO")
    expect(outcome).to_contain_text("The plan is NOT observable")
    expect(outcome).to_contain_text("stretch of v1-v2")
    assert accessibility_faults(page) == []


def test_a_refinement_draws_its_best_plan_until_it_ends(page: Page, server: Server) -> None:
    def unhurried(route: Route) -> None:
        asked = json.loads(route.request.post_data or "{}")
        route.continue_(post_data=json.dumps({**asked, "starts": 1000, "time_limit_s": 600.0}))

    page.route("**/refinements", unhurried)
    part(page, "Run")
    before = drawn(page, "circle")
    page.get_by_role("button", name="Refine").click()
    text = page.locator("#job-text")
    expect(text).to_contain_text(
        re.compile(r"of 1000 starts; best so far: predicted error [\d.]+ m → [\d.]+ m")
    )
    beside = drawn(page, "beside")
    assert len(beside) == 6
    assert drawn(page, "circle") == before
    assert accessibility_faults(page) == []
    page.reload()
    expect(text).to_contain_text("best so far")
    assert len(drawn(page, "beside")) == 6
    shown = float(re.findall(r"→ ([\d.]+) m", text.inner_text())[0])
    page.get_by_role("button", name="Finish now").click()
    expect(page.locator("#job-outcome")).to_contain_text("predicted error")
    assert drawn(page, "beside") == []
    plan = stored(page, server)
    assert float(f"{plan['predicted_rms_m']['overall']:.3g}") <= shown
    refined = drawn(page, "circle")
    assert refined != before
    # one that is cancelled leaves the plan alone on the map
    validate = page.get_by_role("button", name="Validate")
    page.get_by_role("button", name="Refine").click()
    expect(text).to_contain_text("best so far")
    expect(validate).to_be_disabled()
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("#notice")).to_have_text("Refinement cancelled.")
    expect(validate).to_be_enabled()
    assert drawn(page, "beside") == []
    assert drawn(page, "circle") == refined
    assert httpx2.get(f"{server.url}/v1/jobs").json()["items"][0]["state"] == "cancelled"


def test_a_drag_beside_a_refinement_stays_at_it_and_says_what_becomes_of_phases(
    visit: Visit, page: Page
) -> None:
    refine(page)
    expect(page.locator("#job-outcome")).to_contain_text("predicted error")
    visit.settle()
    page.get_by_role("button", name="Refine").click()
    drag(page, "v2", (12.0, 0.0))
    expect(page.get_by_role("tab", name="Run", exact=True)).to_have_attribute(
        "aria-selected", "true"
    )
    expect(page.locator("#findings")).to_contain_text("Phases of all vehicles are computed anew")
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("button", name="Refine")).to_be_enabled()


def test_a_validation_fills_its_figures(visit: Visit, page: Page, server: Server) -> None:
    # a figure that is asked for while the job ends is refused
    visit.expect_complaints("409")
    validate(page, "100000")
    text = page.locator("#panel-text")
    expect(text).to_contain_text(re.compile(r"\d+ trials of 200 s, seed 0"))
    first = int(re.findall(r"(\d+) trials", text.inner_text())[0])
    assert first % 16 == 0
    page.get_by_role("tab", name="Errors over time").click()
    expect(text).not_to_contain_text(f"{first} trials")
    # the chosen figure stays when more trials come
    assert page.get_by_role("tab", name="Errors over time").get_attribute("aria-selected") == "true"
    assert accessibility_faults(page) == []
    menu(page, "Copy link")
    link = f"{server.url}/?plan={plan_id_of(page)}"
    expect(page.locator("#notice")).to_have_text(f"Link copied: {link}")
    assert page.evaluate("navigator.clipboard.readText()") == link
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("#notice")).to_have_text("Validation cancelled.")


def test_a_plan_that_was_deleted_is_stored_anew(visit: Visit, page: Page, server: Server) -> None:
    visit.expect_complaints("404")
    validate(page, "10")
    expect(page.locator("#job-outcome")).to_contain_text(": 10 trials of")
    httpx2.delete(f"{server.url}/v1/plans/{plan_id_of(page)}")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#work")).to_contain_text("was deleted from the service")
    page.get_by_role("button", name="Validate").click()
    expect(page.locator("#job-outcome")).to_contain_text(": 10 trials of")


def test_what_is_edited_while_a_job_runs_stays(visit: Visit, page: Page) -> None:
    validate(page, "1500")
    expect(page.locator("#job-text")).to_contain_text("of 1500 trials")
    part(page, "Scenario")
    visit.fill("Radius of all", "21")
    assert "job=" in page.url
    assert "plan=" not in page.url
    expect(page.locator("#job-outcome")).to_contain_text("before your edits")
    expect(page.get_by_label("Radius of all")).to_have_value("21")
    assert page.url.rpartition("/")[2] == ""
    visit.choose("four-ground-robots")
    expect(page.locator("#job-outcome")).to_be_empty()


def fly(page: Page, flights: int, **fields: str) -> None:
    """Fly the plan on show."""
    part(page, "Run")
    page.get_by_label("Flights").fill(str(flights))
    for label, text in fields.items():
        page.locator(f"#fly-{label}").fill(text)
    page.get_by_role("button", name="Fly").click()


def test_a_flight_is_summed_up_and_played(visit: Visit, page: Page, server: Server) -> None:
    visit.fill("Duration (s)", "40")
    fly(page, 4, wind_mps="0.5, -0.25", lose="v6@30", hold="v2@5:3")
    outcome = page.locator("#job-outcome")
    expect(outcome).to_contain_text("4 flights of 40 s")
    (job,) = httpx2.get(f"{server.url}/v1/jobs?limit=1").json()["items"]
    asked = httpx2.get(f"{server.url}/v1/jobs/{job['id']}").json()["request"]
    given = {"wind_mps": [0.5, -0.25], "lose": ["v6@30"], "hold": ["v2@5:3"]}
    assert given.items() <= asked.items()
    expect(outcome).to_contain_text(re.compile(r"least separation: [\d.]+ m in the median trial"))
    expect(outcome).to_contain_text("v6 is lost at 30 s")
    expect(outcome.get_by_role("row", name="v6")).to_contain_text("(lost)")
    expect(page.get_by_role("tab", name="Tracks")).to_have_attribute("aria-selected", "true")
    for name in ("Errors in flight", "Meetings kept", "What was lost"):
        page.get_by_role("tab", name=name).click()
        assert page.evaluate("document.getElementById('panel-plot').data.length") > 0
    assert accessibility_faults(page) == []
    played = page.get_by_label("What is played")
    played.select_option("Flight 2")
    taken = f"({DRAWN})('estimate').length"
    page.wait_for_function(f"() => {taken} === 6")
    assert drawn(page, "sighting") == []
    slider = page.get_by_label("Moment in the period")
    slider.fill(str(slider.get_attribute("max")))
    expect(page.locator("#moment-text")).to_have_text("40 s")
    # what happens is said, and marked where it happened
    happening = page.locator("#happening")
    expect(happening).to_have_text("v6 is lost at 30 s")
    assert [one["name"] for one in drawn(page, "event")] == ["v6 is lost at 30 s"]
    slider.fill("90")
    expect(happening).to_have_text("v2 is held from 5 s for 3 s")
    assert accessibility_faults(page) == []
    slider.fill(str(slider.get_attribute("max")))
    # v6 is gone by then, all others are there
    page.wait_for_function(f"() => {taken} === 5")
    assert len(drawn(page, "vehicle")) == 5
    played.select_option("The plan")
    page.wait_for_function(f"() => {taken} === 0")
    expect(happening).to_be_empty()
    part(page, "Scenario")
    page.get_by_label("Radius of all").fill("21")
    expect(played).to_be_hidden()


def test_a_flight_at_work_counts_its_time_and_keeps_its_options_over_a_reload(
    visit: Visit, page: Page
) -> None:
    fly(page, 400, lose="v3@60")
    elapsed = page.locator(".running .hint").first
    expect(elapsed).to_contain_text(re.compile(r"[1-9]\d* s since"))
    page.reload()
    visit.verdict("Observable: rank 18 of 18")
    expect(page.get_by_role("tab", name="Run", exact=True)).to_have_attribute(
        "aria-selected", "true"
    )
    expect(page.locator("#fly-trials")).to_have_value("400")
    expect(page.locator("#fly-lose")).to_have_value("v3@60")
    # nor does a drag lead away from it
    drag(page, "v1", (0.0, 8.0))
    expect(page.get_by_role("tab", name="Run", exact=True)).to_have_attribute(
        "aria-selected", "true"
    )
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".running").first).to_be_hidden()


def test_options_of_rare_use_are_made_when_they_are_looked_for(
    visit: Visit, page: Page, server: Server
) -> None:
    part(page, "Run")
    form = page.get_by_role("form", name="Fly")
    assert form.get_by_label("Lost sightings").count() == 0
    form.get_by_text("More options").click()
    form.get_by_label("Lost sightings").fill("0.2")
    form.get_by_label("Length of a run (s)").fill("30")
    form.get_by_label("Filter").select_option("ekf")
    form.get_by_label("False bearings").fill("")
    fly(page, 2)
    expect(page.locator("#fly-outliers-fault")).to_contain_text("is missing")
    form.get_by_label("False bearings").fill("0")
    assert accessibility_faults(page) == []
    fly(page, 2)
    expect(page.locator("#job-outcome")).to_contain_text("2 flights of 30 s")
    (job,) = httpx2.get(f"{server.url}/v1/jobs?limit=1").json()["items"]
    asked = httpx2.get(f"{server.url}/v1/jobs/{job['id']}").json()["request"]
    assert {
        "dropout": 0.2,
        "duration_s": 30.0,
        "filter": "ekf",
        "trials": 2,
    }.items() <= asked.items()


def test_what_a_job_can_not_do_is_reported_next_to_its_field(visit: Visit, page: Page) -> None:
    visit.expect_complaints("422")
    validate(page, "0")
    reported = page.locator("#validate-trials-fault")
    expect(reported).to_have_text("must be at least 1")
    expect(page.get_by_label("Trials")).to_have_attribute("aria-invalid", "true")
    page.get_by_label("Time limit (s)").fill("")
    page.get_by_role("button", name="Refine").click()
    expect(page.locator("#refine-time-fault")).to_contain_text("is missing")
    expect(page.get_by_label("Time limit (s)")).to_be_focused()
    fly(page, 2, lose="v9@30")
    expect(page.locator("#fly-lose-fault")).to_contain_text("is neither a vehicle")
    fly(page, 2, lose="", hold="v2@-1:3")
    expect(page.locator("#fly-hold-fault")).to_contain_text("-1 s is outside the flight")
    expect(page.locator("#fly-lose-fault")).to_be_empty()
    fly(page, 2, hold="", wind_mps="east")
    expect(page.locator("#fly-wind_mps-fault")).not_to_be_empty()
    assert accessibility_faults(page) == []
