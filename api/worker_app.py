"""What a worker answers over HTTP, if it has a port: health, readiness and metrics."""

from fastapi import FastAPI

from api.application import without_routes
from api.jobs.job_counts import JobCounts
from api.jobs.worker import Worker
from api.routes import health_routes
from api.service import Service, limits_of
from api.settings import Settings
from api.storage.database import Database
from api.storage.plan_reader import PlanReader
from api.storage.plan_writer import PlanWriter
from api.telemetry import OFF
from api.watching.job_readings import JobReadings
from api.watching.pool_readings import PoolReadings
from api.watching.readings_cache import Cached


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
    app.include_router(health_routes.router)
    return app
