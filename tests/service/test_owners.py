"""What one owner has is nothing to another: every operation that takes an identifier, tried."""

import re
from collections.abc import Iterator
from typing import Any

import httpx2
import pytest

from tests.tools.api_servers import (
    NOBODY,
    done,
    events_of,
    openapi_document,
    operations_of,
    planned,
    problem,
    speaking,
)
from tests.tools.briefs import FIELD
from tests.tools.record_examples import RECORDED
from tests.tools.recordings import zipped
from tests.tools.scenarios import document
from tests.tools.serving import Server

LONG = {"vary": ["phases", "centers"], "starts": 1000, "time_limit_s": 300.0}
ARCHIVE = zipped({name: text.encode() for name, text in RECORDED.items()})
OPERATIONS = operations_of(openapi_document())
WITH_IDENTIFIER = [(method, path) for method, path in OPERATIONS if "{" in path]


@pytest.fixture(scope="module")
def bob(server: Server) -> Iterator[httpx2.Client]:
    """The one who has none of them."""
    with speaking(server, "bob") as http:
        yield http


@pytest.fixture(scope="module")
def ended(ann: httpx2.Client) -> str:
    """A validation of Ann's that has succeeded."""
    at: str = ann.post(f"/v1/plans/{plan_of(ann)}/validations", json={"trials": 2}).json()["id"]
    done(ann, f"/v1/jobs/{at}")
    return at


def begun(http: httpx2.Client) -> str:
    """Return the identifier of a new refinement that goes on for minutes."""
    at: str = http.post(f"/v1/plans/{plan_of(http)}/refinements", json=LONG).json()["id"]
    return at


@pytest.fixture(scope="module")
def running(ann: httpx2.Client) -> Iterator[str]:
    """A refinement of Ann's that goes on until the tests have ended."""
    at = begun(ann)
    yield at
    ann.post(f"/v1/jobs/{at}/cancel")


def plan_of(http: httpx2.Client) -> str:
    """Return the identifier of a new plan."""
    return str(planned(http, landmarks_m=[[0.0, 60.0], [70.0, 60.0]])["id"])


def recorded(http: httpx2.Client) -> str:
    """Return the identifier of the newest recording, a new one if there is none."""
    kept = http.get("/v1/recordings").json()["items"]
    if not kept:
        headers = {"content-type": "application/zip"}
        kept = [http.post("/v1/recordings", content=ARCHIVE, headers=headers).json()]
    found: str = kept[0]["id"]
    return found


def ask(
    http: httpx2.Client, method: str, path: str, identifiers: dict[str, str], **options: Any
) -> httpx2.Response:
    """Ask for an operation; one with an identifier of a kind not known here fails the test."""
    named = {"format": "csv", "figure": "accuracy" if "/jobs/" in path else "formation"}
    url = re.sub(r"\{(\w+)\}", lambda found: {**named, **identifiers}[found[1]], path)
    headers = {"accept": "*/*", **options.pop("headers", {})}
    with http.stream(method, url, headers=headers, **options) as answer:
        if answer.headers.get("content-type", "").startswith("text/event-stream"):
            return answer
        answer.read()
    return answer


def test_the_operations_tried_are_those_that_are_served(ann: httpx2.Client) -> None:
    assert operations_of(ann.get("/openapi.json").json()) == OPERATIONS
    assert len(WITH_IDENTIFIER) >= 9


@pytest.mark.parametrize(("method", "path"), WITH_IDENTIFIER)
def test_what_is_anothers_is_not_there(
    ann: httpx2.Client, bob: httpx2.Client, ended: str, running: str, method: str, path: str
) -> None:
    """Finished or at work, a job is nothing to Bob; what he tries is what Ann then can do."""
    plan, recording = plan_of(ann), recorded(ann)
    sent: dict[str, Any] = {"json": {"name": "another"}} if method == "PATCH" else {}
    if path.endswith("/landmark-choice"):
        sent = {"params": {"candidate": "L1", "choose": 1}}
    for job in (ended, running):
        identifiers = {"plan_id": plan, "job_id": job, "recording_id": recording}
        state = ann.get(f"/v1/jobs/{job}").json()["state"]
        nobody = ask(bob, method, path, dict.fromkeys(identifiers, NOBODY), **sent)
        refused = ask(bob, method, path, identifiers, **sent)
        reported = problem(refused, 404)
        # not to be distinguished from what there never was
        for identifier in identifiers.values():
            reported_of_nobody = reported.detail.replace(identifier, NOBODY)
            reported = reported.model_copy(update={"detail": reported_of_nobody})
        assert reported.detail == problem(nobody, 404).detail
        assert "etag" not in refused.headers
        # nothing has happened
        assert ann.get(f"/v1/plans/{plan}").status_code == 200
        now = ann.get(f"/v1/jobs/{job}").json()["state"]
        assert now == state or {state, now} == {"queued", "running"}
    # and there is something to be refused
    mine = {"plan_id": plan, "job_id": ended, "recording_id": recording}
    if (method, path) == ("DELETE", "/v1/jobs/{job_id}"):
        # the others need the finished one
        mine["job_id"] = begun(ann)
        ann.post(f"/v1/jobs/{mine['job_id']}/cancel")
    answer = ask(ann, method, path, mine, **sent)
    assert answer.status_code in (
        {409} if path.endswith(("/cancel", "/finish")) else {200, 202, 204}
    )
    if answer.status_code == 202:
        ann.post(f"{answer.headers['location']}/cancel")


