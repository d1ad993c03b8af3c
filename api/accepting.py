"""Taking connections from a listening socket, whatever becomes of file descriptors meanwhile.

When there is no descriptor left, uvloop closes new connections without a word, and asyncio logs a
trace for each try; here the log says so now and then, clients get an answer, and it goes on.
"""

import asyncio
import contextlib
import errno
import logging
import os
import socket
from collections.abc import Callable, Iterator

from api.seldom_logs import SeldomLog

_AT_ONCE = 64
"""Connections that are taken before others have their turn."""

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
    """Give every connection a protocol, until cancelled; `listening` is to be closed thereafter.

    While there are no descriptors, a spare one answers connections with `refusal` and closes them.
    Where other processes take connections from the socket as well, `gives_way` says whether
    one of them should have the next.
    """
    loop = asyncio.get_running_loop()
    listening.setblocking(False)
    seldom = SeldomLog(_log)
    with _Spare() as spare:
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
    """The next connection that no other process takes, in whose favour this one waits a moment."""
    while True:
        await _readable(listening)
        for _ in range(_TIMES_GIVEN_WAY):
            if not gives_way():
                break
            await asyncio.sleep(_GIVEN_WAY_S)
        with contextlib.suppress(BlockingIOError):
            one, _ = listening.accept()
            one.setblocking(False)
            return one


async def _readable(listening: socket.socket) -> None:
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(listening, readable.set)
    try:
        await readable.wait()
    finally:
        loop.remove_reader(listening)


def _waiting(listening: socket.socket) -> Iterator[socket.socket]:
    """The connections that wait by now, up to so many; what fails is for the next try to say."""
    with contextlib.suppress(OSError):
        for _ in range(_AT_ONCE - 1):
            one, _ = listening.accept()
            one.setblocking(False)
            yield one


async def _connect(one: socket.socket, make: Callable[[], asyncio.Protocol]) -> None:
    try:
        await asyncio.get_running_loop().connect_accepted_socket(make, one)
    except OSError:
        # it is gone already
        one.close()
    except Exception as error:
        _log.error("connection not taken: %s", type(error).__name__, exc_info=error)
        one.close()


class _Spare:
    """A descriptor that is held open, to be let go of when there is no other."""

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def __enter__(self) -> "_Spare":
        self._hold()
        return self

    def __exit__(self, *_: object) -> None:
        self._let_go()

    def turn_away(self, listening: socket.socket, refusal: bytes) -> None:
        """Take one connection in place of the spare descriptor, answer, and close it."""
        self._let_go()
        with contextlib.suppress(OSError):
            one, _ = listening.accept()
            with one:
                one.setblocking(False)
                one.send(refusal)
        self._hold()

    def _hold(self) -> None:
        with contextlib.suppress(OSError):
            self._descriptor = os.open(os.devnull, os.O_RDONLY)

    def _let_go(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
