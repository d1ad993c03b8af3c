"""Parts of jobs: how often each is begun, what it took, which version's it is, what is kept."""

import asyncio
import contextlib
import json
from concurrent.futures import Future
from unittest.mock import Mock

import pytest
from sqlalchemy import Connection, func, select

from api.computing import child
from api.computing.pool import Pool
from api.computing.turns import GaveWayError
from api.following import events_after
from api.job_kinds.job_kind import Batch, JobReport
from api.jobs import parts
from api.jobs.parts import WatchedPart
from api.jobs.queue import VERSION
from api.settings import load_settings
from api.storage import job_records, part_records
from api.storage.database import Database
from api.storage.job_records import begin_anew, jobs_that_wait
from api.storage.part_records import BEGINNING, PartHistory
from api.storage.tables import earlier, job_parts, job_starts, moment
from syncplan.errors import InputError, NoSolutionError

BATCHES = [Batch(0, 0, 32), Batch(0, 32, 8)]


def begun(connection: Connection, owner: str = "ann") -> str:
    """A job that this version has begun."""
    new = job_records.NewJob("validation", "{}", 40, "plan", "text")
    job_id = job_records.add_job(connection, owner, new).id
    assert job_records.start_job(connection, job_id, VERSION)
    return job_id


def test_any_version_begins_a_job_and_no_other_one_works_on_it(connection: Connection) -> None:
    job_id = begun(connection)
    assert job_records.begun_job(connection, job_id, VERSION)
    assert job_records.start_job(connection, job_id, "2.0+1") is None
    assert job_records.begun_job(connection, job_id, "2.0+1") is None
    assert part_records.begin_part(connection, job_id, BEGINNING, "2.0+1") is None
    assert part_records.worked_on(connection, {job_id}, VERSION) == {job_id: False}
    assert part_records.worked_on(connection, {job_id}, "2.0+1") == {}


def test_attempts_deaths_and_seconds_of_a_part_add_up(connection: Connection) -> None:
    job_id = begun(connection)
    assert part_records.begin_part(connection, job_id, BEGINNING, VERSION) == PartHistory(1, 0, 0.0)
    assert part_records.count_death(connection, job_id, BEGINNING) == 1
    part_records.add_seconds(connection, job_id, BEGINNING, 2.5)
    assert part_records.begin_part(connection, job_id, BEGINNING, VERSION) == PartHistory(2, 1, 2.5)
    part_records.withdraw_part(connection, job_id, BEGINNING)
    assert part_records.begin_part(connection, job_id, BEGINNING, VERSION) == PartHistory(2, 1, 2.5)


@pytest.mark.usefixtures("hollow")
def test_a_database_that_is_away_adds_nothing_to_what_a_part_took(database: Database) -> None:
    with database.writing() as connection:
        job_id = begun(connection)
        part_records.begin_part(connection, job_id, BEGINNING, VERSION)
    with contextlib.closing(Pool(1)) as pool:
        ticket = pool.submit("ready")
        ticket.future.result()
    assert ticket.ended is not None
    # it has run for half a second, and is noted much later
    ticket.began, ticket.ended = 1.0, 1.5
    WatchedPart(job_id, BEGINNING, ticket).note(database, over=True)
    with database.writing() as connection:
        history = part_records.begin_part(connection, job_id, BEGINNING, VERSION)
    assert history is not None
    assert history.computed_s == 0.5


@pytest.mark.parametrize(
    ("error", "tries", "title", "said"),
    [
        (child.ChildGoneError(), 5, "Internal fault", "5 processes ended while they computed it"),
        (child.TooSlowError(), 1, "Too slow", "it took longer than the 2 s"),
        (child.OutOfMemoryError(), 1, "Too large", "it needs more than the 600 MiB of memory"),
        (child.TaskFailedError("Traceback"), 1, "Internal fault", "see the service's log"),
        (NoSolutionError("too far apart"), 1, "No solution", "too far apart"),
        (InputError("too short", key="range_m"), 1, "Bad input", "range_m: too short"),
    ],
)
def test_a_part_that_can_not_be_computed_fails_its_job_with_the_reason(
    database: Database,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    tries: int,
    title: str,
    said: str,
) -> None:
    monkeypatch.setattr(parts, "_PAUSE_S", 0.0)
    pool = pool_of(*[error] * tries)
    result, ended = computed(database, monkeypatch, pool)
    assert result is None
    assert (ended.state, pool.submit.call_count) == ("failed", tries)
    reported = json.loads(str(ended.error))
    assert (reported["title"], said in reported["detail"]) == (title, True), reported


