"""Turns of owners: one with many tasks delays another by one task, and nobody starves."""

import time
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from api.computing.pool import Pool
from api.computing.turns import Turns
from tests.service.conftest import Hollow
from tests.tools.processes import PATIENCE_S

OWNERS = ["a", "b", "c", "d"]


def filled(**counts: int) -> Turns[str]:
    turns: Turns[str] = Turns()
    for owner, count in counts.items():
        for number in range(count):
            turns.add(owner, f"{owner}{number}")
    return turns


@given(before=st.integers(0, 50), running=st.integers(0, 3))
def test_an_owner_with_a_thousand_tasks_delays_another_by_one(before: int, running: int) -> None:
    turns = filled(a=1000)
    taken = [turns.take() for _ in range(before)]
    for _ in taken[running:]:
        turns.done("a")
    turns.add("b", "b0")
    assert "b0" in (turns.take(), turns.take())


@given(
    st.lists(st.sampled_from(OWNERS), min_size=10, max_size=200),
    st.lists(st.integers(0, 5), min_size=10, max_size=200),
)
def test_no_owner_with_nothing_running_is_passed_twice_by_another(
    owners: list[str], steps: list[int]
) -> None:
    turns: Turns[str] = Turns()
    running: list[str] = []
    passed: dict[str, Counter[str]] = {}
    for owner, step in zip(owners, steps, strict=False):
        turns.add(owner, owner)
        for one in turns.idle_owners():
            passed.setdefault(one, Counter())
        if step < 3 and running:
            turns.done(running.pop(0))
            continue
        taken = turns.take()
        assert taken is not None
        running.append(taken)
        passed.pop(taken, None)
        for one in turns.idle_owners():
            passed.setdefault(one, Counter())[taken] += 1
            assert passed[one][taken] <= 1, (one, taken)
        for one in [one for one in passed if one not in turns.idle_owners()]:
            del passed[one]


@given(st.lists(st.sampled_from(OWNERS), max_size=100))
def test_within_an_owner_the_first_is_served_first_and_all_are(owners: list[str]) -> None:
    turns: Turns[tuple[str, int]] = Turns()
    for number, owner in enumerate(owners):
        turns.add(owner, (owner, number))
    assert len(turns) == len(owners)
    taken = [turns.take() for _ in owners]
    assert turns.take() is None
    for owner in OWNERS:
        own = [one[1] for one in taken if one is not None and one[0] == owner]
        assert own == sorted(own)
        assert len(own) == owners.count(owner)


def test_running_tasks_are_divided_evenly() -> None:
    turns = filled(a=1000, b=3, c=1000)
    assert Counter(str(turns.take())[0] for _ in range(9)) == {"a": 3, "b": 3, "c": 3}


def test_among_idle_owners_only_those_with_nothing_running_count() -> None:
    turns = filled(a=3)
    assert turns.take() == "a0"
    assert turns.take(idle_owners=True) is None
    turns.add("b", "b0")
    assert turns.take(idle_owners=True) == "b0"


def test_a_task_that_left_the_queue_is_never_taken() -> None:
    turns = filled(a=2)
    assert turns.remove("a", "a0")
    assert not turns.remove("a", "a0")
    assert not turns.remove("b", "b0")
    assert turns.held("a") == 1
    assert turns.take() == "a1"
    assert turns.held("a") == 1
    turns.done("a")
    assert turns.held("a") == 0


@pytest.mark.parametrize(("own", "displaced"), [(0, "a4"), (3, "a4"), (4, None)])
def test_a_full_queue_loses_the_newest_task_of_the_longest(own: int, displaced: str | None) -> None:
    turns = filled(a=5, b=own)
    assert turns.displaced_by("b") == displaced
    assert turns.displaced_by("a") is None


def test_owners_whose_short_tasks_take_turns_need_no_extra_process(
    hollow: list[Hollow], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Hollow, "call", lambda *_, **__: time.sleep(0.01))
    # on a busy machine, one of them may take 0.2 s
    monkeypatch.setattr("api.computing.pool.PATIENCE_S", 1.0)
    pool = Pool(1)
    # the last ones wait longer than an owner that is blocked would
    tickets = [pool.submit("short", owner=owner) for _ in range(150) for owner in ("ann", "eve")]
    for ticket in tickets:
        ticket.future.result(timeout=PATIENCE_S)
    pool.close()
    assert len(hollow) == 1
