"""Plan files, read back as they were written or refused, and what else stands for a plan."""

import copy
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import syncplan
from syncplan.errors import InputError
from syncplan.planning.plan_files import loaded_from, plan_of
from syncplan.planning.plans import Plan
from syncplan.reports.plan_report import plan_document
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import scenario_from
from syncplan.scenario.other_documents import OTHER_DOCUMENTS
from tests.tools.on_paper import plan, refine
from tests.tools.scenarios import circling, document, example, small

Tree = dict[str, Any]

STAR = {"links": [["v1", f"v{k}"] for k in range(2, 5)]}
NAMES = ("biased-grid", "boats", "camera-pair", "five-ring")
DERIVED = ("speed_mps", "position_m", "heading_rad")


def written(made: Plan) -> Tree:
    """The document of a plan as its file holds it."""
    values: Tree = json.loads(json.dumps(plan_document(made).as_json()))
    return values


def again(values: Tree) -> Tree:
    """The document of the plan that a file's values are judged as."""
    return written(plan_of(loaded_from(values, source="p.json")))


def codes(values: Tree) -> list[str]:
    return [one["code"] for one in values["verdict"]["findings"]]


def without_derived(values: Tree) -> Tree:
    bare = copy.deepcopy(values)
    for one in bare["vehicles"]:
        for key in DERIVED:
            del one[key]
    return bare


@pytest.mark.parametrize("name", [*NAMES, "crooked-line-alternate", "landmark-bridge", "shelves"])
def test_a_plan_read_back_is_the_plan_that_was_written(name: str) -> None:
    first = written(plan(example(name)))
    assert again(first) == first


def test_centres_and_lost_links_are_read_back_with_what_is_said_of_them() -> None:
    placed = written(plan(small(formation=STAR)))
    assert "centres-placed" in codes(placed)
    assert again(placed) == placed
    triangle = [[0.0, 0.0], [86.0, 0.0], [43.0, 74.0]]
    lost = written(plan(small(formation={"centers_m": triangle}, min_separation_m=46.0)))
    assert lost["dropped_links"]
    lost["dropped_links"][0]["reason"] = "some other reason"
    kept = again(lost)
    assert kept["dropped_links"][0]["reason"] == "some other reason"
    assert any("some other reason" in one["message"] for one in kept["verdict"]["findings"])


@pytest.mark.parametrize("improved", [True, False])
def test_a_refinement_is_read_back(improved: bool) -> None:
    scenario = small(landmarks_m=[[30.0, 0.0], [40.0, 10.0]], duration_s=20.0)
    made = refine(scenario, objective="logdet", starts=1, time_limit_s=1e-9, workers=1)
    assert made.refinement is not None
    assert not made.refinement.improved
    first = written(replace(made, refinement=replace(made.refinement, improved=improved)))
    assert ("not-refined" in codes(first)) == (not improved)
    assert again(first) == first
    first["refinement"] |= {"improved": True, "cut_short": True}
    assert "search-cut-short" in codes(again(first))


def test_changed_orbits_have_no_record() -> None:
    first = written(plan(small(formation=STAR)))
    bare = without_derived(first)
    assert again(bare) == first
    bare["vehicles"][1]["phase_rad"] += 0.5
    changed = again(bare)
    assert changed["synchronisation"]["method"] == "given"
    assert "centres-placed" not in codes(changed)


@pytest.mark.parametrize(
    "change",
    [
        {"synchronisation": "perfect"},
        {"links": None},
        {"links": []},
        {"verdict": {"findings": 3}},
        {"refinement": {"objective": "logdet"}},
    ],
)
def test_a_record_that_can_not_be_read_is_none(change: Tree) -> None:
    values = {**written(plan(small())), **change}
    assert again(values)["synchronisation"]["method"] == "given"


@pytest.mark.parametrize(
    ("key", "value", "right"),
    [
        ("speed_mps", 9.0, "4"),
        ("speed_mps", "fast", "4"),
        ("position_m", [19.0, 0.0], "[20, 0]"),
        ("position_m", [20.0, 0.0, 0.0], "[20, 0]"),
        ("heading_rad", 1.6, "1.5708"),
        ("heading_rad", None, "1.5708"),
    ],
)
def test_what_follows_from_other_keys_must_agree_with_them(
    key: str, value: Any, right: str
) -> None:
    values = written(plan(small()))
    values["vehicles"][0][key] = value
    with pytest.raises(InputError) as caught:
        loaded_from(values, source="p.json")
    assert caught.value.key == f"vehicles[0].{key}"
    assert str(caught.value).startswith(f"p.json: vehicles[0].{key}: ")
    assert f"which give {right}; change those" in str(caught.value)
    del values["vehicles"][0][key]
    loaded_from(values, source="p.json")


def test_a_stale_phase_names_every_key_that_follows_from_it() -> None:
    values = written(plan(small()))
    values["vehicles"][1]["phase_rad"] = 1.0
    values["period_s"] = 30.0
    with pytest.raises(InputError) as caught:
        loaded_from(values, source="p.json")
    assert [one.key for one in caught.value.faults] == [
        "period_s",
        "vehicles[1].position_m",
        "vehicles[1].heading_rad",
    ]
    assert str(caught.value).endswith("(and 2 more)")


@pytest.mark.parametrize("name", NAMES)
def test_a_rounded_file_loads(name: str) -> None:
    values = written(plan(example(name), bound="never"))
    for one in values["vehicles"]:
        one["phase_rad"] = round(one["phase_rad"], 5)
        one["speed_mps"] = round(one["speed_mps"], 4)
        # four digits after the first of the radius
        places = 4 - math.floor(math.log10(one["radius_m"]))
        one["position_m"] = [round(part, places) for part in one["position_m"]]
        # the same direction, a turn further
        one["heading_rad"] = round(one["heading_rad"], 4) + 6.2832
    values["period_s"] = round(values["period_s"], 3)
    loaded_from(values)


@pytest.mark.parametrize("name", OTHER_DOCUMENTS)
def test_other_documents_are_called_by_their_names(name: str) -> None:
    kind = OTHER_DOCUMENTS[name]
    with pytest.raises(InputError) as caught:
        loaded_from(dict.fromkeys(kind.keys, 1), source="x.json")
    assert str(caught.value).startswith(f"x.json: is {kind.called} where a scenario or a plan")
    assert kind.instead in str(caught.value)
    # whatever else a scenario holds, it is read as one
    with pytest.raises(InputError, match="unknown key"):
        scenario_from({**document(), **dict.fromkeys(kind.keys, 1)})


def test_a_shape_beyond_the_usual_limit_is_planned_where_it_was_let_in() -> None:
    shape = {"shape": "grid", "count": 10_001, "columns": 50, "spacing_m": 70.0}
    loaded = scenario_from(document(formation=shape, duration_s=10.0), max_vehicles=10_001)
    resolved = loaded.resolved()
    assert resolved.centers == loaded.centers
    assert resolved.formation.shape is None
    assert len(resolved.vehicle_names) == 10_001


# --- what stands for a plan -----------------------------------------------------------------------


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
