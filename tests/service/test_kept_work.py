"""Work that is kept: plans renamed, jobs deleted."""

import httpx2
import pytest
from sqlalchemy import Connection, select

from api.following import FollowedJob, events_after, heads_of
from api.job_kinds.job_kind import JobReport
from api.storage import job_records, part_records, tables
from tests.tools.api_servers import done, faults_of, planned, problem
from tests.tools.scenarios import LANDMARKS


@pytest.fixture
def plan(ann: httpx2.Client) -> str:
    """Path of a plan named before."""
    return f"/v1/plans/{planned(ann, name='before', landmarks_m=LANDMARKS)['id']}"


# --- plans ----------------------------------------------------------------------------------------


def test_a_renamed_plan_is_the_same_but_for_its_name(ann: httpx2.Client, plan: str) -> None:
    before = ann.get(plan)
    answer = ann.patch(plan, json={"name": "nach Süden"})
    assert answer.status_code == 200
    named = before.text.replace('"name": "before"', '"name": "nach Süden"')
    assert answer.text == named != before.text
    now = ann.get(plan, headers={"if-none-match": before.headers["etag"]})
    assert (now.status_code, now.text) == (200, named)
    assert now.headers["etag"] == answer.headers["etag"] != before.headers["etag"]
    assert ann.get("/v1/plans?limit=1").json()["items"][0]["name"] == "nach Süden"
    figure = ann.get(f"{plan}/figures/formation").json()
    assert "nach Süden" in figure["layout"]["title"]["text"]
    ann.patch(plan, json={"name": "before"})
    back = ann.get(plan)
    assert (back.text, back.headers["etag"]) == (before.text, before.headers["etag"])


def test_reports_have_the_name_that_the_plan_had_when_they_were_asked_for(
    ann: httpx2.Client, plan: str
) -> None:
    first = ann.post(f"{plan}/validations", json={"trials": 1}).headers["location"]
    ann.patch(plan, json={"name": "after"})
    then = ann.post(f"{plan}/validations", json={"trials": 1}).headers["location"]
    for at, name in ((first, "before"), (then, "after")):
        done(ann, at)
        assert ann.get(f"{at}/result").json()["name"] == name


def test_a_plan_is_renamed_if_it_is_the_one_that_is_meant(ann: httpx2.Client, plan: str) -> None:
    etag = ann.get(plan).headers["etag"]
    headers = {"if-match": etag}
    assert ann.patch(plan, json={"name": "after"}, headers=headers).status_code == 200
    reported = problem(ann.patch(plan, json={"name": "later"}, headers=headers), 412)
    assert etag in reported.detail
    assert ann.get(plan).json()["scenario"]["name"] == "after"


@pytest.mark.parametrize(
    "body", [{}, {"name": None}, {"name": "n" * 201}, {"name": "two\nlines"}, {"name": 7}]
)
def test_a_name_that_no_scenario_may_have_is_refused(
    ann: httpx2.Client, plan: str, body: dict[str, object]
) -> None:
    assert [one.path for one in faults_of(ann.patch(plan, json=body))] == ["name"]
    assert ann.get(plan).json()["scenario"]["name"] == "before"


# --- jobs -----------------------------------------------------------------------------------------


def test_a_deleted_job_leaves_the_plan_that_it_made(ann: httpx2.Client, plan: str) -> None:
    asked = {"vary": ["phases"], "starts": 1}
    at = ann.post(f"{plan}/refinements", json=asked).headers["location"]
    made = done(ann, at)["result_plan_id"]
    answer = ann.delete(at)
    assert (answer.status_code, answer.content) == (204, b"")
    for path in ("", "/events", "/result"):
        problem(ann.get(at + path), 404)
    problem(ann.delete(at), 404)
    assert at[-36:] not in {one["id"] for one in ann.get("/v1/jobs?limit=200").json()["items"]}
    assert ann.get(f"/v1/plans/{made}").status_code == 200


def test_a_job_is_deleted_once_it_has_ended(ann: httpx2.Client, plan: str) -> None:
    running = ann.post(f"{plan}/validations", json={"trials": 100_000}).headers["location"]
    assert "cancel it first" in problem(ann.delete(running), 409).detail
    assert ann.post(f"{running}/cancel").status_code == 200
    assert ann.delete(running).status_code == 204
    problem(ann.post(f"{running}/cancel"), 404)


def test_a_stream_ends_where_its_job_is_deleted(connection: Connection) -> None:
    """Its last events are gone: nothing is left to wait for."""
    job_id = _computed(connection)
    followed = FollowedJob()
    followed.take(heads_of(connection, [job_id])[job_id], events_after(connection, job_id, 0)[:1])
    assert not followed.over
    job_records.delete_job(connection, job_id)
    followed.take(heads_of(connection, [job_id])[job_id], events_after(connection, job_id, 1))
    assert followed.over


def test_the_computing_time_of_a_deleted_job_counts_until_it_expires(
    connection: Connection,
) -> None:
    before = tables.moment(connection)
    job_id = _computed(connection)
    assert job_records.delete_job(connection, job_id)
    # its worker has not noticed yet
    part_records.add_seconds(connection, job_id, part_records.BEGINNING, 2.0)
    assert part_records.computed_seconds(connection, "ann", before) == 7.0
    assert job_records.list_jobs(connection, "ann", 9, None) == []
    job = connection.execute(select(tables.jobs)).one()
    assert (job.request, job.plan_text, job.error) == ("null", None, None)
    for table in (tables.job_results, tables.job_events, tables.job_parts):
        assert connection.execute(select(table)).all() == []
    later = tables.earlier(tables.moment(connection), -60.0)
    assert job_records.ended_before(connection, later, 9) == [job_id]


def _computed(connection: Connection) -> str:
    """A validation that has succeeded after five seconds."""
    new = job_records.NewJob("validation", '{"trials": 40}', 40, "plan", "text")
    job_id = job_records.add_job(connection, "ann", new).id
    assert not job_records.delete_job(connection, job_id)
    job_records.start_job(connection, job_id, "1")
    part_records.begin_part(connection, job_id, part_records.BEGINNING, "1")
    part_records.add_seconds(connection, job_id, part_records.BEGINNING, 5.0)
    job_records.end_job(connection, job_id, "succeeded", report=JobReport("report"))
    return job_id
