"""What holds of the page: accessibility, policy, assets, what it offers."""

import hashlib
import re
from pathlib import Path, PurePosixPath
from typing import Any

import httpx2
import pytest
from playwright.sync_api import Page, Route, expect

from api.routes import page_routes
from api.settings import load_settings
from syncplan.exporting.formats import FORMATS
from tests.page.gestures import box_of, figures, handle, part, sheet
from tests.tools.browsing import (
    DESKTOP,
    DOUBLED,
    PHONE,
    Tabs,
    Visit,
    accessibility_faults,
    faults_by_day_and_night,
    launched,
    visiting,
)
from tests.tools.scenarios import FILES
from tests.tools.serving import Server

ALTERNATE = "paper-grid-alternate"
PAGE = Path(page_routes.__file__).parents[1] / "page"
UNFOLD = "all => all.forEach(one => one.checkVisibility() && one.click())"
"""Opens what is folded away."""


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_all_parts_are_accessible(tabs: Tabs, server: Server, size: tuple[int, int]) -> None:
    with visiting(tabs, server.url, size=size) as visit:
        page = visit.page
        visit.choose(ALTERNATE)
        handle(page, "v2").click()
        sheet(page)
        page.locator("summary").evaluate_all(UNFOLD)
        for name in ("Verdict", "Run", "Design", "Preflight", "Scenario"):
            part(page, name)
            assert faults_by_day_and_night(page) == []
        figures(page)
        for name in ("Singular values", "Predicted error"):
            page.get_by_role("tab", name=name).click()
            assert faults_by_day_and_night(page) == []
        page.get_by_role("button", name="New").click()
        assert faults_by_day_and_night(page) == []


def test_the_page_fits_a_phone_and_keeps_the_verdict_in_sight(tabs: Tabs, server: Server) -> None:
    with visiting(tabs, server.url, size=PHONE, touch=True) as visit:
        page = visit.page
        visit.choose(ALTERNATE)
        wide = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.evaluate(wide) <= 0
        handle(page, "v2").tap()
        badge = page.locator("#badge")
        sheet(page)
        expect(page.get_by_label("Centre east")).to_have_value("70")
        page.get_by_label("Sample time").scroll_into_view_if_needed()
        expect(badge).to_be_in_viewport(ratio=1.0)
        expect(badge).to_have_class("badge bad")
        page.get_by_label("Desynchronise by").fill("0.2")
        expect(badge).to_contain_text("rank 18 of 18")
        expect(badge).to_have_class("badge good flown")
        expect(badge).to_be_in_viewport(ratio=1.0)
        page.locator("#sheet").tap()
        figures(page)
        for name in ("Contacts", "Singular values", "Predicted error"):
            page.get_by_role("tab", name=name).tap()
            visit.settle()
            over = page.evaluate(
                """[...document.querySelectorAll('#panel-plot text')].filter(one =>
                    one.getBoundingClientRect().right
                        > document.getElementById('panel').getBoundingClientRect().right)
                .map(one => one.textContent)"""
            )
            assert over == []


def _cut(page: Page) -> Any:
    """What sticks out of its part of the page and can't be scrolled to."""
    return page.evaluate(
        """[...document.querySelectorAll('.inspector *, .bar *, .player *')].filter(one => {
            const box = one.getBoundingClientRect();
            const around = one.closest('.inspector, .bar, .player').getBoundingClientRect();
            const apart = '.unseen, svg, .plot, #handles, legend, .actions, .front';
            return box.width && !one.closest(apart)
                && (box.right > around.right + 1 || box.left < around.left - 1);
        }).map(one => one.outerHTML.slice(0, 100))"""
    )


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_large_letters_find_room(tabs: Tabs, server: Server, size: tuple[int, int]) -> None:
    large = "--blink-settings=defaultFontSize=32"
    with (
        launched(tabs.browser.browser_type, large) as browser,
        visiting(Tabs(browser), server.url, size=size) as visit,
    ):
        page = visit.page
        visit.choose(ALTERNATE)
        handle(page, "v2").click()
        sheet(page)
        body = "parseFloat(getComputedStyle(document.body).fontSize)"
        assert page.evaluate(body) == pytest.approx(30.0)
        page.locator("summary").evaluate_all(UNFOLD)
        assert _cut(page) == []
        for name in ("Centre east", "Angular rate", "Trials"):
            part(page, "Run" if name == "Trials" else "Scenario")
            assert _cut(page) == []
            expect(page.get_by_label(name)).to_be_visible()
            # a label beside its field has room for words
            assert box_of(page.locator("label", has_text=name))["width"] > 150
        assert accessibility_faults(page) == []


