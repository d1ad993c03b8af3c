"""The documentation is followed block by block; what it is made of is made and looked at."""

import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect
from typer.main import get_command

import syncplan
from docs.site import studies
from docs.site.__main__ import generate
from docs.site.__main__ import main as build_site
from docs.site.figures import DRAWN, final_error, sight_direction
from docs.site.kind_tables import TABLES, with_tables
from docs.site.pages import with_figures
from docs.site.reference import PAGES as REFERENCE
from docs.site.scenario_keys import described_keys, unit_of
from docs.site.service_pages import settings_table
from docs.site.speed_page import BENCHMARKS, measured, speed_page
from syncplan.cli.command_line import application
from syncplan.errors import InputError
from syncplan.scenario.specification import Scenario
from tests.tools.api_servers import openapi_document
from tests.tools.browsing import accessibility_faults, chromium
from tests.tools.likeness import Likeness
from tests.tools.serving import ROOT
from tests.tools.walkthrough import DATABASE, Block, Walk, blocks_of

DOCS = ROOT / "docs"
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in [*DOCS.rglob("*.md"), ROOT / "README.md"]
    if blocks_of(path)
)
FIRST = {"README.md", "docs/quick-start.md"}
"""What a reader sees first: continuous integration follows these, `make check-all` every page."""

NOT_RUN = {
    "installs from the package index": 1,
    "run with the examples": 1,
    "there is no container engine where the project is checked": 3,
}
"""Why blocks may be left out, and how many are for each reason."""

ONE, OTHER = (f"{digit}1a1fdbe-70b6-72f8-a8d5-adf8507a7c1c" for digit in "09")
"""Identifiers."""

OF_THE_THEME = ("aria-dialog-name", "landmark-unique", "scrollable-region-focusable")
"""Faults of accessibility that Material brings along: its search, copy buttons, wide tables."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=pytest.mark.long if page in FIRST else pytest.mark.documented)
        for page in PAGES
    ],
)
def test_a_page_does_what_it_says(
    page: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    path = ROOT / page
    text = path.read_text("utf-8")
    url = request.getfixturevalue("postgres").new_database() if DATABASE in text else None
    with Walk(tmp_path / "reader", database=url) as walk:
        if "    make serve\n" in text:
            walk.serve()
        if "examples/" in text:
            # its reader is in the project's folder
            walk.folder.joinpath("examples").symlink_to(ROOT / "examples")
        for block in blocks_of(path):
            walk.follow(block)


def test_few_blocks_are_left_out_and_each_says_why() -> None:
    assert set(PAGES) > FIRST
    reasons = (block.not_run for page in PAGES for block in blocks_of(ROOT / page))
    assert Counter(reason for reason in reasons if reason is not None) == NOT_RUN


@pytest.mark.parametrize(
    ("language", "text", "error", "said"),
    [
        ("console", "$ false\n", AssertionError, "exit status 1"),
        ("console", "$ printf 'a\\nb\\n'\na\n", AssertionError, "written:"),
        ("console", "nothing is typed\n", AssertionError, "output before any command"),
        ("console", "$ (exit 2)\n$ echo $?\n3\n", AssertionError, "written:"),
        ("fortran", "END\n", AssertionError, "nothing runs a block of 'fortran'"),
        ("text", "printed\n", AssertionError, "printed:"),
        ("python", "assert 1 == 2, 'wrong'\n", AssertionError, "wrong"),
        ("yaml", "orbit: {radius: 20, angular_rate_rad_s: 0.2}\n", InputError, None),
        ("yaml", "near: [1]\n", InputError, None),
        ("yaml", "orbit: [\n", InputError, None),
        ("json", "{'a': 1}\n", json.JSONDecodeError, None),
    ],
)
def test_a_block_that_does_not_do_what_it_says_is_found(
    language: str, text: str, error: type[Exception], said: str | None, tmp_path: Path
) -> None:
    with Walk(tmp_path / "reader") as walk, pytest.raises(error, match=said):
        walk.follow(Block("page.md:1", language, {}, text))


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("a ... d", "a b c"),
        ("first\n...", "the first"),
        ("a ... b ... c", "a c b c d"),
        ("error 4.02 m", "error 4.2 m"),
        ("-1.0", "1.0"),
        ("rank 16 of 18", "rank 18 of 18"),
        ("", "anything"),
        (f"{ONE} {ONE}", f"{ONE} {OTHER}"),
    ],
)
def test_likeness_sees_what_differs(written: str, shown: str) -> None:
    assert not Likeness().matches(written, shown)


# --- the site ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site() -> Path:
    """The site, built strictly, in this process so that figures are computed once."""
    assert build_site() == 0
    return ROOT / "build" / "site"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as opened:
        yield opened


@pytest.mark.long
def test_every_page_is_built_and_asks_nobody_else(site: Path) -> None:
    built = sorted(path.relative_to(site).as_posix() for path in site.rglob("*.html"))
    written = {path.removeprefix("docs/").replace(".md", ".html") for path in PAGES} - {
        "README.html"
    }
    generated = {name.replace(".md", ".html") for name in REFERENCE}
    quick_start = site.joinpath("quick-start.html").read_text("utf-8")
    assert 'data-not-run="installs from the package index"' in quick_start
    assert set(built) >= written | generated | {"index.html", "concepts.html", "theory.html"}
    for path in site.rglob("*.html"):
        text = path.read_text("utf-8")
        fetched = re.findall(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="([^"]*)"', text)
        assert fetched
        assert "```" not in text, path
        assert not [address for address in fetched if "//" in address], path


@pytest.mark.long
def test_the_site_opens_as_a_file_with_figures_and_search(site: Path, browser: Browser) -> None:
    complaints: list[str] = []
    requests: list[str] = []
    for scheme in ("light", "dark"):
        page = browser.new_context(color_scheme=scheme).new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda asked: requests.append(asked.url))
        page.goto((site / "concepts.html").as_uri())
        expect(page.locator(".plot .main-svg").first).to_be_visible()
        drawn = page.locator(".plot .plot-container").count()
        assert drawn == page.locator(".plot").count() > 5
    page.keyboard.press("/")
    page.keyboard.type("desynchronised")
    expect(page.locator(".md-search-result__item").first).to_be_visible()
    assert complaints == []
    assert requests
    assert [url for url in requests if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.long
def test_pages_are_accessible_but_for_their_theme(site: Path, browser: Browser) -> None:
    page = browser.new_page()
    for name in ("quick-start", "concepts", "reference/scenario"):
        page.goto((site / f"{name}.html").as_uri())
        page.wait_for_load_state()
        faults = accessibility_faults(page)
        assert [fault for fault in faults if not fault.startswith(OF_THE_THEME)] == []


@pytest.mark.long
def test_captions_state_what_the_figures_show() -> None:
    """The line of sight of mirror motion never turns, and the filter's sigma does not notice."""
    _, turn, length = sight_direction(studies.pair("alternate", 20.0, 0.0))
    assert abs(turn).max() < 1e-9
    # samples miss the very ends
    assert length.min() == pytest.approx(30.0, abs=0.01)
    assert length.max() == pytest.approx(110.0, abs=0.01)
    for other in (("alternate", 20.0, 0.2), ("alternate", 15.0, 0.0), ("ccw", 20.0, 0.0)):
        assert abs(sight_direction(studies.pair(*other))[1]).max() > 4.0
    wrong, claimed = final_error(studies.flown())
    right, own = final_error(studies.flown(studies.DESYNC_RAD))
    assert wrong > 3.0 * claimed
    assert right < 1.5 * own
    words = DRAWN["optimism"]().words
    assert f"{wrong:.1f} m" in words
    assert f"{claimed:.1f} m" in words


