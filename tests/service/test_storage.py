"""What the service keeps: plans as their bytes, jobs that end once, events without gaps."""

import contextlib
import json
import os
import re
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from sqlalchemy import (
    Connection,
    Table,
    create_engine,
    delete,
    event,
    insert,
    literal,
    select,
    update,
)
from sqlalchemy.exc import DBAPIError, IntegrityError, OperationalError

from api.documents import PackedRecording, PlanText
from api.following import MOST_EVENTS, events_after
from api.job_kinds.job_kind import Batch, JobReport
from api.storage import executors, holdings, job_records, part_records, tables
from api.storage.database import (
    Database,
    WriteCheck,
    open_database,
    patiently,
    release_reserve,
    unavailable,
)
from api.storage.migrations import NEWEST
from syncplan.errors import InputError
from syncplan.runtime.files import as_text
from tests.tools.full_disk import fill, small_disk
from tests.tools.serving import Postgres

MADE = PlanText('{\n "version": "1"\n}\n', "survey", 6, True, 1.5)
LARGE = replace(MADE, text=f"{MADE.text}{'-' * 60_000}")
BATCHES = [Batch(0, 0, 32), Batch(0, 32, 8)]


@pytest.fixture
def wrong_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """This process's clock, eight days ahead."""
    ahead = 8 * 86400
    real, real_ns = time.time, time.time_ns
    monkeypatch.setattr(time, "time", lambda: real() + ahead)
    monkeypatch.setattr(time, "time_ns", lambda: real_ns() + ahead * 10**9)
    wrong = Mock(wraps=datetime, now=lambda tz=None: datetime.fromtimestamp(time.time(), tz))
    monkeypatch.setattr("api.storage.tables.datetime", wrong)


def job(connection: Connection, owner: str = "ann", work: int = 40) -> str:
    """A queued validation."""
    new = job_records.NewJob("validation", "{}", work, "plan", "text")
    return job_records.add_job(connection, owner, new).id


def states(connection: Connection, job_id: str) -> list[tuple[int, str, int]]:
    """Number, state and progress of all events of a job."""
    found = [(number, json.loads(data)) for number, data in events_after(connection, job_id, 0)]
    return [(number, reported["state"], reported["progress"]["done"]) for number, reported in found]


def test_identifiers_sort_by_time_and_are_uuids_of_version_7() -> None:
    time = "2026-05-01T09:00:00.123999Z"
    made = [tables.new_id(time) for _ in range(3)]
    assert all(one[14] == "7" and one[19] in "89ab" for one in made)
    assert len(set(made)) == 3
    began = datetime(2026, 5, 1, 9, 0, 0, 123000, UTC)
    assert all(int(one.replace("-", "")[:12], 16) == began.timestamp() * 1000 for one in made)
    assert max(made) < tables.new_id("2026-05-01T09:00:00.124000Z")


@pytest.mark.parametrize("table", [tables.plans, tables.jobs, tables.recordings], ids=str)
def test_what_an_owner_stores_is_the_newest_whatever_was_done_to_the_clock(
    connection: Connection, monkeypatch: pytest.MonkeyPatch, table: Table
) -> None:
    packed = PackedRecording(b"0123", '{"name": "hall"}')
    store: dict[str, Callable[[str], str]] = {
        "plans": lambda owner: holdings.add_plan(connection, owner, MADE).id,
        "jobs": partial(job, connection),
        "recordings": lambda owner: holdings.add_recording(connection, owner, packed).id,
    }
    add, now = store[table.name], tables.moment(connection)
    identifiers = []
    for ago_s in (0.0, -86400.0, 0.0, 3600.0, 3600.0, -86400.0):
        monkeypatch.setattr(tables, "NOW", literal(tables.earlier(now, ago_s)))
        identifiers += [add("ann"), add("ann")]
    assert identifiers == sorted(identifiers)
    assert len(set(identifiers)) == len(identifiers)
    # the clock of the others is their own
    monkeypatch.setattr(tables, "NOW", literal(now))
    assert add("bob")[:13] == identifiers[0][:13]
    # what is gone no longer leads a list
    connection.execute(delete(table).where(table.c.owner == "ann"))
    assert add("ann")[:13] == identifiers[0][:13]