def test_at_200_percent_the_plan_and_the_details_are_in_sight(tabs: Tabs, server: Server) -> None:
    newcomers = Tabs(tabs.browser, greeted=False)
    with visiting(newcomers, server.url, size=DOUBLED) as visit:
        page = visit.page
        visit.settle()
        greeting, plot = page.get_by_role("region", name="Welcome"), page.locator("#map-plot")
        covered = box_of(greeting)["width"] * box_of(greeting)["height"]
        assert covered < 0.25 * box_of(plot)["width"] * box_of(plot)["height"]
        if page.locator("#sheet").is_visible():
            page.locator("#sheet").click()
        expect(page.get_by_role("tab", name="Scenario", exact=True)).to_be_in_viewport(ratio=1.0)
        expect(page.get_by_label("Angular rate")).to_be_in_viewport()


def test_before_the_first_plan_the_page_asks_for_nothing(tabs: Tabs, server: Server) -> None:
    with visiting(tabs, server.url) as visit:
        page = visit.page
        held: list[Route] = []
        page.route("**/v1/**", lambda route: held.append(route))
        page.goto(server.url)
        page.wait_for_timeout(300)
        assert "Choose an example" not in page.locator("body").inner_text()
        expect(page.locator("#workspace")).to_have_attribute("aria-busy", "true")
        for route in held:
            route.continue_()
        page.unroute("**/v1/**")
        visit.verdict("GO")


def test_the_page_speaks_of_things_and_not_of_keys(visit: Visit, page: Page) -> None:
    handle(page, "v2").click()
    shown = []
    for name in ("Scenario", "Verdict", "Run", "Design", "Preflight"):
        part(page, name)
        page.locator("summary").evaluate_all(UNFOLD)
        shown.append(page.locator("body").inner_text())
    said = " ".join(shown)
    assert "Trials" in said
    for key in ("area_m", "initial_sigma", "plan --fly", "0.000000001", "RFC 3339"):
        assert key not in said
    # a tab and no file
    expect(page.get_by_role("button", name="Scenario", exact=True)).to_have_count(0)


def test_units_stay_beside_numbers_and_figures_follow_the_theme(visit: Visit, page: Page) -> None:
    part(page, "Run")
    amounts = page.locator(".amount")
    expect(amounts).to_have_count(2)
    for amount in amounts.all():
        assert box_of(amount)["height"] < 40
    assert _cut(page) == []
    figures(page)
    words = page.locator("#panel-plot .xtitle")
    for dark in (False, True, False):
        page.emulate_media(color_scheme="dark" if dark else "light")
        expect(words).to_have_css("fill", "rgb(236, 236, 240)" if dark else "rgb(27, 27, 31)")


@pytest.mark.quick
def test_nothing_comes_from_elsewhere_and_no_style_or_script_is_inline(server: Server) -> None:
    answer = httpx2.get(server.url)
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self';" in policy
    assert "unsafe" not in policy
    assert " style=" not in answer.text
    assert "<style" not in answer.text
    assert re.findall(r'(?:src|href)="(?:https?:)?//', answer.text) == []


@pytest.mark.quick
def test_a_violation_of_the_policy_would_be_noticed(tabs: Tabs, server: Server) -> None:
    with visiting(tabs, server.url) as visit:
        visit.verdict("Observable")
        visit.page.evaluate("document.body.setAttribute('style', 'color: red')")
        visit.page.evaluate("fetch('http://127.0.0.2:9/').catch(() => 0)")
        assert any("Content Security Policy" in one for one in visit.unexpected)
        assert len(visit.unexpected) >= 2
        visit.expect_complaints("Content Security Policy", "127.0.0.2")


