"""Every route over HTTP: statuses, headers, pages, conditions, repeated requests, limits."""

import contextlib
import json
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx2
import pytest

from api.jobs.queue import VERSION
from api.responses import Job, StoredPlan
from api.storage.database import open_database
from api.storage.job_records import start_job
from api.storage.part_records import BEGINNING, add_seconds, begin_part
from syncplan.planning.variations import stressed
from syncplan.reports.validation_report import stress_document
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import load_scenario
from syncplan.scenario.specification import Scenario
from tests.tools.api_servers import (
    NOBODY,
    Event,
    done,
    events_of,
    faults_of,
    operations_of,
    planned,
    problem,
    serving,
    speaking,
)
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.scenarios import BAD_FILES, FILES, LANDMARKS, document, small
from tests.tools.serving import Server

YAML = {"content-type": "application/yaml"}
HTML = {"accept": "text/html"}


@pytest.fixture(scope="module")
def idle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service with narrow limits whose jobs wait for a worker that never comes."""
    limits = {
        "SYNCPLAN_MAX_VEHICLES": "3",
        "SYNCPLAN_MAX_SAMPLES": "3000",
        "SYNCPLAN_MAX_TRIALS": "600",
        "SYNCPLAN_MAX_RUN_S": "250",
        "SYNCPLAN_MAX_REFINE_S": "30",
        "SYNCPLAN_MAX_SWEEP_VALUES": "3",
        "SYNCPLAN_MAX_QUEUED_JOBS": "3",
        "SYNCPLAN_MAX_JOB_SECONDS": "60",
        "SYNCPLAN_MAX_STREAMS": "1",
    }
    folder = tmp_path_factory.mktemp("idle")
    with serving(folder, "cat dan eve fay gus", "--no-worker", **limits) as one:
        yield one


@pytest.fixture(scope="module")
def cat(idle: Server) -> Iterator[httpx2.Client]:
    """A client of the service that does no jobs."""
    with speaking(idle, "cat") as http:
        yield http


@pytest.fixture
def queued(cat: httpx2.Client) -> Iterator[str]:
    """Where a job is that waits, cancelled afterwards."""
    at = cat.post(f"/v1/plans/{planned(cat)['id']}/validations").headers["location"]
    yield at
    cat.post(f"{at}/cancel")


def paths_of(answer: httpx2.Response) -> list[str]:
    """Return the paths, in lower case, of what is wrong with a request."""
    return [one.path.lower() for one in faults_of(answer)]


def ended(http: httpx2.Client, at: str) -> Job:
    """Return a job that has succeeded."""
    return Job.model_validate(done(http, at))


# --- plans --------------------------------------------------------------------------------------


def test_a_plan_is_made_at_once_and_kept_as_it_was_made(ann: httpx2.Client) -> None:
    answer = ann.post("/v1/plans", json=document())
    assert answer.status_code == 201
    made = StoredPlan.model_validate_json(answer.content)
    assert answer.headers["location"] == f"/v1/plans/{made.id}"
    assert answer.headers["content-type"] == "application/json"
    again = ann.get(answer.headers["location"])
    assert (again.status_code, again.content) == (200, answer.content)
    assert again.headers["etag"] == answer.headers["etag"]
    assert re.fullmatch(r'"[0-9a-f]{64}"', again.headers["etag"])
    assert again.headers["cache-control"] == "private, no-cache"


def test_yaml_and_json_make_the_same_plan(ann: httpx2.Client) -> None:
    file = FILES / "paper-grid-same.yaml"
    values = load_scenario(file).model_dump(mode="json", exclude_none=True)
    written = ann.post("/v1/plans", content=file.read_bytes(), headers=YAML)
    listed = ann.post("/v1/plans", json=values)
    assert written.headers["etag"] == listed.headers["etag"]
    assert written.headers["location"] != listed.headers["location"]


def test_a_plan_is_sent_and_deleted_if_it_is_the_one_that_is_meant(ann: httpx2.Client) -> None:
    at = f"/v1/plans/{planned(ann)['id']}"
    etag = ann.get(at).headers["etag"]
    for tag in (etag, f"W/{etag}", f'"other", {etag}', "*"):
        answer = ann.get(at, headers={"if-none-match": tag})
        assert (answer.status_code, answer.content) == (304, b""), tag
        assert answer.headers["etag"] == etag
    assert ann.get(at, headers={"if-none-match": '"other"'}).status_code == 200
    reported = problem(ann.delete(at, headers={"if-match": '"other"'}), 412)
    assert etag.strip('"') in reported.detail
    assert ann.get(at).status_code == 200
    answer = ann.delete(at, headers={"if-match": etag})
    assert (answer.status_code, answer.content) == (204, b"")
    problem(ann.get(at), 404)
    problem(ann.delete(at), 404)


def test_plans_are_listed_newest_first_a_page_at_a_time(server: Server) -> None:
    with speaking(server, "lea") as lea:
        made = [planned(lea, name=f"plan {k}")["id"] for k in range(5)][::-1]
        pages, following = [], "/v1/plans?limit=2"
        while following:
            page = lea.get(following).json()
            pages.append([one["id"] for one in page["items"]])
            following = page["next"]
        assert pages == [made[:2], made[2:4], made[4:]]
        whole = lea.get("/v1/plans?limit=5").json()
        assert (len(whole["items"]), whole["next"]) == (5, None)
        assert whole["items"][0] == {
            "id": made[0],
            "parent_id": None,
            "created_at": lea.get(f"/v1/plans/{made[0]}").json()["created_at"],
            "name": "plan 4",
            "vehicles": 2,
            "observable": False,
            "go": False,
            "predicted_rms_m": whole["items"][0]["predicted_rms_m"],
            "worst_predicted_rms_m": whole["items"][0]["worst_predicted_rms_m"],
            "outline": {
                "circles": [[0.0, 0.0, 20.0], [70.0, 0.0, 20.0]],
                "landmarks": [],
                "area": None,
            },
        }
        lea.delete(f"/v1/plans/{made[2]}")
        after = lea.get(f"/v1/plans?before={made[1]}").json()
        assert [one["id"] for one in after["items"]] == made[3:]


def test_a_listed_plan_has_its_worst_error_and_an_outline(ann: httpx2.Client) -> None:
    plan = planned(
        ann,
        formation={"centers_m": [[0.123, -0.012], [70.0, 0.0]]},
        landmarks_m={"pole": [35.04, 40.06], "gate": [35.0, -40.0]},
        area_m=[[-30.0, -50.0], [100.0, -50.0], [35.0, 149.96]],
    )
    row = ann.get("/v1/plans?limit=1").json()["items"][0]
    assert row["id"] == plan["id"]
    assert row["worst_predicted_rms_m"] == max(plan["predicted_rms_m"]["vehicles"].values())
    # the extent is 200 m
    assert row["outline"] == {
        "circles": [[0.0, 0.0, 20.0], [70.0, 0.0, 20.0]],
        "landmarks": [[35.0, 40.0], [35.0, -40.0]],
        "area": [[-30.0, -50.0], [100.0, -50.0], [35.0, 150.0]],
    }


def test_parameters_that_can_not_be_are_refused_by_name(cat: httpx2.Client, queued: str) -> None:
    for path in ("/v1/plans", "/v1/jobs"):
        for query in ("limit=0", "limit=201", "before=x"):
            answer = cat.get(f"{path}?{query}")
            assert paths_of(answer) == [f"query.{query.partition('=')[0]}"]
    assert paths_of(cat.get("/v1/jobs?state=lost")) == ["query.state"]
    assert paths_of(cat.post("/v1/plans?steady=maybe", json=document())) == ["query.steady"]
    for last in ("-1", "x", "99999999999"):
        answer = cat.get(f"{queued}/events", headers={"last-event-id": last})
        assert paths_of(answer) == ["header.last-event-id"]
    for key in ("", "k" * 256, "with blanks"):
        answer = cat.post("/v1/plans", json=document(), headers={"idempotency-key": key})
        assert paths_of(answer) == ["header.idempotency-key"]


BAD_YAML = [(file.read_bytes(), "yaml") for file in sorted(BAD_FILES.iterdir())]
BAD_JSON = [(body, "json") for body in (b"", b"\xff\xfe", b"{", b"[1]", b'{"orbit": NaN}')]


@pytest.mark.parametrize(("body", "kind"), [*BAD_YAML, *BAD_JSON])
def test_a_bad_scenario_is_refused_with_its_faults(
    ann: httpx2.Client, body: bytes, kind: str
) -> None:
    headers = {"content-type": f"application/{kind}"}
    answer = ann.post("/v1/plans", content=body, headers=headers)
    faults = faults_of(answer)
    assert all(one.message for one in faults)
    assert faults[0].path in answer.json()["detail"]


# --- repeated requests --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "name"), [("/v1/plans", "other"), ("/v1/plans?steady=true", "one"), ("/v1/sweeps", "")]
)
def test_another_request_under_the_same_key_is_refused(
    ann: httpx2.Client, path: str, name: str
) -> None:
    headers = {"idempotency-key": f"reused {path}".replace(" ", "-")}
    ann.post("/v1/plans", json=document(name="one"), headers=headers)
    reported = problem(ann.post(path, json=document(name=name or "one"), headers=headers), 422)
    assert "Idempotency-Key" in reported.detail


def test_a_request_that_was_refused_may_be_mended_under_its_key(ann: httpx2.Client) -> None:
    headers = {"idempotency-key": "mended"}
    problem(ann.post("/v1/plans", json=document(sensor=None), headers=headers), 422)
    assert ann.post("/v1/plans", json=document(), headers=headers).status_code == 201


def test_equal_requests_at_once_make_one_plan(ann: httpx2.Client) -> None:
    known = {one["id"] for one in ann.get("/v1/plans?limit=200").json()["items"]}

    def ask(_: int) -> httpx2.Response:
        return ann.post("/v1/plans", json=document(), headers={"idempotency-key": "at-once"})

    with ThreadPoolExecutor(8) as threads:
        answers = list(threads.map(ask, range(8)))
    assert {answer.status_code for answer in answers} == {201}
    assert len({answer.content for answer in answers}) == 1
    for name in ("location", "etag", "content-type"):
        assert len({answer.headers[name] for answer in answers}) == 1
    assert len({answer.headers["x-request-id"] for answer in answers}) == 8
    now = {one["id"] for one in ann.get("/v1/plans?limit=200").json()["items"]}
    assert now - known == {answers[0].json()["id"]}


def test_a_job_is_handed_in_once_even_where_its_plan_is_gone_since(cat: httpx2.Client) -> None:
    plan = f"/v1/plans/{planned(cat)['id']}"
    headers = {"idempotency-key": "handed-in"}
    first = cat.post(f"{plan}/validations", json={"trials": 3}, headers=headers)
    assert cat.delete(plan).status_code == 204
    again = cat.post(f"{plan}/validations", json={"trials": 3}, headers=headers)
    assert (again.status_code, again.content) == (202, first.content)
    assert again.headers["location"] == first.headers["location"]
    problem(cat.post(f"{plan}/validations", json={"trials": 3}), 404)
    assert cat.post(f"{first.headers['location']}/cancel").json()["plan_id"] == plan[-36:]


# --- jobs ---------------------------------------------------------------------------------------


def test_a_job_is_accepted_with_its_defaults_filled_in(cat: httpx2.Client) -> None:
    plan = planned(cat)["id"]
    answer = cat.post(f"/v1/plans/{plan}/validations", content=b"trials: 7", headers=YAML)
    assert answer.status_code == 202
    job = Job.model_validate_json(answer.content)
    assert answer.headers["location"] == f"/v1/jobs/{job.id}"
    assert (job.kind, job.state, job.plan_id) == ("validation", "queued", plan)
    assert (job.progress.done, job.progress.total) == (0, 7)
    assert job.request == {
        "trials": 7,
        "seed": 0,
        "filter": "auto",
        "substeps": 10,
        "series": False,
        "stress": False,
    }
    assert (job.started_at, job.ended_at, job.result, job.error) == (None, None, None, None)
    assert cat.get(answer.headers["location"]).content == answer.content
    cat.post(f"/v1/jobs/{job.id}/cancel")


def test_what_a_job_may_not_ask_for_is_named(cat: httpx2.Client) -> None:
    plan = f"/v1/plans/{planned(cat)['id']}"
    sweep = {"scenario": document(), "range_m": [50.0], "radius_m": [20.0]}
    scenario = document(sensor={"range_m": -1, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1})
    for path, body, fault in (
        (f"{plan}/validations", {"trials": 0}, "trials"),
        (f"{plan}/validations", {"trails": 9}, "trails"),
        (f"{plan}/flights", {"hold": ["v1@-5:1"]}, "hold"),
        (f"{plan}/refinements", {"objective": "beauty"}, "objective"),
        ("/v1/sweeps", sweep, "angular_rate_rad_s"),
        ("/v1/sweeps", {"scenario": scenario, "range_m": [50.0]}, "scenario.sensor.range_m"),
        ("/v1/sweeps", {"scenario": document(), "range_m": [50.0, -1.0]}, "range_m.sensor.range_m"),
    ):
        assert paths_of(cat.post(path, json=body))[0] == fault


def test_the_result_of_a_job_comes_with_its_success(cat: httpx2.Client, queued: str) -> None:
    for part in ("result", "trials"):
        assert "queued" in problem(cat.get(f"{queued}/{part}"), 409).detail
    first, again = cat.post(f"{queued}/cancel"), cat.post(f"{queued}/cancel")
    assert (first.status_code, first.json()["state"]) == (200, "cancelled")
    assert again.content == first.content
    assert "cancelled" in problem(cat.get(f"{queued}/result"), 409).detail


def test_a_validation_leaves_a_report_and_its_trials(ann: httpx2.Client) -> None:
    plan = planned(ann)["id"]
    at = ann.post(f"/v1/plans/{plan}/validations", json={"trials": 2}).headers["location"]
    job = ended(ann, at)
    assert (job.progress.done, job.result) == (2, f"{at}/result")
    assert job.created_at < str(job.started_at) < str(job.ended_at)
    assert ann.get(f"{at}/result").json()["trials"] == 2
    told = ann.get(f"{at}/result", headers=HTML)
    assert told.headers["content-type"] == "text/html; charset=utf-8"
    assert told.headers["content-security-policy"] == "default-src 'none'"
    assert ": 2 trials of" in told.text
    trials = ann.get(f"{at}/trials")
    assert trials.headers["content-type"] == "application/octet-stream"
    assert trials.content.startswith(b"PK")
    reported = problem(ann.post(f"{at}/cancel"), 409)
    assert "succeeded" in reported.detail


@pytest.mark.long
def test_a_stress_test_leaves_the_report_of_the_library_to_the_byte(ann: httpx2.Client) -> None:
    made = planned(ann, landmarks_m=LANDMARKS)["id"]
    asked: dict[str, Any] = {"trials": 2, "truth": {"sensor": {"bearing_sigma_rad": 0.15}}}
    body = {**asked, "stress": True}
    at = ann.post(f"/v1/plans/{made}/validations", json=body).headers["location"]
    job = ended(ann, at)
    test = stressed(small(landmarks_m=LANDMARKS), **asked)
    assert job.progress.done == job.progress.total == 2 * (1 + len(test.rows))
    assert ann.get(f"{at}/result").text == as_text(stress_document(test).as_json())


def test_a_refinement_leaves_its_owner_a_plan_that_names_its_parent(ann: httpx2.Client) -> None:
    plan = planned(ann, landmarks_m=LANDMARKS)["id"]
    options = {"starts": 1, "objective": "logdet", "time_limit_s": 20}
    at = ann.post(f"/v1/plans/{plan}/refinements", json=options).headers["location"]
    job = ended(ann, at)
    assert job.result_plan_id is not None
    result, stored = ann.get(f"{at}/result"), ann.get(f"/v1/plans/{job.result_plan_id}")
    assert result.content == stored.content
    assert result.headers["etag"] == stored.headers["etag"]
    assert result.headers["content-location"] == f"/v1/plans/{job.result_plan_id}"
    assert stored.json()["parent_id"] == plan
    assert "refined for logdet, 1 starts" in ann.get(f"{at}/result", headers=HTML).text
    problem(ann.get(f"{at}/trials"), 409)
    assert ann.delete(f"/v1/plans/{job.result_plan_id}").status_code == 204
    problem(ann.get(f"{at}/result"), 404)


def test_jobs_are_listed_by_state(idle: Server) -> None:
    with speaking(idle, "dan") as dan:
        plan = planned(dan)["id"]
        made = [dan.post(f"/v1/plans/{plan}/validations").json()["id"] for _ in range(3)][::-1]
        dan.post(f"/v1/jobs/{made[1]}/cancel")
        page = dan.get("/v1/jobs?limit=1&state=queued").json()
        assert [one["id"] for one in page["items"]] == [made[0]]
        page = dan.get(page["next"]).json()
        assert ([one["id"] for one in page["items"]], page["next"]) == ([made[2]], None)
        listed = dan.get("/v1/jobs").json()["items"]
        assert [one["id"] for one in listed] == made
        read = dan.get(f"/v1/jobs/{made[1]}").json()
        assert read["request"]["trials"] == 200
        assert listed[1] == {**read, "request": None}
        assert dan.get("/v1/jobs?state=running").json() == {"items": [], "next": None}


def test_too_many_jobs_are_refused_until_one_has_ended(idle: Server) -> None:
    with speaking(idle, "eve") as eve, speaking(idle, "fay") as fay:
        path = f"/v1/plans/{planned(eve)['id']}/validations"
        made = [eve.post(path).headers["location"] for _ in range(3)]
        headers = {"idempotency-key": "later"}
        refused = eve.post(path, headers=headers)
        assert "3 unfinished jobs" in problem(refused, 429).detail
        assert int(refused.headers["retry-after"]) >= 1
        # another owner's are counted apart
        other = f"/v1/plans/{planned(fay)['id']}/validations"
        assert fay.post(other).status_code == 202
        eve.post(f"{made[0]}/cancel")
        assert eve.post(path, headers=headers).status_code == 202
        problem(eve.post(path), 429)


def test_an_owner_whose_seconds_of_a_day_are_spent_is_refused_and_others_are_not(
    idle: Server, cat: httpx2.Client
) -> None:
    with speaking(idle, "gus") as gus:
        paths = [f"/v1/plans/{planned(one)['id']}/validations" for one in (gus, cat)]
        job = gus.post(paths[0]).json()["id"]
        url = f"sqlite:///{idle.log.parent}/data/syncplan.db"
        with contextlib.closing(open_database(url)) as database, database.writing() as connection:
            start_job(connection, job, VERSION)
            begin_part(connection, job, BEGINNING, VERSION)
            add_seconds(connection, job, BEGINNING, 61.0)
        refused = gus.post(paths[0])
        assert "the most allowed is 60 s" in problem(refused, 429).detail
        assert int(refused.headers["retry-after"]) > 0
        other = cat.post(paths[1])
        assert other.status_code == 202
        cat.post(f"{other.headers['location']}/cancel")


# --- events -------------------------------------------------------------------------------------


def test_the_events_of_a_job_are_reported_from_wherever_one_asks(ann: httpx2.Client) -> None:
    plan = planned(ann, landmarks_m=LANDMARKS)["id"]
    at = ann.post(f"/v1/plans/{plan}/validations", json={"trials": 4000}).headers["location"]
    with ann.stream("GET", f"{at}/events") as answer:
        reported = list(events_of(answer))
    assert [one.id for one in reported] == list(range(1, len(reported) + 1))
    assert [one.done for one in reported] == sorted(one.done for one in reported)
    assert reported[0] == Event(1, "queued", 0)
    assert reported[1] == Event(2, "running", 0)
    assert reported[-1] == Event(len(reported), "succeeded", 4000)
    assert {one.state for one in reported[2:-1]} == {"running"}
    for last in range(len(reported) + 2):
        headers = {"last-event-id": str(last)}
        with ann.stream("GET", f"{at}/events", headers=headers) as answer:
            assert list(events_of(answer)) == reported[last:]


def test_events_come_when_they_happen_and_streams_are_counted(
    cat: httpx2.Client, queued: str
) -> None:
    with cat.stream("GET", f"{queued}/events") as answer:
        events = events_of(answer)
        assert next(events) == Event(1, "queued", 0)
        assert "\nsyncplan_streams 1.0\n" in cat.get("/metrics").text
        refused = problem(cat.get(f"{queued}/events"), 429)
        assert refused.detail.startswith("you have 1 event streams open, the most allowed")
        cat.post(f"{queued}/cancel")
        assert list(events) == [Event(2, "cancelled", 0)]
    wait_until(lambda: "\nsyncplan_streams 0.0\n" in cat.get("/metrics").text)


# --- what is the same everywhere ----------------------------------------------------------------


def test_what_is_not_there_is_a_404(ann: httpx2.Client) -> None:
    for path in ("/nothing", "/v1", "/v2/plans", "/v1/plan", "/docs", "/redoc"):
        assert problem(ann.get(path), 404).detail == "there is nothing at this path"
    for path in (f"/v1/plans/{NOBODY}", f"/v1/jobs/{NOBODY}"):
        assert NOBODY in problem(ann.get(path), 404).detail
        problem(ann.get(path[:-1] + "x"), 422)


def test_what_a_client_does_not_accept_is_a_406(cat: httpx2.Client, queued: str) -> None:
    html = {"accept": "text/html"}
    for path in ("/v1/plans", "/v1/jobs", queued, "/healthz", "/v1/schemas/plan"):
        problem(cat.get(path, headers=html), 406)
    for part in ("events", "trials"):
        problem(cat.get(f"{queued}/{part}", headers={"accept": "application/json"}), 406)
    problem(cat.post("/v1/plans", json=document(), headers=html), 406)


def test_a_body_of_another_kind_is_a_415(cat: httpx2.Client) -> None:
    body = json.dumps(document()).encode()
    for path in ("/v1/plans", "/v1/sweeps", f"/v1/plans/{planned(cat)['id']}/validations"):
        answer = cat.post(path, content=body, headers={"content-type": "text/plain"})
        problem(answer, 415)
        assert answer.headers["accept"] == "application/json, application/yaml"


def test_signs_of_life_and_schemas_need_no_key_and_the_rest_does(server: Server) -> None:
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as stranger:
        assert stranger.get("/healthz").json() == {"status": "ok"}
        assert stranger.get("/readyz").json() == {"status": "ok"}
        operations = operations_of(stranger.get("/openapi.json").json())
        open_to_all = {"/healthz", "/readyz", "/v1/schemas/scenario", "/v1/schemas/plan"}
        assert open_to_all < {path for _, path in operations}
        for method, path in operations:
            answer = stranger.request(method, re.sub(r"\{\w+\}", NOBODY, path))
            if path in open_to_all:
                assert answer.status_code == 200
            else:
                problem(answer, 401)
                assert answer.headers["www-authenticate"] == "Bearer"


def test_schemas_are_those_of_the_library(ann: httpx2.Client) -> None:
    scenario = ann.get("/v1/schemas/scenario").json()
    assert scenario.pop("$schema") == "https://json-schema.org/draft/2020-12/schema"
    assert scenario == json.loads(json.dumps(Scenario.model_json_schema()))
    plan = ann.get("/v1/schemas/plan").json()
    made = planned(ann)
    assert set(plan["required"]) <= set(made) <= set(plan["properties"])
    assert {"id", "created_at", "parent_id"} <= set(plan["required"])


# --- limits -------------------------------------------------------------------------------------


def refused_for(answer: httpx2.Response, path: str, reported: str) -> None:
    """Check that a request is beyond a limit that is named."""
    assert faults_of(answer)[0].path == path
    assert reported in answer.json()["detail"]


def team(count: int) -> dict[str, Any]:
    """A formation of some vehicles in a line."""
    return {"shape": "line", "count": count, "spacing_m": 70.0}


def test_plans_are_limited_in_vehicles_and_samples(cat: httpx2.Client) -> None:
    planned(cat, formation=team(3), duration_s=300.0)
    answer = cat.post("/v1/plans", json=document(formation=team(4)))
    refused_for(answer, "formation.count", "4 vehicles are more than the limit of 3")
    answer = cat.post("/v1/plans", json=document(duration_s=300.2))
    refused_for(answer, "duration_s", "3002 samples asked for; this service takes up to 3000")
    answer = cat.post("/v1/plans", json=document(window_s=400.0))
    refused_for(answer, "window_s", "samples")


def test_jobs_are_limited_in_trials_seconds_and_values(cat: httpx2.Client) -> None:
    plan = f"/v1/plans/{planned(cat)['id']}"
    accepted = [
        cat.post(f"{plan}/validations", json={"trials": 600, "duration_s": 250}),
        cat.post(f"{plan}/refinements", json={"time_limit_s": 30}),
        cat.post("/v1/sweeps", json=sweep([40.0, 50.0, 60.0], trials=200)),
    ]
    assert [answer.status_code for answer in accepted] == [202] * 3, [a.text for a in accepted]
    for answer in accepted:
        cat.post(f"{answer.headers['location']}/cancel")
    crowd = document(formation=team(4))
    for path, body, key, reported in (
        (
            f"{plan}/validations",
            {"trials": 601},
            "trials",
            "takes up to 600 trials",
        ),
        (f"{plan}/validations", {"duration_s": 251}, "duration_s", "takes up to 250 s"),
        (
            f"{plan}/refinements",
            {"time_limit_s": 31},
            "time_limit_s",
            "takes up to 30 s",
        ),
        ("/v1/sweeps", sweep([40.0, 50.0], trials=301), "trials", "602 trials"),
        ("/v1/sweeps", sweep([40.0, 50.0, 60.0, 70.0], trials=1), "range_m", "4 rows"),
        ("/v1/sweeps", sweep([40.0, 50.0, 60.0], trials=1, connected=True), "range_m", "4 rows"),
        ("/v1/sweeps", sweep([50.0], scenario=crowd), "scenario.formation.count", "limit of 3"),
    ):
        refused_for(cat.post(path, json=body), key, reported)
    at_length = planned(cat, duration_s=300.0)["id"]
    refused_for(cat.post(f"/v1/plans/{at_length}/validations"), "duration_s", "300 s asked for")


def sweep(values: list[float], **options: Any) -> dict[str, Any]:
    """What a sweep of ranges asks for."""
    return {"scenario": document(), "range_m": values, **options}
