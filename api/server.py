"""The application served on a socket until a signal ends it; event streams end first."""

import contextlib
import signal
import socket
import threading
from collections.abc import Iterator
from types import FrameType

import uvicorn
from fastapi import FastAPI

from api.protocol import HttpProtocol
from api.service import Ending

__all__ = ["serve_until_told", "served_beside"]

_GRACE_S = 5


class _Server(uvicorn.Server):
    """A server that ends streams when it closes; else they would outlast its grace period."""

    def __init__(self, config: uvicorn.Config, ending: Ending) -> None:
        super().__init__(config)
        self._ending = ending

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the streams, then the server."""
        self._ending.set()
        super().handle_exit(sig, frame)


def serve_until_told(app: FastAPI, listening: socket.socket) -> bool:
    """Serve an application until SIGTERM or Ctrl-C; return whether it could start."""
    server = _Server(_config(app), app.state.ending)
    # uvicorn takes signals over, ends in good order and then raises them again: that is no failure
    signal.signal(signal.SIGTERM, lambda number, frame: server.handle_exit(number, frame))
    with contextlib.suppress(KeyboardInterrupt, SystemExit):
        server.run(sockets=[listening])
    return server.started


@contextlib.contextmanager
def served_beside(app: FastAPI, listening: socket.socket) -> Iterator[None]:
    """Serve an application in a thread of its own until the block ends."""
    server = _Server(_config(app), app.state.ending)
    thread = threading.Thread(
        target=server.run, kwargs={"sockets": [listening]}, daemon=True, name="http"
    )
    thread.start()
    try:
        yield
    finally:
        app.state.ending.set()
        server.should_exit = True
        thread.join(timeout=_GRACE_S)


def _config(app: FastAPI) -> uvicorn.Config:
    return uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        server_header=False,
        http=HttpProtocol,
        ws="none",
        timeout_graceful_shutdown=_GRACE_S,
    )
