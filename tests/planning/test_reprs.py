"""Public objects introduce themselves in a line, whatever arrays they hold."""

import re

import pytest

from syncplan.planning.plans import Plan
from syncplan.planning.validation import validate
from tests.tools.on_paper import choose_landmarks, plan
from tests.tools.scenarios import example

LONGEST = 250


@pytest.fixture(scope="module")
def grid() -> Plan:
    return plan(example("paper-grid-same"), bound="never")


def test_a_plan_states_its_name_team_rank_and_period(grid: Plan) -> None:
    assert repr(grid) == (
        f"<Plan {grid.scenario.name!r}: 6 vehicles, rank 18 of 18, observable, period 31.42 s>"
    )


def test_a_scenario_states_its_name_and_numbers(grid: Plan) -> None:
    assert repr(grid.scenario) == (f"<Scenario {grid.scenario.name!r}: 6 vehicles, 2 landmarks>")


def test_arrays_are_shown_as_shapes(grid: Plan) -> None:
    assert repr(grid.orbits) == (
        "Orbits(centers=(6, 2), radii=(6,), senses=(6,), phases=(6,), rate=0.2)"
    )
    for one in (grid.team, grid.sensors, grid.windows):
        assert re.fullmatch(rf"{type(one).__name__}\(.*\)", repr(one))
        assert "array" not in repr(one)


def test_results_take_one_line_each(grid: Plan) -> None:
    validation = validate(grid, trials=2, duration=20.0)
    choice = choose_landmarks(grid, {"A": (190.0, 35.0), "B": (-40.0, 0.0)}, 1, bound="never")
    for one in (grid, grid.scenario, grid.team, validation, choice):
        assert len(repr(one)) < LONGEST + len(repr(grid)), repr(one)
        assert "\n" not in repr(one)
    assert "2 trials over 20 s" in repr(validation)
    assert f"{choice.names[choice.chosen[0]]} of 2 candidates" in repr(choice)
