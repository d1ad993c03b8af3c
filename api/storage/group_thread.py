"""One thread that answers in groups: whoever asks while it is busy waits for its next round.

    ask --> asked in this turn of the loop --> queue --> the thread: one call for all that wait
      ^                                                      |
      +------------------ each its answer -------------------+

A thread of its own keeps waits for the database out of the event loop. One for all who ask changes
threads twice a group; a thread for each request does so twice a request, and all of them compete
for the interpreter.
"""

import asyncio
import queue
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE_S = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class _Question(Generic[T, R]):
    """A question, the loop that waits for the answer, and where it waits."""

    question: T
    loop: asyncio.AbstractEventLoop
    future: "asyncio.Future[R]"


class GroupThread(Generic[T, R]):
    """A thread that answers questions of an event loop, as many at once as wait.

    It starts with the first question.

    Parameters
    ----------
    name : of the thread
    answer : called in the thread with a group of questions; returns one answer, or the exception
        to raise, for each of them in order. What it raises itself is raised for the whole group
    most : questions in a group
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
        """Return the answer to a question; one event loop alone may ask."""
        loop = asyncio.get_running_loop()
        asked: _Question[T, R] = _Question(question, loop, loop.create_future())
        self._turn.append(asked)
        if not self._started:
            self._started = True
            self._thread.start()
        if len(self._turn) == 1:
            # after whatever else this turn of the loop asks
            loop.call_soon(self._hand_over)
        return await asked.future

    def close(self) -> None:
        """End the thread once it has answered what was asked."""
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
            outcomes = self._answer([one.question for one in group])
        except Exception as error:
            outcomes = [error] * len(group)
        answered = list(zip(group, outcomes, strict=True))
        try:
            group[0].loop.call_soon_threadsafe(_deliver, answered)
        except RuntimeError:
            # the loop has ended, and with it all who waited
            return


def _deliver(answered: list[tuple[_Question[T, R], R | Exception]]) -> None:
    for asked, outcome in answered:
        # whoever has gone away has cancelled its future
        if asked.future.done():
            continue
        if isinstance(outcome, Exception):
            asked.future.set_exception(outcome)
        else:
            asked.future.set_result(outcome)
