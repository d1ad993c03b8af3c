"""Fronts: a larger team is no worse than a smaller one, and no simple search beats them."""

from pathlib import Path

import pytest

from syncplan.designs.candidates import UNFIT
from syncplan.designs.ladder import Ladder
from syncplan.runtime.machine import single_threaded_blas
from syncplan.runtime.task_crew import EarlierSearch
from syncplan.scenario.brief import Brief, brief_of
from tests.tools.briefs import brief
from tests.tools.fronts import simple_search, worsened

BRIEFS = [
    *(Path("tests/data/briefs") / f"{name}.yaml" for name in ("cover-wind", "visit-walls")),
    Path("tests/data/briefs/keep-distances.yaml"),
]


def _beaten(given: Brief, every: int) -> list[str]:
    """What worsens in a front, and which of its teams a simple search beats by over 3 %."""
    front = Ladder(given, 2, lambda _state: None, EarlierSearch()).search_all()
    errors = {team.cell: team.value for team in front[::every]}
    simple = {cell: simple_search(given, cell) for cell in errors}
    return worsened(front) + [
        f"{cell}: {errors[cell]} m, simple search {simple[cell]} m"
        for cell in errors
        if errors[cell] > 1.03 * simple[cell] and simple[cell] < UNFIT
    ]


@single_threaded_blas
def test_no_simple_search_beats_a_front_and_larger_teams_are_no_worse() -> None:
    purpose = {"keep": {"count": 2, "spread_m": 40.0}}
    assert _beaten(brief(purpose=purpose, landmarks={"max": 3}, seed=1), 3) == []


@pytest.mark.long
@pytest.mark.parametrize("path", BRIEFS, ids=lambda path: path.stem)
@single_threaded_blas
def test_no_simple_search_beats_larger_fronts(path: Path) -> None:
    assert _beaten(brief_of(path), 4) == []
