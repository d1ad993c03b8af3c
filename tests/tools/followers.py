"""Hundreds of followers of a job's events from one process: bare sockets on one event loop."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from tests.tools.processes import PATIENCE_S
from tests.tools.serving import Server

__all__ = ["Stream", "connected"]


class Stream:
    """One request on a connection of its own, and what comes back."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.text = b""
        self.ended = False
        self._reader = reader
        self._writer = writer

    async def read_until(self, wanted: bytes, times: int = 1) -> bytes:
        """Read until something has come so many times, or all has; return everything so far."""
        async with asyncio.timeout(PATIENCE_S):
            while self.text.count(wanted) < times and not self.ended:
                piece = await self._reader.read(2**16)
                self.text += piece
                self.ended = not piece
        return self.text

    def close(self) -> None:
        """Go away without a word."""
        self._writer.transport.abort()


@asynccontextmanager
async def connected(
    server: Server, path: str, number: int, key: str
) -> AsyncIterator[list[Stream]]:
    """A number of connections, a request on each, closed at the end."""
    head = (
        f"GET {path} HTTP/1.1\r\nhost: 127.0.0.1:{server.port}\r\n"
        f"authorization: Bearer {key}\r\naccept: */*\r\n\r\n"
    )
    streams = []
    try:
        for _ in range(number):
            reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
            streams.append(Stream(reader, writer))
            writer.write(head.encode())
        yield streams
    finally:
        for one in streams:
            one.close()
