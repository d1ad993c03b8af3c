"""Plans sent in the place of scenarios: judged with their own orbits, kept, refused in words."""

import json
import math
from dataclasses import replace
from typing import Any

import httpx2
import numpy as np
import pytest

import syncplan
from api.computing.tasks import made_plan
from api.documents import loaded_plan
from api.service import limits_of
from api.settings import load_settings
from syncplan.client.service_client import Client
from syncplan.errors import InputError
from syncplan.orbits.circles import Orbits
from syncplan.planning.plan_files import loaded_from, plan_of, stated
from syncplan.reports.plan_report import plan_document
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import scenario_from
from tests.tools.api_servers import faults_of, key_of
from tests.tools.processes import PATIENCE_S
from tests.tools.scenarios import LANDMARKS, document, small
from tests.tools.serving import Server

Tree = dict[str, Any]

PATHS = ["/v1/plans", "/v1/previews?figure=formation"]


def given(**changes: Any) -> Tree:
    """Return the document of a plan whose phases no rule gives."""
    made = syncplan.plan(small(landmarks_m=LANDMARKS, **changes))
    values: Tree = json.loads(json.dumps(plan_document(made).as_json()))
    values["vehicles"][1]["phase_rad"] = 2.5
    for key in ("position_m", "heading_rad"):
        del values["vehicles"][1][key]
    return values


def judged(ann: httpx2.Client, path: str, body: Tree) -> Tree:
    """Return what the service makes of a document."""
    answer = ann.post(path, json=body)
    assert answer.status_code in (200, 201), answer.text
    made: Tree = answer.json()
    plan: Tree = made.get("plan", made)
    return plan


@pytest.mark.parametrize("path", PATHS)
def test_a_plan_keeps_its_phases_and_is_judged_as_the_library_judges_it(
    ann: httpx2.Client, path: str
) -> None:
    body = given()
    made = judged(ann, path, body)
    assert [one["phase_rad"] for one in made["vehicles"]] == [0.0, 2.5]
    assert made["synchronisation"]["method"] == "given"
    own = {
        key: value for key, value in made.items() if key not in ("id", "created_at", "parent_id")
    }
    assert own == plan_document(plan_of(loaded_from(body))).as_json()
    assert judged(ann, path, body["scenario"])["vehicles"][1]["phase_rad"] != 2.5


def test_a_plan_that_was_given_is_kept_and_drawn_and_exported_with_its_phases(
    ann: httpx2.Client,
) -> None:
    answer = ann.post("/v1/plans", json=given())
    at = answer.headers["location"]
    assert answer.json()["parent_id"] is None
    assert ann.get(f"{at}/figures/timeline").status_code == 200
    assert ann.get(f"{at}/exports/csv?force=true").status_code == 200
    assert ann.post(f"{at}/refinements", json={"starts": 1}).status_code == 202


def test_a_plan_that_is_sent_back_as_it_was_keeps_its_record(ann: httpx2.Client) -> None:
    first = judged(ann, "/v1/plans", document(landmarks_m=LANDMARKS))
    assert judged(ann, "/v1/plans", first)["synchronisation"] == first["synchronisation"]


def test_only_the_scenario_and_the_orbits_of_a_plan_are_read(ann: httpx2.Client) -> None:
    whole = given()
    keys = ("name", "center_m", "radius_m", "direction", "phase_rad")
    short = {
        "scenario": whole["scenario"],
        "vehicles": [{key: one[key] for key in keys} for one in whole["vehicles"]],
    }
    lying = {**whole, "observability": "perfect", "links": None}
    tags = {ann.post("/v1/plans", json=one).headers["etag"] for one in (whole, short, lying)}
    assert len(tags) == 1


def test_the_bytes_of_a_scenarios_plan_are_those_of_the_library(ann: httpx2.Client) -> None:
    answer = ann.post("/v1/plans", json=document(landmarks_m=LANDMARKS))
    text = as_text(plan_document(syncplan.plan(small(landmarks_m=LANDMARKS))).as_json())
    assert answer.text.endswith(text[1:])


