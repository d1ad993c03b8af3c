"""One thread answers those who wait, in groups; plans are read and stored that way."""

import asyncio
import sqlite3
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from api.documents import PlanText
from api.storage.database import Database, open_database
from api.storage.holdings import PlanRow, add_plan, delete_plan, find_plans, list_plans
from api.storage.plan_threads import GroupThread, PlanReader, PlanWriter
from tests.tools.processes import wait_until

MADE = PlanText('{\n "version": "1"\n}\n', "survey", 6, True, 1.5)


@contextmanager
def group_thread(
    answer: Callable[[Sequence[int]], Sequence[int | Exception]], most: int = 100
) -> Iterator[GroupThread[int, int]]:
    """A thread for a test, ended with it."""
    thread: GroupThread[int, int] = GroupThread("test", answer, most)
    try:
        yield thread
    finally:
        thread.close()


def test_questions_of_one_turn_are_answered_together_each_with_its_own_answer() -> None:
    groups: list[list[int]] = []

    def doubled(questions: Sequence[int]) -> list[int | Exception]:
        groups.append(list(questions))
        return [2 * one for one in questions]

    async def ask(thread: GroupThread[int, int]) -> list[int]:
        return await asyncio.gather(*(thread.ask(k) for k in range(10)))

    with group_thread(doubled, most=4) as thread:
        assert asyncio.run(ask(thread)) == [2 * k for k in range(10)]
    assert groups == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]


def test_who_asks_while_the_thread_is_busy_waits_for_the_next_round_not_for_a_thread() -> None:
    groups: list[list[int]] = []
    going_on = threading.Event()

    def answered(questions: Sequence[int]) -> list[int | Exception]:
        groups.append(list(questions))
        going_on.wait()
        return list(questions)

    async def ask(thread: GroupThread[int, int]) -> list[int]:
        first = asyncio.create_task(thread.ask(0))
        while not groups:
            await asyncio.sleep(0)
        rest = []
        for k in range(1, 4):
            rest.append(asyncio.create_task(thread.ask(k)))
            await asyncio.sleep(0.01)
        going_on.set()
        return await asyncio.gather(first, *rest)

    with group_thread(answered) as thread:
        assert asyncio.run(ask(thread)) == [0, 1, 2, 3]
    assert groups == [[0], [1, 2, 3]]


def test_an_answer_that_is_an_exception_is_raised_for_its_question_alone() -> None:
    def answered(questions: Sequence[int]) -> list[int | Exception]:
        return [KeyError(one) if one == 1 else one for one in questions]

    async def ask(thread: GroupThread[int, int]) -> list[int | BaseException]:
        return await asyncio.gather(*(thread.ask(k) for k in range(3)), return_exceptions=True)

    with group_thread(answered) as thread:
        found = asyncio.run(ask(thread))
    assert found[0] == 0
    assert isinstance(found[1], KeyError)
    assert found[2] == 2


def test_what_fails_for_a_group_fails_for_all_of_it_and_for_nobody_after_it() -> None:
    failing = [True]

    def answered(questions: Sequence[int]) -> list[int | Exception]:
        if failing.pop():
            raise OSError("away")
        return list(questions)

    async def ask(thread: GroupThread[int, int]) -> list[int | BaseException]:
        found = await asyncio.gather(*(thread.ask(k) for k in range(2)), return_exceptions=True)
        failing.append(False)
        return [*found, await thread.ask(2)]

    with group_thread(answered) as thread:
        found = asyncio.run(ask(thread))
    assert [type(one) for one in found] == [OSError, OSError, int]


def test_who_goes_away_leaves_the_answers_of_the_others_alone() -> None:
    going_on = threading.Event()

    def answered(questions: Sequence[int]) -> list[int | Exception]:
        going_on.wait()
        return list(questions)

    async def ask(thread: GroupThread[int, int]) -> int:
        gone, stays = (asyncio.create_task(thread.ask(k)) for k in range(2))
        await asyncio.sleep(0.01)
        gone.cancel()
        going_on.set()
        return await stays

    with group_thread(answered) as thread:
        assert asyncio.run(ask(thread)) == 1


def test_a_loop_that_ends_before_its_answer_leaves_the_thread_to_the_next() -> None:
    going_on = threading.Event()
    asked = threading.Event()

    def answered(questions: Sequence[int]) -> list[int | Exception]:
        asked.set()
        going_on.wait()
        return list(questions)

    async def leave(thread: GroupThread[int, int]) -> None:
        task = asyncio.create_task(thread.ask(0))
        while not asked.is_set():
            await asyncio.sleep(0.01)
        task.cancel()

    with group_thread(answered) as thread:
        asyncio.run(leave(thread))
        going_on.set()
        assert asyncio.run(thread.ask(1)) == 1


# --- plans --------------------------------------------------------------------------------------


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    opened = open_database(f"sqlite:///{tmp_path / 'syncplan.db'}")
    yield opened
    opened.close()


@contextmanager
def reading(database: Database) -> Iterator[PlanReader]:
    """A reader of plans, ended with the test."""
    reader = PlanReader(database)
    try:
        yield reader
    finally:
        reader.close()


