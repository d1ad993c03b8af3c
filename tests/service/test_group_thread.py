"""One thread answers those who wait, in groups; plans are read and stored that way."""

import asyncio
import contextlib
import sqlite3
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from unittest.mock import Mock

import pytest
from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError

from api.documents import PlanText
from api.storage.database import Database, open_database
from api.storage.holdings import PlanRow, add_plan, delete_plan, find_plans, list_plans
from api.storage.plan_threads import GroupThread, PlanReader, PlanWriter
from tests.tools.processes import wait_until

Change = Callable[[Connection], PlanRow]
MADE = PlanText('{\n "version": "1"\n}\n', "survey", 6, True, 1.5)


class Answering:
    """What answers groups of questions: notes them, and waits until it may go on."""

    def __init__(self, answer: Callable[[int], int | Exception] = lambda one: one) -> None:
        self.groups: list[list[int]] = []
        self.going_on = threading.Event()
        self._answer = answer

    def __call__(self, questions: Sequence[int]) -> Sequence[int | Exception]:
        self.groups.append(list(questions))
        self.going_on.wait()
        return [self._answer(one) for one in questions]


@contextmanager
def group_thread(
    answer: Callable[[Sequence[int]], Sequence[int | Exception]], most: int = 100
) -> Iterator[GroupThread[int, int]]:
    """A thread for a test, ended with it."""
    with contextlib.closing(GroupThread("test", answer, most)) as thread:
        yield thread


async def asked(thread: GroupThread[int, int], *questions: int) -> list[int | BaseException]:
    """Return the answers, or what was raised, to questions asked at once."""
    return await asyncio.gather(*map(thread.ask, questions), return_exceptions=True)


def test_questions_of_one_turn_are_answered_together_each_with_its_own_answer() -> None:
    answering = Answering(lambda one: KeyError(one) if one == 1 else 2 * one)
    answering.going_on.set()
    with group_thread(answering, most=4) as thread:
        found = asyncio.run(asked(thread, *range(10)))
    assert isinstance(found.pop(1), KeyError)
    assert found == [0, *(2 * k for k in range(2, 10))]
    assert answering.groups == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]


def test_who_asks_while_the_thread_is_busy_waits_for_the_next_round_not_for_a_thread() -> None:
    answering = Answering()

    async def ask(thread: GroupThread[int, int]) -> list[int]:
        first = asyncio.create_task(thread.ask(0))
        while not answering.groups:
            await asyncio.sleep(0)
        rest = []
        for k in range(1, 5):
            rest.append(asyncio.create_task(thread.ask(k)))
            await asyncio.sleep(0.01)
        # who goes away leaves the answers of the others alone
        rest.pop(0).cancel()
        answering.going_on.set()
        return await asyncio.gather(first, *rest)

    with group_thread(answering) as thread:
        assert asyncio.run(ask(thread)) == [0, 2, 3, 4]
    assert [group[-3:] for group in answering.groups] == [[0], [2, 3, 4]]


def test_what_fails_for_a_group_fails_for_all_of_it_and_for_nobody_after_it() -> None:
    async def ask(thread: GroupThread[int, int]) -> list[int | BaseException]:
        return [*await asked(thread, 0, 1), *await asked(thread, 2)]

    with group_thread(Mock(side_effect=[OSError("away"), [2]])) as thread:
        found = asyncio.run(ask(thread))
    assert [type(one) for one in found] == [OSError, OSError, int]


def test_a_loop_that_ends_before_its_answer_leaves_the_thread_to_the_next() -> None:
    answering = Answering()

    async def leave(thread: GroupThread[int, int]) -> None:
        task = asyncio.create_task(thread.ask(0))
        while not answering.groups:
            await asyncio.sleep(0.01)
        task.cancel()

    with group_thread(answering) as thread:
        asyncio.run(leave(thread))
        answering.going_on.set()
        assert asyncio.run(thread.ask(1)) == 1


# --- plans --------------------------------------------------------------------------------------


@pytest.fixture
def reader(database: Database) -> Iterator[PlanReader]:
    """A reader of plans, ended with the test."""
    with contextlib.closing(PlanReader(database)) as one:
        yield one


@pytest.fixture
def writer(database: Database) -> Iterator[PlanWriter]:
    """A writer of plans, ended with the test."""
    with contextlib.closing(PlanWriter(database)) as one:
        yield one


@pytest.fixture
def other(database: Database) -> Iterator[Database]:
    """The same database as another process has it open."""
    with contextlib.closing(open_database(str(database.engine.url))) as one:
        yield one


