"""Child processes of the service: tasks in order, given up at once, gone with their parent."""

import contextlib
import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from api.computing.child import (
    Child,
    ChildGoneError,
    OutOfMemoryError,
    TaskFailedError,
    TooSlowError,
)
from api.computing.pool import Pool
from api.computing.tasks import made_plan
from api.computing.turns import GivenUpError, OwnerBusyError, PoolFullError, Ticket
from api.job_kinds.job_kind import Batch, JobSpec
from api.jobs.workflows import batches_of
from api.service import limits_of
from api.settings import load_settings
from syncplan.estimation.trials import CHUNK_TRIALS
from tests.tools.processes import PATIENCE_S, command, family, wait_until
from tests.tools.scenarios import FILES, shared_circles

LIMITS = limits_of(load_settings())
GRID = (FILES / "paper-grid-same.yaml").read_bytes()


MADE = made_plan(GRID, "yaml", LIMITS, False)
VALIDATION = JobSpec(
    "job",
    "validation",
    '{"trials": 100000, "seed": 0, "filter": "ekf", "substeps": 10, "series": false}',
    MADE.text,
)
LONG = ("computed_batch", VALIDATION, Batch(0, 0, 100_000))
"""A task that takes minutes."""
SHORT = ("made_plan", GRID, "yaml", LIMITS, False)


@contextlib.contextmanager
def own_pool(**options: Any) -> Iterator[Pool]:
    """A pool of one process for a test alone."""
    made = Pool(1, **{"background": True, **options})
    try:
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def shared_pool() -> Iterator[Pool]:
    with own_pool(niceness=7) as made:
        made.call("ready")
        yield made


@pytest.fixture
def pool(shared_pool: Pool) -> Iterator[Pool]:
    """The shared pool, which must serve as ever when the test has ended."""
    yield shared_pool
    assert shared_pool.call(*SHORT) == MADE


def end_of(ticket: Ticket) -> Any:
    """Return what a task comes to."""
    return ticket.future.result(timeout=PATIENCE_S)


def begun(ticket: Ticket) -> bool:
    """Whether a process is at a task."""
    return ticket.child is not None


def at_work(pool: Pool, owner: str = "") -> Ticket:
    """Submit a long task and wait until a process is at it."""
    ticket = pool.submit(*LONG, owner=owner)
    wait_until(lambda: begun(ticket))
    return ticket


def processes_of(parent: int) -> list[int]:
    """Processes of the pools of a process."""
    return [one for one in family(parent)[1:] if "api.computing.child" in command(one)]


def test_a_child_yields_as_far_as_it_is_asked_to(pool: Pool) -> None:
    niceness = {os.getpriority(os.PRIO_PROCESS, one) for one in processes_of(os.getpid())}
    assert os.nice(0) + 7 in niceness


def test_a_child_inherits_no_secret_and_no_file_but_its_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("SYNCPLAN_DATA_DIR", "PGPASSFILE", "OTEL_EXPORTER", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "not-for-children")
    with (tmp_path / "kept").open("w") as kept, own_pool(background=False) as pool:
        os.set_inheritable(kept.fileno(), True)
        child = at_work(pool).child
        assert child is not None
        process = Path(f"/proc/{child.pid}")
        files = [os.readlink(one) for one in (process / "fd").iterdir()]
        environment = (process / "environ").read_text()
    assert "not-for-children" not in environment
    assert f"\0PATH={os.environ['PATH']}\0" in f"\0{environment}\0"
    assert kept.name not in files
    assert sum(one.startswith("socket:") for one in files) == 1


@pytest.mark.long
def test_depth_counts_tasks_owners_and_children() -> None:
    with own_pool() as one:
        wait_until(lambda: one.depth().started == 1)
        running = at_work(one, "ann")
        for owner in ("ann", "ann", "bob"):
            one.submit(*LONG, owner=owner)
        depth = one.depth()
        # ann has a process; for bob, an extra one may have begun
        assert depth.running + depth.waiting == 4
        assert depth.owners in (1, 2)
        assert 0.0 < depth.oldest_s < PATIENCE_S
        running.cancel()
        wait_until(lambda: one.depth().started > depth.started)
    assert one.depth().waiting == 0


def test_a_fault_of_a_task_is_no_error_that_clients_hear_of(pool: Pool) -> None:
    with pytest.raises(TaskFailedError, match="Traceback"):
        pool.call("made_plan", None, "json", LIMITS, False)


@pytest.mark.long
def test_a_task_given_up_stops_at_once_or_is_never_begun(pool: Pool) -> None:
    first, second = at_work(pool), pool.submit(*LONG)
    second.cancel()
    first.cancel()
    for ticket in (first, second):
        with pytest.raises(GivenUpError):
            end_of(ticket)


