"""HTTP below the application: what no route ever sees is answered with a problem as well."""

import asyncio
import contextlib
import itertools
import json
import logging
import socket
import time
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi import FastAPI, Request, Response

from api.connections import ConnectionLimits
from api.protocol import LARGEST_HEAD_BYTES
from tests.tools.api_apps import bare_app, served
from tests.tools.processes import PATIENCE_S, wait_until
from tests.tools.raw_connections import crowd_of, holds, said_to

HOST = b"Host: here\r\n"
GET = b"GET / HTTP/1.1\r\n" + HOST + b"\r\n"
SLOW = b"POST / HTTP/1.1\r\n" + HOST + b"Content-Length: 9\r\n\r\n{"
"""A body of which nothing more comes."""

LARGE = 2**24
"""Bytes that no socket holds for a client that does not read."""


def _app() -> FastAPI:
    app = bare_app()

    @app.get("/")
    @app.get("/healthz")
    def nothing() -> None: ...

    @app.post("/")
    async def read(body: dict[str, int]) -> int:
        return len(body)

    @app.post("/refused")
    async def refused() -> Response:
        return Response(status_code=403)

    @app.get("/large")
    def large() -> Response:
        return Response(bytes(LARGE))

    @app.post("/headers")
    async def names(request: Request) -> list[str]:
        await request.body()
        return [name.decode() for name, _ in request.scope["headers"]]

    return app


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with served(_app(), ConnectionLimits(), ws="none") as number:
        yield number


