"""Child processes of the service: tasks in order, given up at once, gone with their parent."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
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
from api.computing.turns import GivenUpError, OwnerBusyError, PoolFullError, Ticket
from api.documents import PlanText
from api.job_kinds.job_kind import Batch, JobSpec
from api.jobs.workflows import batches_of
from api.service import limits_of
from api.settings import load_settings
from syncplan.errors import InputError, NoSolutionError
from syncplan.estimation.trials import CHUNK_TRIALS
from syncplan.planning.planner import plan
from syncplan.planning.validation import validate
from syncplan.reports.plan_report import plan_document
from syncplan.reports.validation_report import validation_document
from syncplan.runtime.files import as_text
from tests.tools.processes import PATIENCE_S, alive, command, family, wait_until
from tests.tools.scenarios import FILES, example, shared_circles

LIMITS = limits_of(load_settings())
GRID = (FILES / "paper-grid-same.yaml").read_bytes()


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    made = Pool(1, background=True, niceness=7)
    yield made
    made.close()


@pytest.fixture(scope="module")
def made(pool: Pool) -> PlanText:
    result = pool.call("made_plan", GRID, "yaml", LIMITS, False)
    assert isinstance(result, PlanText)
    return result


def spec_of(made: PlanText, pool: Pool, **request: object) -> JobSpec:
    body = json.dumps(request).encode()
    checked, _ = pool.call("checked_request", "validation", body, "json", LIMITS, made.text)
    return JobSpec("job", "validation", checked, made.text)


def long_flight(pool: Pool, made: PlanText, owner: str = "") -> Ticket:
    """A task that takes minutes."""
    request = '{"trials": 100000, "seed": 0, "filter": "ekf", "substeps": 10, "series": false}'
    spec = JobSpec("job", "validation", request, made.text)
    return pool.submit("computed_batch", spec, Batch(0, 0, 100_000), owner=owner)


def begun(ticket: Ticket) -> bool:
    """Whether a process is at a task."""
    return ticket.child is not None


def processes_of(parent: int) -> list[int]:
    """Processes of the pools of a process."""
    return [one for one in family(parent)[1:] if "api.computing.child" in command(one)]


def test_a_child_yields_as_far_as_it_is_asked_to(pool: Pool, made: PlanText) -> None:
    niceness = {os.getpriority(os.PRIO_PROCESS, one) for one in processes_of(os.getpid())}
    assert os.nice(0) + 7 in niceness


def test_depth_counts_tasks_owners_and_children(made: PlanText) -> None:
    one = Pool(1, background=True)
    try:
        wait_until(lambda: one.depth().started == 1)
        running = long_flight(one, made, "ann")
        wait_until(lambda: begun(running))
        for owner in ("ann", "ann", "bob"):
            long_flight(one, made, owner)
        depth = one.depth()
        # ann has a process; for bob, an extra one may have begun
        assert depth.running + depth.waiting == 4
        assert depth.owners in (1, 2)
        assert 0.0 < depth.oldest_s < PATIENCE_S
        running.cancel()
        wait_until(lambda: one.depth().started > depth.started)
    finally:
        one.close()
    assert one.depth().waiting == 0


def test_a_plan_made_by_a_child_is_the_librarys_to_the_byte(made: PlanText) -> None:
    assert made.text == as_text(plan_document(plan(example("paper-grid-same"))).as_json())


def test_a_fault_of_a_task_is_no_error_that_clients_are_told_of(pool: Pool) -> None:
    with pytest.raises(TaskFailedError, match="Traceback"):
        pool.call("made_plan", None, "json", LIMITS, False)


def test_batches_of_children_come_to_the_librarys_report(pool: Pool, made: PlanText) -> None:
    spec = spec_of(made, pool, trials=40, seed=5, duration_s=20.0)
    batches = [Batch(0, 16, 24), Batch(0, 0, 16)]
    report = pool.call(
        "concluded_job",
        spec,
        [(batch, pool.call("computed_batch", spec, batch)) for batch in batches],
    )
    whole = validate(example("paper-grid-same"), trials=40, seed=5, duration=20.0)
    assert report.text == as_text(validation_document(whole).as_json())
    assert report.trials


def test_bad_input_comes_back_as_the_librarys_error(pool: Pool) -> None:
    with pytest.raises(InputError) as caught:
        pool.call("made_plan", b'{"orbit": 3}', "json", LIMITS, False)
    assert caught.value.faults[0].key == "orbit"
    assert len(caught.value.faults) == 3


def test_what_has_no_solution_comes_back_as_the_librarys_error(pool: Pool) -> None:
    body = json.dumps(
        {
            "orbit": {"radius_m": 50.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
            "formation": {"count": 8, "links": [["v1", f"v{k}"] for k in range(2, 9)]},
            "sensor": {"range_m": 10.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
        }
    )
    with pytest.raises(NoSolutionError, match="at most 6"):
        pool.call("made_plan", body.encode(), "json", LIMITS, False)


@pytest.mark.parametrize(
    ("limits", "key"), [({"vehicles": 5}, "formation"), ({"samples": 100}, "duration_s")]
)
def test_what_is_above_a_limit_is_refused(pool: Pool, limits: dict[str, int], key: str) -> None:
    with pytest.raises(InputError) as caught:
        pool.call("made_plan", GRID, "yaml", replace(LIMITS, **limits), False)
    assert caught.value.key.startswith(key)


def test_a_task_given_up_stops_at_once_and_the_next_one_is_done(pool: Pool, made: PlanText) -> None:
    ticket = long_flight(pool, made)
    wait_until(lambda: begun(ticket))
    ticket.cancel()
    with pytest.raises(GivenUpError):
        ticket.future.result(timeout=PATIENCE_S)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_a_task_given_up_before_its_turn_is_never_begun(pool: Pool, made: PlanText) -> None:
    first, second = long_flight(pool, made), long_flight(pool, made)
    second.cancel()
    first.cancel()
    for ticket in (first, second):
        with pytest.raises(GivenUpError):
            ticket.future.result(timeout=PATIENCE_S)


def test_a_task_that_takes_too_long_is_stopped(pool: Pool, made: PlanText) -> None:
    spec = spec_of(made, pool, trials=100_000)
    with pytest.raises(TooSlowError):
        pool.call("computed_batch", spec, Batch(0, 0, 100_000), timeout_s=0.5)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_no_task_gets_the_answer_of_one_that_nobody_heard_out(pool: Pool, made: PlanText) -> None:
    def refuse(done: object) -> None:
        raise ValueError("not heard out")

    spec = spec_of(made, pool, trials=20_000)
    ticket = pool.submit("computed_batch", spec, Batch(0, 0, 20_000), progress=refuse)
    with pytest.raises(ValueError, match="not heard out"):
        ticket.future.result(timeout=PATIENCE_S)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_a_task_whose_process_dies_is_done_by_another(pool: Pool, made: PlanText) -> None:
    spec = spec_of(made, pool, trials=1600, duration_s=200.0)
    ticket = pool.submit("computed_batch", spec, Batch(0, 0, 1600))
    wait_until(lambda: begun(ticket))
    for one in processes_of(os.getpid()):
        os.kill(one, signal.SIGKILL)
    assert ticket.future.result(timeout=PATIENCE_S)


def test_a_task_whose_process_dies_each_time_is_given_back(
    made: PlanText, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(self: Child, *_: object, **__: object) -> None:
        raise ChildGoneError("killed")

    monkeypatch.setattr(Child, "call", gone)
    pool = Pool(1, background=False)
    with pytest.raises(ChildGoneError):
        pool.call("made_plan", GRID, "yaml", LIMITS, False)
    pool.close()


def test_more_tasks_than_may_wait_are_refused(made: PlanText) -> None:
    pool = Pool(1, background=True, most_waiting=1)
    try:
        pool.call("made_plan", GRID, "yaml", LIMITS, False)
        tickets = [long_flight(pool, made)]
        wait_until(lambda: begun(tickets[0]))
        tickets.append(long_flight(pool, made))
        with pytest.raises(PoolFullError):
            long_flight(pool, made)
    finally:
        pool.close()
    for ticket in tickets:
        with pytest.raises(GivenUpError):
            ticket.future.result(timeout=PATIENCE_S)


def test_children_die_with_a_parent_that_is_killed() -> None:
    code = (
        "import time; from api.computing.pool import Pool; from tests.service.test_pool import *; "
        "p = Pool(1, background=True); m = p.call('made_plan', GRID, 'yaml', LIMITS, False); "
        "long_flight(p, m); print('at work', flush=True); time.sleep(3600)"
    )
    root = Path(__file__).parents[2]
    parent = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, cwd=root, text=True
    )
    assert parent.stdout is not None
    with parent.stdout:
        assert parent.stdout.readline() == "at work\n"
    children = processes_of(parent.pid)
    assert children
    parent.kill()
    parent.wait()
    wait_until(lambda: not any(alive(one) for one in children))


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


def test_batches_of_a_long_run_take_about_what_they_should() -> None:
    batches = batches_of([(100_000, 0.002)], 7.0, 2)
    assert all(5.0 < 0.002 * batch.trials < 10.0 for batch in batches)


def test_a_short_run_is_divided_for_all_processes_and_a_shorter_one_is_not() -> None:
    assert len(batches_of([(2000, 0.002)], 7.0, 2)) == 2
    assert len(batches_of([(200, 0.002)], 7.0, 2)) == 1


@pytest.mark.parametrize("processes", [1, 2, 3, 8])
def test_no_process_waits_for_a_last_batch_of_another(processes: int) -> None:
    for trials in range(5_000, 60_000, 1_700):
        assert len(batches_of([(trials, 0.002)], 7.0, processes)) % processes == 0, trials


def test_a_pool_outlives_a_system_without_room_for_a_process(
    made: PlanText, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = Child.__init__
    refused: list[int] = []

    def refuse_twice(self: Child, **asked: Any) -> None:
        if len(refused) < 2:
            refused.append(1)
            raise OSError(12, "Cannot allocate memory")
        begin(self, **asked)

    monkeypatch.setattr(Child, "__init__", refuse_twice)
    pool = Pool(1, background=False)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made
    assert len(refused) == 2
    pool.close()


def test_a_pool_that_closes_starts_no_process(made: PlanText) -> None:
    pool = Pool(1, background=True)
    running = long_flight(pool, made)
    wait_until(lambda: begun(running))
    pool.close()
    assert pool.depth().started == 1


def test_a_caller_who_went_away_harms_nobody(pool: Pool, made: PlanText) -> None:
    first = long_flight(pool, made)
    waiting = pool.submit("made_plan", GRID, "yaml", LIMITS, False)
    assert waiting.future.cancel()
    first.cancel()
    first.future.exception(timeout=PATIENCE_S)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_a_pool_closes_though_a_caller_went_away(made: PlanText) -> None:
    pool = Pool(1, background=True)
    pool.call("made_plan", GRID, "yaml", LIMITS, False)
    running = long_flight(pool, made)
    waiting = [pool.submit("made_plan", GRID, "yaml", LIMITS, False) for _ in range(2)]
    waiting[0].future.cancel()
    pool.close()
    for ticket in (running, waiting[1]):
        with pytest.raises(GivenUpError):
            ticket.future.result(timeout=PATIENCE_S)


def test_a_task_that_waited_too_long_for_its_turn_is_refused(pool: Pool, made: PlanText) -> None:
    first = long_flight(pool, made)
    wait_until(lambda: begun(first))
    waiting = pool.submit("made_plan", GRID, "yaml", LIMITS, False, deadline_s=0.2)
    with pytest.raises(PoolFullError):
        waiting.future.result(timeout=PATIENCE_S)
    # it did not wait for its turn
    assert begun(first)
    assert pool.depth().waiting == 0
    first.cancel()


def test_a_task_past_its_deadline_fails_though_it_runs(pool: Pool, made: PlanText) -> None:
    spec = spec_of(made, pool, trials=100_000)
    ticket = pool.submit("computed_batch", spec, Batch(0, 0, 100_000), deadline_s=0.5)
    with pytest.raises(TooSlowError):
        ticket.future.result(timeout=PATIENCE_S)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_a_task_past_its_deadline_is_not_begun_again(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []

    def die(self: Child, task: str, **_: Any) -> None:
        begun.append(task)
        time.sleep(0.5)
        raise ChildGoneError

    pool = Pool(1, background=False)
    try:
        pool.call("ready")
        monkeypatch.setattr(Child, "call", die)
        with pytest.raises(TooSlowError):
            pool.submit("late", deadline_s=0.3).future.result(timeout=PATIENCE_S)
        with pytest.raises(ChildGoneError):
            pool.submit("other", retries=0).future.result(timeout=PATIENCE_S)
    finally:
        pool.close()
    assert begun == ["late", "other"]


def test_deadlines_hold_though_the_system_has_no_room_for_a_thread(
    pool: Pool, made: PlanText, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = threading.Thread.start
    refused: list[str] = []

    def refuse(self: threading.Thread) -> None:
        if self.name == "child-extra":
            refused.append(self.name)
            raise RuntimeError("can't start new thread")
        begin(self)

    monkeypatch.setattr(threading.Thread, "start", refuse)
    long = long_flight(pool, made, "busy")
    other = pool.submit("made_plan", GRID, "yaml", LIMITS, False, owner="other", deadline_s=2.5)
    with pytest.raises(PoolFullError):
        other.future.result(timeout=PATIENCE_S)
    assert 1 <= len(refused) <= 2
    assert pool.depth().processes == 1
    long.cancel()
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_a_task_that_a_caller_leaves_may_nearly_finish_and_keeps_its_process(
    pool: Pool, made: PlanText
) -> None:
    before = processes_of(os.getpid())
    tickets = [pool.submit("made_plan", GRID, "yaml", LIMITS, False) for _ in range(20)]
    for ticket in tickets:
        ticket.cancel(spare=True)
        with pytest.raises(GivenUpError):
            ticket.future.result(timeout=PATIENCE_S)
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made
    assert processes_of(os.getpid()) == before


def test_a_long_task_that_a_caller_leaves_is_killed(pool: Pool, made: PlanText) -> None:
    ticket = long_flight(pool, made)
    wait_until(lambda: begun(ticket))
    ticket.cancel(spare=True)
    wait_until(lambda: not begun(ticket))
    assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made


def test_long_tasks_of_one_owner_never_block_another(pool: Pool, made: PlanText) -> None:
    before = processes_of(os.getpid())
    long = [long_flight(pool, made, "busy") for _ in range(3)]
    wait_until(lambda: begun(long[0]))
    other = pool.submit("made_plan", GRID, "yaml", LIMITS, False, owner="other")
    assert other.future.result(timeout=PATIENCE_S) == made
    assert begun(long[0])
    assert not begun(long[1])
    # the extra process ends once it is idle
    wait_until(lambda: processes_of(os.getpid()) == before)
    for ticket in reversed(long):
        ticket.cancel()


def test_a_full_queue_makes_room_for_an_owner_with_less_in_it(made: PlanText) -> None:
    pool = Pool(1, background=True, most_waiting=3, most_of_owner=4)
    try:
        tickets = [long_flight(pool, made, "busy")]
        wait_until(lambda: begun(tickets[0]))
        tickets += [long_flight(pool, made, "busy") for _ in range(3)]
        with pytest.raises(OwnerBusyError):
            long_flight(pool, made, "busy")
        other = long_flight(pool, made, "other")
        with pytest.raises(PoolFullError):
            tickets[-1].future.result(timeout=PATIENCE_S)
        assert not other.future.done()
    finally:
        pool.close()


def test_a_task_that_is_asked_to_end_ends_by_itself(pool: Pool, made: PlanText) -> None:
    spec = spec_of(made, pool, trials=100_000)
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
        child.call("computed_batch", spec, Batch(0, 0, 100_000), timeout_s=0.5)
    assert complaints == [("out of time", False)]
    # and the time of one task does not end the next
    assert child.call("made_plan", GRID, "yaml", LIMITS, False, timeout_s=PATIENCE_S) == made
    child.end()


def test_a_task_that_needs_more_memory_than_it_may_use_fails_for_that_reason(
    made: PlanText,
) -> None:
    pool = Pool(1, background=False, memory_bytes=2**28)
    try:
        crowd = json.dumps(shared_circles(8)).encode()
        with pytest.raises(OutOfMemoryError):
            pool.call("made_plan", crowd, "json", LIMITS, False)
        assert pool.call("made_plan", GRID, "yaml", LIMITS, False) == made
    finally:
        pool.close()
