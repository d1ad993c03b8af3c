"""Queues and deadlines of pools, of children without processes.

No pool with processes may be about: it would begin such children too.
"""

import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any
from unittest.mock import create_autospec

import pytest

from api.computing.child import ChildGoneError, ChildNotStartedError, TooSlowError
from api.computing.pool import Pool
from api.computing.turns import GaveWayError, GivenUpError, OwnerBusyError, PoolFullError, Ticket
from api.job_kinds.job_kind import FinishedSearch, Progress
from tests.service.conftest import Hollow, begun, end_of
from tests.tools.processes import PATIENCE_S, wait_until


@pytest.fixture
def narrow(hollow: list[Hollow]) -> Iterator[Pool]:
    """A pool of one such child, with room for three tasks that wait and four of an owner."""
    with closing(Pool(1, most_waiting=3, most_of_owner=4)) as made:
        wait_until(lambda: made.depth().started == len(hollow) == 1)
        yield made


def held(pool: Pool, owner: str = "") -> Ticket:
    """Submit a task that goes on until its child is killed, and wait until a child is at it."""
    ticket = pool.submit("long", owner=owner)
    wait_until(lambda: begun(ticket))
    return ticket


def test_depth_counts_tasks_owners_and_children(narrow: Pool) -> None:
    running = held(narrow, "ann")
    for owner in ("ann", "ann", "bob"):
        narrow.submit("long", owner=owner)
    depth = narrow.depth()
    # ann has a process; for bob, an extra one may have begun
    assert depth.running + depth.waiting == 4
    assert depth.owners in (1, 2)
    assert 0.0 < depth.oldest_s < PATIENCE_S
    running.cancel()
    wait_until(lambda: narrow.depth().started > depth.started)
    narrow.close()
    assert narrow.depth().waiting == 0


