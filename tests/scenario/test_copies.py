"""Copies of a scenario are checked as its file is."""

from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.scenario.models import MAX_VEHICLES
from syncplan.scenario.specification import Scenario
from tests.tools.scenarios import document, small


def test_a_copy_has_the_changed_keys_and_keeps_the_others() -> None:
    scenario = small()
    copied = scenario.model_copy(update={"min_separation_m": 3.0})
    assert copied.min_separation_m == 3.0
    assert copied.model_copy(update={"min_separation_m": 0.0}) == small(min_separation_m=0.0)
    assert copied.model_fields_set == scenario.model_fields_set | {"min_separation_m"}


@pytest.mark.parametrize(
    ("section", "changes", "message"),
    [
        ("sensor", {"range_m": -70}, "range_m: -70: must be greater"),
        ("sensor", {"rnage_m": 70.0}, "rnage_m: unknown key; did you mean range_m"),
        ("orbit", {"radius_m": None}, "radius_m"),
        ("", {"landmarks_m": {"v1": [0.0, 0.0]}}, "v1"),
        ("", {"min_separation_m": float("nan")}, "min_separation_m"),
    ],
)
def test_a_copy_that_no_file_could_state_is_refused(
    section: str, changes: dict[str, Any], message: str
) -> None:
    scenario = small()
    changed = getattr(scenario, section) if section else scenario
    with pytest.raises(InputError, match=message):
        changed.model_copy(update=changes)


def test_a_deep_copy_shares_nothing_that_can_change() -> None:
    scenario = small()
    deep = scenario.model_copy(deep=True)
    changed = scenario.model_copy(update={"min_separation_m": 1.0}, deep=True)
    for one in (deep, changed):
        assert one.formation.centers_m == scenario.formation.centers_m
        assert one.formation.centers_m is not scenario.formation.centers_m


def test_a_team_above_the_limit_can_be_copied() -> None:
    centers = [[70.0 * k, 0.0] for k in range(MAX_VEHICLES + 1)]
    keys = document(formation={"centers_m": centers}, duration_s=100.0)
    large = Scenario.model_validate(keys, context={"max_vehicles": MAX_VEHICLES + 1})
    formation = large.formation.model_copy(update={"centers_m": [*centers[1:], [-70.0, 0.0]]})
    assert large.model_copy(update={"formation": formation}).size == MAX_VEHICLES + 1
    with pytest.raises(InputError, match="more than the limit"):
        Scenario.from_mapping(keys)


def test_a_mapping_is_checked_as_a_file() -> None:
    assert Scenario.from_mapping(document()) == small()
    with pytest.raises(InputError, match="orbit: is missing"):
        Scenario.from_mapping({key: value for key, value in document().items() if key != "orbit"})
