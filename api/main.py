"""The application of the service, with workers and database around it; that of a worker.

Both answer, log, count and check keys alike.
"""

from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager
from typing import Any

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from api.computing.pool import Pool
from api.failures import install_handlers
from api.following import JobWatch
from api.jobs.job_counts import JobCounts
from api.jobs.queue import JobQueue
from api.jobs.worker import Worker, guard_of
from api.logs import RequestLog
from api.metrics import JobTally, Metrics, RequestMetrics, Source
from api.openapi import document_operations
from api.readings import Cached, JobReadings, PoolReadings
from api.routes import (
    job_routes,
    page_routes,
    plan_routes,
    recording_routes,
    rendition_routes,
    service_routes,
)
from api.security import Keyring, KeyThrottle, LocalOnly, names_here
from api.service import Ending, Service, limits_of
from api.settings import ALONE, Settings, Share, load_settings
from api.storage.database import Database, open_database
from api.storage.plan_threads import PlanReader, PlanWriter
from api.telemetry import OFF, telemetry_options
from syncplan import __version__

UPLOADS = "/v1/recordings"
"""Where bodies may be larger than elsewhere."""


def without_routes(settings: Settings, *, tally: JobTally | None = None, **options: Any) -> FastAPI:
    """Return an application for routes to be added to; `options` are FastAPI's.

    Its metrics include the jobs that `tally` counts.
    """
    app = FastAPI(
        title="syncplan",
        version=__version__,
        docs_url=None,
        redoc_url=None,
        **options,
    )
    app.state.settings = settings
    app.state.keyring = Keyring(settings)
    app.state.key_throttle = KeyThrottle(settings.max_refused_keys)
    app.state.metrics = Metrics(tally)
    app.state.ending = Ending()
    if not settings.asks_for_keys:
        names = names_here((settings.host, settings.worker_host), settings.allowed_hosts)
        app.add_middleware(LocalOnly, names=names)
    install_handlers(
        app, settings.body_limit_bytes, larger={UPLOADS: settings.recording_limit_bytes}
    )
    app.add_middleware(RequestMetrics, metrics=app.state.metrics)
    app.add_middleware(RequestLog)
    return app


# --- a worker -------------------------------------------------------------------------------------


def create_worker_app(
    settings: Settings, database: Database, worker: Worker, counts: JobCounts
) -> FastAPI:
    """Return the application of a running worker: the paths that machines poll, and no others."""
    app = without_routes(settings, tally=counts.tally, openapi_url=None, telemetry=OFF)
    app.state.service = Service(
        settings,
        database,
        worker.pool,
        worker.queue,
        limits_of(settings),
        lambda: worker.guard.silent_s,
        counts,
        PlanReader(database),
        PlanWriter(database),
    )
    app.state.metrics.watch(
        PoolReadings({"jobs": worker.pool.depth}), Cached(JobReadings(database, worker.queue))
    )
    app.include_router(service_routes.health)
    return app


# --- the service ----------------------------------------------------------------------------------


_DESCRIPTION = """Plans of synchronised circular orbits that let a team of robots localise itself:
initial poses and phases at once, refinement and Monte Carlo as jobs that survive."""


def create_app(settings: Settings | None = None, share: Share = ALONE) -> FastAPI:
    """Return the application, which opens its database and starts its processes on start-up.

    The server decides where it listens: `syncplan serve` refuses to listen beyond this machine
    without keys; another ASGI server does not.

    Settings come from the environment where none are given. `share` is the part of the service
    that this process is, and of its child processes. Raises InputError.
    """
    chosen = load_settings() if settings is None else settings
    app = without_routes(
        chosen,
        description=_DESCRIPTION,
        separate_input_output_schemas=False,
        telemetry=telemetry_options(chosen),
        lifespan=_lifespan,
    )
    app.state.share = share
    document_operations(app)
    for routes in (
        plan_routes.router,
        recording_routes.router,
        job_routes.router,
        rendition_routes.router,
        service_routes.schemas,
    ):
        app.include_router(routes, prefix="/v1")
    app.include_router(service_routes.health)
    app.include_router(page_routes.router)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    settings: Settings = app.state.settings
    running = await run_in_threadpool(_Running, settings, app.state.share, app.state.metrics.jobs)
    app.state.service = running.service
    app.state.metrics.watch(*running.readings())
    app.state.watch = JobWatch(
        running.database,
        most_streams=settings.max_streams,
        keyring=app.state.keyring,
        is_ending=app.state.ending.is_set,
    )
    app.state.metrics.watch(lambda: {"syncplan_streams": {(): app.state.watch.streams}})
    try:
        yield
    finally:
        app.state.watch.close()
        await run_in_threadpool(running.close)


class _Running:
    """All that has to be closed when the application ends."""

    def __init__(self, settings: Settings, share: Share, tally: JobTally) -> None:
        self.database = open_database(settings.database)
        self.queue = JobQueue(settings.database)
        counts = JobCounts(self.database, tally)
        self.worker = None
        if settings.embedded_worker:
            # what can't be written to just now can be read nevertheless
            self.worker = Worker(settings, self.database, counts, patient=True)
        self.guard = None
        if self.worker is None:
            self.guard = guard_of(settings, self.database, self.queue, counts, None)
            self.guard.start()
        self.pool = Pool(
            share.of(settings.process_count),
            background=False,
            memory_bytes=settings.task_memory,
            most_waiting=settings.max_plan_queue,
            most_of_owner=settings.max_requests,
        )
        self.plans = PlanReader(self.database)
        self.writer = PlanWriter(self.database)
        self.service = Service(
            settings,
            self.database,
            self.pool,
            self.queue,
            limits_of(settings),
            self.silent_s,
            counts,
            self.plans,
            self.writer,
        )

    def silent_s(self) -> float:
        """Return how long ago this process's last heartbeat was, 0 if it runs no jobs."""
        return 0.0 if self.worker is None else self.worker.guard.silent_s

    def readings(self) -> tuple[Source, ...]:
        """Return what each scrape reads of this process and its database."""
        depths = {"requests": self.pool.depth}
        if self.worker is not None:
            depths["jobs"] = self.worker.pool.depth
        return PoolReadings(depths), Cached(JobReadings(self.database, self.queue))

    def close(self) -> None:
        """End everything, the processes first, each whatever happens to the others."""
        with ExitStack() as last_first:
            last_first.callback(self.database.close)
            last_first.callback(self.queue.close)
            for one in (self.plans, self.writer, self.guard, self.worker, self.pool):
                if one is not None:
                    last_first.callback(one.close)
