"""Child processes of the service: tasks in order, given up at once, gone with their parent."""

import contextlib
import json
import os
import signal
import time
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from api.computing.child import (
    Child,
    OutOfMemoryError,
    TaskFailedError,
    TooSlowError,
)
from api.computing.pool import Pool
from api.computing.tasks import made_plan
from api.computing.turns import GivenUpError, PoolFullError
from api.job_kinds.job_kind import Batch, JobSpec
from api.jobs.workflows import batches_of
from api.service import limits_of
from api.settings import load_settings
from syncplan.estimation.trials import CHUNK_TRIALS
from syncplan.runtime.template_process import TemplateProcess
from tests.service.conftest import begun, end_of
from tests.tools.processes import PATIENCE_S, alive, command, family, wait_until
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
    """A pool of one process for a test alone, which no early child is replaced in."""
    wait_until(template_is_loaded)
    pool = Pool(1, **options)
    try:
        yield pool
    finally:
        pool.close()


def template_is_loaded() -> bool:
    """Whether a child has all that the template loads."""
    child = Child()
    child.wait_until_ready()
    child.end()
    return child.complete


def keeps_its_process(pool: Pool) -> bool:
    """Whether a pool goes on with its process after a task, which it does not if it is early."""
    before = pool.depth().started
    for _ in range(2):
        pool.call("ready")
    return pool.depth().started == before


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


def forks_of(parent: int) -> list[int]:
    """The template of a process, and what is forked from it."""
    templates = (
        child for child in family(parent, generations=1)[1:] if "template_process" in command(child)
    )
    # a test has one beside, of which nothing is forked any more
    return max(map(family, templates), key=len, default=[])


def processes_of(parent: int) -> list[int]:
    """Processes of the pools of a process: each leads a group, and none of a template's does."""
    return [process for process in forks_of(parent) if os.getpgid(process) == process]


def test_a_child_yields_as_far_as_it_is_asked_to(pool: Pool) -> None:
    pool.call("ready")
    niceness = {os.getpriority(os.PRIO_PROCESS, one) for one in processes_of(os.getpid())}
    assert os.nice(0) + 7 in niceness


