"""Objects that the routes share: the database, processes for plans, the queue of jobs."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from threading import Event
from typing import Annotated

from anyio import CapacityLimiter
from fastapi import Depends, Request

from api.computing.pool import Pool
from api.jobs.guard import Guard
from api.jobs.job_counts import JobCounts
from api.jobs.queue import JobQueue
from api.limits import RequestLimits
from api.problems import TooManyRequests
from api.settings import Settings
from api.storage.database import Database
from api.storage.plan_threads import PlanReader, PlanWriter

MOST = 4
MOST_OF_OWNER = 2
_RETRY_AFTER_S = 5.0


class Uploads:
    """Uploads of recordings in progress, by owner; used only on the event loop."""

    def __init__(self) -> None:
        self._held: Counter[str] = Counter()

    @contextmanager
    def one_of(self, owner: str) -> Iterator[None]:
        """Count an upload until the block ends; raises TooManyRequests if there are enough."""
        if self._held[owner] >= MOST_OF_OWNER or self._held.total() >= MOST:
            raise TooManyRequests(
                f"{self._held[owner]} of your recordings are being taken in, "
                f"{self._held.total()} of all; allowed are {MOST_OF_OWNER} and {MOST}; send "
                "one after the other",
                retry_after_s=_RETRY_AFTER_S,
            )
        self._held[owner] += 1
        try:
            yield
        finally:
            self._held -= Counter([owner])


Ending = Event
"""Event set once the server is about to end, so that long streams end too."""


def limits_of(settings: Settings) -> RequestLimits:
    """Return the limits on requests from the settings."""
    names = [one.name for one in fields(RequestLimits)]
    return RequestLimits(**{name: getattr(settings, f"max_{name}") for name in names})


@dataclass(frozen=True, slots=True)
class Service:
    """One running service.

    Attributes
    ----------
    pool : processes for requests; those for jobs are the worker's
    counts : counts of the jobs that end in this process
    heartbeat : heartbeat of this process; None if it runs no jobs
    results : limits the results of jobs that are read from the database at a time
    """

    settings: Settings
    limits: RequestLimits
    database: Database
    pool: Pool
    queue: JobQueue
    counts: JobCounts
    plans: PlanReader
    writer: PlanWriter
    heartbeat: Guard | None = None
    uploads: Uploads = field(default_factory=Uploads)
    results: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(MOST))


def service_of(request: Request) -> Service:
    """Return the service of a request, faster than a dependency does."""
    service: Service = request.app.state.service
    return service


async def _service(request: Request) -> Service:
    return service_of(request)


CurrentService = Annotated[Service, Depends(_service)]