@pytest.mark.usefixtures("wrong_clock")
def test_the_database_dates_rows_whatever_the_clock_of_a_process(connection: Connection) -> None:
    before = tables.moment(connection)
    plan = holdings.add_plan(connection, "ann", MADE)
    job_id = job(connection)
    job_records.start_job(connection, job_id, "1")
    job_records.end_job(connection, job_id, "cancelled")
    holdings.keep_answer(connection, "ann", "key", holdings.Answer("digest", 201, {}, ""))
    executors.beat(connection, "one", "1")
    ended = job_records.find_job(connection, "ann", job_id)
    assert ended is not None
    reported = [json.loads(data)["at"] for _, data in events_after(connection, job_id, 0)]
    written = [plan.created_at, ended.created_at, ended.started_at, ended.ended_at, *reported]
    written += connection.execute(select(tables.answers.c.created_at)).scalars()
    written += connection.execute(select(tables.executors.c.seen_at)).scalars()
    assert len(written) == 9
    after = tables.moment(connection)
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z", str(one)) for one in written)
    assert all(before <= str(one) <= after for one in written)
    assert tables.new_id(before)[:13] <= plan.id[:13] <= job_id[:13] <= tables.new_id(after)[:13]
    assert tables.earlier(after, 3600.0) < before


def test_a_time_has_come_once_every_living_worker_has_seen_it(connection: Connection) -> None:
    executors.beat(connection, "one", "1")
    executors.beat(connection, "ahead", "1")
    ahead = tables.earlier(tables.moment(connection), -8 * 86400.0)
    connection.execute(
        update(tables.executors).where(tables.executors.c.id == "ahead").values(seen_at=ahead)
    )
    assert executors.agreed_moment(connection) <= tables.moment(connection)
    connection.execute(
        update(tables.executors).where(tables.executors.c.id == "one").values(seen_at="2020-01-01")
    )
    assert executors.agreed_moment(connection) == "2020-01-01"
    executors.forget(connection, "one")
    assert executors.agreed_moment(connection) <= tables.moment(connection)
    executors.forget(connection, "ahead")
    assert executors.agreed_moment(connection) <= tables.moment(connection)


def test_a_stored_plan_is_the_plan_with_three_keys_at_its_top(connection: Connection) -> None:
    row = holdings.add_plan(connection, "ann", MADE, parent_id="p")
    assert holdings.find_plans(connection, [("ann", row.id)]) == [row]
    body = holdings.body_of(row)
    assert json.loads(body) == {
        "id": row.id,
        "created_at": row.created_at,
        "parent_id": "p",
        "version": "1",
    }
    assert body.endswith(MADE.text[1:])


def test_lists_state_the_verdict_that_a_plan_has(connection: Connection) -> None:
    made: dict[str, bool | None] = {}
    for go in (True, False, None):
        document: dict[str, Any] = {"version": "1", "verdict": {"go": go, "findings": []}}
        if go is None:
            document = {"version": "1", "scenario": {"name": '"go": true'}}
        row = holdings.add_plan(connection, "ann", replace(MADE, text=as_text(document)))
        made[row.id] = go
    assert {one.id: one.go for one in holdings.list_plans(connection, "ann", 9, None)} == made


def test_a_job_goes_from_queued_over_its_batches_to_one_end(connection: Connection) -> None:
    job_id = job(connection)
    assert job_records.start_job(connection, job_id, "1")
    assert part_records.divide_job(connection, job_id, BATCHES)
    assert part_records.next_batch(connection, job_id, 1) == BATCHES[1]
    assert part_records.note_progress(connection, job_id, 5, 0)
    part_records.keep_batch(connection, job_id, 1, b"late")
    part_records.keep_batch(connection, job_id, 0, b"soon")
    assert part_records.finished_batches(connection, job_id) == [
        (BATCHES[0], b"soon"),
        (BATCHES[1], b"late"),
    ]
    assert job_records.end_job(connection, job_id, "succeeded", report=JobReport("report", b"npz"))
    assert job_records.report_of(connection, job_id) == "report"
    assert job_records.trials_of(connection, job_id) == b"npz"
    assert states(connection, job_id) == [
        (1, "queued", 0),
        (2, "running", 0),
        (3, "running", 5),
        (4, "running", 13),
        (5, "running", 40),
        (6, "succeeded", 40),
    ]
    assert connection.execute(select(tables.job_parts)).all() == []


def test_an_ended_job_changes_no_more(connection: Connection) -> None:
    job_id = job(connection)
    job_records.start_job(connection, job_id, "1")
    part_records.divide_job(connection, job_id, BATCHES)
    assert job_records.end_job(connection, job_id, "cancelled")
    before = states(connection, job_id)
    assert not job_records.end_job(connection, job_id, "succeeded", report=JobReport("late"))
    assert not job_records.start_job(connection, job_id, "1")
    assert not part_records.divide_job(connection, job_id, BATCHES)
    assert not part_records.note_progress(connection, job_id, 9)
    part_records.keep_batch(connection, job_id, 0, b"late")
    assert part_records.next_batch(connection, job_id, 0) is None
    assert job_records.report_of(connection, job_id) is None
    assert states(connection, job_id) == before
    assert connection.execute(select(tables.job_parts)).all() == []


