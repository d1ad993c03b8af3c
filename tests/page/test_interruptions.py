"""What comes between: a service that is away, keys, answers in another order, deleted plans."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from tests.page.gestures import copied, menu, part, validate
from tests.tools.api_servers import key_of, serving, speaking
from tests.tools.browsing import Tabs, Visit, accessibility_faults, visiting
from tests.tools.serving import QUICK, Server, running, settings_of

ALTERNATE = "paper-grid-alternate"


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that wants a key."""
    with serving(tmp_path_factory.mktemp("guarded"), "ann bob", "--no-worker") as one:
        yield one


@pytest.fixture
def keyless(tabs: Tabs, guarded: Server) -> Iterator[Visit]:
    """A visit to that server, which is refused until a key is entered."""
    with visiting(tabs, guarded.url) as one:
        one.expect_complaints("401")
        yield one


def enter_key(page: Page, key: str) -> None:
    """Enter a key where it is asked for."""
    page.get_by_label("API key").fill(key)
    page.keyboard.press("Enter")


def test_a_server_that_dies_in_mid_job_costs_only_time(tabs: Tabs, tmp_path: Path) -> None:
    given = {**settings_of(tmp_path / "data"), **QUICK}
    first = Server(tmp_path / "log", port=None, **given)
    with running(first), visiting(tabs, first.url) as visit:
        page = visit.page
        visit.expect_complaints("net::ERR", "503")
        visit.verdict("Observable")
        validate(page, "500")
        expect(page.locator("#work progress")).not_to_have_attribute("value", "0")
        first.kill()
        expect(page.locator("#job-text")).to_contain_text("can't be reached")
        with running(Server(tmp_path / "log", port=first.port, **given)):
            expect(page.locator("#job-text")).to_contain_text("Validation running")
            expect(page.locator("#job-outcome")).to_contain_text(": 500 trials of")


def test_a_service_with_keys_asks_for_one_and_refuses_others_at_its_field(keyless: Visit) -> None:
    page, key = keyless.page, key_of("ann")
    field = page.get_by_label("API key")
    expect(field).to_be_focused()
    expect(page.locator("#notice")).to_have_text(re.compile("^This service needs a key"))
    expect(page.locator("#notice.bad")).to_have_count(0)
    expect(page.locator("body")).not_to_contain_text("Authorization")
    expect(page.locator("#change-key")).to_have_attribute("hidden", "")
    assert accessibility_faults(page) == []
    for wrong, reported in (
        ("wrong", "not known"),
        (f"{key[:3]}\u200b{key[3:]}", "character 4 is U+200B"),
        ("", "Enter the key"),
        ("two words", "character 4 is U+0020"),
    ):
        enter_key(page, wrong)
        expect(page.locator("#key-fault")).to_contain_text(reported)
        expect(field).to_have_attribute("aria-invalid", "true")
    assert accessibility_faults(page) == []
    enter_key(page, f"  {key}\n")
    keyless.verdict("Observable: rank 18 of 18")
    expect(page.locator("#key-form")).to_be_hidden()
    expect(page.locator("#notice")).to_be_empty()


def test_a_key_is_changed_and_hides_others_plans(keyless: Visit, guarded: Server) -> None:
    keyless.expect_complaints("401", "404", "422")
    page = keyless.page
    enter_key(page, key_of("ann"))
    # an edit that waits for a key is not lost
    keyless.choose(ALTERNATE)
    page.evaluate("sessionStorage.clear()")
    page.get_by_label("Desynchronise by").fill("0.2")
    expect(page.get_by_label("API key")).to_be_focused()
    keyless.doubt("Waiting for a key")
    enter_key(page, key_of("ann"))
    keyless.verdict("Observable: rank 18 of 18")
    expect(page.locator("#map-name")).to_have_text(ALTERNATE)
    expect(page.get_by_label("Desynchronise by")).to_have_value("0.2")
    copied(page)
    menu(page, "Change key")
    expect(page.get_by_label("API key")).to_be_focused()
    assert accessibility_faults(page) == []
    page.get_by_role("button", name="Keep the current key").click()
    expect(page.get_by_role("button", name="More", exact=True)).to_be_focused()
    menu(page, "Change key")
    enter_key(page, key_of("bob"))
    keyless.settle()
    assert page.evaluate("sessionStorage.getItem('syncplan-key')") == key_of("bob")
    keyless.verdict("Observable: rank 18 of 18")
    with speaking(guarded, "ann") as http:
        owned = http.get("/v1/plans").json()["items"]
    for plan in (owned[0]["id"], "nonsense"):
        page.goto(f"{guarded.url}/?plan={plan}")
        expect(page.locator("#dead-link")).to_contain_text(
            "There is no such plan, or it belongs to another key."
        )