@pytest.mark.long
def test_a_task_that_takes_too_long_is_stopped(pool: Pool) -> None:
    with pytest.raises(TooSlowError):
        pool.call(*LONG, timeout_s=0.5)
    # by a deadline too, though it runs
    pool.call("ready")
    with pytest.raises(TooSlowError):
        end_of(pool.submit(*LONG, deadline_s=0.5))


@pytest.mark.long
def test_no_task_gets_the_answer_of_one_that_nobody_heard_out(pool: Pool) -> None:
    def refuse(done: object) -> None:
        raise ValueError("not heard out")

    with pytest.raises(ValueError, match="not heard out"):
        end_of(pool.submit(*LONG, progress=refuse))


def test_a_task_whose_process_dies_is_done_by_another(pool: Pool) -> None:
    ticket = pool.submit("computed_batch", VALIDATION, Batch(0, 0, 400))
    wait_until(lambda: begun(ticket))
    for one in processes_of(os.getpid()):
        os.kill(one, signal.SIGKILL)
    assert end_of(ticket)


def test_a_task_whose_process_dies_each_time_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(self: Child, *_: object, **__: object) -> None:
        raise ChildGoneError("killed")

    monkeypatch.setattr(Child, "call", gone)
    with own_pool(background=False) as pool, pytest.raises(ChildGoneError):
        pool.call(*SHORT)


def test_more_tasks_than_may_wait_are_refused() -> None:
    with own_pool(most_waiting=1) as pool:
        tickets = [at_work(pool), pool.submit(*LONG)]
        with pytest.raises(PoolFullError):
            pool.submit(*LONG)
    for ticket in tickets:
        with pytest.raises(GivenUpError):
            end_of(ticket)


@pytest.mark.parametrize(
    ("trials", "seconds"), [(1, 0.001), (200, 0.002), (100_000, 0.002), (5000, 3.0), (47, 0.5)]
)
def test_batches_cover_each_run_once_in_whole_chunks(trials: int, seconds: float) -> None:
    batches = batches_of([(trials, seconds), (trials, 2 * seconds)], 7.0, 2)
    for run in (0, 1):
        own = [batch for batch in batches if batch.run == run]
        assert own[0].first_trial == 0
        assert all(one.first_trial % CHUNK_TRIALS == 0 and one.trials > 0 for one in own)
        assert all(a.first_trial + a.trials == b.first_trial for a, b in pairwise(own))
        assert own[-1].first_trial + own[-1].trials == trials


def test_batches_take_about_what_they_should_and_keep_all_processes_at_work() -> None:
    assert all(5.0 < 0.002 * one.trials < 10.0 for one in batches_of([(100_000, 0.002)], 7.0, 2))
    assert len(batches_of([(2000, 0.002)], 7.0, 2)) == 2
    assert len(batches_of([(200, 0.002)], 7.0, 2)) == 1
    # no process waits for a last batch of another
    for processes in (1, 2, 3, 8):
        for trials in range(5_000, 60_000, 1_700):
            assert len(batches_of([(trials, 0.002)], 7.0, processes)) % processes == 0, trials


def test_a_pool_outlives_a_system_without_room_for_a_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begin = Child.__init__
    refused: list[int] = []

    def refuse_twice(self: Child, **asked: Any) -> None:
        if len(refused) < 2:
            refused.append(1)
            raise OSError(12, "Cannot allocate memory")
        begin(self, **asked)

    monkeypatch.setattr(Child, "__init__", refuse_twice)
    with own_pool(background=False) as pool:
        assert pool.call(*SHORT) == MADE
    assert len(refused) == 2


def test_a_caller_who_went_away_harms_nobody(pool: Pool) -> None:
    first = pool.submit(*LONG)
    waiting = pool.submit(*SHORT)
    assert waiting.future.cancel()
    first.cancel()
    first.future.exception(timeout=PATIENCE_S)


def test_a_pool_closes_though_a_caller_went_away_and_starts_no_process() -> None:
    with own_pool() as pool:
        running = at_work(pool)
        waiting = [pool.submit(*SHORT) for _ in range(2)]
        waiting[0].future.cancel()
    for ticket in (running, waiting[1]):
        with pytest.raises(GivenUpError):
            end_of(ticket)
    assert pool.depth().started == 1


@pytest.mark.long
def test_a_task_that_waited_too_long_for_its_turn_is_refused(pool: Pool) -> None:
    first = at_work(pool)
    waiting = pool.submit(*SHORT, deadline_s=0.2)
    with pytest.raises(PoolFullError):
        end_of(waiting)
    # it did not wait for its turn
    assert begun(first)
    assert pool.depth().waiting == 0
    first.cancel()


