"""Bytes of each owner, counted by the database whoever writes, against sums over its tables."""

from pathlib import Path

import httpx2
import pytest
from sqlalchemy import Connection, MetaData, delete, insert, select, update

from api.documents import PackedRecording, PlanText
from api.job_kinds.job_kind import Batch, JobReport
from api.settings import load_settings
from api.storage import holdings, job_records, owner_bytes, part_records, tables
from api.storage.database import open_database
from api.storage.migrations import upgrade
from tests.service.test_migrations import connected
from tests.tools.api_servers import planned, problem
from tests.tools.kept_databases import restore_postgresql, restore_sqlite
from tests.tools.owner_sums import summed_bytes

EACH = pytest.mark.parametrize(
    "address", ["sqlite", pytest.param("postgresql", marks=pytest.mark.long)], indirect=True
)
TEXT = PlanText("n\N{DIAERESIS}" * 1000, "süd", 2, observable=True, predicted_rms_m=1.0)


def see_sums(connection: Connection, *owners: str) -> None:
    """Fail unless owners keep what their rows sum up to."""
    sums = summed_bytes(connection)
    for owner in owners:
        kept = owner_bytes.bytes_kept(connection, owner)
        assert kept == {kind: sums[owner][kind] if owner in sums else 0 for kind in kept}


def job_of(connection: Connection, owner: str) -> str:
    """Enter a job about a plan that begins, with a batch and a finished search."""
    new = job_records.NewJob("validation", '{"trials": 40}', 40, "plan", TEXT.text)
    job_id = job_records.add_job(connection, owner, new).id
    job_records.start_job(connection, job_id, "1")
    part_records.divide_job(connection, job_id, [Batch(0, 0, 40)])
    part_records.keep_search(connection, job_id, 0, b"search" * 100)
    part_records.keep_batch(connection, job_id, 0, b"batch" * 100)
    return job_id


@EACH
def test_every_row_counts_for_its_owner_until_it_goes(address: str | None, tmp_path: Path) -> None:
    database = open_database(load_settings(data_dir=tmp_path, database_url=address).database)
    answer = holdings.Answer("digest", 200, {"etag": "tag"}, "body")
    try:
        with database.writing() as connection:
            plan_ids = [holdings.add_plan(connection, who, TEXT).id for who in ("ann", "bob")]
            holdings.rename_plan(connection, "ann", plan_ids[0], {"*"}, "other", "o" * 5000)
            packed = PackedRecording(b"\x00\xff" * 3000, "{}")
            recorded = holdings.add_recording(connection, "ann", packed).id
            holdings.rename_recording(connection, "ann", recorded, '{"name": "other"}')
            for key in "12":
                holdings.keep_answer(connection, "ann", key, answer)
            jobs = [job_of(connection, who) for who in ("ann", "ann", "ann", "bob")]
            see_sums(connection, "ann", "bob", "eve")
        with database.writing() as connection:
            report = JobReport("report" * 1000, b"trials" * 1000)
            job_records.end_job(connection, jobs[0], "succeeded", report=report)
            job_records.end_job(connection, jobs[1], "failed", error={"title": "t" * 100})
            job_records.end_job(connection, jobs[3], "cancelled")
            texts = connection.execute(select(tables.jobs.c.id, tables.jobs.c.plan_text)).all()
            assert [job_id for job_id, plan in texts if plan is not None] == [jobs[2]]
            see_sums(connection, "ann", "bob")
            job_records.delete_job(connection, jobs[0])
            see_sums(connection, "ann")
        with database.writing() as connection:
            # with all that refers to them, and one under way among them
            job_records.forget_jobs(connection, jobs)
            holdings.forget_answers(connection, tables.earlier(tables.moment(connection), -60.0))
            holdings.delete_recording(connection, "ann", recorded)
            holdings.delete_plan(connection, "ann", plan_ids[0], {"*"})
            assert set(owner_bytes.bytes_kept(connection, "ann").values()) == {0}
            see_sums(connection, "bob")
    finally:
        database.close()


@EACH
def test_rows_of_earlier_versions_count(address: str | None, tmp_path: Path) -> None:
    if address is None:
        restore_sqlite("version-1", tmp_path / "syncplan.db")
    else:
        restore_postgresql("version-1", address)
    with connected(address, tmp_path) as earlier:
        reflected = MetaData()
        reflected.reflect(earlier)
        old = reflected.tables
        upgrade(earlier)
        owners = summed_bytes(earlier).keys()
        assert owners
        see_sums(earlier, *owners)
        # a process of that version goes on
        row = dict(earlier.execute(select(old["plans"]).limit(1)).mappings().one())
        earlier.execute(insert(old["plans"]).values({**row, "id": "new", "owner": "ann"}))
        job = dict(earlier.execute(select(old["jobs"]).limit(1)).mappings().one())
        earlier.execute(insert(old["jobs"]).values({**job, "id": "new", "owner": "ann"}))
        event = {"job_id": "new", "number": 1, "data": "event"}
        earlier.execute(insert(old["job_events"]).values(event))
        earlier.execute(update(old["jobs"]).where(old["jobs"].c.id == "new").values(plan_text="p"))
        see_sums(earlier, "ann", *owners)
        earlier.execute(delete(old["jobs"]))
        see_sums(earlier, "ann", *owners)
        # counting anew changes nothing
        owner_bytes.count_bytes(earlier)
        see_sums(earlier, "ann", *owners)


def test_usage_is_the_owners_and_states_the_limits(ann: httpx2.Client) -> None:
    before = ann.get("/v1/usage").json()
    size = len(ann.get(f"/v1/plans/{planned(ann)['id']}").content)
    after = ann.get("/v1/usage").json()
    # what is added on storing is not in its text
    assert size - 200 < after["bytes"]["plans"] - before["bytes"]["plans"] < size + 1000
    assert after["max_bytes"] == 2**31
    assert after["max_job_seconds"] == 2_592_000.0
    assert after["computing_s"] >= before["computing_s"] >= 0.0
    nobody = ann.get("/v1/usage", headers={"authorization": "Bearer wrong-0123456789abcdef"})
    problem(nobody, 401)
