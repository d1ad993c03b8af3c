"""HTTP by hand, for clients that send much and read little, or hang up."""

import contextlib
import json
import select
import socket
from collections.abc import Iterator, Mapping
from typing import Any

from tests.tools.api_servers import key_of
from tests.tools.serving import Server

__all__ = ["answered", "asking"]


@contextlib.contextmanager
def asking(
    server: Server, owner: str, path: str, document: Mapping[str, Any], count: int
) -> Iterator[list[socket.socket]]:
    """Connections on which a POST was sent whose answer nobody reads; closed at the end."""
    body = json.dumps(document).encode()
    head = (
        f"POST {path} HTTP/1.1\r\nhost: 127.0.0.1:{server.port}\r\n"
        f"authorization: Bearer {key_of(owner)}\r\n"
        f"content-type: application/json\r\ncontent-length: {len(body)}\r\n\r\n"
    ).encode()
    with contextlib.ExitStack() as opened:
        sockets = []
        for _ in range(count):
            one = opened.enter_context(socket.create_connection(("127.0.0.1", server.port)))
            one.sendall(head + body)
            sockets.append(one)
        yield sockets


def answered(sockets: list[socket.socket]) -> int:
    """Return on how many connections an answer, or an end, has come."""
    return len(select.select(sockets, [], [], 0.0)[0])
