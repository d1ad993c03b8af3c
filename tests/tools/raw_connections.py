"""Connections as an attacker makes them: bytes as they are, many at once, read late or never."""

import contextlib
import json
import select
import socket
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.tools.processes import PATIENCE_S

__all__ = [
    "Said",
    "answered",
    "connected",
    "crowd_of",
    "holds",
    "read_until",
    "request_of",
    "said_to",
]


class Said:
    """What came back on a connection: status (0 if nothing), head in lower case, body."""

    def __init__(self, received: bytes) -> None:
        head, _, self.body = received.partition(b"\r\n\r\n")
        first, _, rest = head.partition(b"\r\n")
        self.status = int(first.split()[1]) if first else 0
        self.head = rest.decode().lower()


def request_of(path: str, key: str, document: Mapping[str, Any] | None = None) -> bytes:
    """Return a GET with a key, or the POST of a document."""
    body = b"" if document is None else json.dumps(document).encode()
    head = (
        f"{'GET' if document is None else 'POST'} {path} HTTP/1.1\r\nHost: localhost\r\n"
        f"Authorization: Bearer {key}\r\nContent-Type: application/json\r\n"
        f"Content-Length: {len(body)}\r\n\r\n"
    )
    return head.encode() + body


def connected(port: int) -> socket.socket:
    """Return a connection to a port of this machine."""
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)


def said_to(port: int, sent: Iterable[bytes]) -> Said:
    """Return what the server at a port says to these bytes until it closes the connection.

    Nothing more is sent once an answer is there.
    """
    with connected(port) as connection:
        with contextlib.suppress(ConnectionError):
            for piece in sent:
                connection.sendall(piece)
                if answered([connection]):
                    break
        received = b""
        with contextlib.suppress(ConnectionError):
            while piece := connection.recv(65536):
                received += piece
        return Said(received)


@contextlib.contextmanager
def crowd_of(port: int, number: int, greeting: bytes = b"") -> Iterator[list[socket.socket]]:
    """So many connections that say the same and no more, closed at the end."""
    with contextlib.ExitStack() as all_of_them:
        crowd = []
        for _ in range(number):
            one = all_of_them.enter_context(connected(port))
            with contextlib.suppress(ConnectionError):
                one.sendall(greeting)
            crowd.append(one)
        yield crowd


def answered(sockets: list[socket.socket]) -> int:
    """Return on how many connections an answer, or an end, has come."""
    look = select.poll()
    for one in sockets:
        look.register(one, select.POLLIN)
    return len(look.poll(0))


def read_until(connection: socket.socket, wanted: bytes) -> bytes:
    """Return what comes on a connection until this has come, or all has."""
    text = b""
    while wanted not in text and (piece := connection.recv(65536)):
        text += piece
    return text


def holds(server_port: int, port: int) -> bool:
    """Return whether a process holds the server's end of the connection from a port."""
    ends = f"0100007F:{server_port:04X} 0100007F:{port:04X}"
    rows = (line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:])
    # what was closed while it had bytes to send goes on without a process, its inode being 0
    return any(" ".join(row[1:3]) == ends and row[9] != "0" for row in rows)
