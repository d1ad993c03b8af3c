"""What README and documentation say of service, targets, figure and verdict is so."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

import syncplan
from api.settings import PREFIX, Settings
from syncplan import figures
from syncplan.planning.verdict_checks import CHECKS
from tests.tools.api_servers import openapi_document
from tests.tools.scenarios import small
from tests.tools.serving import ROOT

README = (ROOT / "README.md").read_text("utf-8")
SERVICE = (ROOT / "docs" / "how-to" / "service.md").read_text("utf-8")
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 170


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_setting_file_and_module_that_a_page_names_is_there(page: Path) -> None:
    """The builder of the site checks its own links, not those of the README."""
    text = page.read_text("utf-8")
    known = {name.upper() for name in Settings.model_fields} | {"DEBUG", "DATABASE_PASSWORD"}
    assert set(re.findall(rf"\b{PREFIX}(\w+)", text)) <= known
    generated = {"reference", "speed.md"}
    for target in re.findall(r"\]\(([\w./-]+)(?:#[\w-]+)?\)", text):
        assert (page.parent / target).exists() or generated & set(Path(target).parts), target
    homes = (ROOT, ROOT / "syncplan", ROOT / "benchmarks")
    for name in re.findall(r"`(?:python )?([\w./-]+\.py)`", text):
        assert any((home / name).exists() for home in homes), name
    for name in re.findall(r"python -m ((?:tests|benchmarks|docs)[\w.]*)", text):
        place = ROOT.joinpath(*name.split("."))
        assert place.with_suffix(".py").exists() or (place / "__main__.py").exists(), name


def test_every_route_is_listed_and_no_other() -> None:
    names = {"figure": "NAME", "format": "FORMAT"}
    paths = {
        re.sub(r"\{(\w+)\}", lambda found: names.get(found[1], "ID"), path)
        for path in openapi_document()["paths"]
    }
    table = SERVICE[SERVICE.index("| request |") : SERVICE.index("Errors are problem documents")]
    listed: set[str] = {"/openapi.json"}
    for cell in (row.split("|")[1] for row in table.splitlines() if row.startswith("|")):
        first = ""
        for path in re.findall(r"(?:\.\.\.)?/[\w/.-]+", cell):
            # "..." stands for the path before it, up to its identifier
            whole = first + path.removeprefix("...") if path.startswith("...") else path
            first = whole[: whole.index("/ID") + 3] if "/ID" in whole else first
            listed.add(whole)
    assert listed == paths | {"/openapi.json"}


def test_every_target_named_is_there() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in ("serve", "check", "container-steps", "demo", "docs"):
        assert f"make {target}" in README + SERVICE
        assert f"\n{target}:" in makefile


def test_the_readme_shows_the_plan_it_speaks_of() -> None:
    """The image holds every word of the figure that its command draws; fonts may differ."""
    image = ElementTree.parse(ROOT / "docs" / "assets" / "formation.svg").getroot()
    shown = {text for element in image.iter() for text in element.itertext()}
    scenario = syncplan.load_scenario(ROOT / "examples" / "scenarios" / "paper-grid-same.yaml")
    figure = figures.formation(syncplan.plan(scenario))
    legend = {trace.name for trace in figure.data if trace.name and trace.showlegend is not False}
    names = {*scenario.vehicle_names, "L1", "L2"}
    assert legend
    assert legend | names <= shown
    assert re.sub(r"<[^>]*>", "", figure.layout.title.text.split("<br>")[0]) in shown


def test_the_page_on_the_verdict_lists_every_code_in_order_and_its_level() -> None:
    page = (ROOT / "docs" / "verdict.md").read_text("utf-8")
    listed = dict(re.findall(r"^\| `([a-z-]+)` \| (stop|warning|note) \|", page, re.MULTILINE))
    assert list(listed) == list(CHECKS)
    square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]
    broken = syncplan.plan(
        small(
            formation={"centers_m": [[0.0, 0.0], [25.0, 0.0]]},
            landmarks_m=[[20.5, 0.0]],
            area_m=square,
            keep_out_m=[[[15.0, -5.0], [25.0, -5.0], [25.0, 5.0]]],
            min_separation_m=90.0,
        ),
        bound="never",
    )
    levels = {finding.code: finding.level for finding in broken.verdict.findings}
    assert len(levels) >= 6
    assert levels.items() <= listed.items()