def pool_of(*outcomes: object) -> Mock:
    """A pool of which each task comes to the next of these outcomes."""
    tickets = []
    for outcome in outcomes:
        future: Future[object] = Future()
        if isinstance(outcome, Exception):
            future.set_exception(outcome)
        else:
            future.set_result(outcome)
        tickets.append(Mock(future=future, ran_s=0.0))
    return Mock(submit=Mock(side_effect=tickets))


def computed(
    database: Database, monkeypatch: pytest.MonkeyPatch, pool: Mock
) -> tuple[object, job_records.JobRow]:
    """The result of a part that a pool computes, and its job afterwards."""
    settings = load_settings(task_memory_bytes=600 * 2**20, job_task_s=2.0)
    watch = parts.PartWatch(database, VERSION)
    runtime = parts.Runtime(settings, database, Mock(), pool, Mock(), watch)
    monkeypatch.setattr(parts, "_in_use", [runtime])
    with database.writing() as connection:
        job_id = begun(connection)
        job = job_records.begun_job(connection, job_id, VERSION)
    assert job is not None
    part = parts.Part(job, BEGINNING, "it", "ready", resumes=True)
    with contextlib.closing(watch):
        result = asyncio.run(parts.computed(part))
    with database.reading() as connection:
        row = job_records.find_job(connection, "ann", job_id)
    assert row is not None
    return result, row


def test_a_part_that_gives_way_often_is_computed_all_the_same(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "MOST_ATTEMPTS", 5)
    pool = pool_of(*[GaveWayError()] * 20, "result")
    assert computed(database, monkeypatch, pool)[0] == "result"
    assert all(call.kwargs["resumes"] for call in pool.submit.call_args_list)


def test_parts_that_are_no_batches_are_not_among_them(connection: Connection) -> None:
    job_id = begun(connection)
    part_records.begin_part(connection, job_id, BEGINNING, VERSION)
    assert not part_records.is_divided(connection, job_id)
    assert part_records.divide_job(connection, job_id, BATCHES)
    part_records.begin_part(connection, job_id, part_records.CONCLUSION, VERSION)
    assert len(part_records.finished_batches(connection, job_id)) == 2
    assert part_records.unfinished_batches(connection, job_id, 9) == [(0, 0), (1, 1)]


def test_figures_of_a_job_under_way_are_of_its_first_trials_without_a_gap(
    connection: Connection, monkeypatch: pytest.MonkeyPatch
) -> None:
    job_id = begun(connection)
    batches = [Batch(0, 8 * k, 8) for k in range(4)]
    part_records.divide_job(connection, job_id, [*batches, Batch(1, 0, 8)])

    def shown(number: int) -> int | None:
        part_records.keep_batch(connection, job_id, number, b"data", shows=True)
        found: int | None = json.loads(events_after(connection, job_id, 0)[-1][1]).get("finished")
        return found

    assert [shown(number) for number in (1, 0, 4, 3)] == [None, 16, 16, 16]
    assert part_records.first_batches(connection, job_id) == [(batches[0], 0), (batches[1], 1)]
    found = part_records.finished_batches(connection, job_id, [0, 1])
    assert found == [(batches[0], b"data"), (batches[1], b"data")]
    # nor are they drawn from more than a server can hold
    monkeypatch.setattr(part_records, "MOST_SHOWN_BYTES", 7)
    assert part_records.first_batches(connection, job_id) == [(batches[0], 0)]


