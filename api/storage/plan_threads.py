"""Threads that read and write plans for many requests at once.

    ask --> asked in this turn of the loop --> queue --> the thread: one call for all that wait
      ^                                                      |
      +------------------ each its answer -------------------+

A question asked while the thread is busy waits for the next round. A separate thread keeps waits
for the database out of the event loop. One thread for all questions costs two thread switches a
group; a thread for each request costs two a request, and all of them compete for the interpreter.

Plans are read by one statement, over a connection that stays open. They are written in one
transaction, with one wait for the disk: a request is answered once its rows are on the disk, as if
it had written alone.
"""

import asyncio
import queue
import threading
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from sqlalchemy import Connection

from api.storage.database import Database, unavailable
from api.storage.holdings import PlanRow, find_plans

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE_S = 5.0


_Question = tuple[T, asyncio.Future[R]]
"""A question, and the future of its answer."""


class GroupThread(Generic[T, R]):
    """Thread that answers the waiting questions of an event loop in groups.

    It starts with the first question.

    Parameters
    ----------
    name : name of the thread
    answer : called in the thread with a group of questions; returns one answer, or the exception
        to raise, for each of them in order. An error that it raises is raised for the whole group
    most : most questions in a group
    """

    def __init__(
        self, name: str, answer: Callable[[Sequence[T]], Sequence[R | Exception]], most: int
    ) -> None:
        self._answer = answer
        self._most = most
        self._turn: list[_Question[T, R]] = []
        self._waiting: queue.SimpleQueue[list[_Question[T, R]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True, name=name)
        self._started = False

    async def ask(self, question: T) -> R:
        """Return the answer to a question; only one event loop may ask."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[R] = loop.create_future()
        self._turn.append((question, future))
        if not self._started:
            self._started = True
            self._thread.start()
        if len(self._turn) == 1:
            # after all other questions of this turn of the loop
            loop.call_soon(self._hand_over)
        return await future

    def close(self) -> None:
        """End the thread once it has answered all questions."""
        if self._started:
            self._waiting.put(None)
            self._thread.join(timeout=_PATIENCE_S)

    def _hand_over(self) -> None:
        turn, self._turn = self._turn, []
        self._waiting.put(turn)

    def _run(self) -> None:
        waiting: list[_Question[T, R]] = []
        last = False
        while waiting or not last:
            while not last and (not waiting or not self._waiting.empty()):
                turn = self._waiting.get()
                last = turn is None
                waiting += turn or ()
            group, waiting = waiting[: self._most], waiting[self._most :]
            if group:
                self._settle(group)

    def _settle(self, group: list[_Question[T, R]]) -> None:
        outcomes: Sequence[R | Exception]
        try:
            outcomes = self._answer([question for question, _ in group])
        except Exception as error:
            outcomes = [error] * len(group)
        futures = [future for _, future in group]
        answered = list(zip(futures, outcomes, strict=True))
        try:
            futures[0].get_loop().call_soon_threadsafe(_deliver, answered)
        except RuntimeError:
            # the loop has ended, and with it all that waited
            return


def _deliver(answered: list[tuple[asyncio.Future[R], R | Exception]]) -> None:
    for future, outcome in answered:
        # a caller that has gone has cancelled its future
        if future.done():
            continue
        if isinstance(outcome, Exception):
            future.set_exception(outcome)
        else:
            future.set_result(outcome)


# --- reading --------------------------------------------------------------------------------------


_MOST = 16
"""Most questions in a group: some plans take hundreds of kilobytes."""


class PlanReader:
    """Thread that reads plans; every reading sees the database as it is at that moment."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._connection: Connection | None = None
        self._thread = GroupThread("plan-reader", self._found, _MOST)

    async def find(self, owner: str, plan_id: str) -> PlanRow | None:
        """Return an owner's plan, or None."""
        return await self._thread.ask((owner, plan_id))

    def close(self) -> None:
        """End the thread and close its connection."""
        self._thread.close()
        self._drop()

    def _found(self, asked: Sequence[tuple[str, str]]) -> list[PlanRow | None]:
        is_new = self._connection is None
        try:
            if self._connection is None:
                self._connection = self._database.autocommitting()
            return find_plans(self._connection, asked)
        except Exception as error:
            self._drop()
            if is_new or not unavailable(error):
                raise
        # the connection may have been cut long ago: a new one decides
        return self._found(asked)

    def _drop(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()


# --- writing --------------------------------------------------------------------------------------


_Write = Callable[[Connection], Any]


class PlanWriter:
    """Thread that writes the results of requests.

    It is for rows that nobody else waits for or writes at the same time: a change that holds a
    lock, or may meet one, needs its own transaction.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._thread: GroupThread[_Write, Any] = GroupThread("plan-writer", self._written, _MOST)

    async def write(self, change: Callable[[Connection], R]) -> R:
        """Return the result of `change` once it is committed; raises its errors.

        `change` may be called again, in another transaction, after one that was rolled back.
        """
        result: R = await self._thread.ask(change)
        return result

    def close(self) -> None:
        """End the thread."""
        self._thread.close()

    def _written(self, changes: Sequence[_Write]) -> list[Any]:
        try:
            with self._database.writing() as connection:
                return [change(connection) for change in changes]
        except Exception as error:
            if len(changes) == 1 or unavailable(error):
                raise
        # one of them failed: each has its own outcome
        return [self._alone(change) for change in changes]

    def _alone(self, change: _Write) -> Any:
        try:
            return self._database.write(change)
        except Exception as error:
            return error