@pytest.mark.quick
def test_assets_are_compressed_once_and_not_sent_again(server: Server) -> None:
    with httpx2.Client(base_url=server.url) as http:
        script = http.get("/assets/plotly.min.js")
        assert script.headers["content-encoding"] == "gzip"
        assert int(script.headers["content-length"]) < 450_000
        tag = {"if-none-match": script.headers["etag"]}
        assert http.get("/assets/plotly.min.js", headers=tag).status_code == 304
        plain = http.get("/assets/main.js", headers={"accept-encoding": "gzip;q=0"})
        assert "content-encoding" not in plain.headers
        assert plain.headers["content-type"] == "text/javascript; charset=utf-8"
        for name in ("../main.py", "..%2fmain.py", "examples/../../main.py", "examples", "none.js"):
            missing = http.get(f"/assets/{name}")
            assert missing.status_code == 404, name
            assert missing.headers["content-type"] == "application/problem+json"


@pytest.mark.quick
def test_what_the_page_names_is_kept_until_another_edition(server: Server) -> None:
    with httpx2.Client(base_url=server.url) as http:
        index = http.get("/").text
        named = re.findall(r'(?:src|href)="(assets/[^"]+)"', index)
        [edition] = {re.fullmatch(r"assets/([0-9a-f]{12})/.+", one)[1] for one in named}  # type: ignore[index]
        assert edition == page_routes.edition(
            page_routes.Site.of(load_settings(data_dir="/nowhere"))
        )
        for one in named:
            assert "immutable" in http.get(f"/{one}").headers["cache-control"], one
        older = http.get("/assets/0123456789ab/main.js")
        assert older.headers["cache-control"] == "no-cache"
        assert older.text == http.get(f"/assets/{edition}/main.js").text


@pytest.mark.quick
def test_the_first_example_is_within_the_page_that_never_scrolls(visit: Visit, page: Page) -> None:
    loaded = page.evaluate("performance.getEntriesByType('resource').map(one => one.name)")
    assert [one for one in loaded if "yaml" in one] == []
    within = page.locator("#paper-grid-same").text_content()
    assert within == (FILES / "paper-grid-same.yaml").read_text()
    taller = "document.documentElement.scrollHeight - innerHeight"
    assert page.evaluate(taller) == 0
    handle(page, "v3").click()
    expect(page.get_by_label("Centre east")).to_be_visible()
    assert page.evaluate(taller) == 0


@pytest.mark.quick
def test_the_preloads_are_the_modules_that_the_page_imports() -> None:
    index = (PAGE / "index.html").read_text()
    preloads = re.findall(r'rel="modulepreload" href="assets/([\w./-]+)"', index)
    modules = re.findall(r'<script type="module" src="assets/([\w./]+)"', index)
    for name in modules:
        imported = re.findall(r'\bfrom ?"\./([\w./-]+)"', (PAGE / name).read_text())
        found = [str(PurePosixPath(name).parent / one) for one in imported]
        modules += [one for one in found if one not in modules]
    assert sorted(["opening.js", "main.js", *preloads]) == sorted(modules)


@pytest.mark.quick
def test_the_libraries_of_the_page_are_as_they_were_bundled() -> None:
    vendored = PAGE / "vendor"
    lines = (vendored / "SHA256SUMS").read_text().splitlines()
    digests = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = {path.name for path in vendored.iterdir() if not path.name.endswith(".d.ts")}
    assert set(digests) == files - {"SHA256SUMS"}
    for name, digest in digests.items():
        assert hashlib.sha256((vendored / name).read_bytes()).hexdigest() == digest, name


def test_every_format_and_only_examples_there_are_are_offered(visit: Visit, server: Server) -> None:
    def values(chosen: str) -> Any:
        return visit.page.eval_on_selector_all(chosen, "a => a.map(o => o.value).filter(Boolean)")

    assert values("#format option") == list(FORMATS)
    for name in values("#examples option"):
        answer = httpx2.get(f"{server.url}/assets/examples/{name}.yaml")
        assert answer.content == (FILES / f"{name}.yaml").read_bytes()
