"""What the workflows of this process work with."""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event
from typing import TypeVar

from sqlalchemy import Connection

from api.computing.pool import Pool
from api.jobs.job_counts import JobCounts
from api.jobs.part_watch import PartWatch
from api.jobs.queue import JobQueue
from api.settings import Settings
from api.storage.database import Database, patiently

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Runtime:
    """The process's database, queue, child processes and settings.

    Attributes
    ----------
    counts : of the jobs that end here
    at_work : the workflows that this process runs; one restarted while it ran is there twice
    closing : set before the process ends, so that what is killed then does not count as failed
    """

    settings: Settings
    database: Database
    queue: JobQueue
    pool: Pool
    counts: JobCounts
    watch: PartWatch
    at_work: list[str] = field(default_factory=list)
    closing: Event = field(default_factory=Event)

    @contextmanager
    def at(self, workflow_id: str) -> Iterator[None]:
        """Count a workflow as running until the block ends."""
        self.at_work.append(workflow_id)
        try:
            yield
        finally:
            self.at_work.remove(workflow_id)


_in_use: list[Runtime] = []


def use(runtime: Runtime | None) -> None:
    """Let the workflows of this process use a runtime; None ends its use."""
    _in_use[:] = [] if runtime is None else [runtime]


def current() -> Runtime:
    """Return the runtime in use."""
    return _in_use[0]


async def in_transaction(function: Callable[[Connection], T]) -> T:
    """Return what a function does in a transaction, waiting for the database if it is away."""

    def transact() -> T:
        with current().database.writing() as connection:
            return function(connection)

    return await asyncio.to_thread(patiently, transact)
