"""Who counts as dead, what is done about what they left, and what is kept for how long."""

from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
from dbos import DBOSClient
from sqlalchemy import text

from api.job_kinds.job_kind import Batch, JobReport
from api.jobs.guard import Guard
from api.jobs.queue import PARTS_QUEUE, VERSION, JobQueue
from api.settings import load_settings
from api.storage import executors, job_records, part_records
from api.storage.database import Database, open_database
from api.storage.holdings import Answer, find_answer, keep_answer
from api.storage.tables import earlier, moment

BEAT_S, DEAD_AFTER_S, KEEP_S, GRACE_S = 2.0, 8.0, 60.0, 600.0
WORKFLOW, ITS_JOB = "UPDATE workflow_status SET", "WHERE workflow_uuid = :id"
LOOKS = 4
"""Looks at an unchanged count after which a process is dead."""


class Bench:
    """A database, a queue, and a guard on it that looks when asked to."""

    def __init__(self, url: str) -> None:
        self.database: Database = open_database(url)
        self.queue = JobQueue(url)
        self.now = 1000.0
        self.at_work: list[str] = []
        self.guard = self.another("own")

    def another(self, name: str | None, keep_s: float = KEEP_S) -> Guard:
        settings = load_settings(
            heartbeat_s=BEAT_S, dead_after_s=DEAD_AFTER_S, version_grace_s=GRACE_S
        )
        # unchecked: below 0, what is new is old
        kept = settings.model_copy(update={"keep_jobs_s": keep_s, "keep_answers_s": keep_s})
        return Guard(
            kept,
            self.database,
            self.queue,
            name,
            at_work=self.at_work,
            clock=lambda: self.now,
        )

    @property
    def client(self) -> DBOSClient:
        return self.queue.client

    def close(self) -> None:
        self.queue.close()
        self.database.close()

    def look(self, times: int = 1, every_s: float = BEAT_S) -> None:
        for _ in range(times):
            self.now += every_s
            self.guard.look_after()

    def beat(self, name: str, version: str = VERSION) -> None:
        with self.database.writing() as connection:
            executors.beat(connection, name, version)

    def living(self) -> set[str]:
        with self.database.reading() as connection:
            return set(executors.living(connection))

    def job(self) -> str:
        """A job that waits, and its workflow."""
        with self.database.writing() as connection:
            new = job_records.NewJob("validation", "{}", 40, "plan", "text")
            job_id = job_records.add_job(connection, "ann", new).id
            self.queue.add_job(connection, job_id, "ann")
        return job_id

    def write(self, statement: str, **values: str | None) -> None:
        """Change the database behind the service's back."""
        with self.database.writing() as connection:
            connection.execute(text(statement), values)

    def begun(self, version: str | None = VERSION) -> str:
        """A job that a version has begun, and its workflow."""
        job_id = self.job()
        running = "UPDATE jobs SET state = 'running', version = :version WHERE id = :id"
        self.write(running, version=version, id=job_id)
        self.write(
            f"{WORKFLOW} application_version = :version {ITS_JOB}", version=version, id=job_id
        )
        return job_id

    def keep_a_batch(self, job_id: str) -> None:
        with self.database.writing() as connection:
            part_records.divide_job(connection, job_id, [Batch(0, 0, 40)])
            part_records.keep_batch(connection, job_id, 0, b"data")

    def batches(self, job_id: str) -> int:
        """How many batches of a job are kept."""
        with self.database.reading() as connection:
            return len(part_records.finished_batches(connection, job_id))

    def see_last(self, version: str, seconds_ago: float) -> None:
        """Let a version have been alive some time ago for the last time."""
        with self.database.reading() as connection:
            seen_at = earlier(moment(connection), seconds_ago)
        change = "UPDATE versions SET seen_at = :at WHERE version = :version"
        self.write(change, at=seen_at, version=version)

    def app_version(self, job_id: str) -> str | None:
        return self.client.list_workflows(workflow_ids=[job_id])[0].app_version

    def end(self, job_id: str) -> None:
        with self.database.writing() as connection:
            job_records.end_job(connection, job_id, "succeeded", report=JobReport("report"))

    def state(self, job_id: str) -> str | None:
        with self.database.reading() as connection:
            return job_records.state_of(connection, job_id)

    def set_workflow(self, job_id: str, status: str, executor: str | None = None) -> None:
        """Leave a workflow as if an executor had come so far with it."""
        change = f"{WORKFLOW} status = :status, executor_id = :executor {ITS_JOB}"
        self.write(change, status=status, executor=executor, id=job_id)

    def workflow(self, job_id: str) -> tuple[str, str | None] | None:
        """Status and queue of a workflow."""
        found = self.client.list_workflows(workflow_ids=[job_id])
        return (found[0].status, found[0].queue_name) if found else None


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(f"sqlite:///{tmp_path / 'syncplan.db'}")
    yield made
    made.close()


