"""Altitudes of a scenario: for all or for each vehicle, within limits, and no key of a sweep."""

from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.orbits.lost_parts import lost_together, scenario_after
from syncplan.scenario.altitudes import HIGHEST_M, LOWEST_M
from syncplan.scenario.dotted_keys import all_numeric_keys, numeric_keys, swept_key
from tests.tools.scenarios import small


def test_a_scenario_without_altitudes_does_not_mention_them() -> None:
    scenario = small()
    assert scenario.altitudes == []
    assert "altitude_m" not in scenario.resolved().model_dump(exclude_none=True)


@pytest.mark.parametrize(
    ("given", "each"),
    [
        (60.0, [60.0, 60.0]),
        ([40, 55.5], [40.0, 55.5]),
        ([LOWEST_M, HIGHEST_M], [-1000.0, 100_000.0]),
    ],
)
def test_altitudes_are_of_all_or_of_each(given: Any, each: list[float]) -> None:
    assert small(altitude_m=given).altitudes == each
    assert small(altitude_m=given).resolved().altitudes == each


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (-1001.0, "altitude_m: -1001.0: must be at least -1000"),
        (1e6, "altitude_m: 1000000.0: must be at most 100000"),
        ([1.0, float("nan")], r"altitude_m\[1\]: .*finite"),
        ([1.0], "altitude_m: has 1 values for 2 vehicles; give one each"),
        ([1.0, None], r"altitude_m\[1\]: "),
    ],
)
def test_other_altitudes_are_refused(given: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        small(altitude_m=given)


def test_an_altitude_is_described_but_not_swept() -> None:
    assert all_numeric_keys()["altitude_m"].unit == "m"
    assert all_numeric_keys().keys() - numeric_keys().keys() >= {"altitude_m", "motion.lag_s"}
    for key in ("altitude_m", "refine.margin_m"):
        with pytest.raises(InputError, match="no figure of a sweep depends on it"):
            swept_key(key)


def test_a_lost_vehicle_takes_its_altitude_along() -> None:
    three = {"centers_m": [[0.0, 0.0], [70.0, 0.0], [140.0, 0.0]]}
    scenario = small(formation=three, altitude_m=[40.0, 50.0, 60.0])
    left = scenario_after(scenario.resolved(), lost_together(["v2"], scenario))
    assert left.altitude_m == [40.0, 60.0]