def test_a_step_that_runs_again_changes_nothing(connection: Connection) -> None:
    job_id = job(connection)
    assert job_records.start_job(connection, job_id, "1")
    assert job_records.start_job(connection, job_id, "1")
    part_records.divide_job(connection, job_id, BATCHES)
    assert part_records.divide_job(connection, job_id, [Batch(0, 0, 40)])
    part_records.keep_batch(connection, job_id, 0, b"first")
    part_records.keep_batch(connection, job_id, 0, b"second")
    assert part_records.finished_batches(connection, job_id)[0] == (BATCHES[0], b"first")
    assert part_records.next_batch(connection, job_id, 0) is None
    assert states(connection, job_id)[-1] == (3, "running", 32)
    # nor does progress go back, or past the whole
    for done in (36, 10, 99):
        part_records.note_progress(connection, job_id, done)
    assert [done for _, _, done in states(connection, job_id)][2:] == [32, 36, 40]


def test_jobs_that_ended_long_ago_are_deleted_with_all_that_hangs_on_them(
    connection: Connection,
) -> None:
    old, running = job(connection), job(connection)
    job_records.end_job(connection, old, "succeeded", report=JobReport("report"))
    past, to_come = (tables.earlier(tables.moment(connection), ago_s) for ago_s in (60.0, -60.0))
    assert job_records.ended_before(connection, past, 10) == []
    assert job_records.ended_before(connection, to_come, 10) == [old]
    assert job_records.ended_before(connection, to_come, 0) == []
    job_records.forget_jobs(connection, [old])
    assert job_records.find_job(connection, "ann", old) is None
    assert events_after(connection, old, 0) == []
    assert job_records.report_of(connection, old) is None
    assert job_records.find_job(connection, "ann", running) is not None


def test_an_answer_is_given_once_for_a_key_and_owner_and_forgotten_in_time(
    connection: Connection,
) -> None:
    answer = holdings.Answer("digest", 201, {"location": "/v1/plans/1"}, "body")
    holdings.keep_answer(connection, "ann", "key", answer)
    holdings.keep_answer(connection, "bob", "key", holdings.Answer("other", 202, {}, ""))
    assert holdings.find_answer(connection, "ann", "key") == answer
    assert holdings.find_answer(connection, "ann", "other") is None
    with pytest.raises(holdings.AnswerTakenError):
        holdings.keep_answer(connection, "ann", "key", answer)
    holdings.forget_answers(connection, tables.earlier(tables.moment(connection), 60.0))
    assert holdings.find_answer(connection, "ann", "key") is not None
    holdings.forget_answers(connection, tables.earlier(tables.moment(connection), -60.0))
    assert holdings.find_answer(connection, "ann", "key") is None


def test_an_executor_is_struck_off_only_at_the_count_that_was_seen(connection: Connection) -> None:
    for _ in range(3):
        executors.beat(connection, "one", "1")
    assert executors.living(connection) == {"one": 2}
    executors.forget(connection, "one", beats=1)
    assert executors.living(connection) == {"one": 2}
    executors.forget(connection, "one", beats=2)
    assert executors.living(connection) == {}


def test_a_transaction_that_fails_leaves_nothing(database: Database) -> None:
    def fail() -> None:
        with database.writing() as connection:
            holdings.add_plan(connection, "ann", MADE)
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    with database.reading() as connection:
        assert holdings.list_plans(connection, "ann", 10, None) == []


def test_a_database_opens_again_with_what_it_held(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'syncplan.db'}"
    first = open_database(url)
    with first.writing() as connection:
        row = holdings.add_plan(connection, "ann", MADE)
    first.close()
    second = open_database(url)
    with second.reading() as connection:
        assert holdings.find_plans(connection, [("ann", row.id)]) == [row]
        assert connection.execute(select(tables.schema_version.c.version)).scalar_one() == NEWEST
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
    second.close()
    # the file is its owner's alone
    assert (tmp_path / "syncplan.db").stat().st_mode & 0o077 == 0


