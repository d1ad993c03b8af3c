"""A task's orders, carried out in this process or in child processes.

    worker(task) -> work         once in each process
    work(order, stop, report) -> result

Children ignore Ctrl-C: this process tells them to stop, and they return the best that they have.
"""

import contextlib
import math
import os
import queue
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from multiprocessing.connection import Connection
from typing import Any

from syncplan.errors import ProcessEndedError
from syncplan.runtime.child_processes import ChildProcess, connect_to_parent
from syncplan.runtime.machine import keep_loaded

Work = Callable[[Any, threading.Event, Callable[[Any], None]], Any]
"""Function of an order, of the event that asks it to stop, and of a callback for its progress."""


@dataclass(frozen=True, slots=True)
class EarlierSearch:
    """Results kept from an interrupted search, and the function that keeps further ones.

    Attributes
    ----------
    finished : results by the number of their order, as they were kept
    spent_s : s, part of its time limit that is spent
    keep : called with the number and the bytes of each result whose order was not cut short
    """

    finished: Mapping[int, bytes] = field(default_factory=dict)
    spent_s: float = 0.0
    keep: Callable[[int, bytes], None] = lambda _number, _data: None


def run_orders(
    worker: Callable[[Any], Work],
    task: Any,
    orders: Sequence[Any],
    workers: int,
    *,
    begin: Callable[[Any, bool], Any],
    take: Callable[[Any], Sequence[Any] | None],
    report: Callable[[Any], None] | None = None,
    time_limit_s: float = math.inf,
) -> bool:
    """Carry out orders in so many processes; return whether the limit or Ctrl-C cut them short.

    `worker` is a function of a module, and all else that children are sent can be pickled. Before
    an order, `begin` receives it, and whether others are being carried out; it returns what `work`
    is given, or None to leave out this order and all further ones. `take` receives each result and
    may return further orders. Raises ProcessEndedError where a child ends by itself.
    """
    run = _in_children if min(workers, len(orders)) > 1 else _here
    with interruption(time_limit_s) as interrupted:
        if orders:
            run(_Run(worker, task, deque(orders), begin, take, report, interrupted), workers)
        return interrupted.is_set()


@dataclass(frozen=True, slots=True)
class _Run:
    """What run_orders is given, and the event that the time limit and Ctrl-C set."""

    worker: Callable[[Any], Work]
    task: Any
    orders: deque[Any]
    begin: Callable[[Any, bool], Any]
    take: Callable[[Any], Sequence[Any] | None]
    report: Callable[[Any], None] | None
    interrupted: threading.Event


@contextlib.contextmanager
def interruption(time_limit_s: float = math.inf) -> Iterator[threading.Event]:
    """Context of an event that is set after a time limit, and by Ctrl-C if this is the main thread.

    Contexts may be nested: Ctrl-C sets the events of all, and of those that are entered later.
    """
    event = threading.Event()
    with contextlib.ExitStack() as end:
        if time_limit_s <= 0.0:
            event.set()
        elif time_limit_s < math.inf:
            timer = threading.Timer(time_limit_s, event.set)
            timer.daemon = True
            timer.start()
            end.callback(timer.cancel)
        if threading.current_thread() is threading.main_thread():
            if _entered and _entered[-1].is_set():
                event.set()
            _entered.append(event)
            end.callback(_entered.pop)
            end.callback(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, _interrupt))
        yield event


_entered: list[threading.Event] = []
"""Events of the contexts that the main thread is in, the innermost last."""


def _interrupt(*_: object) -> None:
    for event in _entered:
        event.set()


def _here(run: _Run, _workers: int) -> None:
    work, orders = run.worker(run.task), run.orders
    while orders and not run.interrupted.is_set():
        message = run.begin(orders.popleft(), False)
        if message is None:
            return
        orders.extend(run.take(work(message, run.interrupted, run.report or _ignored)) or ())


def _in_children(run: _Run, workers: int) -> None:
    orders = run.orders
    messages: queue.Queue[Any] = queue.Queue()
    children: list[_Child] = []
    idle: list[_Child] = []
    busy: set[int] = set()

    def give() -> None:
        """Give orders to idle children, and to new ones up to the number of processes."""
        while orders and len(busy) < workers:
            message = run.begin(orders[0], bool(busy))
            if message is None:
                orders.clear()
                return
            orders.popleft()
            if not idle:
                idle.append(_Child(len(children), run.worker, run.task, messages))
                children.append(idle[-1])
            child = idle.pop()
            child.send(message)
            busy.add(child.number)

    try:
        give()
        stopping = False
        while busy:
            if run.interrupted.is_set() and not stopping:
                stopping = True
                orders.clear()
                for child in children:
                    child.send("stop")
            try:
                number, kind, value = messages.get(timeout=0.05)
            except queue.Empty:
                continue
            if kind == "progress" and run.report is not None:
                run.report(value)
            elif kind == "done":
                further = run.take(value)
                busy.discard(number)
                idle.append(children[number])
                if not stopping:
                    orders.extend(further or ())
                    give()
            elif kind == "gone" and number in busy:
                raise ProcessEndedError(
                    f"a process of the search ended: {children[number].process.complaint()}"
                )
    finally:
        for child in children:
            child.process.end()


class _Child:
    """Child process that carries out orders, one after the other."""

    def __init__(
        self, number: int, worker: Callable[[Any], Work], task: Any, messages: "queue.Queue[Any]"
    ) -> None:
        self.number, self.messages = number, messages
        # a child that is being started is spared: signals are the parent's to handle
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
        try:
            self.process = ChildProcess(__name__, "serve_orders")
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self.send((worker.__module__, worker.__qualname__))
        self.send(task)
        threading.Thread(target=self._listen, daemon=True).start()

    def send(self, message: Any) -> None:
        """Send a message, or "stop"."""
        with contextlib.suppress(OSError):
            self.process.connection.send(message)

    def _listen(self) -> None:
        with contextlib.suppress(EOFError, OSError, TypeError):
            while True:
                self.messages.put((self.number, *self.process.connection.recv()))
        self.messages.put((self.number, "gone", None))


# --- in a child -----------------------------------------------------------------------------------


def serve_orders(descriptor: int) -> None:
    """Carry out the parent's orders until it ends; main function of a child process."""
    connection = connect_to_parent(descriptor)
    module, name = connection.recv()
    work = getattr(import_module(module), name)(connection.recv())
    keep_loaded()
    orders: queue.Queue[Any] = queue.Queue()
    stop = threading.Event()
    threading.Thread(target=_take_orders, args=(connection, orders, stop), daemon=True).start()
    while True:
        order = orders.get()
        made = work(order, stop, lambda progress: _answer(connection, ("progress", progress)))
        _answer(connection, ("done", made))


def _take_orders(connection: Connection, orders: "queue.Queue[Any]", stop: threading.Event) -> None:
    """Queue the parent's orders; exit at the end of the stream, as no one waits for a result."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            order = connection.recv()
            if isinstance(order, str) and order == "stop":
                stop.set()
            else:
                orders.put(order)
    os._exit(0)


def _answer(connection: Connection, message: Any) -> None:
    try:
        connection.send(message)
    except BrokenPipeError:
        os._exit(0)


def _ignored(_progress: Any) -> None:
    """Take progress that no one asked for."""
