"""Briefs are read like scenarios: every fault is one line that names the key."""

from pathlib import Path
from typing import Any

import pytest

from syncplan.errors import InputError
from syncplan.scenario.brief import brief_of
from tests.tools.briefs import FIELD, brief

EXAMPLES = sorted(Path("examples/briefs").glob("*.yaml"))


def test_the_smallest_circle_is_that_of_the_tightest_limit() -> None:
    vehicle = brief(vehicle={"speed_mps": 18.0, "bank_deg": 30.0}).vehicle
    assert vehicle.least_radius(18.0) == pytest.approx(57.23, abs=0.01)
    vehicle = brief(vehicle={"speed_mps": [2.0, 4.0], "turn_rate_rad_s": 0.5}).vehicle
    assert vehicle.least_radius(4.0) == 8.0
    assert vehicle.speeds == (2.0, 4.0)


FAULTS: list[tuple[dict[str, Any], str]] = [
    ({"area_m": [[0.0, 0.0], [1.0, 0.0]]}, "area_m: has 2 corners"),
    ({"vehicle": {"speed_mps": 5.0}}, "vehicle.min_radius_m: is missing"),
    ({"vehicle": {"speed_mps": [5.0, 4.0], "min_radius_m": 1.0}}, "vehicle.speed_mps: the least"),
    (
        {"vehicle": {"speed_mps": [5.0, 4.0, 3.0], "min_radius_m": 1.0}},
        "vehicle.speed_mps: must have at most 2 items",
    ),
    ({"vehicle": {"speed_mps": [5.0], "min_radius_m": 1.0}}, "vehicle.speed_mps[1]: is missing"),
    ({"team": {"max": 0}}, "team.max: must be at least 1"),
    ({"team": {"min": 4, "max": 3}}, "team.min: is larger than max, 3"),
    ({"landmarks": {}}, "landmarks.max: is missing"),
    ({"landmarks": {"max": 2, "given": [[0.0, 0.0]]}}, "landmarks.max: is more than the 1 sites"),
    (
        {"landmarks": {"on_edge": True, "max": 1, "candidates_m": [[0.0, 0.0]]}},
        "landmarks.on_edge: can't be combined with candidates_m",
    ),
    ({"landmarks": {"max": 2, "candidates_m": []}}, "landmarks.candidates_m: is empty"),
    ({"landmarks": {"max": 2, "given": []}}, "landmarks.given: is empty"),
    ({"purpose": {"visit_m": []}}, "purpose.visit_m: is empty"),
    ({"purpose": {}}, "purpose.cover: is missing: give cover, visit_m or keep"),
    (
        {"purpose": {"visit_m": [[1.0, 1.0]], "keep": {"count": 2, "spread_m": 10.0}}},
        "purpose.keep: can't be combined with visit_m",
    ),
    ({"purpose": {"keep": {"count": 9, "spread_m": 10.0}}}, "purpose.keep.count: is more than"),
    ({"need": {"worst_rms_m": 0.0}}, "need.worst_rms_m: must be greater than 0"),
    ({"landmarks": {"candidates_m": [[float(k), 0.0] for k in range(51)]}}, "landmarks.max: is"),
    ({"keep_out_m": [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]] * 334}, "keep_out_m: has 1002 corners"),
    ({"effort": "huge"}, "effort: must be 'quick', 'normal' or 'thorough'"),
    ({"keep_outs_m": []}, "keep_outs_m: unknown key; did you mean keep_out_m?"),
]


@pytest.mark.parametrize(("keys", "message"), FAULTS)
def test_a_bad_brief_is_refused_by_its_key(keys: dict[str, Any], message: str) -> None:
    key, _, problem = message.partition(": ")
    with pytest.raises(InputError) as caught:
        brief_of({**FIELD, **keys})
    assert caught.value.key == key
    assert problem in caught.value.problem
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_are_briefs_and_no_scenarios(path: Path) -> None:
    from syncplan.scenario.loading import load_scenario

    assert brief_of(path).name
    with pytest.raises(InputError, match="is a brief where a scenario or a plan is wanted"):
        load_scenario(path)