def test_scenario_keys_carry_their_units() -> None:
    units = {"radius_m": "m", "turn_rate_sigma_rad_s": "rad/s", "speed_mps": "m/s", "name": ""}
    assert {key: unit_of(key) for key in units} == units
    rows = {row[0] for _, table in described_keys(Scenario.model_json_schema()) for row in table}
    assert {"`orbit`", "`desync_rad`", "`fov_deg`", "`center_box_m`", "`lat_deg`"} <= rows


def test_the_reference_names_every_command_operation_and_public_name() -> None:
    made = {name: content() for name, content in REFERENCE.items()}
    commands = get_command(application())
    for name in commands.commands:  # type: ignore[attr-defined]
        assert f"`syncplan {name}`" in made["reference/command-line.md"]
    document = openapi_document()
    for path, item in document["paths"].items():
        for method in set(item) - {"parameters"}:
            assert f"`{method.upper()} {path}`" in made["reference/service.md"]
    for name in {*syncplan.__all__, *syncplan.figures.__all__} - {"figures"}:
        assert f".{name}\n" in made["reference/python.md"]
    for status in ("401", "404", "422", "507"):
        assert f"| {status} |" in made["reference/problems.md"]
    assert settings_table() in made["reference/settings.md"]


def test_the_page_of_speeds_states_the_benchmarks_figures() -> None:
    page = speed_page()
    rows = measured(BENCHMARKS.read_text("utf-8"))
    assert len(rows) > 80
    for row in (
        "syncplan plan --paper, 1,000 vehicles",
        "refine, logdet, one start, 50 vehicles: 144",
    ):
        value = next(value for name, value in rows.items() if name.startswith(row))
        assert value in page[: page.index("## The benchmarks")]
    assert "{" not in page[: page.index("## The benchmarks")]


def test_tables_of_what_can_be_chosen_are_those_of_the_code() -> None:
    """`python -m docs.site --write` renews them; each stands on one page."""
    for path in DOCS.rglob("*.md"):
        text = path.read_text("utf-8")
        assert with_tables(text, path.name) == text
    named = [
        re.findall(r"<!-- table: ([\w-]+) -->", path.read_text()) for path in DOCS.rglob("*.md")
    ]
    assert sorted(name for names in named for name in names) == sorted(TABLES)
    with pytest.raises(InputError, match="no figure 'nothing'; there are accuracy"):
        with_figures("<!-- figure: nothing -->", "page.md")
    with pytest.raises(InputError, match="no table 'nothing'; there are figures"):
        with_tables("<!-- table: nothing -->\n<!-- end of table -->", "page.md")


def test_a_link_that_leads_nowhere_ends_the_build(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("[x](nothing.md)\n")
    (tmp_path / "mkdocs.yml").write_text("site_name: x\ntheme: {name: material, font: false}\n")
    assert generate(tmp_path / "mkdocs.yml") == 1
    (tmp_path / "docs" / "index.md").write_text("[x](index.md)\n")
    assert generate(tmp_path / "mkdocs.yml") == 0
