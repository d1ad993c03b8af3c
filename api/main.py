"""Applications of the service, with its workers and database, and of a worker.

Both answer, log, count and check keys alike.
"""

from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import ExitStack, asynccontextmanager, closing
from functools import partial
from typing import Any

from fastapi import FastAPI
from starlette.concurrency import run_in_threadpool

from api.answering import answer_requests
from api.computing.pool import Pool, PoolDepth
from api.following import JobWatch
from api.jobs.guard import Guard
from api.jobs.job_counts import JobCounts
from api.jobs.queue import JobQueue
from api.jobs.worker import Worker
from api.metrics import JobTally, Metrics
from api.openapi import document_operations
from api.readings import Cached, job_readings, pool_readings
from api.routes import (
    job_routes,
    page_routes,
    plan_routes,
    recording_routes,
    rendition_routes,
    service_routes,
    study_routes,
)
from api.security import Keyring, KeyThrottle, LocalOnly, names_here
from api.service import Ending, Service, limits_of
from api.settings import ALONE, Settings, Share, load_settings
from api.storage.database import Database, open_database
from api.storage.plan_threads import PlanReader, PlanWriter
from api.telemetry import OFF, telemetry_options
from syncplan import __version__

UPLOADS = "/v1/recordings"
"""Path at which bodies may be larger than elsewhere."""


def without_routes(settings: Settings, *, tally: JobTally | None = None, **options: Any) -> FastAPI:
    """Return an application without routes; `options` are FastAPI's.

    Its metrics include the jobs that `tally` counts.
    """
    app = FastAPI(
        title="syncplan",
        version=__version__,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
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
    answer_requests(
        app,
        app.state.metrics,
        settings.body_limit_bytes,
        larger={UPLOADS: settings.recording_limit_bytes},
    )
    return app


# --- a worker -------------------------------------------------------------------------------------


def create_worker_app(
    settings: Settings, database: Database, worker: Worker, counts: JobCounts
) -> FastAPI:
    """Return the application of a running worker, with only the paths that machines poll."""
    app = without_routes(settings, tally=counts.tally, telemetry=OFF)
    app.state.service = Service(
        settings,
        limits_of(settings),
        database,
        worker.pool,
        worker.queue,
        counts,
        PlanReader(database),
        PlanWriter(database),
        worker.guard,
    )
    _watch(app, database, worker.queue, {"jobs": worker.pool.depth})
    app.include_router(service_routes.health)
    return app


# --- the service ----------------------------------------------------------------------------------


_DESCRIPTION = """Plans of synchronised circular orbits that let a team of robots localise itself:
initial poses and phases at once, refinement and Monte Carlo as durable jobs."""


def create_app(settings: Settings | None = None, share: Share = ALONE) -> FastAPI:
    """Return the application, which opens its database and starts its processes on start-up.

    The server decides where it listens: `syncplan serve` refuses to listen beyond this machine
    without keys; another ASGI server does not.

    Settings default to those of the environment. `share` is this process's part of the service and
    of its child processes. Raises InputError.
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
        study_routes.router,
        service_routes.usage,
        service_routes.schemas,
    ):
        app.include_router(routes, prefix="/v1")
    app.include_router(service_routes.health)
    app.include_router(page_routes.router)
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    settings: Settings = app.state.settings
    last_first = ExitStack()
    app.state.service = await run_in_threadpool(_begun, app, last_first)
    app.state.watch = JobWatch(
        app.state.service.database,
        most_streams=settings.max_streams,
        keyring=app.state.keyring,
        is_ending=app.state.ending.is_set,
    )
    app.state.metrics.watch(lambda: {"syncplan_streams": {(): app.state.watch.streams}})
    try:
        yield
    finally:
        app.state.watch.close()
        await run_in_threadpool(last_first.close)


def _begun(app: FastAPI, last_first: ExitStack) -> Service:
    """Start everything that the application uses; `last_first` ends it, the processes first."""
    settings: Settings = app.state.settings
    ends = last_first.enter_context
    database = ends(closing(open_database(settings.database)))
    queue = ends(closing(JobQueue(settings.database)))
    plans = ends(closing(PlanReader(database)))
    writer = ends(closing(PlanWriter(database)))
    counts = JobCounts(database, app.state.metrics.jobs)
    depths, heartbeat = {}, None
    if settings.embedded_worker:
        # a database that can't be written to just now can still be read
        worker = ends(closing(Worker(settings, database, counts, queue, patient=True)))
        depths["jobs"], heartbeat = worker.pool.depth, worker.guard
    else:
        guard = Guard(settings, database, queue, None, job_over=counts.job_over)
        guard.start()
        ends(closing(guard))
    pool = Pool(
        app.state.share.of(settings.process_count),
        later_niceness=settings.job_niceness,
        memory_bytes=settings.task_memory,
        most_waiting=settings.max_plan_queue,
        most_of_owner=settings.max_requests,
    )
    ends(closing(pool))
    _watch(app, database, queue, {"requests": pool.depth, **depths})
    limits = limits_of(settings)
    return Service(settings, limits, database, pool, queue, counts, plans, writer, heartbeat)


def _watch(
    app: FastAPI,
    database: Database,
    queue: JobQueue,
    depths: Mapping[str, Callable[[], PoolDepth]],
) -> None:
    """Make each scrape read the state of an application's pools, and the jobs and workers."""
    app.state.metrics.watch(partial(pool_readings, depths))
    app.state.metrics.watch(Cached(partial(job_readings, database, queue)), of="service")
