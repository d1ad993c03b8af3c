"""A service in its own processes, one for all modules that ask for it, and empty databases.

Also child processes that are none, and what becomes of tasks.
"""

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from sqlalchemy import Connection

from api.computing.child import Child, ChildGoneError
from api.computing.turns import Ticket
from api.storage.database import Database, open_database
from tests.tools.api_servers import serving, speaking
from tests.tools.processes import PATIENCE_S
from tests.tools.serving import Server


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service that does its jobs; the plans of lea are counted, and the recordings of rex."""
    limits = {"SYNCPLAN_RECORDING_LIMIT_BYTES": "2000000", "SYNCPLAN_MAX_RECORDINGS": "5"}
    with serving(tmp_path_factory.mktemp("service"), "ann bob lea rex", **limits) as one:
        yield one


@pytest.fixture(scope="session")
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The first owner, who has plans and jobs."""
    with speaking(server, "ann") as http:
        yield http


@pytest.fixture
def database(tmp_path: Path) -> Iterator[Database]:
    """An empty database, in a folder that opening it makes."""
    opened = open_database(f"sqlite:///{tmp_path / 'folder' / 'syncplan.db'}")
    yield opened
    opened.close()


@pytest.fixture
def connection(database: Database) -> Iterator[Connection]:
    """A transaction in the empty database, kept where the test passes."""
    with database.writing() as opened:
        yield opened


class Hollow(Child):
    """A child without a process: a task named "long" ends when it is killed, any other at once."""

    begun: list["Hollow"]

    def __init__(self, **_: object) -> None:
        self.begun.append(self)
        self.growth = 0
        self.killed = self.paused = self.yielded = False
        self.fresh = self.complete = True
        self._killed = threading.Event()

    def wait_until_ready(self) -> None:
        """Be ready."""

    def call(self, task: str, *_: Any, **__: Any) -> Any:
        """Return the task, or wait until the child is killed."""
        if task == "long":
            self._killed.wait()
            raise ChildGoneError
        return task

    def pause(self, paused: bool) -> None:
        """Note whether the child is paused."""
        self.paused = paused

    def kill(self) -> None:
        """End the task at work."""
        self.killed = True
        self._killed.set()

    def end(self) -> None:
        """Free nothing."""


@pytest.fixture
def hollow(monkeypatch: pytest.MonkeyPatch) -> list[Hollow]:
    """Let pools begin children without processes; returns those that have begun."""
    monkeypatch.setattr(Hollow, "begun", [], raising=False)
    monkeypatch.setattr("api.computing.pool.Child", Hollow)
    return Hollow.begun


def end_of(ticket: Ticket) -> Any:
    """Return what a task comes to."""
    return ticket.future.result(timeout=PATIENCE_S)


def begun(ticket: Ticket) -> bool:
    """Whether a process is at a task."""
    return ticket.child is not None
