"""Without a key: connections by the thousand, silent or slow, and guesses at keys."""

import contextlib
import resource
import time
from collections.abc import Iterator

import httpx2
import pytest

from tests.tools.api_servers import key_of, serving, speaking
from tests.tools.processes import PATIENCE_S, memory_given_back, wait_until
from tests.tools.raw_connections import connected, crowd_of, said_to
from tests.tools.serving import Server

SILENT = 1100
"""More than a process may open files where nothing else is set."""

SLOW = 1000
GRACE_S = 5.0
HEALTH = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"
SLOW_BODY = (
    b"POST /v1/plans HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    + f"Authorization: Bearer {key_of('ann')}\r\n".encode()
    + b"Content-Length: 100\r\n\r\n{"
)


@contextlib.contextmanager
def _files(number: int) -> Iterator[None]:
    """Let what is started meanwhile open so many files, unless it asks for more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (number, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that takes 300 connections, and lets them be silent or slow for long."""
    given = {
        "SYNCPLAN_MAX_CONNECTIONS": "300",
        "SYNCPLAN_MAX_CONNECTIONS_PER_ADDRESS": "300",
        "SYNCPLAN_HEAD_TIMEOUT_S": f"{PATIENCE_S:g}",
        "SYNCPLAN_BODY_TIMEOUT_S": f"{PATIENCE_S:g}",
    }
    with contextlib.ExitStack() as at_the_end:
        with _files(1024):
            folder = tmp_path_factory.mktemp("crowd")
            one = at_the_end.enter_context(serving(folder, "ann bob", **given))
        yield one


def _health(server: Server) -> float:
    """The time in s that a new connection waits for the server's sign of life."""
    started = time.monotonic()
    with contextlib.closing(connected(server)) as connection:
        connection.settimeout(10.0)
        connection.sendall(HEALTH)
        assert connection.recv(65536).startswith(b"HTTP/1.1 200 OK")
    return time.monotonic() - started


@pytest.mark.long
def test_silent_sockets_leave_room_for_probes_and_no_memory(server: Server) -> None:
    with crowd_of(server, SILENT):
        _health(server)
    wait_until(lambda: speaks(server))
    with memory_given_back(server.popen.pid):
        with crowd_of(server, SILENT):
            for _ in range(5):
                _health(server)
            refused = said_to(server, [b"GET /v1/plans HTTP/1.1\r\nHost: localhost\r\n\r\n"])
            assert refused.status == 503
            assert "retry-after: 1" in refused.head
        wait_until(lambda: speaks(server))
    assert '"kind": "connections"' in server.log.read_text()


def speaks(server: Server) -> bool:
    """Whether there is room again for an ordinary request."""
    with contextlib.suppress(httpx2.TransportError), speaking(server, "ann") as http:
        return http.get("/v1/plans").status_code == 200
    return False


@pytest.mark.parametrize("greeting", [b"", SLOW_BODY], ids=["silent", "refused"])
@pytest.mark.long
def test_the_reserve_is_held_by_nobody(server: Server, greeting: bytes) -> None:
    with crowd_of(server, 300), crowd_of(server, 200, greeting) as beyond:
        _health(server)
        # beyond the limit, all are closed by and by, and each with its reason
        for one in beyond:
            one.settimeout(PATIENCE_S)
            assert one.recv(65536).startswith(b"HTTP/1.1 503 ")


def test_wrong_keys_are_throttled_and_logged_with_their_address(server: Server) -> None:
    wait_until(lambda: speaks(server))
    with speaking(server, "ann") as http:
        assert http.get("/v1/plans").status_code == 200
        reported = []
        with httpx2.Client(base_url=server.url, timeout=PATIENCE_S) as guesser:
            for number in range(30):
                headers = {"authorization": f"Bearer guess-{number:020d}"}
                reported.append(guesser.get("/v1/plans", headers=headers))
        statuses = [one.status_code for one in reported]
        assert statuses[0] == 401
        assert statuses.count(429) >= 5
        late = next(one for one in reported if one.status_code == 429)
        assert int(late.headers["retry-after"]) >= 1
        # who was at work here before is not stopped by that, and who is new has to wait
        assert http.get("/v1/plans").status_code == 200
        with speaking(server, "bob") as other:
            assert other.get("/v1/plans").status_code == 429
    lines = server.log.read_text().splitlines()
    assert any('"key refused"' in one and '"address": "127.0.0.1"' in one for one in lines)


@pytest.mark.long
def test_slow_bodies_do_not_hold_up_the_end(tmp_path_factory: pytest.TempPathFactory) -> None:
    took = []
    for number in (0, SLOW):
        slow = tmp_path_factory.mktemp("slow")
        with serving(slow, "ann") as server, crowd_of(server, number, SLOW_BODY):
            _health(server)
            started = time.monotonic()
            assert server.stop() == 0
            took.append(time.monotonic() - started)
    alone, crowded = took
    assert crowded < alone + GRACE_S


@pytest.mark.long
def test_without_file_descriptors_it_goes_on(tmp_path_factory: pytest.TempPathFactory) -> None:
    with serving(tmp_path_factory.mktemp("files"), "ann", SYNCPLAN_MAX_CONNECTIONS="2000") as one:
        _health(one)
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.prlimit(one.popen.pid, resource.RLIMIT_NOFILE, (150, hard))
        with crowd_of(one, 400):
            wait_until(lambda: "no connection can be taken" in one.log.read_text())
        wait_until(lambda: _lives(one))
        assert one.log.read_text().count("no connection can be taken") < 10


def _lives(server: Server) -> bool:
    with contextlib.suppress(OSError, AssertionError):
        return _health(server) > 0.0
    return False
