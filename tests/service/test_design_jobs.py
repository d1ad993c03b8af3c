"""Designs as jobs: the front in their events, the library's bytes, and searches that end early."""

import json
from typing import Any

import httpx2
import pytest

from api.computing.tasks import checked_request
from api.responses import JobEvent
from syncplan.designs.designer import design
from syncplan.errors import InputError
from syncplan.reports.design_report import DesignDocument, design_document
from syncplan.runtime.files import as_text
from tests.service.test_requests import LIMITS
from tests.tools.api_servers import done, faults_of, planned, problem
from tests.tools.briefs import FIELD, brief
from tests.tools.processes import wait_until


def _handed_in(http: httpx2.Client, path: str, body: dict[str, Any]) -> str:
    answer = http.post(path, json=body)
    assert answer.status_code == 202, answer.text
    return str(answer.headers["location"])


def _events(http: httpx2.Client, job: str) -> list[JobEvent]:
    """All events of a job, which has ended by then."""
    lines = http.get(f"{job}/events", headers={"accept": "text/event-stream"}).text.splitlines()
    given = (line.removeprefix("data: ") for line in lines if line.startswith("data: "))
    return [JobEvent.model_validate_json(one) for one in given]


def test_a_design_is_the_librarys_and_its_events_carry_the_front(ann: httpx2.Client) -> None:
    job = _handed_in(ann, "/v1/designs", {**FIELD, "team": {"min": 2, "max": 4}})
    assert done(ann, job)["progress"] == {"done": 14, "total": 14}
    result = ann.get(f"{job}/result").text
    here = design(brief(team={"min": 2, "max": 4}), workers=1)
    assert result == as_text(design_document(here).as_json())
    shown = [one for one in _events(ann, job) if one.front]
    assert shown[0].doing == "searching teams"
    last = shown[-1].front
    assert last is not None
    front = DesignDocument.model_validate_json(result).front
    assert last == [one.model_copy(update={"formation": None}) for one in front]
    # what is stated of a team in the front can be planned as it is
    formation = next(one.formation for one in front if one.formation)
    assert ann.post("/v1/plans", json=formation).status_code == 201
    drawn = ann.get(f"{job}/figures/front").json()
    assert {trace["uid"] for trace in drawn["data"]} == {"landmarks-2", "need", "winner"}


@pytest.mark.long
def test_a_search_that_is_to_finish_gives_the_best_it_has(ann: httpx2.Client) -> None:
    long = {**FIELD, "effort": "normal", "team": {"min": 2, "max": 5}}
    job = _handed_in(ann, "/v1/designs", long)
    wait_until(lambda: ann.get(job).json()["progress"]["done"] >= 1)
    assert ann.post(f"{job}/finish").status_code == 200
    assert done(ann, job)["state"] == "succeeded"
    found = ann.get(f"{job}/result").json()
    assert (found["cut_short"], found["binding"]) == (True, "time")
    assert found["plan"]["observability"]["observable"]
    assert found["validation"] is None
    # it has ended
    problem(ann.post(f"{job}/finish"), 409)


@pytest.mark.long
def test_a_refinement_that_is_to_finish_gives_the_best_it_has(ann: httpx2.Client) -> None:
    plan = planned(ann)["id"]
    body = {"vary": ["phases", "centers"], "starts": 1000, "time_limit_s": 300.0}
    job = _handed_in(ann, f"/v1/plans/{plan}/refinements", body)
    wait_until(lambda: ann.get(job).json()["progress"]["done"] >= 1)
    ann.post(f"{job}/finish").raise_for_status()
    ended = done(ann, job)
    assert ann.get(f"/v1/plans/{ended['result_plan_id']}").json()["parent_id"] == plan


def test_the_events_of_a_refinement_carry_its_best_plan_so_far(ann: httpx2.Client) -> None:
    plan = planned(ann)["id"]
    body = {"vary": ["phases", "centers"], "starts": 2}
    job = _handed_in(ann, f"/v1/plans/{plan}/refinements", body)
    refined = ann.get(f"/v1/plans/{done(ann, job)['result_plan_id']}").json()
    best = [one.best for one in _events(ann, job) if one.best][-1]
    for key in ("before", "after"):
        assert getattr(best, key).model_dump(mode="json") == refined["refinement"][key]
    orbits = best.formation["vehicles"]
    assert orbits == [{key: of[key] for key in orbits[0]} for of in refined["vehicles"]]
    # and can be planned as it is
    assert ann.post("/v1/plans", json=best.formation).status_code == 201


def test_a_job_without_a_result_before_its_end_cannot_finish(ann: httpx2.Client) -> None:
    job = _handed_in(ann, f"/v1/plans/{planned(ann)['id']}/validations", {"trials": 50_000})
    told = problem(ann.post(f"{job}/finish"), 409)
    assert told.detail == "a validation has no result before its end; cancel stops it without one"
    ann.post(f"{job}/cancel").raise_for_status()


def test_a_bad_brief_is_refused_by_its_key(ann: httpx2.Client) -> None:
    wrong = {**FIELD, "need": {"worst_rms_m": -1.0}, "radius": 3}
    assert {one.path for one in faults_of(ann.post("/v1/designs", json=wrong))} == {
        "need.worst_rms_m",
        "radius",
    }


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"team": {"max": 11}}, "team.max: 11 vehicles asked for; this service takes up to 10"),
        ({"effort": "normal"}, "effort: 5492 candidates of all teams asked for; .* up to 2000"),
    ],
)
def test_a_design_beyond_the_limits_is_refused(keys: dict[str, Any], message: str) -> None:
    assert checked_request("design", json.dumps(FIELD).encode(), "json", LIMITS, None)[1] == 10
    body = json.dumps({**FIELD, **keys}).encode()
    with pytest.raises(InputError, match=message):
        checked_request("design", body, "json", LIMITS, None)