def _said(port: int, *sent: bytes, answers: int | None = None) -> bytes:
    """All that comes back for some bytes until there are so many answers, or it is closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as connection:
        # whoever is refused may find the connection closed before all is sent
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
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


EXCHANGES = {
    "plain": (GET, [200]),
    "head": (b"HEAD /nowhere HTTP/1.1\r\n" + HOST + b"\r\n", [404]),
    "pipelined": (3 * GET, [200, 200, 200]),
    "body": (
        b"POST / HTTP/1.1\r\nContent-Type: application/json\r\n"
        + HOST
        + b'Content-Length: 8\r\n\r\n{"a": 1}'
        + GET,
        [200, 200],
    ),
    "trailers": (
        b"POST / HTTP/1.1\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\n"
        + HOST
        + b'\r\n4;x=y\r\n{"a"\r\n4\r\n: 1}\r\n0\r\nX-Trailer: z\r\n\r\n'
        + GET,
        [200, 200],
    ),
    "continue": (
        b"POST / HTTP/1.1\r\nContent-Type: application/json\r\nExpect: 100-continue\r\n"
        + HOST
        + b'Content-Length: 8\r\n\r\n{"a": 1}',
        [100, 200],
    ),
    # what was asked before the nonsense is answered
    "nonsense": (GET + b"nonsense\r\n\r\n", [200]),
}
"""Bytes and the statuses they are answered with."""


def _statuses(said: bytes) -> list[int]:
    return [int(one[:3]) for one in said.split(b"HTTP/1.1 ")[1:]]


@pytest.mark.parametrize("name", EXCHANGES)
def test_requests_are_read_wherever_they_are_cut(port: int, name: str) -> None:
    sent, statuses = EXCHANGES[name]
    byte_by_byte = [sent[k : k + 1] for k in range(len(sent))]
    for pieces in (byte_by_byte, *([sent[:k], sent[k:]] for k in range(1, len(sent), 3))):
        found = _statuses(_said(port, *pieces, answers=len(statuses)))
        # nonsense that arrives after the answer to the request is refused
        late = [400] if name == "nonsense" and len(found) > len(statuses) else []
        assert found == statuses + late, pieces


def test_nonsense_sent_with_a_request_is_not_answered_beside_it(port: int) -> None:
    sent, statuses = EXCHANGES["nonsense"]
    assert _statuses(_said(port, sent)) == statuses


def test_trailers_are_no_headers_of_the_request(port: int) -> None:
    trailer = b"X-Late: yes\r\nAuthorization: Bearer late\r\n"
    head = b"POST /headers HTTP/1.1\r\nTransfer-Encoding: chunked\r\n" + HOST
    said = _said(port, head + b"\r\n2\r\n{}\r\n0\r\n" + trailer + b"\r\n", answers=1)
    assert json.loads(said.partition(b"\r\n\r\n")[2]) == ["transfer-encoding", "host"]


@contextlib.contextmanager
def _limited(**limits: float) -> Iterator[int]:
    """A port where the limits are these, and else beyond what a busy machine takes."""
    patient = dict.fromkeys(("head_s", "body_s", "answer_s", "idle_s"), PATIENCE_S)
    given: dict[str, Any] = {**patient, **limits}
    with served(_app(), ConnectionLimits(**given), ws="none") as number:
        yield number


@pytest.fixture(scope="module")
def hurried() -> Iterator[int]:
    with _limited(head_s=0.2, body_s=0.2, idle_s=0.2) as number:
        yield number


@pytest.mark.parametrize(
    ("sent", "statuses"),
    [
        (b"", []),
        (b"G", [408]),
        (GET, [200]),
        (GET + b"GET", [200]),
        (SLOW, [408]),
        (b"POST /refused HTTP/1.1\r\n" + HOST + b"Content-Length: 9\r\n\r\n{", [403]),
    ],
)
def test_what_does_not_come_in_time_is_answered_once(
    hurried: int, sent: bytes, statuses: list[int]
) -> None:
    assert _statuses(_said(hurried, sent)) == statuses


@pytest.mark.parametrize(
    "begun",
    [GET[:-2] + b"X: ", b"POST / HTTP/1.1\r\n" + HOST + b"Content-Length: 999\r\n\r\n"],
    ids=["head", "body"],
)
def test_a_byte_now_and_then_gains_no_time(hurried: int, begun: bytes) -> None:
    drops = itertools.repeat(b"y", 400)

    def dripping() -> Iterator[bytes]:
        yield begun
        for drop in drops:
            time.sleep(0.02)
            yield drop

    assert said_to(hurried, dripping()).status == 408
    assert next(drops, None) is not None


def test_a_client_that_does_not_read_is_cut_off() -> None:
    with _limited(answer_s=0.2) as number, socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", number))
        connection.sendall(b"GET /large HTTP/1.1\r\n" + HOST + b"\r\n")
        own = connection.getsockname()[1]
        wait_until(lambda: holds(number, own))
        wait_until(lambda: not holds(number, own))


def test_slow_bodies_do_not_hold_up_the_end(caplog: pytest.LogCaptureFixture) -> None:
    with contextlib.ExitStack() as held, _limited() as number:
        held.enter_context(crowd_of(number, 5, SLOW))
        # whoever came before has been read
        assert _statuses(_said(number, GET, answers=1)) == [200]
    assert "graceful shutdown exceeded" not in caplog.text


def test_a_head_that_comes_later_has_its_own_time() -> None:
    with (
        _limited(head_s=0.2) as number,
        socket.create_connection(("127.0.0.1", number), timeout=PATIENCE_S) as connection,
    ):
        connection.sendall(GET)
        assert connection.recv(65536).startswith(b"HTTP/1.1 200 ")
        connection.sendall(GET[:9])
        assert connection.recv(65536).startswith(b"HTTP/1.1 408 ")


def test_the_reserve_answers_probes_and_closes() -> None:
    with _limited(total=2, per_address=2) as number, contextlib.ExitStack() as held:

        def asked(path: bytes) -> bytes:
            return _said(number, b"GET " + path + b" HTTP/1.1\r\n" + HOST + b"\r\n")

        for _ in range(2):
            held.enter_context(socket.create_connection(("127.0.0.1", number)))
        # the last one taken has an answer, so those before it are counted
        assert _statuses(asked(b"/healthz")) == [200]
        said = asked(b"/")
        assert _problem(said)["status"] == 503
        assert b"retry-after: 1" in said
        # of a body that does not end, no more is awaited
        for silent in (b"", SLOW):
            assert _statuses(_said(number, silent)) == [503]


def test_what_waits_behind_an_answer_ends_with_the_nonsense_after_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    begun: list[int] = []
    ended: list[int] = []
    app = bare_app()

    @app.get("/")
    async def slow() -> None:
        begun.append(1)
        await asyncio.sleep(0.3)
        ended.append(1)

    with served(app, ConnectionLimits(), ws="none") as number:
        assert _statuses(_said(number, 2 * GET + b"nonsense\r\n\r\n")) == []
        wait_until(lambda: bool(ended))
        assert _statuses(_said(number, b"GET /no HTTP/1.1\r\n" + HOST + b"\r\n", answers=1)) == [
            404
        ]
    assert len(begun) == 1
    assert [one for one in caplog.records if one.levelno >= logging.ERROR] == []