def test_a_child_inherits_no_secret(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SYNCPLAN_DATA_DIR", "PGPASSFILE", "OTEL_EXPORTER", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "not-for-children")
    child = TemplateProcess("tests.tools.forked", "load", "serve").fork()
    child.wait_until_begun()
    environment = Path(f"/proc/{child.process.pid}/environ").read_text()
    child.kill()
    child.end()
    assert "not-for-children" not in environment
    assert f"\0PATH={os.environ['PATH']}\0" in f"\0{environment}\0"


def test_a_child_inherits_no_file_but_its_pipe(tmp_path: Path) -> None:
    with (tmp_path / "kept").open("w") as kept:
        os.set_inheritable(kept.fileno(), True)
        child = Child()
        child.wait_until_ready()
        folder = Path(f"/proc/{child.pid}/fd")
        files = [os.readlink(file) for file in folder.iterdir()]
        child.end()
    assert kept.name not in files
    assert sum(file.startswith("socket:") for file in files) == 1


def test_a_fault_of_a_task_is_no_error_that_clients_hear_of(pool: Pool) -> None:
    with pytest.raises(TaskFailedError, match="Traceback"):
        pool.call("made_plan", None, "json", LIMITS, False)


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
    refuse = Mock(side_effect=ValueError("not heard out"))
    with pytest.raises(ValueError, match="not heard out"):
        end_of(pool.submit(*LONG, progress=refuse))


def test_a_task_whose_process_dies_is_done_by_another(pool: Pool) -> None:
    ticket = pool.submit("computed_batch", VALIDATION, Batch(0, 0, 400))
    wait_until(lambda: begun(ticket))
    for one in processes_of(os.getpid()):
        os.kill(one, signal.SIGKILL)
    assert end_of(ticket)


def test_a_child_that_has_been_idle_is_replaced_by_a_fresh_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("api.computing.pool._IDLE_S", 0.5)
    with own_pool() as pool:
        assert pool.call(*SHORT) == MADE
        before = pool.depth().started
        wait_until(lambda: pool.depth().started > before)
        # which stays until it has had a task
        wait_until(lambda: pool.depth().processes == 1)
        before = pool.depth().started
        time.sleep(1.5)
        assert pool.depth().started == before


def test_processes_are_forked_while_their_template_still_loads() -> None:
    def is_complete(template: TemplateProcess) -> bool:
        """Fork a process, and return whether it has all stages."""
        child = template.fork()
        child.wait_until_begun()
        child.kill()
        child.end()
        return child.complete

    slow = TemplateProcess("tests.tools.forked", "load_for_long", "serve")
    assert not any(is_complete(slow) for _ in range(2))
    whole = TemplateProcess("tests.tools.forked", "load", "serve")
    wait_until(lambda: is_complete(whole))


@pytest.mark.long
def test_a_template_that_is_killed_is_started_anew(pool: Pool) -> None:
    before = forks_of(os.getpid())
    os.kill(before[0], signal.SIGKILL)
    wait_until(lambda: not any(map(alive, before)))
    assert pool.call(*SHORT) == MADE
    assert not set(before) & set(forks_of(os.getpid()))
    wait_until(lambda: keeps_its_process(pool))


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
    ticket = pool.submit(*LONG)
    wait_until(lambda: begun(ticket))
    ticket.cancel(spare=True)
    wait_until(lambda: not begun(ticket))


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

    child = Watched()
    child.wait_until_ready()
    with pytest.raises(TooSlowError):
        child.call(*LONG, timeout_s=0.5)
    assert complaints == [("out of time", False)]
    # and the time of one task does not end the next
    assert child.call(*SHORT, timeout_s=PATIENCE_S) == MADE
    child.end()


def test_a_task_that_needs_more_memory_than_it_may_use_fails_for_that_reason() -> None:
    crowd = json.dumps(shared_circles(8)).encode()
    with own_pool(memory_bytes=2**29) as pool:
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
    with own_pool() as pool:
        pool.call(*SHORT)
        before = pool.depth().started
        for _ in range(2):
            pool.call("made_plan", body, "json", LIMITS, False)
        assert pool.depth().started == before


@pytest.mark.long
def test_pauses_count_towards_no_time_limit_and_one_that_is_to_end_is_not_paused() -> None:
    with own_pool() as pool:
        other = pool.submit(*LONG, owner="ann")
        wait_until(lambda: begun(other))
        began = time.monotonic()
        limited = pool.submit(*LONG, owner="bob", timeout_s=1.5)
        with pytest.raises(TooSlowError):
            end_of(limited)
        # each has computed for about half of the time
        assert limited.ran_s < 0.8 * (time.monotonic() - began)
        limited = pool.submit(*LONG, owner="bob", deadline_s=3.0)
        with pytest.raises((TooSlowError, PoolFullError)):
            end_of(limited)
        assert other.child is not None
        other.interrupt()
        wait_until(lambda: other.child is not None and not other.child.paused)
        other.cancel()


@pytest.mark.long
def test_tasks_beyond_the_processes_kept_are_paused_and_long_ones_yield() -> None:
    with own_pool(later_niceness=5) as pool:
        tickets = [pool.submit(*LONG, owner=owner) for owner in ("ann", "bob")]
        wait_until(lambda: all(begun(ticket) for ticket in tickets))
        children = [ticket.child.pid for ticket in tickets if ticket.child is not None]
        for child in children:
            wait_until(partial(stopped, child), every_s=0.01)
        wait_until(lambda: {os.getpriority(os.PRIO_PROCESS, child) for child in children} == {5})
        for ticket in tickets:
            ticket.cancel()
        wait_until(lambda: not any(alive(child) for child in children))
        pool.call("ready")
        assert os.getpriority(os.PRIO_PROCESS, processes_of(os.getpid())[-1]) == 0


def stopped(process: int) -> bool:
    """Whether a process is stopped by a signal."""
    return ") T " in Path(f"/proc/{process}/stat").read_text()


# --- batches --------------------------------------------------------------------------------------


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
