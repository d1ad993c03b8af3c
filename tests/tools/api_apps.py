"""A small application under the service's own chrome, and a real server for it."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx2
import uvicorn
from fastapi import FastAPI

from api.answering import answer_requests
from api.connections import ConnectionLimits
from api.metrics import Metrics
from api.server import LimitedServer
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.serving import NO_CERTIFICATES

BODY_LIMIT = 1000


def bare_app(inner: Any = None, metrics: Metrics | None = None, **options: Any) -> FastAPI:
    """Return an application without routes that answers and logs as the service does.

    `inner` is a middleware to add inside, with its options.
    """
    app = FastAPI()
    if inner is not None:
        app.add_middleware(inner, **options)
    answer_requests(app, metrics or Metrics(), BODY_LIMIT)
    return app


@contextmanager
def served(app: Any, limits: ConnectionLimits | None = None, **options: Any) -> Iterator[int]:
    """Serve an application on a loopback port; yields the port. `options` are uvicorn's.

    With `limits` it is served as the service is, else by plain uvicorn.
    """
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(1024)
    config = uvicorn.Config(
        app, log_config=None, access_log=False, timeout_graceful_shutdown=2, **options
    )
    server = uvicorn.Server(config) if limits is None else LimitedServer(config, limits)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        wait_until(lambda: server.started)
        yield listener.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def ask(port: int, method: str, path: str, **options: Any) -> httpx2.Response:
    """Return the answer of a server at `port`; a body in pieces is sent chunked."""
    url = f"http://127.0.0.1:{port}"
    with httpx2.Client(base_url=url, timeout=PATIENCE_S, verify=NO_CERTIFICATES) as http:
        # what is accepted is said by those who call
        del http.headers["accept"]
        return http.request(method, path, **options)