def added(database: Database, owner: str) -> PlanRow:
    """Store a plan."""
    with database.writing() as connection:
        return add_plan(connection, owner, MADE)


async def written(writer: PlanWriter, *changes: Change) -> list[PlanRow | BaseException]:
    """Return what comes of changes that are asked for at once."""
    return await asyncio.gather(*map(writer.write, changes), return_exceptions=True)


def add(connection: Connection) -> PlanRow:
    """Add a plan of Ann's."""
    return add_plan(connection, "ann", MADE)


def test_plans_asked_for_at_once_go_each_to_its_owner_alone(
    database: Database, reader: PlanReader
) -> None:
    rows = {owner: added(database, owner) for owner in ("ann", "bob")}
    wanted = [(asker, row.id) for asker in rows for row in rows.values()] * 20

    async def found() -> list[PlanRow | None]:
        return await asyncio.gather(*(reader.find(*one) for one in wanted))

    assert asyncio.run(found()) == [
        rows[asker] if rows[asker].id == plan_id else None for asker, plan_id in wanted
    ]


def test_a_plan_that_another_process_deletes_is_gone_at_once(
    database: Database, reader: PlanReader, other: Database
) -> None:
    row = added(database, "ann")
    assert asyncio.run(reader.find("ann", row.id)) == row
    with other.writing() as connection:
        delete_plan(connection, "ann", row.id, ["*"])
    assert asyncio.run(reader.find("ann", row.id)) is None


def test_a_reader_takes_one_connection_another_if_it_is_cut_and_gives_it_back(
    database: Database, reader: PlanReader
) -> None:
    row = added(database, "ann")
    for _ in range(5):
        assert asyncio.run(reader.find("ann", row.id)) == row
    assert database.engine.pool.checkedout() == 1  # type: ignore[attr-defined]
    assert reader._connection is not None
    reader._connection.connection.driver_connection.close()  # type: ignore[union-attr]
    assert asyncio.run(reader.find("ann", row.id)) == row
    reader.close()
    wait_until(lambda: database.engine.pool.checkedout() == 0)  # type: ignore[attr-defined]


# --- stored together ----------------------------------------------------------------------------


@contextmanager
def counted(monkeypatch: pytest.MonkeyPatch, fault: Exception | None = None) -> Iterator[list[int]]:
    """Note each transaction that is begun; it fails if a fault is given."""
    transactions: list[int] = []
    begin = Database.writing

    @contextmanager
    def noted(self: Database) -> Iterator[Connection]:
        transactions.append(1)
        if fault is not None:
            raise fault
        with begin(self) as connection:
            yield connection

    with monkeypatch.context() as patched:
        patched.setattr(Database, "writing", noted)
        yield transactions


def test_plans_of_one_moment_are_stored_in_one_transaction(
    database: Database, writer: PlanWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    with counted(monkeypatch) as transactions:
        rows = [one for one in asyncio.run(written(writer, *[add] * 8)) if isinstance(one, PlanRow)]
    assert len(transactions) == 1
    with database.reading() as connection:
        assert find_plans(connection, [("ann", one.id) for one in rows]) == rows
    assert len({one.id for one in rows}) == 8


def test_a_change_that_fails_takes_none_of_the_others_along(
    database: Database, writer: PlanWriter
) -> None:
    def refuse(connection: Connection) -> PlanRow:
        add_plan(connection, "ann", MADE, plan_id="half")
        raise KeyError("refused")

    found = asyncio.run(written(writer, add, add, refuse, add))
    assert isinstance(found[2], KeyError)
    kept = [one for one in found if isinstance(one, PlanRow)]
    assert len(kept) == 3
    with database.reading() as connection:
        assert find_plans(connection, [("ann", one.id) for one in kept]) == kept
        assert len(list_plans(connection, "ann", 10, None)) == 3


def test_a_plan_is_answered_only_once_it_is_on_the_disk(
    writer: PlanWriter, other: Database
) -> None:
    async def stored() -> bool:
        row = await writer.write(add)
        with other.reading() as connection:
            return find_plans(connection, [("ann", row.id)]) == [row]

    assert asyncio.run(stored())


def test_a_database_that_is_locked_refuses_the_group_once(
    writer: PlanWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    busy = sqlite3.OperationalError("database is locked")
    busy.sqlite_errorcode = sqlite3.SQLITE_BUSY
    with counted(monkeypatch, OperationalError("INSERT", {}, busy)) as tries:
        found = asyncio.run(written(writer, add, add, add))
    assert [type(one) for one in found] == [OperationalError] * 3
    assert len(tries) == 1