def test_a_task_whose_process_dies_each_time_is_given_back(
    narrow: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = create_autospec(Hollow.call, side_effect=ChildGoneError("killed"))
    monkeypatch.setattr(Hollow, "call", gone)
    with pytest.raises(ChildGoneError):
        narrow.call("short")
    assert len({tried.args[0] for tried in gone.call_args_list}) == gone.call_count == 2


@pytest.mark.usefixtures("hollow")
def test_more_tasks_than_may_wait_are_refused() -> None:
    with closing(Pool(1, most_waiting=1)) as pool:
        tickets = [held(pool), pool.submit("long")]
        with pytest.raises(PoolFullError):
            pool.submit("long")
    for ticket in tickets:
        with pytest.raises(GivenUpError):
            end_of(ticket)


def test_a_pool_outlives_a_system_without_room_for_a_process(
    hollow: list[Hollow], monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = Hollow.__init__
    refused: list[int] = []

    def refuse_twice(self: Hollow, **asked: Any) -> None:
        if len(refused) < 2:
            refused.append(1)
            raise OSError(12, "Cannot allocate memory")
        begin(self, **asked)

    monkeypatch.setattr(Hollow, "__init__", refuse_twice)
    with closing(Pool(1)) as pool:
        assert pool.call("short") == "short"
    # where threads are slow, an extra child may have begun too
    assert len(refused) == 2
    assert hollow


def test_a_caller_who_went_away_harms_nobody(narrow: Pool) -> None:
    first = held(narrow)
    waiting = narrow.submit("short")
    assert waiting.future.cancel()
    first.cancel()
    with pytest.raises(GivenUpError):
        end_of(first)
    assert narrow.call("short") == "short"


def test_a_pool_closes_though_a_caller_went_away_and_starts_no_process(narrow: Pool) -> None:
    running = held(narrow)
    waiting = [narrow.submit("short") for _ in range(2)]
    waiting[0].future.cancel()
    narrow.close()
    for ticket in (running, waiting[1]):
        with pytest.raises(GivenUpError):
            end_of(ticket)
    assert narrow.depth().started == 1


def test_a_task_that_waited_too_long_for_its_turn_is_refused(narrow: Pool) -> None:
    first = held(narrow)
    waiting = narrow.submit("short", deadline_s=0.2)
    with pytest.raises(PoolFullError):
        end_of(waiting)
    # it did not wait for its turn
    assert begun(first)
    assert narrow.depth().waiting == 0


def test_a_task_past_its_deadline_is_not_begun_again(
    narrow: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[str] = []

    def die(self: Hollow, task: str, **_: Any) -> None:
        tried.append(task)
        time.sleep(0.5)
        raise ChildGoneError

    monkeypatch.setattr(Hollow, "call", die)
    with pytest.raises(TooSlowError):
        end_of(narrow.submit("late", deadline_s=0.3))
    with pytest.raises(ChildGoneError):
        end_of(narrow.submit("other", retries=0))
    assert tried == ["late", "other"]


def test_deadlines_hold_though_the_system_has_no_room_for_another_process(
    narrow: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    held(narrow, "busy")
    refused = create_autospec(Hollow.__init__, side_effect=OSError(12, "Cannot allocate memory"))
    monkeypatch.setattr(Hollow, "__init__", refused)
    with pytest.raises((ChildNotStartedError, PoolFullError)):
        end_of(narrow.submit("short", owner="other", deadline_s=2.5))
    assert 1 <= refused.call_count <= 3
    assert narrow.depth().processes == 1


def test_long_tasks_of_one_owner_never_block_another(
    narrow: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.computing.pool._IDLE_S", 0.2)
    long = [held(narrow, "busy"), *(narrow.submit("long", owner="busy") for _ in range(2))]
    assert end_of(narrow.submit("short", owner="other")) == "short"
    assert begun(long[0])
    assert not begun(long[1])
    # the extra process ends once it is idle
    wait_until(lambda: narrow.depth().processes == 1)


def test_owners_who_have_computed_most_are_paused_in_turn(narrow: Pool) -> None:
    began = time.monotonic()
    first, second = held(narrow, "ann"), held(narrow, "bob")

    def computes(ticket: Ticket, other: Ticket) -> bool:
        assert ticket.child is not None
        assert other.child is not None
        return other.child.paused and not ticket.child.paused

    # ann has computed for longer
    wait_until(lambda: computes(second, first), every_s=0.01)
    wait_until(lambda: computes(first, second), every_s=0.01)
    wait_until(lambda: computes(second, first), every_s=0.01)
    # pauses do not count
    assert first.ran_s + second.ran_s < time.monotonic() - began + 0.5
    first.cancel()
    wait_until(lambda: second.child is not None and not second.child.paused)


def test_where_no_child_may_be_added_work_that_resumes_gives_way(
    narrow: Pool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.computing.pool.MOST_EXTRA", 0)
    searches: list[FinishedSearch] = []

    def call(self: Hollow, task: str, *_: Any, progress: Progress, **__: Any) -> str:
        while task == "search" and not self.killed:
            searches.append(FinishedSearch(len(searches), b""))
            progress(searches[-1])
            time.sleep(0.05)
        return task

    monkeypatch.setattr(Hollow, "call", call)
    ticket = narrow.submit("search", owner="ann", resumes=True)
    wait_until(lambda: begun(ticket))
    assert end_of(narrow.submit("short", owner="bob")) == "short"
    with pytest.raises(GaveWayError):
        end_of(ticket)
    assert searches


def test_a_full_queue_makes_room_for_an_owner_with_less_in_it(narrow: Pool) -> None:
    held(narrow, "busy")
    tickets = [narrow.submit("long", owner="busy") for _ in range(3)]
    with pytest.raises(OwnerBusyError):
        narrow.submit("long", owner="busy")
    other = narrow.submit("long", owner="other")
    with pytest.raises(PoolFullError):
        end_of(tickets[-1])
    assert not other.future.done()


def test_a_process_that_was_forked_early_is_replaced_after_its_task(hollow: list[Hollow]) -> None:
    with closing(Pool(1)) as pool:
        wait_until(lambda: len(hollow) == 1)
        hollow[0].complete = False
        pool.call("short")
        wait_until(lambda: len(hollow) == 2)
        pool.call("short")
        assert pool.call("short") == "short"
        assert len(hollow) == 2