def test_no_batch_is_begun_that_is_not_there(connection: Connection) -> None:
    job_id = begun(connection)
    assert part_records.begin_part(connection, job_id, 7, VERSION) is None
    job_records.end_job(connection, job_id, "cancelled")
    assert part_records.begin_part(connection, job_id, BEGINNING, VERSION) is None
    assert connection.execute(select(func.count()).select_from(job_parts)).scalar() == 0


def test_the_next_batch_to_enter_is_found_whatever_order_they_end_in(
    connection: Connection,
) -> None:
    job_id = begun(connection)
    part_records.divide_job(connection, job_id, [Batch(0, 8 * k, 8) for k in range(5)])
    part_records.keep_batch(connection, job_id, 1, b"data")
    assert part_records.unfinished_batches(connection, job_id, 1, skipped=1) == [(2, 2)]
    part_records.keep_batch(connection, job_id, 0, b"data")
    assert part_records.unfinished_batches(connection, job_id, 1, skipped=1) == [(3, 3)]
    assert part_records.unfinished_batches(connection, job_id, 1, skipped=3) == []


def test_a_job_begun_anew_elsewhere_takes_nothing_from_before(connection: Connection) -> None:
    job_id = begun(connection)
    part_records.divide_job(connection, job_id, BATCHES)
    part_records.keep_batch(connection, job_id, 0, b"old")
    part_records.keep_search(connection, job_id, 0, b"old")
    (job,) = jobs_that_wait(connection)
    assert begin_anew(connection, job, "2.0+1", keep=False)
    # whoever looked at the same moment comes too late
    assert not begin_anew(connection, job, "3.0+1", keep=False)
    assert part_records.finished_searches(connection, job_id) == {}
    late = part_records.divide_job(connection, job_id, BATCHES, begun=0)
    assert not late
    moved = job_records.start_job(connection, job_id, "2.0+1")
    assert moved is not None
    assert moved.begun == 1
    assert part_records.divide_job(connection, job_id, BATCHES, moved.begun)
    # a process that wakes up late
    part_records.keep_batch(connection, job_id, 1, b"late")
    entered = part_records.unfinished_batches(connection, job_id, 9)
    assert [turn for _, turn in entered] == [0, 1]
    assert {number for number, _ in entered}.isdisjoint({0, 1})


def test_a_job_begun_anew_by_its_own_version_goes_on(connection: Connection) -> None:
    job_id = begun(connection)
    part_records.divide_job(connection, job_id, BATCHES)
    part_records.keep_batch(connection, job_id, 0, b"data")
    (job,) = jobs_that_wait(connection)
    assert begin_anew(connection, job, VERSION, keep=True)
    assert job_records.start_job(connection, job_id, VERSION)
    assert part_records.unfinished_batches(connection, job_id, 9) == [(1, 1)]


def test_starts_are_kept_once_and_go_with_their_job(connection: Connection) -> None:
    job_id = begun(connection)
    part_records.keep_search(connection, job_id, 3, b"first")
    part_records.keep_search(connection, job_id, 3, b"second")
    part_records.keep_search(connection, job_id, 1, b"other")
    assert part_records.finished_searches(connection, job_id) == {1: b"other", 3: b"first"}
    job_records.end_job(connection, job_id, "succeeded", report=JobReport("report"))
    assert connection.execute(select(func.count()).select_from(job_starts)).scalar() == 0


def test_the_seconds_of_an_owner_are_those_of_a_day(connection: Connection) -> None:
    now = moment(connection)
    for owner, seconds in (("ann", 5.0), ("ann", 7.0), ("bob", 100.0)):
        job_id = begun(connection, owner)
        part_records.begin_part(connection, job_id, BEGINNING, VERSION)
        part_records.add_seconds(connection, job_id, BEGINNING, seconds)
    job_records.end_job(connection, job_id, "cancelled")
    assert part_records.computed_seconds(connection, "ann", now) == 12.0
    assert part_records.computed_seconds(connection, "bob", earlier(now, 3600.0)) == 100.0
    assert part_records.computed_seconds(connection, "bob", earlier(now, -3600.0)) == 0.0
    assert part_records.computed_seconds(connection, "eve", now) == 0.0
