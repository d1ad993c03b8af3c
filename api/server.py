"""Server of the application on a socket until a signal ends it; event streams end first.

When no file descriptor is left, uvloop closes new connections without a word, and asyncio logs a
trace for each try. This module therefore accepts connections itself: the log reports the shortage
now and then, clients get an answer, and serving goes on.
"""

import asyncio
import contextlib
import errno
import logging
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from functools import partial
from types import FrameType

import uvicorn
from fastapi import FastAPI

from api.connections import ConnectionLimits, Connections, Place, limits_of_connections, raise_limit
from api.logs import SeldomLog
from api.protocol import HttpProtocol, crowd
from api.readings import connection_readings
from api.service import Ending
from syncplan.runtime.machine import keep_loaded, return_memory

# --- taking connections ---------------------------------------------------------------------------


_AT_ONCE = 64
"""Most connections accepted before other tasks of the loop have their turn."""

_PAUSE_S = 0.1
_GIVEN_WAY_S = 0.001
_TIMES_GIVEN_WAY = 10
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}

_log = logging.getLogger("api.connections")


async def accept_connections(
    listening: socket.socket,
    make: Callable[[], asyncio.Protocol],
    refusal: bytes,
    gives_way: Callable[[], bool] | None = None,
) -> None:
    """Accept connections and give each a protocol, until cancelled; close `listening` afterwards.

    While there are no descriptors, a spare one serves to answer connections with `refusal` and
    close them. If other processes take connections from the socket as well, `gives_way` returns
    whether one of them should have the next.
    """
    loop = asyncio.get_running_loop()
    listening.setblocking(False)
    seldom = SeldomLog(_log)
    with contextlib.closing(_Spare()) as spare:
        while True:
            try:
                if gives_way is None:
                    first, _ = await loop.sock_accept(listening)
                    taken = [first, *_waiting(listening)]
                else:
                    taken = [await _in_turn(listening, gives_way)]
            except OSError as error:
                if error.errno in _EXHAUSTED:
                    seldom.warn("descriptors", f"no connection can be taken: {error.strerror}")
                    spare.turn_away(listening, refusal)
                    await asyncio.sleep(_PAUSE_S)
                continue
            await asyncio.gather(*(_connect(one, make) for one in taken))


async def _in_turn(listening: socket.socket, gives_way: Callable[[], bool]) -> socket.socket:
    """Next connection that no other process takes after this one has given way for a moment."""
    while True:
        await _readable(listening)
        for _ in range(_TIMES_GIVEN_WAY):
            if not gives_way():
                break
            await asyncio.sleep(_GIVEN_WAY_S)
        with contextlib.suppress(BlockingIOError):
            return _accepted(listening)


async def _readable(listening: socket.socket) -> None:
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(listening, readable.set)
    try:
        await readable.wait()
    finally:
        loop.remove_reader(listening)


def _waiting(listening: socket.socket) -> Iterator[socket.socket]:
    """Further connections that wait by now, up to a limit; an error is left to the next try."""
    with contextlib.suppress(OSError):
        for _ in range(_AT_ONCE - 1):
            yield _accepted(listening)


def _accepted(listening: socket.socket) -> socket.socket:
    connection, _ = listening.accept()
    connection.setblocking(False)
    return connection


async def _connect(one: socket.socket, make: Callable[[], asyncio.Protocol]) -> None:
    try:
        await asyncio.get_running_loop().connect_accepted_socket(make, one)
    except Exception as error:
        # of OSError, the client has already gone
        if not isinstance(error, OSError):
            _log.error("connection not taken: %s", type(error).__name__, exc_info=error)
        one.close()


class _Spare:
    """A spare descriptor, held open and released when there is no other."""

    def __init__(self) -> None:
        self._descriptor: int | None = None
        self._hold()

    def turn_away(self, listening: socket.socket, refusal: bytes) -> None:
        """Accept one connection in place of the spare descriptor, answer, and close it."""
        self.close()
        with contextlib.suppress(OSError), _accepted(listening) as connection:
            connection.send(refusal)
        self._hold()

    def _hold(self) -> None:
        with contextlib.suppress(OSError):
            self._descriptor = os.open(os.devnull, os.O_RDONLY)

    def close(self) -> None:
        """Release the descriptor."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


# --- serving --------------------------------------------------------------------------------------


_GRACE_S = 5
_TICKS_BETWEEN_LOOKS = 2
"""Ticks, of 0.1 s each, between two looks at the connections that are due."""


class LimitedServer(uvicorn.Server):
    """A server that counts its connections and ends those that take too long.

    It accepts connections itself: see api.server. With a `place` among several processes, it
    takes its share of them.
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
        """Start the application, then accept connections from the sockets."""
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
        gives_way = None if self._place is None else self._gives_way
        self._accepting = [
            asyncio.create_task(accept_connections(one, make, refusal, gives_way))
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
        """Accept no more connections, and end the open ones, those being answered last."""
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
        # copied: those that expire leave
        for protocol in list(self.server_state.connections):
            if (
                isinstance(protocol, HttpProtocol)
                and min(protocol.due, protocol.stalled_due) <= now
            ):
                protocol.expire(now)


def serve_until_told(app: FastAPI, listening: socket.socket, place: Place | None = None) -> bool:
    """Serve an application until SIGTERM or Ctrl-C; return whether it could start.

    `place` is this process's place among several on the socket.
    """
    server = _server_of(app, place)
    keep_loaded()
    return_memory()
    # uvicorn handles signals itself, ends in good order and raises them again, which is no failure
    signal.signal(signal.SIGTERM, lambda number, frame: server.handle_exit(number, frame))
    with contextlib.suppress(KeyboardInterrupt, SystemExit):
        server.run(sockets=[listening])
    return server.started


@contextlib.contextmanager
def served_beside(app: FastAPI, listening: socket.socket) -> Iterator[None]:
    """Serve an application in its own thread until the block ends."""
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
    app.state.metrics.watch(partial(connection_readings, server.connections))
    return server