def test_a_count_that_stands_still_is_dead_after_its_time_and_not_before(bench: Bench) -> None:
    # a count that rises is never dead, nor is the process that looks
    for _ in range(5 * LOOKS):
        bench.beat("other")
        bench.look()
        assert bench.living() == {"own", "other"}
    bench.look(LOOKS - 1)
    assert bench.living() == {"own", "other"}
    bench.look()
    assert bench.living() == {"own"}


def test_time_in_which_nobody_could_look_makes_nobody_dead(bench: Bench) -> None:
    bench.beat("other")
    bench.look()
    bench.look(every_s=3600.0)
    bench.beat("other")
    bench.look()
    assert bench.living() == {"own", "other"}
    bench.look(LOOKS)
    assert bench.living() == {"own"}


def test_a_guard_that_does_no_jobs_itself_is_not_among_the_living(bench: Bench) -> None:
    bench.beat("other")
    bench.guard = bench.another(None)
    bench.look(LOOKS + 1)
    assert bench.living() == set()


def test_what_a_dead_process_had_begun_goes_back_to_its_queue(bench: Bench) -> None:
    left, held = bench.job(), bench.job()
    bench.at_work.append(held)
    bench.beat("other")
    bench.set_workflow(left, "PENDING", "other")
    bench.set_workflow(held, "PENDING", "own")
    bench.look(LOOKS)
    assert bench.workflow(left) == ("PENDING", PARTS_QUEUE)
    bench.look()
    assert bench.workflow(left) == ("ENQUEUED", PARTS_QUEUE)
    assert bench.workflow(held) == ("PENDING", PARTS_QUEUE)


def test_what_this_process_has_begun_and_dropped_goes_back_at_the_second_look(
    bench: Bench,
) -> None:
    dropped, about_to_begin = bench.job(), bench.job()
    for job_id in (dropped, about_to_begin):
        bench.set_workflow(job_id, "PENDING", "own")
    bench.look()
    assert bench.workflow(dropped) == ("PENDING", PARTS_QUEUE)
    bench.at_work.append(about_to_begin)
    bench.look()
    assert bench.workflow(dropped) == ("ENQUEUED", PARTS_QUEUE)
    bench.at_work.clear()
    bench.look()
    assert bench.workflow(about_to_begin) == ("PENDING", PARTS_QUEUE)


def test_a_process_that_ends_gives_back_what_it_had_begun(bench: Bench) -> None:
    job_id = bench.job()
    bench.guard.start()
    bench.set_workflow(job_id, "PENDING", "own")
    bench.at_work.append(job_id)
    bench.guard.close()
    assert bench.living() == set()
    assert bench.workflow(job_id) == ("ENQUEUED", PARTS_QUEUE)


@pytest.mark.parametrize("status", ["ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"])
def test_a_job_whose_workflow_is_broken_fails(bench: Bench, status: str) -> None:
    lost, waiting, ended = bench.job(), bench.job(), bench.job()
    bench.end(ended)
    for job_id in (lost, ended):
        bench.set_workflow(job_id, status)
    bench.look(10)
    assert [bench.state(one) for one in (lost, waiting, ended)] == ["failed", "queued", "succeeded"]


def test_a_job_whose_workflow_is_gone_begins_again_with_what_it_has(bench: Bench) -> None:
    lost, waiting, ended = bench.job(), bench.begun(), bench.job()
    bench.keep_a_batch(waiting)
    bench.end(ended)
    for job_id in (lost, waiting, ended):
        bench.client.delete_workflows([job_id])
    bench.look(10)
    # it may just have come to its end
    assert bench.workflow(lost) is bench.workflow(waiting) is None
    bench.look(10)
    assert bench.workflow(lost) == bench.workflow(waiting) == ("ENQUEUED", PARTS_QUEUE)
    assert bench.app_version(lost) is None
    assert bench.app_version(waiting) == VERSION
    assert bench.workflow(ended) is None
    assert bench.batches(waiting) == 1