@pytest.mark.parametrize("usable_from", [NEWEST, NEWEST + 1])
def test_a_newer_database_is_opened_as_it_is_or_refused(
    database: Database, usable_from: int
) -> None:
    newer = {"version": 99, "usable_from": usable_from}
    with database.writing() as connection:
        connection.execute(update(tables.schema_version).values(newer))
    url = database.engine.url.render_as_string()
    if usable_from > NEWEST:
        with pytest.raises(InputError, match=r"holds schema version 99.*update syncplan"):
            open_database(url)
        return
    again = open_database(url)
    with again.reading() as connection:
        assert dict(connection.execute(select(tables.schema_version)).mappings().one()) == newer
    again.close()


def test_a_file_that_is_no_database_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "syncplan.db"
    path.write_bytes(b"not a database, but long enough to look at" * 20)
    with pytest.raises(InputError, match=r"syncplan\.db: can't be opened: file is not a database"):
        open_database(f"sqlite:///{path}")


def test_waiting_for_the_database_ends_when_it_is_back_and_not_before() -> None:
    away = OperationalError("select", {}, Exception("connection refused"))
    asked = Mock(side_effect=[away, away, "back"])
    assert patiently(asked) == "back"
    assert asked.call_count == 3


def test_waiting_is_only_for_the_database_and_not_for_mistakes(database: Database) -> None:
    def mistaken() -> None:
        with database.reading() as connection:
            connection.exec_driver_sql("SELECT 1 FROM nowhere")

    with pytest.raises(ValueError, match="no database"):
        patiently(Mock(side_effect=ValueError("no database")))
    with pytest.raises(OperationalError, match="no such table"):
        patiently(mistaken)


def test_two_writers_take_turns(database: Database) -> None:
    with database.writing() as first:
        first.execute(insert(tables.executors).values(id="one", beats=0))
        with database.reading() as other:
            assert executors.living(other) == {}
    with database.reading() as other:
        assert executors.living(other) == {"one": 0}


def test_a_full_disk_counts_as_a_lost_connection_whoever_writes(tmp_path: Path) -> None:
    # DBOS, with an engine of its own, waits for connections that are lost and for nothing else
    engine = create_engine(f"sqlite:///{tmp_path / 'other.db'}")
    with engine.connect() as connection:
        connection.exec_driver_sql("CREATE TABLE things (thing TEXT)")
        connection.exec_driver_sql("PRAGMA max_page_count = 3")
        with pytest.raises(OperationalError, match="database or disk is full") as caught:
            connection.exec_driver_sql("INSERT INTO things VALUES (hex(zeroblob(100000)))")
    engine.dispose()
    assert caught.value.connection_invalidated
    assert unavailable(caught.value)


def test_what_is_stored_stays_out_of_errors(connection: Connection) -> None:
    row = holdings.add_plan(connection, "ann", MADE)
    with pytest.raises(IntegrityError) as caught:
        holdings.add_plan(connection, "secret owner", MADE, plan_id=row.id)
    assert "secret owner" not in str(caught.value)
    with pytest.raises(InputError) as refused:
        open_database("postgresql+psycopg://127.0.0.1:9/db?password=secretword")
    assert "secretword" not in str(refused.value)


