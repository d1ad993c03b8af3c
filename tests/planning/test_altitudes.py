"""Altitudes in a verdict: ranges count in the plane, and great differences are reported."""

import math
from typing import Any

import numpy as np
import pytest

from syncplan.planning.plan_records import flight_digest
from syncplan.reports.plan_report import plan_document
from tests.tools.flown import WELL
from tests.tools.on_paper import plan
from tests.tools.scenarios import findings_of, planned, small

LIMIT = math.sqrt(1.0 - 0.99**2)
"""Difference of altitude, over the range, that takes a hundredth of the range."""

TEAM: dict[str, Any] = {
    "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0], [140.0, 0.0]]},
    "landmarks_m": [[-20.0, 40.0], [60.0, -40.0]],
    "sensor": [{"range_m": reach} for reach in (50.0, 50.0, 60.0)],
}


def test_altitudes_move_nothing_in_the_plane() -> None:
    low, high = (plan(small(**TEAM, altitude_m=given)) for given in (None, [20.0, 90.0, 0.0]))
    assert np.array_equal(low.orbits.phases, high.orbits.phases)
    before, after = (plan_document(judged).as_json() for judged in (low, high))
    assert after["scenario"].pop("altitude_m") == [20.0, 90.0, 0.0]
    slanted = [finding.message for finding in findings_of(high, "slant-range")]
    assert len(slanted) == 2
    for message in slanted:
        after["notes"].remove(message)
    findings = after["verdict"]["findings"]
    after["verdict"]["findings"] = [each for each in findings if each["message"] not in slanted]
    assert after == before


def test_flights_count_whatever_the_altitude() -> None:
    judged = planned()
    changed = judged.scenario.model_copy(update={"altitude_m": 30.0})
    digests = {flight_digest(each, judged.orbits, WELL) for each in (judged.scenario, changed)}
    assert len(digests) == 1


@pytest.mark.parametrize(
    ("share", "codes"), [(0.999, []), (1.001, ["warning"])], ids=["below", "above"]
)
def test_a_difference_that_takes_a_hundredth_of_the_range_is_a_warning(
    share: float, codes: list[str]
) -> None:
    judged = planned(altitude_m=[30.0, 30.0 + share * LIMIT * 50.0])
    assert [finding.level for finding in findings_of(judged, "slant-range")] == codes


def test_the_pair_that_differs_most_is_named_with_its_slant_and_the_remedy() -> None:
    judged = planned(**{**TEAM, "landmarks_m": []}, altitude_m=[20.0, 40.0, 70.0])
    (finding,) = findings_of(judged, "slant-range")
    assert (finding.level, finding.subjects) == ("warning", ("v2", "v3"))
    assert "v2 and v3 differ by 30 m in altitude" in finding.message
    assert f"range, 60 m, they are {math.hypot(60, 30):.4g} m from each other" in finding.message
    assert finding.cure is not None
    assert f"sqrt(R^2 - d^2) = {math.sqrt(60**2 - 30**2):.4g} m;" in finding.cure.text
    assert finding.cure.change == {}


def test_vehicles_that_never_meet_may_differ() -> None:
    apart = {"centers_m": [[0.0, 0.0], [500.0, 0.0]]}
    assert not findings_of(planned(formation=apart, altitude_m=[0.0, 500.0]), "slant-range")


def test_landmarks_far_below_are_a_note() -> None:
    judged = planned(landmarks_m={"mast": [0.0, 40.0]}, altitude_m=30.0)
    (finding,) = findings_of(judged, "slant-range")
    assert (finding.level, finding.subjects) == ("note", ("v1", "mast"))
    assert f"they are {math.hypot(50, 30):.4g} m from each other" in finding.message
    assert not findings_of(planned(landmarks_m=[[0.0, 40.0]], altitude_m=7.0), "slant-range")


@pytest.mark.parametrize(
    ("altitude", "level"), [(49.9, "note"), (50.0, "warning"), (60.0, "warning")]
)
def test_landmarks_beyond_the_range_below_are_a_warning(altitude: float, level: str) -> None:
    judged = planned(landmarks_m={"mast": [0.0, 40.0]}, altitude_m=altitude)
    (finding,) = findings_of(judged, "slant-range")
    assert (finding.level, finding.subjects) == (level, ("v1", "mast"))
    assert ("they never see each other" in finding.message) == (level == "warning")
    # no reach in the plane is left to state
    assert finding.cure is not None
    assert ("sqrt" in finding.cure.text) == (level == "note")
    assert not findings_of(planned(altitude_m=30.0), "slant-range")


def test_vehicles_further_apart_in_altitude_than_they_see_never_meet() -> None:
    (finding,) = findings_of(planned(altitude_m=[0.0, 51.0]), "slant-range")
    assert "v1 and v2 differ by 51 m in altitude: if the range, 50 m, is meant" in finding.message
    assert finding.level == "warning"
