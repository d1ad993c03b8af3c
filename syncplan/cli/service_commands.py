"""The commands that run the service: serve, worker."""

import contextlib
import importlib.util
import logging
import os
import queue
import signal
import socket
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from syncplan.cli.arguments import optional
from syncplan.errors import InputError, SyncplanError

if TYPE_CHECKING:
    from api.settings import Settings
    from api.storage.database import Database

_BACKLOG = 1024

services = typer.Typer()


@services.command(
    name="serve",
    epilog="\b\nExample: SYNCPLAN_DATA_DIR=/var/lib/syncplan syncplan serve --port 8000",
)
def _serve(
    host: Annotated[str | None, optional(help="Address to listen on (default 127.0.0.1)")] = None,
    port: Annotated[int | None, optional(min=0, max=65535, help="Port (default 8000)")] = None,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Listen beyond this machine without API keys"),
    ] = False,
    embedded_worker: Annotated[
        bool | None,
        optional("--worker/--no-worker", help="Work on jobs in this process as well (default: do)"),
    ] = None,
    http_processes: Annotated[
        int | None, optional(min=1, help="Processes that answer requests (default 1)")
    ] = None,
) -> NoReturn:
    """Serve plans, refinements and validations over HTTP; settings from SYNCPLAN_* variables."""
    _require_extra()
    from api.computing.child import template
    from api.settings import load_settings

    settings = load_settings(
        host=host,
        port=port,
        insecure=insecure or None,
        embedded_worker=embedded_worker,
        http_processes=http_processes,
    )
    if settings.http_processes == 1:
        # loads what computes while this process loads what serves
        template()
    from api.logs import configure_logs
    from api.security import refuse_exposure
    from api.storage.database import open_database

    refuse_exposure(settings)
    configure_logs(settings.log_level)
    # a fault of the database is reported in one line here, but with a trace by uvicorn
    open_database(settings.database).close()
    serve = _server_for(settings)
    with _listening(settings.host, settings.port) as listening:
        if not serve(listening):
            raise SyncplanError("the service could not start; its log says why")
    _leave()


def _server_for(settings: "Settings") -> Callable[[socket.socket], bool]:
    """Callback that serves on a socket until it is stopped, and returns whether it could start."""
    if settings.http_processes > 1:
        from api.processes import serve_by_processes
        from api.telemetry import telemetry_options

        # its faults are reported once here, and not by each process
        telemetry_options(settings)
        return partial(serve_by_processes, settings)
    from api.main import create_app
    from api.server import serve_until_told

    return partial(serve_until_told, create_app(settings))


def _listening(host: str, port: int) -> socket.socket:
    """A listening socket; raises InputError if it can't be opened."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listening = socket.create_server((host, port), family=family, backlog=_BACKLOG)
    except OSError as error:
        raise InputError(
            f"can't be listened at: {error.strerror or error}; choose another --host or --port",
            source=f"{host}:{port}",
        ) from None
    shown = f"[{host}]" if family == socket.AF_INET6 else host
    address = f"http://{shown}:{listening.getsockname()[1]}"
    logging.getLogger("syncplan.serve").info("serving at %s", address)
    return listening


@services.command(
    name="worker",
    epilog="\b\nExample: SYNCPLAN_DATABASE_URL=postgresql://syncplan@db/syncplan syncplan worker",
)
def _worker(
    host: Annotated[
        str | None, optional(help="Address at which --port listens (default 127.0.0.1)")
    ] = None,
    port: Annotated[
        int | None,
        optional(
            min=0,
            max=65535,
            help="Answer /healthz, /readyz and /metrics at this port (default: do not)",
        ),
    ] = None,
) -> NoReturn:
    """Work on the jobs of a service, beside it or on another machine, until it is stopped."""
    _require_extra()
    from api.computing.child import template
    from api.settings import load_settings

    settings = load_settings(worker_host=host, worker_port=port)
    template()
    from api.logs import configure_logs
    from api.security import refuse_exposure
    from api.storage.database import open_database

    refuse_exposure(settings, worker=True)
    configure_logs(settings.log_level)
    database = open_database(settings.database)
    # not an Event: if a handler set it while this thread begins to wait for it, it would deadlock
    stop: queue.SimpleQueue[None] = queue.SimpleQueue()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.put(None))
    with contextlib.ExitStack() as last_first:
        last_first.callback(database.close)
        listening = None
        if settings.worker_port is not None:
            # before anything starts that would have to be undone
            listening = last_first.enter_context(
                _listening(settings.worker_host, settings.worker_port)
            )
        _work(settings, database, listening, stop)
    _leave()


def _work(
    settings: "Settings",
    database: "Database",
    listening: socket.socket | None,
    stop: "queue.SimpleQueue[None]",
) -> None:
    """Work on jobs, and answer on a socket if there is one, until `stop` holds something."""
    from api.jobs.job_counts import JobCounts
    from api.jobs.queue import JobQueue
    from api.jobs.worker import Worker
    from api.main import create_worker_app
    from api.metrics import JobTally
    from api.server import served_beside
    from api.storage.database import unavailable
    from api.telemetry import export_spans

    send_last_spans = export_spans(settings)
    counts = JobCounts(database, JobTally())
    try:
        jobs = JobQueue(settings.database)
        worker = Worker(settings, database, counts, jobs)
    except Exception as error:
        if not unavailable(error):
            raise
        raise InputError(
            "went away while the worker was starting; start it again once it can be reached",
            source="the database",
        ) from None
    served: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
    if listening is not None:
        served = served_beside(create_worker_app(settings, database, worker, counts), listening)
    with served:
        stop.get()
    worker.close()
    jobs.close()
    send_last_spans()


def _leave() -> NoReturn:
    """End this process at once, after its work: threads may wait for an unavailable database."""
    logging.shutdown()
    os._exit(0)


def _require_extra() -> None:
    """Raise InputError if the service's libraries are not installed."""
    wanted = (
        "fastapi",
        "uvicorn",
        "dbos",
        "pydantic_settings",
        "prometheus_client",
        "psycopg",
        "plotly",
    )
    missing = [name for name in wanted if importlib.util.find_spec(name) is None]
    if missing:
        raise InputError(
            f"needs {', '.join(missing)}; install the extra: pip install 'syncplan[api]'",
            source="the service",
        )
