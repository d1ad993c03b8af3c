"""Without a key: requests that never end, come too slowly, or come from another's page."""

import itertools
import json
import re
import socket
import time
from collections.abc import Iterator

import httpx2
import pytest

from api.answering import ALWAYS, OF_DOCUMENTS, UNLESS_GIVEN
from tests.tools.processes import PATIENCE_S, memory_given_back, wait_until
from tests.tools.raw_connections import connected, holds, said_to
from tests.tools.scenarios import document
from tests.tools.serving import Server, open_server

MEGABYTES = 16
"""What an attack sends at most."""

QUICK = {
    "SYNCPLAN_HEAD_TIMEOUT_S": "1",
    "SYNCPLAN_BODY_TIMEOUT_S": "1.5",
    "SYNCPLAN_ANSWER_TIMEOUT_S": "1",
    "SYNCPLAN_IDLE_TIMEOUT_S": "1",
}
CHUNKED = (
    b"POST /v1/plans HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with open_server(tmp_path_factory.mktemp("edge"), **QUICK) as server:
        yield server


def _trailers() -> Iterator[bytes]:
    yield CHUNKED + b"2\r\n{}\r\n0\r\n"
    for number in range(MEGABYTES * 16):
        yield b"".join(b"x%d-%d: %s\r\n" % (number, k, b"y" * 1010) for k in range(64))


def _one_trailer() -> Iterator[bytes]:
    yield CHUNKED + b"2\r\n{}\r\n0\r\nx: "
    yield from itertools.repeat(b"y" * 65536, MEGABYTES * 16)


def _extensions() -> Iterator[bytes]:
    yield CHUNKED
    chunk = b"1;x=" + b"y" * 4000 + b"\r\n \r\n"
    yield from itertools.repeat(16 * chunk, MEGABYTES * 16)


@pytest.mark.parametrize("endless", [_trailers, _one_trailer, _extensions])
@pytest.mark.long
def test_what_comes_around_a_chunked_body_is_bounded(server: Server, endless: object) -> None:
    assert callable(endless)
    for _ in range(3):
        said_to(server, itertools.islice(endless(), 40))
    with memory_given_back(server.popen.pid):
        said = said_to(server, endless())
    assert said.status == 431
    assert json.loads(said.body)["status"] == 431


@pytest.mark.long
def test_many_requests_at_once_wait_as_bytes(server: Server) -> None:
    many = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n" * 3000

    def answered() -> int:
        with connected(server) as connection:
            connection.sendall(many)
            count, rest = 0, b""
            while count < 3000 and (piece := connection.recv(65536)):
                count += (rest + piece).count(b"HTTP/1.1 200 OK")
                rest = piece[-14:]
            return count

    assert answered() == 3000
    with memory_given_back(server.popen.pid):
        assert answered() == 3000


@pytest.mark.parametrize(
    "begun", [CHUNKED[:-2] + b"X: ", CHUNKED + b"ff\r\n"], ids=["head", "body"]
)
def test_a_byte_now_and_then_gains_no_time(server: Server, begun: bytes) -> None:
    drops = itertools.repeat(b"y", 400)

    def dripping() -> Iterator[bytes]:
        yield begun
        for drop in drops:
            time.sleep(0.05)
            yield drop

    assert said_to(server, dripping()).status == 408
    assert next(drops, None) is not None


def test_a_client_that_does_not_read_is_cut_off(server: Server) -> None:
    path = "/assets/plotly.min.js"
    ask = f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", server.port))
        connection.sendall(ask)
        port = connection.getsockname()[1]
        wait_until(lambda: holds(server, port))
        wait_until(lambda: not holds(server, port))


def test_names_bent_to_this_machine_and_pages_of_others_start_nothing(server: Server) -> None:
    with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as http:
        plan = http.post("/v1/plans", json=document()).json()
        answer = http.get("/v1/plans", headers={"host": "rebound.example"})
        assert answer.status_code == 421
        assert "rebound.example" in answer.json()["detail"]
        # what a form or a simple fetch of any page sends, without asking first
        at, headers = f"/v1/plans/{plan['id']}/validations", {"origin": "https://evil.example"}
        assert http.post(at, headers=headers).status_code == 403
        assert http.get("/v1/jobs").json()["items"] == []
        headers = {"host": "[::1]:8000", "origin": "http://localhost:8000"}
        assert http.get("/v1/plans", headers=headers).status_code == 200


@pytest.mark.parametrize(
    "ask",
    [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /v1/plans HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /nowhere HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /v1/plans HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"nonsense\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: " + b"x" * 70_000,
    ],
    ids=["page", "list", "problem", "misdirected", "head", "nonsense", "large"],
)
def test_every_answer_has_the_headers_of_security(server: Server, ask: bytes) -> None:
    said = said_to(server, [ask])
    for name, value in ALWAYS:
        assert said.head.count(f"{name.decode()}: {value.decode()}".lower()) == 1
    for name, _ in UNLESS_GIVEN:
        assert said.head.count(f"\r\n{name.decode()}: ") == 1
    assert "frame-ancestors 'none'" in said.head


@pytest.mark.parametrize("name", ["main.js", "page.css"])
def test_scripts_and_styles_have_the_headers_that_protect_them(server: Server, name: str) -> None:
    said = said_to(server, [f"GET /assets/{name} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()])
    names = set(re.findall(r"\r\n([a-z-]+): ", said.head))
    assert {"x-content-type-options", "cross-origin-resource-policy"} <= names
    # of no effect on them, and as large as many a script
    assert not {name.decode() for name in OF_DOCUMENTS} & names
