"""The application served on a socket until a signal ends it; event streams end first."""

import contextlib
import signal
import socket
from types import FrameType

import uvicorn
from fastapi import FastAPI

from api.protocol import HttpProtocol
from api.service import Ending

__all__ = ["serve_until_told"]

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
    config = uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        server_header=False,
        http=HttpProtocol,
        ws="none",
        timeout_graceful_shutdown=_GRACE_S,
    )
    server = _Server(config, app.state.ending)
    # uvicorn takes signals over, ends in good order and then raises them again: that is no failure
    signal.signal(signal.SIGTERM, lambda number, frame: server.handle_exit(number, frame))
    with contextlib.suppress(KeyboardInterrupt, SystemExit):
        server.run(sockets=[listening])
    return server.started
