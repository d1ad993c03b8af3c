"""Services of any checkout, and clients that ask again as soon as they are answered."""

import contextlib
import http.client
import json
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.tools.processes import wait_until
from tests.tools.serving import free_port

__all__ = ["KEYS", "LONGEST_S", "Request", "ask", "load", "serving"]

KEYS = {"busy": "busy-0123456789abcdef", "other": "other-0123456789abcdef"}
"""The keys of a service's two owners."""

LONGEST_S = 120.0
"""How long a client waits for an answer."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request as bytes, again and again the same."""

    method: str
    path: str
    body: bytes = b""
    key: str = KEYS["other"]

    def on(self, port: int) -> bytes:
        """Return what is sent to a port of this machine."""
        head = (
            f"{self.method} {self.path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n"
            f"Authorization: Bearer {self.key}\r\n"
        )
        if self.body:
            head += f"Content-Type: application/json\r\nContent-Length: {len(self.body)}\r\n"
        return f"{head}\r\n".encode() + self.body


@contextlib.contextmanager
def serving(checkout: Path, *arguments: str, **settings: str) -> Iterator[int]:
    """A service of a checkout, with two owners; yields its port."""
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        environment = {k: v for k, v in os.environ.items() if not k.startswith("SYNCPLAN_")}
        environment |= {
            "PYTHONPATH": str(checkout),
            "SYNCPLAN_DATA_DIR": folder,
            "SYNCPLAN_API_KEYS": ",".join(f"{name}:{key}" for name, key in KEYS.items()),
            **settings,
        }
        with (Path(folder) / "log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "syncplan", "serve", "--port", str(port), *arguments],
                cwd=checkout,
                env=environment,
                stderr=log,
            )
        try:
            wait_until(lambda: _ready(port))
            yield port
        finally:
            process.kill()
            process.wait()


def _ready(port: int) -> bool:
    with contextlib.suppress(OSError, http.client.HTTPException):
        return ask(port, Request("GET", "/readyz"))[0] == 200
    return False


def ask(port: int, request: Request) -> tuple[int, Any]:
    """Return (status, what the body holds) of one request over a connection of its own."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=LONGEST_S)
    headers = {"authorization": f"Bearer {request.key}", "content-type": "application/json"}
    try:
        connection.request(request.method, request.path, request.body or None, headers)
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read() or b"null")
    finally:
        connection.close()


def load(port: int, request: Request, clients: int, seconds: float) -> list[float]:
    """Return the seconds each request took, from processes that each ask again when answered.

    Raises RuntimeError for an answer that is not 2xx, and OSError where the service is away.
    """
    context = multiprocessing.get_context("fork")
    start, found = context.Event(), context.SimpleQueue()
    processes = [
        context.Process(target=_client, args=(port, request.on(port), seconds, start, found))
        for _ in range(clients)
    ]
    for one in processes:
        one.start()
    start.set()
    taken = [found.get() for _ in processes]
    for one in processes:
        one.join()
    for answered in taken:
        if isinstance(answered, Exception):
            raise answered
    return [one for answered in taken for one in answered]


def _client(port: int, sent: bytes, seconds: float, start: Any, found: Any) -> None:
    try:
        found.put(_asked(port, sent, seconds, start))
    except (OSError, RuntimeError) as error:
        found.put(error)


def _asked(port: int, sent: bytes, seconds: float, start: Any) -> list[float]:
    taken: list[float] = []
    with socket.create_connection(("127.0.0.1", port), timeout=LONGEST_S) as connection:
        start.wait()
        end = time.perf_counter() + seconds
        while (began := time.perf_counter()) < end:
            connection.sendall(sent)
            _read_answer(connection)
            taken.append(time.perf_counter() - began)
    return taken


def _read_answer(connection: socket.socket) -> None:
    """Read one answer with a Content-Length; as little work as there can be."""
    got = b""
    while (end := got.find(b"\r\n\r\n")) < 0:
        got += _more(connection)
    if got[9:10] != b"2":
        raise RuntimeError(f"answered with {got[:200]!r}")
    at = got.lower().index(b"content-length:") + len(b"content-length:")
    missing = int(got[at : got.index(b"\r", at)]) + end + 4 - len(got)
    while missing > 0:
        missing -= len(_more(connection))


def _more(connection: socket.socket) -> bytes:
    if more := connection.recv(65536):
        return more
    raise ConnectionResetError("closed within an answer")