def test_plans_asked_for_at_once_go_each_to_its_owner_alone(database: Database) -> None:
    with database.writing() as connection:
        rows = {owner: add_plan(connection, owner, MADE) for owner in ("ann", "bob")}
    wanted = [(asker, row.id) for asker in rows for row in rows.values()] * 20

    async def found(reader: PlanReader) -> list[object]:
        return await asyncio.gather(*(reader.find(*one) for one in wanted))

    with reading(database) as reader:
        assert asyncio.run(found(reader)) == [
            rows[asker] if rows[asker].id == plan_id else None for asker, plan_id in wanted
        ]


def test_a_plan_that_another_process_deletes_is_gone_at_once(
    database: Database, tmp_path: Path
) -> None:
    with database.writing() as connection:
        row = add_plan(connection, "ann", MADE)
    other = open_database(f"sqlite:///{tmp_path / 'syncplan.db'}")
    with reading(database) as reader:
        assert asyncio.run(reader.find("ann", row.id)) == row
        with other.writing() as connection:
            delete_plan(connection, "ann", row.id)
        assert asyncio.run(reader.find("ann", row.id)) is None
    other.close()


def test_a_reader_whose_connection_was_cut_connects_again(database: Database) -> None:
    with database.writing() as connection:
        row = add_plan(connection, "ann", MADE)
    with reading(database) as reader:
        assert asyncio.run(reader.find("ann", row.id)) == row
        assert reader._connection is not None
        reader._connection.connection.driver_connection.close()  # type: ignore[union-attr]
        assert asyncio.run(reader.find("ann", row.id)) == row


def test_a_reader_takes_one_connection_and_gives_it_back(database: Database) -> None:
    with reading(database) as reader:
        for _ in range(5):
            assert asyncio.run(reader.find("ann", "x")) is None
        assert database.engine.pool.checkedout() == 1  # type: ignore[attr-defined]
    wait_until(lambda: database.engine.pool.checkedout() == 0)  # type: ignore[attr-defined]


# --- stored together ----------------------------------------------------------------------------


@contextmanager
def writing(database: Database) -> Iterator[PlanWriter]:
    """A writer of plans, ended with the test."""
    writer = PlanWriter(database)
    try:
        yield writer
    finally:
        writer.close()


def test_plans_of_one_moment_are_stored_in_one_transaction(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    transactions: list[int] = []
    begin = Database.writing

    @contextmanager
    def counted(self: Database) -> Iterator[Connection]:
        transactions.append(1)
        with begin(self) as connection:
            yield connection

    async def stored(writer: PlanWriter) -> list[PlanRow]:
        return await asyncio.gather(
            *(writer.write(lambda open_: add_plan(open_, "ann", MADE)) for _ in range(8))
        )

    monkeypatch.setattr(Database, "writing", counted)
    with writing(database) as writer:
        rows = asyncio.run(stored(writer))
    assert len(transactions) == 1
    with database.reading() as connection:
        assert find_plans(connection, [("ann", one.id) for one in rows]) == rows
    assert len({one.id for one in rows}) == 8


def test_a_change_that_fails_takes_none_of_the_others_along(database: Database) -> None:
    def refuse(open_: Connection) -> PlanRow:
        add_plan(open_, "ann", MADE, plan_id="half")
        raise KeyError("refused")

    async def stored(writer: PlanWriter) -> list[PlanRow | BaseException]:
        good = [writer.write(lambda open_: add_plan(open_, "ann", MADE)) for _ in range(3)]
        return await asyncio.gather(
            *good[:2], writer.write(refuse), good[2], return_exceptions=True
        )

    with writing(database) as writer:
        found = asyncio.run(stored(writer))
    assert isinstance(found[2], KeyError)
    kept = [one for one in found if isinstance(one, PlanRow)]
    assert len(kept) == 3
    with database.reading() as connection:
        assert find_plans(connection, [("ann", one.id) for one in kept]) == kept
        assert len(list_plans(connection, "ann", 10, None)) == 3


def test_a_plan_is_answered_only_once_it_is_on_the_disk(database: Database, tmp_path: Path) -> None:
    other = open_database(f"sqlite:///{tmp_path / 'syncplan.db'}")

    async def stored(writer: PlanWriter) -> bool:
        row = await writer.write(lambda open_: add_plan(open_, "ann", MADE))
        with other.reading() as connection:
            return find_plans(connection, [("ann", row.id)]) == [row]

    with writing(database) as writer:
        assert asyncio.run(stored(writer))
    other.close()


def test_a_database_that_is_locked_refuses_the_group_once(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[int] = []

    @contextmanager
    def locked(self: Database) -> Iterator[Connection]:
        tries.append(1)
        raise OperationalError("INSERT", {}, busy)
        yield

    busy = sqlite3.OperationalError("database is locked")
    busy.sqlite_errorcode = sqlite3.SQLITE_BUSY

    async def stored(writer: PlanWriter) -> list[PlanRow | BaseException]:
        return await asyncio.gather(
            *(writer.write(lambda open_: add_plan(open_, "ann", MADE)) for _ in range(3)),
            return_exceptions=True,
        )

    monkeypatch.setattr(Database, "writing", locked)
    with writing(database) as writer:
        found = asyncio.run(stored(writer))
    assert [type(one) for one in found] == [OperationalError] * 3
    assert len(tries) == 1