def test_a_job_that_loses_its_workflow_again_and_again_fails(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.jobs.guard._MOST_BEGUN", 4)
    job_id = bench.job()
    looks = 0
    while bench.state(job_id) != "failed":
        bench.client.delete_workflows([job_id])
        bench.look(10)
        looks += 1
        assert looks < 20
    assert looks > 4


# --- versions -----------------------------------------------------------------------------------


def test_a_job_of_another_version_waits_for_it_and_then_moves(bench: Bench) -> None:
    job_id = bench.begun("0.0+1")
    bench.keep_a_batch(job_id)
    bench.beat("other", "0.0+1")
    bench.look(LOOKS + 1)
    assert bench.living() == {"own"}
    bench.look(20)
    assert bench.app_version(job_id) == "0.0+1"
    assert bench.batches(job_id) == 1
    bench.see_last("0.0+1", GRACE_S + 1.0)
    bench.look(10)
    assert bench.state(job_id) == "running"
    assert bench.workflow(job_id) == ("ENQUEUED", PARTS_QUEUE)
    assert bench.app_version(job_id) == VERSION
    assert bench.batches(job_id) == 0


def test_a_job_stays_with_its_version_while_that_is_alive(bench: Bench) -> None:
    job_id = bench.begun("0.0+1")
    bench.see_last("0.0+1", GRACE_S + 1.0)
    for _ in range(30):
        bench.beat("other", "0.0+1")
        bench.see_last("0.0+1", GRACE_S + 1.0)
        bench.look()
    assert bench.app_version(job_id) == "0.0+1"
    # what runs no jobs moves none
    bench.guard = bench.another(None)
    bench.look(30)
    assert bench.app_version(job_id) == "0.0+1"


def test_a_job_from_before_versions_moves_once_no_such_worker_is_left(bench: Bench) -> None:
    job_id = bench.begun(None)
    bench.keep_a_batch(job_id)
    bench.write("INSERT INTO executors (id, beats) VALUES ('old', 0)")
    for _ in range(30):
        bench.write("UPDATE executors SET beats = beats + 1 WHERE id = 'old'")
        bench.look()
    assert bench.app_version(job_id) is None
    assert bench.batches(job_id) == 1
    bench.look(LOOKS + 11)
    assert bench.app_version(job_id) == VERSION
    assert bench.batches(job_id) == 0


def test_the_workflow_of_a_version_that_is_taken_by_nobody_moves_too(bench: Bench) -> None:
    """Begun by a process that died before it could say so: the row names no version."""
    job_id = bench.job()
    bench.write(f"{WORKFLOW} application_version = '0.0+1' {ITS_JOB}", id=job_id)
    bench.look(10)
    assert bench.app_version(job_id) == VERSION
    assert bench.state(job_id) == "queued"


def test_the_newest_version_that_lives_begins_jobs(bench: Bench) -> None:
    client = bench.client
    # years ahead: by whose clock it is the newest does not matter
    for name, when in ((VERSION, 1), ("0.9+1", 4_000_000_000_000)):
        client._sys_db.create_application_version(name)
        client._sys_db.update_application_version_timestamp(name, when)
    bench.beat("other", "0.9+1")
    bench.look(LOOKS)
    assert client.get_latest_application_version()["version_name"] == "0.9+1"
    bench.look(2)
    assert client.get_latest_application_version()["version_name"] == VERSION


def test_old_jobs_and_answers_are_swept_with_their_workflows_and_no_others(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    old, waiting = bench.job(), bench.job()
    with bench.database.writing() as connection:
        keep_answer(connection, "ann", "key", Answer("digest", 201, {}, ""))
        bench.queue.add_batches(connection, old, "ann", [(0, 0)])
    bench.set_workflow(old, "SUCCESS")
    bench.end(old)
    bench.look(10)
    assert bench.state(old) == "succeeded"
    bench.guard = bench.another("own", keep_s=-60.0)
    # nothing is old that is not old to every living worker
    for _ in range(10):
        bench.beat("behind")
        bench.write("UPDATE executors SET seen_at = '2020-01-01' WHERE id = 'behind'")
        bench.look()
    assert bench.state(old) == "succeeded"
    bench.look(LOOKS)
    # one that is cut short is made up for by the next
    with monkeypatch.context() as patched:
        patched.setattr(bench.client, "delete_workflows", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            bench.look(10)
    bench.look(10)
    assert bench.state(old) is None
    assert bench.workflow(old) is bench.workflow(f"{old}-0") is None
    assert bench.state(waiting) == "queued"
    assert bench.workflow(waiting) == ("ENQUEUED", PARTS_QUEUE)
    with bench.database.reading() as connection:
        assert find_answer(connection, "ann", "key") is None