def test_a_refusal_that_comes_after_a_new_key_asks_for_no_other(keyless: Visit) -> None:
    keyless.expect_complaints("401")
    page = keyless.page
    held: list[Route] = []
    enter_key(page, key_of("ann"))
    keyless.settle()
    page.evaluate("sessionStorage.clear()")
    page.route("**/v1/previews?*", lambda route: held.append(route), times=1)
    with page.expect_request("**/v1/previews?*"):
        page.get_by_label("Desynchronise by").fill("0.2")
    page.evaluate(f"sessionStorage.setItem('syncplan-key', '{key_of('ann')}')")
    held[0].continue_()
    keyless.settle()
    keyless.verdict("Observable: rank 18 of 18")
    expect(page.locator("#key-form")).to_be_hidden()
    page.get_by_role("button", name="More", exact=True).click()
    expect(page.get_by_role("button", name="Change key")).to_be_visible()


def test_of_two_that_are_opened_at_once_the_later_one_stays(visit: Visit, page: Page) -> None:
    held: list[Route] = []
    page.route(f"**/examples/{ALTERNATE}.yaml", lambda route: held.append(route))
    visit.begin(ALTERNATE)
    visit.begin("four-ground-robots")
    visit.verdict("rank 12 of 12")
    assert len(held) == 1
    held[0].continue_()
    visit.settle()
    expect(page.locator("#map-name")).to_have_text("four-ground-robots")
    visit.verdict("rank 12 of 12")


def test_requests_and_edits_wait_until_the_service_is_back(visit: Visit, page: Page) -> None:
    visit.expect_complaints("net::ERR")
    visit.choose(ALTERNATE)
    visit.verdict("Not observable: rank 16 of 18")
    page.route("**/v1/**", lambda route: route.abort())
    page.get_by_label("Desynchronise by").fill("0.2")
    reported = page.locator("#notice.bad")
    expect(reported).to_contain_text("can't be reached")
    visit.doubt("Waiting for the service; before your edits: ✗ NO-GO")
    expect(page.locator("#verdict")).to_contain_text("of the scenario before your edits")
    page.unroute("**/v1/**")
    visit.verdict("Observable: rank 18 of 18")
    expect(reported).to_have_count(0)
    expect(page.get_by_label("Desynchronise by")).to_have_value("0.2")
    page.route("**/v1/plans", lambda route: route.abort())
    menu(page, "Copy link")
    expect(reported).to_have_text("the service can't be reached; trying again …")
    page.unroute("**/v1/plans")
    expect(page.locator("#notice")).to_contain_text("Link copied")
    expect(reported).to_have_count(0)


def test_the_focus_stays_where_it_was_over_undo_and_cancel(visit: Visit, page: Page) -> None:
    undo = page.get_by_role("button", name="Undo")
    visit.fill("Radius of all", "21")
    undo.focus()
    page.keyboard.press("Enter")
    visit.settle()
    expect(page.get_by_label("Radius of all")).to_have_value("20")
    expect(undo).to_have_attribute("aria-disabled", "true")
    expect(undo).to_be_focused()
    part(page, "Run")
    page.get_by_label("Trials").fill("100000")
    validate = page.get_by_role("button", name="Validate")
    validate.focus()
    page.keyboard.press("Enter")
    expect(page.locator("#job-text")).to_contain_text("of 100000 trials")
    expect(page.get_by_role("button", name="Cancel")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.locator("#notice")).to_have_text("Validation cancelled.")
    expect(validate).to_be_focused()
