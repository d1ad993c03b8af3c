"""Taking connections from a listening socket, whatever becomes of file descriptors meanwhile.

uvloop closes the listening socket for good when there is no descriptor left, and asyncio logs a
trace for each try; here the service says so now and then, and goes on.
"""

import asyncio
import contextlib
import errno
import logging
import os
import socket
from collections.abc import Callable, Iterator

from api.seldom_logs import SeldomLog

__all__ = ["accept_connections"]

_AT_ONCE = 64
"""Connections that are taken before others have their turn."""

_PAUSE_S = 0.1
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}

_log = logging.getLogger("api.connections")


async def accept_connections(
    listening: socket.socket, make: Callable[[], asyncio.Protocol], refusal: bytes
) -> None:
    """Give every connection a protocol, until cancelled; `listening` is to be closed thereafter.

    While there are no descriptors, a spare one lets connections be told `refusal` and closed.
    """
    loop = asyncio.get_running_loop()
    listening.setblocking(False)
    seldom = SeldomLog(_log)
    with _Spare() as spare:
        while True:
            try:
                first, _ = await loop.sock_accept(listening)
            except OSError as error:
                if error.errno in _EXHAUSTED:
                    seldom.warn("descriptors", f"no connection can be taken: {error.strerror}")
                    spare.turn_away(listening, refusal)
                    await asyncio.sleep(_PAUSE_S)
                continue
            taken = [first, *_waiting(listening)]
            await asyncio.gather(*(_connect(one, make) for one in taken))


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