def test_a_process_that_freezes_in_a_transaction_does_not_keep_its_locks(
    postgres: Postgres, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.storage.database._IDLE_S", 1)
    locked = "UPDATE executors SET beats = beats + 1"
    with contextlib.closing(open_database(postgres.new_database())) as database:
        with database.writing() as connection:
            connection.execute(insert(tables.executors).values(id="a", beats=0))

        def freeze() -> None:
            with database.writing() as frozen:
                frozen.exec_driver_sql(locked)
                with database.writing() as other:
                    # a second is less than the ten for which locks are waited for
                    other.exec_driver_sql(locked)
                frozen.exec_driver_sql(locked)

        with pytest.raises(DBAPIError) as caught:
            freeze()
        # it is tried again, as after any connection that was lost
        assert caught.value.connection_invalidated
        assert unavailable(caught.value)
        with database.reading() as connection:
            assert connection.scalar(select(tables.executors.c.beats)) == 1


def test_events_are_read_some_hundreds_at_a_time(connection: Connection) -> None:
    job_id = job(connection, work=MOST_EVENTS + 100)
    for done in range(1, MOST_EVENTS + 50):
        part_records.note_progress(connection, job_id, done)
    first = events_after(connection, job_id, 0)
    then = events_after(connection, job_id, first[-1][0])
    assert [number for number, _ in first + then] == list(range(1, MOST_EVENTS + 51))


def test_writing_is_tried_once_in_a_while_and_leaves_nothing(database: Database) -> None:
    now = 0.0
    check = WriteCheck(database.engine, clock=lambda: now)
    tried = []
    event.listen(
        database.engine, "before_cursor_execute", lambda *sent: tried.append(sent[2]), named=False
    )
    for _ in range(5):
        check.check()
    now = 3.0
    check.check()
    assert sum(one.startswith("INSERT") for one in tried) == 2
    with database.reading() as connection:
        assert connection.execute(select(tables.answers)).all() == []
        assert connection.exec_driver_sql("PRAGMA cache_size").scalar() == -2000
    # a write that failed is known until one succeeds
    check.failed(OperationalError("insert", {}, Exception("database or disk is full")))
    for _ in range(2):
        with pytest.raises(OperationalError, match="disk is full"):
            check.check()
    now = 6.0
    # somebody else's writing does not mean that nothing can be written
    with database.writing():
        check.check()


def test_room_is_kept_to_open_a_database_on_a_full_disk(tmp_path: Path) -> None:
    path, reserve = tmp_path / "syncplan.db", tmp_path / "syncplan.db-reserve"
    open_database(f"sqlite:///{path}").close()
    assert reserve.stat().st_blocks * 512 == 6 * 2**20
    assert release_reserve(path)
    assert not reserve.exists()
    assert not release_reserve(path)


def stored_until_full(database: Database, owner: str) -> list[str]:
    """Store plans of an owner until the disk is full; returns their identifiers."""
    stored: list[str] = []
    with contextlib.suppress(OperationalError):
        while len(stored) < 1000:
            with database.writing() as connection:
                row = holdings.add_plan(connection, owner, LARGE)
            stored.append(row.id)
    return stored


def test_what_fills_the_disk_can_be_deleted() -> None:
    with small_disk() as disk:
        url, reserve = f"sqlite:///{disk / 'syncplan.db'}", disk / "syncplan.db-reserve"
        database = open_database(url)
        with database.writing() as connection:
            # larger than the reserve
            packed = PackedRecording(os.urandom(2**23), "{}")
            kept = holdings.add_recording(connection, "ann", packed).id
            plan_ids = [holdings.add_plan(connection, "ann", LARGE).id for _ in range(20)]
        # its end empties the log
        database.close()
        database = open_database(url)
        fill(disk)
        assert stored_until_full(database, "bob") == []
        assert database.freeing(partial(holdings.delete_recording, owner="ann", recording_id=kept))
        # what is free now can be used again, and does not keep more from being deleted
        assert len(stored_until_full(database, "bob")) > 10
        for plan_id in plan_ids:
            gone = partial(holdings.delete_plan, owner="ann", plan_id=plan_id, tags=["*"])
            assert database.freeing(gone)
            stored_until_full(database, "bob")
        assert reserve.stat().st_blocks * 512 > 2**21
        with database.reading() as connection:
            assert holdings.list_recordings(connection, "ann", 10, None) == []
            assert holdings.list_plans(connection, "ann", 10, None) == []
        database.close()


def test_a_deletion_that_finds_no_reserve_either_leaves_all_as_it_was() -> None:
    with small_disk() as disk:
        database = open_database(f"sqlite:///{disk / 'syncplan.db'}")
        with database.writing() as connection:
            row = holdings.add_plan(connection, "ann", MADE)
        with database.reading() as connection:
            connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
        release_reserve(disk / "syncplan.db")
        ballast = fill(disk)
        gone = partial(holdings.delete_plan, owner="ann", plan_id=row.id, tags=["*"])
        with pytest.raises(OperationalError, match="disk is full"):
            database.freeing(gone)
        with database.reading() as connection:
            assert holdings.find_plans(connection, [("ann", row.id)]) == [row]
        ballast.unlink()
        assert database.freeing(gone)
        database.close()


def test_plans_are_forgotten_by_their_age_alone(connection: Connection) -> None:
    rows = [holdings.add_plan(connection, owner, MADE) for owner in ("ann", "eve", "ann")]
    for day, row in enumerate(rows, 1):
        made_at = f"2026-01-0{day}T00:00:00.000000Z"
        connection.execute(
            update(tables.plans).where(tables.plans.c.id == row.id).values(created_at=made_at)
        )
    holdings.forget_plans(connection, "2026-01-01T00:00:00.000000Z")
    assert len(holdings.list_plans(connection, "ann", 10, None)) == 2
    holdings.forget_plans(connection, "2026-01-03T00:00:00.000000Z")
    assert [one.id for one in holdings.list_plans(connection, "ann", 10, None)] == [rows[2].id]
    assert holdings.list_plans(connection, "eve", 10, None) == []
