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

from tests.tools.processes import family, proportional_memory, wait_until
from tests.tools.serving import free_port

__all__ = [
    "KEYS",
    "LONGEST_S",
    "Request",
    "Service",
    "ask",
    "is_ready",
    "load",
    "serving",
    "started",
]

OWNERS = ("busy", "other", *(f"busy{k}" for k in range(5)))
KEYS = {owner: f"{owner}-0123456789abcdef" for owner in OWNERS}
"""The keys of a service's owners."""

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


@dataclass(frozen=True, slots=True)
class Service:
    """A running service: where it listens, its first process, and the folder of its data."""

    port: int
    process: int
    folder: Path

    def memory(self) -> int:
        """Return the proportional memory (PSS) in bytes of all its processes."""
        return sum(proportional_memory(process) for process in family(self.process))

    def stored(self) -> int:
        """Return the bytes of its files, temporary ones included."""
        stored = 0
        for folder, _, names in os.walk(self.folder):
            for name in names:
                # files come and go
                with contextlib.suppress(OSError):
                    stored += Path(folder, name).stat().st_size
        return stored


@contextlib.contextmanager
def started(checkout: Path, *arguments: str, **settings: str) -> Iterator[Service]:
    """A service of a checkout for the owners of KEYS, just started."""
    port = free_port()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "temporary").mkdir()
        environment = {k: v for k, v in os.environ.items() if not k.startswith("SYNCPLAN_")}
        environment |= {
            "PYTHONPATH": str(checkout),
            "TMPDIR": str(folder / "temporary"),
            "SYNCPLAN_DATA_DIR": str(folder),
            "SYNCPLAN_API_KEYS": ",".join(f"{name}:{key}" for name, key in KEYS.items()),
            **settings,
        }
        with (folder / "log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "syncplan", "serve", "--port", str(port), *arguments],
                cwd=checkout,
                env=environment,
                stderr=log,
            )
        try:
            yield Service(port, process.pid, folder)
        finally:
            process.kill()
            process.wait()


@contextlib.contextmanager
def serving(checkout: Path, *arguments: str, **settings: str) -> Iterator[int]:
    """A service of a checkout that is ready; yields its port."""
    with started(checkout, *arguments, **settings) as service:
        wait_until(lambda: is_ready(service.port))
        yield service.port


def is_ready(port: int) -> bool:
    """Return whether the service at a port takes requests."""
    with contextlib.suppress(OSError, http.client.HTTPException):
        return ask(port, Request("GET", "/readyz"))[0] == 200
    return False


def ask(port: int, request: Request) -> tuple[int, Any]:
    """Return (status, what the body holds) of one request over a connection of its own.

    A body that is no JSON is returned as bytes.
    """
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=LONGEST_S)
    headers = {"authorization": f"Bearer {request.key}", "content-type": "application/json"}
    try:
        connection.request(request.method, request.path, request.body or None, headers)
        answer = connection.getresponse()
        body = answer.read()
        is_json = "json" in answer.getheader("content-type", "")
        return answer.status, json.loads(body) if is_json else body
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
