"""House rules beyond those of import-linter and ruff."""

from pathlib import Path

import pytest

import syncplan

ROOT = Path(__file__).parents[1]

DEGREES_AT_THE_EDGE = {
    "syncplan/observability/unobservable_modes.py",
    "syncplan/plotting/canvas.py",
    "syncplan/scenario/ground.py",
}
"""Where degrees are turned to radians or back, besides other programs' formats."""


def test_degrees_appear_only_at_the_edge() -> None:
    using = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "syncplan").rglob("*.py")
        if "degrees(" in path.read_text()
    }
    assert {name for name in using if "/exporting/" not in name} == DEGREES_AT_THE_EDGE


def test_the_package_offers_what_it_lists() -> None:
    for name in syncplan.__all__:
        assert getattr(syncplan, name) is not None
    with pytest.raises(AttributeError):
        syncplan.nothing  # noqa: B018
