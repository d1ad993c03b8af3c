"""Files, mappings and scenarios stand for the plans made of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.planning.planner import Plan
from syncplan.runtime.files import as_text
from tests.tools.scenarios import circling, small

MAPPING = small().model_dump(mode="json", exclude_none=True)


@pytest.fixture
def scenario_file(tmp_path: Path) -> Path:
    path = tmp_path / "scenario.json"
    path.write_text(as_text(MAPPING))
    return path


@pytest.fixture
def plan_file(tmp_path: Path) -> Path:
    path = tmp_path / "plan.json"
    syncplan.plan(small()).save(path)
    return path


def same(one: Plan, other: Plan) -> bool:
    return one.scenario == other.scenario and bool(
        np.array_equal(one.orbits.phases, other.orbits.phases)
    )


def test_a_scenario_is_planned_from_its_file_or_its_keys(scenario_file: Path) -> None:
    made = syncplan.plan(small())
    for given in (scenario_file, str(scenario_file), MAPPING):
        assert same(syncplan.plan(given), made)


def test_what_takes_a_plan_takes_files_and_mappings(scenario_file: Path, plan_file: Path) -> None:
    expected = syncplan.validate(small(), trials=2, duration=10.0).accuracy.late_position
    for given in (scenario_file, str(plan_file), MAPPING, syncplan.load_plan(plan_file)):
        found = syncplan.validate(given, trials=2, duration=10.0).accuracy.late_position
        assert np.array_equal(found, expected)


def test_a_plan_read_keeps_orbits_that_planning_would_not_find(tmp_path: Path) -> None:
    orbit = circling(desync_rad=[0.0, 0.3])
    made = syncplan.plan(small(orbit=orbit))
    made.save(tmp_path / "plan.json")
    assert same(syncplan.load_plan(tmp_path / "plan.json"), made)


@pytest.mark.parametrize("given", [3, None, ["plan.json"]])
def test_anything_else_is_refused_by_its_kind(given: Any) -> None:
    kind = type(given).__name__
    for call in (syncplan.plan, syncplan.validate, syncplan.refine):
        with pytest.raises(syncplan.InputError, match=f"is a {kind}; give a"):
            call(given)


def test_a_plan_where_a_scenario_is_wanted_and_the_reverse_say_what_reads_them(
    scenario_file: Path, plan_file: Path
) -> None:
    with pytest.raises(syncplan.InputError, match=r"is already a plan; syncplan\.load_plan"):
        syncplan.plan(plan_file)
    with pytest.raises(syncplan.InputError, match=r"is a scenario, not a plan; syncplan\.plan"):
        syncplan.load_plan(scenario_file)