def test_no_condition_and_no_event_number_opens_what_is_anothers(
    ann: httpx2.Client, bob: httpx2.Client, ended: str
) -> None:
    plan = f"/v1/plans/{plan_of(ann)}"
    etag = ann.get(plan).headers["etag"]
    for name in ("if-match", "if-none-match"):
        for value in ("*", etag):
            for method in ("GET", "DELETE"):
                problem(bob.request(method, plan, headers={name: value}), 404)
    assert ann.get(plan).status_code == 200
    with ann.stream("GET", f"/v1/jobs/{ended}/events") as answer:
        count = len(list(events_of(answer)))
    for last in (0, 1, count):
        headers = {"last-event-id": str(last)}
        problem(bob.get(f"/v1/jobs/{ended}/events", headers=headers), 404)


def test_lists_hold_ones_own_alone_wherever_they_begin(
    ann: httpx2.Client, bob: httpx2.Client, ended: str
) -> None:
    first, own, last = plan_of(ann), plan_of(bob), plan_of(ann)
    listed = [one["id"] for one in bob.get("/v1/plans?limit=200").json()["items"]]
    assert own in listed
    assert not {first, last} & set(listed)
    after = bob.get(f"/v1/plans?limit=200&before={last}").json()["items"]
    assert [one["id"] for one in after] == listed
    assert {first, last} <= {one["id"] for one in ann.get("/v1/plans?limit=200").json()["items"]}

    job = bob.post(f"/v1/plans/{own}/validations", json={"trials": 1}).json()["id"]
    for query in ("", f"&before={'f' * 8}-0000-7000-8000-000000000000"):
        found = [one["id"] for one in bob.get(f"/v1/jobs?limit=200{query}").json()["items"]]
        assert found == [job]
    assert bob.get(f"/v1/jobs?before={ended}").json()["items"] == []
    assert job not in {one["id"] for one in ann.get("/v1/jobs?limit=200").json()["items"]}


POSTS = [(method, path) for method, path in OPERATIONS if method == "POST"]


@pytest.mark.parametrize(("method", "path"), POSTS)
def test_an_idempotency_key_is_its_owners(
    ann: httpx2.Client, bob: httpx2.Client, method: str, path: str
) -> None:
    """The same request under the same key: Bob never gets the answer that Ann got."""
    bodies = {
        "/v1/plans": document(),
        "/v1/previews": document(),
        "/v1/imports": {"type": "Point", "coordinates": [8.5, 47.4]},
        "/v1/sweeps": {"scenario": document(), "range_m": [50.0], "trials": 1},
        # impossible, so that it ends at once
        "/v1/designs": {**FIELD, "landmarks": {"max": 1}},
    }
    body = bodies.get(path, {})
    headers = {"idempotency-key": f"shared-{path}".replace("{", "").replace("}", "")}
    job = begun(ann) if "{job_id}" in path else NOBODY
    identifiers = {"plan_id": plan_of(ann), "job_id": job, "recording_id": recorded(ann)}
    sent: dict[str, Any] = {"json": body}
    if path == "/v1/recordings":
        sent, headers = {"content": ARCHIVE}, {**headers, "content-type": "application/zip"}
    hers = ask(ann, method, path, identifiers, headers=headers, **sent)
    assert hers.is_success, hers.text
    his = ask(bob, method, path, identifiers, headers=headers, **sent)
    if "{" in path:
        problem(his, 404)
    elif path in ("/v1/previews", "/v1/imports"):
        # keeps nothing, so that equal bodies have equal answers
        assert his.is_success
    else:
        assert his.is_success
        assert his.headers["location"] != hers.headers["location"]
        problem(ann.get(his.headers["location"]), 404)
        problem(bob.get(hers.headers["location"]), 404)
    again = ask(ann, method, path, identifiers, headers=headers, **sent)
    assert (again.status_code, again.content) == (hers.status_code, hers.content)
