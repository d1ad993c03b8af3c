"""Without a key: silent connections by the thousand. Slow ones are in `tests.service`."""

import contextlib
import resource
from collections.abc import Iterator

import httpx2
import pytest

from tests.tools.api_servers import serving, speaking
from tests.tools.processes import PATIENCE_S, memory_given_back, wait_until
from tests.tools.raw_connections import connected, crowd_of, said_to
from tests.tools.serving import Server

SILENT = 1100
"""More than the connections that the server takes, and those of its reserve."""

HEALTH = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that takes 300 connections, and lets them be silent or slow for long."""
    given = {
        "SYNCPLAN_MAX_CONNECTIONS": "300",
        "SYNCPLAN_MAX_CONNECTIONS_PER_ADDRESS": "300",
        "SYNCPLAN_HEAD_TIMEOUT_S": f"{PATIENCE_S:g}",
        "SYNCPLAN_BODY_TIMEOUT_S": f"{PATIENCE_S:g}",
    }
    with serving(tmp_path_factory.mktemp("crowd"), "ann", "--no-worker", **given) as one:
        yield one


def _health(server: Server) -> None:
    """Fail unless a new connection gets the server's sign of life."""
    with contextlib.closing(connected(server.port)) as connection:
        connection.settimeout(10.0)
        connection.sendall(HEALTH)
        assert connection.recv(65536).startswith(b"HTTP/1.1 200 OK")


@pytest.mark.long
def test_silent_sockets_leave_room_for_probes_and_no_memory(server: Server) -> None:
    with crowd_of(server.port, SILENT):
        _health(server)
    wait_until(lambda: speaks(server))
    with memory_given_back(server.popen.pid):
        with crowd_of(server.port, SILENT):
            for _ in range(5):
                _health(server)
            refused = said_to(server.port, [b"GET /v1/plans HTTP/1.1\r\nHost: localhost\r\n\r\n"])
            assert refused.status == 503
            assert "retry-after: 1" in refused.head
        wait_until(lambda: speaks(server))
    assert '"kind": "connections"' in server.log.read_text()


def speaks(server: Server) -> bool:
    """Whether there is room again for an ordinary request."""
    with contextlib.suppress(httpx2.TransportError), speaking(server, "ann") as http:
        return http.get("/v1/plans").status_code == 200
    return False


@pytest.mark.long
def test_without_file_descriptors_it_goes_on(server: Server) -> None:
    soft, hard = resource.prlimit(server.popen.pid, resource.RLIMIT_NOFILE)
    resource.prlimit(server.popen.pid, resource.RLIMIT_NOFILE, (150, hard))
    with crowd_of(server.port, 400):
        wait_until(lambda: "no connection can be taken" in server.log.read_text())
    wait_until(lambda: speaks(server))
    assert server.log.read_text().count("no connection can be taken") < 10
    resource.prlimit(server.popen.pid, resource.RLIMIT_NOFILE, (soft, hard))