@pytest.mark.long
def test_a_task_past_its_deadline_is_not_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []

    def die(self: Child, task: str, **_: Any) -> None:
        begun.append(task)
        time.sleep(0.5)
        raise ChildGoneError

    with own_pool(background=False) as pool:
        pool.call("ready")
        monkeypatch.setattr(Child, "call", die)
        with pytest.raises(TooSlowError):
            end_of(pool.submit("late", deadline_s=0.3))
        with pytest.raises(ChildGoneError):
            end_of(pool.submit("other", retries=0))
    assert begun == ["late", "other"]


def test_deadlines_hold_though_the_system_has_no_room_for_a_thread(
    pool: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = threading.Thread.start
    refused: list[str] = []

    def refuse(self: threading.Thread) -> None:
        if self.name == "child-extra":
            refused.append(self.name)
            raise RuntimeError("can't start new thread")
        begin(self)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    long = pool.submit(*LONG, owner="busy")
    other = pool.submit(*SHORT, owner="other", deadline_s=2.5)
    with pytest.raises(PoolFullError):
        end_of(other)
    assert 1 <= len(refused) <= 2
    assert pool.depth().processes == 1
    long.cancel()


def test_a_task_that_a_caller_leaves_may_nearly_finish_and_keeps_its_process(pool: Pool) -> None:
    before = pool.depth().started
    tickets = [pool.submit(*SHORT) for _ in range(20)]
    for ticket in tickets:
        ticket.cancel(spare=True)
        with pytest.raises(GivenUpError):
            end_of(ticket)
    assert pool.call(*SHORT) == MADE
    assert pool.depth().started == before


def test_a_long_task_that_a_caller_leaves_is_killed(pool: Pool) -> None:
    ticket = at_work(pool)
    ticket.cancel(spare=True)
    wait_until(lambda: not begun(ticket))


@pytest.mark.long
def test_long_tasks_of_one_owner_never_block_another(pool: Pool) -> None:
    long = [at_work(pool, "busy"), *(pool.submit(*LONG, owner="busy") for _ in range(2))]
    assert end_of(pool.submit(*SHORT, owner="other")) == MADE
    assert begun(long[0])
    assert not begun(long[1])
    # the extra process ends once it is idle
    wait_until(lambda: pool.depth().processes == 1)
    for ticket in reversed(long):
        ticket.cancel()


def test_a_full_queue_makes_room_for_an_owner_with_less_in_it() -> None:
    with own_pool(most_waiting=3, most_of_owner=4) as pool:
        at_work(pool, "busy")
        tickets = [pool.submit(*LONG, owner="busy") for _ in range(3)]
        with pytest.raises(OwnerBusyError):
            pool.submit(*LONG, owner="busy")
        other = pool.submit(*LONG, owner="other")
        with pytest.raises(PoolFullError):
            end_of(tickets[-1])
        assert not other.future.done()


def test_a_task_that_is_asked_to_end_ends_by_itself() -> None:
    complaints = []

    class Watched(Child):
        def call(self, *given: Any, **also: Any) -> Any:
            try:
                return super().call(*given, **also)
            except TooSlowError as error:
                # said by the process: it is not killed
                complaints.append((str(error), self.killed))
                raise

    child = Watched(background=True)
    child.wait_until_ready()
    with pytest.raises(TooSlowError):
        child.call(*LONG, timeout_s=0.5)
    assert complaints == [("out of time", False)]
    # and the time of one task does not end the next
    assert child.call(*SHORT, timeout_s=PATIENCE_S) == MADE
    child.end()


def test_a_task_that_needs_more_memory_than_it_may_use_fails_for_that_reason() -> None:
    crowd = json.dumps(shared_circles(8)).encode()
    with own_pool(background=False, memory_bytes=2**28) as pool:
        with pytest.raises(OutOfMemoryError):
            pool.call("made_plan", crowd, "json", LIMITS, False)
        assert pool.call(*SHORT) == MADE


def test_a_child_stays_though_tasks_load_libraries() -> None:
    # three of one sense, all linked: their phases are searched for
    centers = [[0.0, 0.0], [70.0, 0.0], [35.0, 60.0]]
    triangle = {
        "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
        "formation": {"centers_m": centers},
        "sensor": {"range_m": 50.0},
    }
    body = json.dumps(triangle).encode()
    with own_pool(background=False) as pool:
        pool.call(*SHORT)
        for _ in range(2):
            pool.call("made_plan", body, "json", LIMITS, False)
        assert pool.depth().started == 1
