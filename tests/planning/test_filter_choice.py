"""Which filter runs on a plan."""

import pytest

import syncplan
from syncplan.errors import InputError
from syncplan.estimation.filter_options import FilterOptions
from syncplan.planning.validation import choose_filter
from syncplan.planning.variations import sweep
from tests.tools.scenarios import changed, example


def test_a_known_start_is_left_to_the_extended_filter() -> None:
    choice = choose_filter(syncplan.plan(example("paper-grid-same")), FilterOptions())
    assert choice.name == "ekf"
    assert choice.reason.startswith("start-up index 0.")


def test_a_start_that_the_index_does_not_clear_calls_for_the_robust_filter() -> None:
    lost = changed("paper-grid-same", initial_sigma={"position_m": 15.0, "heading_rad": 0.3})
    done = syncplan.validate(lost, trials=16, duration=70.0)
    assert done.filter == "robust"
    assert "over the 0.45" in done.chosen_because
    assert done.judged_from == pytest.approx(31.5)


def test_the_scenario_and_then_the_option_decide() -> None:
    asked = changed("paper-grid-same", filter={"kind": "second-order"})
    plan = syncplan.plan(asked)
    assert choose_filter(plan, FilterOptions()).name == "second-order"
    assert choose_filter(plan, FilterOptions(filter="paper")).name == "paper"


def test_rows_of_a_sweep_have_one_filter() -> None:
    lost = changed("paper-grid-same", initial_sigma={"position_m": 15.0, "heading_rad": 0.3})
    rows = sweep(lost, "range", [50.0, 60.0], trials=1, duration=2.0)
    assert {row.validation.filter for row in rows} == {"ekf"}


@pytest.mark.parametrize(("former", "now"), [("arc", "ekf"), ("euler", "paper")])
def test_former_names_are_understood(former: str, now: str) -> None:
    assert FilterOptions(model=former).filter == now
    assert FilterOptions.of_request({"model": former}).filter == now
    with pytest.raises(InputError, match="leave model out"):
        FilterOptions(model=former, filter="robust")