def test_a_plan_may_be_yaml_and_have_other_phases_by_a_turn(ann: httpx2.Client) -> None:
    body = given()
    body["vehicles"][1]["phase_rad"] = 2.5 - 2.0 * math.pi
    headers = {"content-type": "application/yaml"}
    answer = ann.post("/v1/plans", content="---\n" + json.dumps(body), headers=headers)
    assert answer.status_code == 201, answer.text
    assert answer.json()["vehicles"][1]["phase_rad"] == pytest.approx(2.5, abs=1e-14)


def _with(path: str, value: Any) -> Tree:
    """A plan with one value changed; a value of None takes the key out."""
    body: Any = given()
    *above, last = [int(part) if part.isdigit() else part for part in path.split(".")]
    inner = body
    for part in above:
        inner = inner[part]
    if value is None:
        del inner[last]
    else:
        inner[last] = value
    changed: Tree = body
    return changed


@pytest.mark.parametrize(
    ("changed", "value", "fault"),
    [
        ("scenario.radius", 3, "scenario.radius"),
        ("scenario", [], "scenario"),
        ("scenario.formation", {"links": [["v1", "v2"]]}, "scenario.formation.centers_m"),
        ("vehicles", {}, "vehicles"),
        ("vehicles", [], "vehicles"),
        ("vehicles.1.phase_rad", None, "vehicles[1].phase_rad"),
        ("vehicles.0.phase_rad", "0", "vehicles[0].phase_rad"),
        ("vehicles.0.radius_m", 0, "vehicles[0].radius_m"),
        ("vehicles.1.direction", "alternate", "vehicles[1].direction"),
        ("vehicles.1.name", "v9", "vehicles"),
        ("scenario.duration_s", 1e7, "scenario.duration_s"),
        ("scenario.duration_s", 3000.0, "scenario.duration_s"),
    ],
)
def test_a_fault_of_a_plan_is_reported_by_its_path(
    ann: httpx2.Client, changed: str, value: Any, fault: str
) -> None:
    answer = ann.post("/v1/plans", json=_with(changed, value))
    assert [one.path for one in faults_of(answer)] == [fault]
    assert fault in answer.json()["detail"]


@pytest.mark.parametrize("path", PATHS)
def test_all_faults_of_a_plan_are_reported_at_once(ann: httpx2.Client, path: str) -> None:
    body = _with("scenario.sensor.range_m", -5)
    body["vehicles"][0]["phase_rad"] = None
    faults = {one.path for one in faults_of(ann.post(path, json=body))}
    assert faults == {"vehicles[0].phase_rad", "scenario.sensor.range_m"}


def test_a_plan_of_a_team_that_is_too_large_is_refused() -> None:
    body = json.dumps(given()).encode()
    limits = replace(limits_of(load_settings()), vehicles=1)
    with pytest.raises(InputError, match=r"^scenario\.formation.* limit of 1"):
        made_plan(body, "json", limits, False)


def test_the_client_keeps_a_plan_with_its_phases(server: Server) -> None:
    better = plan_of(loaded_from(given()))
    with Client(server.url, key_of("ann"), timeout_s=PATIENCE_S) as client:
        kept = client.plan(better)
        assert kept.document["synchronisation"]["method"] == "given"
        again = client.plan(kept.document)
    for one in (kept, again):
        assert np.array_equal(one.orbits.phases, better.orbits.phases)
        assert np.array_equal(one.orbits.centers, better.orbits.centers)
    assert kept.observability.rank == better.observability.rank


def test_a_stored_plan_is_read_whatever_its_size() -> None:
    shape = {"shape": "grid", "count": 10_001, "columns": 50, "spacing_m": 70.0}
    large = scenario_from(
        document(formation=shape, duration_s=10.0), max_vehicles=10_001
    ).resolved()
    centers = np.array(large.centers)
    ones = np.ones(large.size)
    orbits = Orbits(centers, 20.0 * ones, ones, 0.0 * ones, large.orbit.rate)
    assert loaded_plan(json.dumps(stated(large, orbits))).scenario.size == 10_001
