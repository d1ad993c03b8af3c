"""HTTP below the application: what no route ever sees is answered with a problem as well."""

import json
import socket
from collections.abc import Iterator

import pytest

from api.connections import ConnectionLimits
from api.refusals import LARGEST_HEAD_BYTES
from tests.tools.api_apps import bare_app, served
from tests.tools.processes import PATIENCE_S

HOST = b"Host: here\r\n"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    app = bare_app()

    @app.get("/")
    def nothing() -> None: ...

    @app.post("/")
    async def read(body: dict[str, int]) -> int:
        return len(body)

    with served(app, ConnectionLimits(), ws="none") as number:
        yield number


def _said(port: int, *sent: bytes, answers: int | None = None) -> bytes:
    """All that comes back for some bytes until there are so many answers, or it is closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as connection:
        for one in sent:
            connection.sendall(one)
        said = b""
        while said.count(b"HTTP/1.1 ") != answers and (piece := connection.recv(65536)):
            said += piece
        return said


def _problem(said: bytes) -> dict[str, object]:
    head, _, body = said.partition(b"\r\n\r\n")
    assert b"content-type: application/problem+json" in head
    assert b"connection: close" in head
    document: dict[str, object] = json.loads(body)
    assert f"x-request-id: {document['request_id']}".encode() in head
    assert head.startswith(f"HTTP/1.1 {document['status']} ".encode())
    return document


@pytest.mark.parametrize(
    "sent",
    [
        b"nonsense\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
        b"GET / HTTP/1.1\r\n" + HOST + b"X: a\x00b\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + HOST + b"Content-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + HOST + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n",
        b"GET /\xff HTTP/1.1\r\n" + HOST + b"\r\n",
        b"GET / HTTP/9.9\r\n" + HOST + b"\r\n",
        b"POST / HTTP/1.1\r\n" + HOST + b"Transfer-Encoding: chunked\r\n\r\nxyz\r\n",
    ],
)
def test_what_is_no_http_is_a_400_problem(port: int, sent: bytes) -> None:
    assert _problem(_said(port, sent))["status"] == 400


def test_a_head_without_end_is_a_431_problem(port: int) -> None:
    line = b"X: " + b"x" * 1000 + b"\r\n"
    head = b"GET / HTTP/1.1\r\n" + HOST
    many = [line] * (LARGEST_HEAD_BYTES // len(line) + 500)
    assert _problem(_said(port, head, *many))["status"] == 431
    assert _problem(_said(port, head, b"X: ", *[b"x" * 1000] * 500))["status"] == 431


def test_large_bodies_and_many_requests_are_no_large_head(port: int) -> None:
    body = b" " * 900 + b'{"a": 1}'
    head = b"POST / HTTP/1.1\r\n" + HOST + b"Content-Type: application/json\r\n"
    head += b"X: " + b"x" * 900 + b"\r\n"
    one = head + b"Content-Length: %d\r\n\r\n" % len(body)
    many = (one, body) * (4 * LARGEST_HEAD_BYTES // len(body))
    assert _said(port, *many, answers=len(many) // 2).count(b"HTTP/1.1 200 OK") == len(many) // 2


def test_a_request_for_a_websocket_is_answered_as_a_plain_one(port: int) -> None:
    upgrade = b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    key = b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    said = _said(port, b"GET / HTTP/1.1\r\n" + HOST + upgrade + key, answers=1)
    assert said.startswith(b"HTTP/1.1 200 OK")


def test_what_was_asked_before_the_nonsense_is_answered(port: int) -> None:
    said = _said(port, b"GET / HTTP/1.1\r\n" + HOST + b"\r\nnonsense\r\n\r\n")
    assert said.startswith(b"HTTP/1.1 200 OK")
    assert said.count(b"HTTP/1.1") == 1
