"""The application served on a socket until a signal ends it; event streams end first."""

import asyncio
import contextlib
import signal
import socket
import threading
from collections.abc import Iterator
from functools import partial
from types import FrameType

import uvicorn
from fastapi import FastAPI

from api.accepting import accept_connections
from api.connections import ConnectionLimits, Connections, limits_of_connections
from api.descriptors import raise_limit
from api.protocol import HttpProtocol
from api.refusals import crowd
from api.service import Ending
from api.shares import Place
from api.watching.connection_readings import ConnectionReadings

_GRACE_S = 5
_TICKS_BETWEEN_LOOKS = 2
"""Of a tenth of a second each."""


class LimitedServer(uvicorn.Server):
    """A server that counts its connections and ends those that take too long.

    It takes connections itself: see api.accepting. With a `place` among several processes, it
    takes its part of them.
    """

    def __init__(
        self,
        config: uvicorn.Config,
        limits: ConnectionLimits,
        ending: Ending | None = None,
        place: Place | None = None,
    ) -> None:
        super().__init__(config)
        self._place = place
        self.connections = Connections(limits)
        self._ending = ending
        self._accepting: list[asyncio.Task[None]] = []

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start the application, then take connections from the sockets."""
        await super().startup(sockets=[])
        if not self.started:
            return
        make = partial(
            HttpProtocol,
            config=self.config,
            server_state=self.server_state,
            app_state=self.lifespan.state,
            connections=self.connections,
        )
        refusal = crowd(self.connections.limits).as_bytes()
        self._accepting = [
            asyncio.create_task(
                accept_connections(
                    one, make, refusal, None if self._place is None else self._gives_way
                )
            )
            for one in sockets or []
        ]
        if self._place is not None:
            self._place.begun()

    async def on_tick(self, counter: int) -> bool:
        """End the connections that are due, a few times a second."""
        if counter % _TICKS_BETWEEN_LOOKS == 0:
            self._end_due()
            if self._place is not None and self._accepting:
                self._gives_way()
        return await super().on_tick(counter)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Take no more connections, and end those there are, what is being answered last."""
        for task in self._accepting:
            task.cancel()
        if self._place is not None:
            self._place.leave()
        await asyncio.gather(*self._accepting, return_exceptions=True)
        await super().shutdown(sockets=sockets)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the streams, then the server."""
        if self._ending is not None:
            self._ending.set()
        super().handle_exit(sig, frame)

    def _gives_way(self) -> bool:
        assert self._place is not None
        return self._place.gives_way(self.connections.number)

    def _end_due(self) -> None:
        now = asyncio.get_running_loop().time()
        late = [
            one
            for one in self.server_state.connections
            if isinstance(one, HttpProtocol) and (one.due <= now or one.stalled_due <= now)
        ]
        for one in late:
            one.expire(now)


def serve_until_told(app: FastAPI, listening: socket.socket, place: Place | None = None) -> bool:
    """Serve an application until SIGTERM or Ctrl-C; return whether it could start.

    `place` is that among several processes on the socket.
    """
    server = _server_of(app, place)
    # uvicorn takes signals over, ends in good order and then raises them again: that is no failure
    signal.signal(signal.SIGTERM, lambda number, frame: server.handle_exit(number, frame))
    with contextlib.suppress(KeyboardInterrupt, SystemExit):
        server.run(sockets=[listening])
    return server.started


@contextlib.contextmanager
def served_beside(app: FastAPI, listening: socket.socket) -> Iterator[None]:
    """Serve an application in a thread of its own until the block ends."""
    server = _server_of(app)
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


def _server_of(app: FastAPI, place: Place | None = None) -> LimitedServer:
    config = uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        server_header=False,
        ws="none",
        timeout_graceful_shutdown=_GRACE_S,
    )
    limits = limits_of_connections(app.state.settings, raise_limit())
    server = LimitedServer(config, limits, app.state.ending, place)
    app.state.connections = server.connections
    app.state.metrics.watch(ConnectionReadings(server.connections))
    return server
