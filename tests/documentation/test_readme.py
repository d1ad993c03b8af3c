"""What the README says of the service is so: its settings, its routes, its Python."""

import re

import pytest

from api.main import create_app
from api.settings import PREFIX, Settings
from docs.site.service_pages import settings_table
from tests.tools.serving import ROOT

README = (ROOT / "README.md").read_text()


def test_the_settings_are_those_of_the_service() -> None:
    assert settings_table() in README


def test_no_variable_is_named_that_is_no_setting() -> None:
    known = {name.upper() for name in Settings.model_fields} | {"DEBUG", "DATABASE_PASSWORD"}
    assert set(re.findall(rf"\b{PREFIX}(\w+)", README)) <= known


def test_every_route_is_told_and_no_other() -> None:
    names = {"figure": "NAME", "format": "FORMAT"}
    paths = {
        re.sub(r"\{(\w+)\}", lambda found: names.get(found[1], "ID"), path)
        for path in create_app().openapi()["paths"]
    }
    section = README[README.index("## The service") : README.index("### Settings")]
    table = section[section.index("| request |") : section.index("Errors are problem documents")]
    told: set[str] = {"/openapi.json"}
    for cell in (row.split("|")[1] for row in table.splitlines() if row.startswith("|")):
        first = ""
        for path in re.findall(r"(?:\.\.\.)?/[\w/.]+", cell):
            # "..." stands for the path before it, up to its identifier
            whole = first + path.removeprefix("...") if path.startswith("...") else path
            first = whole[: whole.index("/ID") + 3] if "/ID" in whole else first
            told.add(whole)
    assert told == paths | {"/openapi.json"}


@pytest.mark.parametrize(
    "word", ["make serve", "make check", "make container-steps", "make demo", "make docs"]
)
def test_every_target_named_is_there(word: str) -> None:
    assert word in README
    assert f"\n{word.split()[1]}:" in (ROOT / "Makefile").read_text()
