"""Requests that never end, come from another's page, ask for too much or come in floods.

Work beyond its memory or share ends with the limit and a remedy; the rest goes on. Requests that
come too slowly are in `tests.service.test_protocol`.
"""

import itertools
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx2
import pytest

from api.answering import ALWAYS, OF_DOCUMENTS, UNLESS_GIVEN
from api.connections import ConnectionLimits
from api.main import create_app
from api.settings import load_settings
from tests.tools.api_apps import ask, served
from tests.tools.api_servers import key_of, problem, serving, speaking
from tests.tools.processes import family, memory_given_back, wait_until
from tests.tools.raw_connections import answered, connected, crowd_of, request_of, said_to
from tests.tools.scenarios import document, shared_circles
from tests.tools.serving import QUICK, Server

MEGABYTES = 16
"""What an attack sends at most."""

FLOOD = 60
TASK_MEMORY_MIB = 600
CHUNKED = (
    b"POST /v1/plans HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    + f"Authorization: Bearer {key_of('ann')}\r\n".encode()
    + b"Transfer-Encoding: chunked\r\n\r\n"
)


# --- an application without keys, below which nothing is started ----------------------------------


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A port of this machine where the whole application answers."""
    app = create_app(load_settings(data_dir=tmp_path_factory.mktemp("edge")))
    with served(app, ConnectionLimits(), ws="none", lifespan="off") as number:
        yield number


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "rebound.example"}, 421),
        # what a form or a simple fetch of any page sends, without asking first
        ({"origin": "https://evil.example"}, 403),
        ({"host": "[::1]:8000", "origin": "http://localhost:8000"}, 200),
    ],
)
def test_names_bent_to_this_machine_and_pages_of_others_start_nothing(
    port: int, headers: dict[str, str], status: int
) -> None:
    answer = ask(port, "GET", "/healthz", headers=headers)
    assert answer.status_code == status
    assert status == 200 or next(iter(headers.values())) in answer.json()["detail"]


@pytest.mark.parametrize(
    "sent",
    [
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /v1/schemas/plan HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /nowhere HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /v1/plans HTTP/1.1\r\nHost: evil.example\r\n\r\n",
        b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"nonsense\r\n\r\n",
        b"GET / HTTP/1.1\r\nX: " + b"x" * 70_000,
    ],
    ids=["page", "schema", "problem", "misdirected", "head", "nonsense", "large"],
)
def test_every_answer_has_the_headers_of_security(port: int, sent: bytes) -> None:
    said = said_to(port, [sent.replace(b"Host", b"Connection: close\r\nHost")])
    for name, value in ALWAYS:
        assert said.head.count(f"{name.decode()}: {value.decode()}".lower()) == 1
    for name, _ in UNLESS_GIVEN:
        assert said.head.count(f"\r\n{name.decode()}: ") == 1
    assert "frame-ancestors 'none'" in said.head


@pytest.mark.parametrize("name", ["main.js", "page.css"])
def test_scripts_and_styles_have_the_headers_that_protect_them(port: int, name: str) -> None:
    names = set(ask(port, "GET", f"/assets/{name}").headers)
    assert {"x-content-type-options", "cross-origin-resource-policy"} <= names
    # of no effect on them, and as large as many a script
    assert not {name.decode() for name in OF_DOCUMENTS} & names


# --- a service with tight limits on tasks, its pools at work --------------------------------------


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server whose tasks have little memory."""
    memory = {"SYNCPLAN_TASK_MEMORY_BYTES": str(TASK_MEMORY_MIB * 2**20)}
    with serving(tmp_path_factory.mktemp("attacked"), "ann eve", **memory) as attacked:
        yield attacked


@pytest.fixture(scope="module")
def ann(server: Server) -> Iterator[httpx2.Client]:
    """The owner who plans."""
    with speaking(server, "ann") as http:
        assert http.post("/v1/plans", json=document()).status_code == 201
        yield http


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
def test_what_comes_around_a_chunked_body_is_bounded(
    server: Server, endless: Callable[[], Iterator[bytes]]
) -> None:
    for _ in range(3):
        said_to(server.port, itertools.islice(endless(), 40))
    with memory_given_back(server.popen.pid):
        said = said_to(server.port, endless())
    assert said.status == 431
    assert json.loads(said.body)["status"] == 431


@pytest.mark.long
def test_many_requests_at_once_wait_as_bytes(server: Server) -> None:
    many = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n" * 3000

    def answers() -> int:
        with connected(server.port) as connection:
            connection.sendall(many)
            count, rest = 0, b""
            while count < 3000 and (piece := connection.recv(65536)):
                count += (rest + piece).count(b"HTTP/1.1 200 OK")
                rest = piece[-14:]
            return count

    assert answers() == 3000
    with memory_given_back(server.popen.pid):
        assert answers() == 3000


def _largest(processes: list[int]) -> int:
    """The most memory, in MiB, that one of these processes ever held."""
    peaks = []
    for one in processes:
        lines = Path(f"/proc/{one}/status").read_text().splitlines()
        peaks += [int(line.split()[1]) // 1024 for line in lines if line.startswith("VmHWM")]
    return max(peaks)


@pytest.mark.long
def test_a_plan_that_needs_too_much_memory_is_refused_with_the_limit(
    server: Server, ann: httpx2.Client
) -> None:
    with memory_given_back(server.popen.pid):
        refused = problem(ann.post("/v1/plans", json=shared_circles(9)), 422)
    assert f"{TASK_MEMORY_MIB} MiB of memory" in refused.detail
    assert "fewer vehicles" in refused.detail
    assert ann.post("/v1/plans", json=document()).status_code == 201
    assert _largest(family(server.popen.pid)) < 1.2 * TASK_MEMORY_MIB


def planning(owner: str, per_circle: int) -> bytes:
    """An owner's request for a plan that takes long."""
    return request_of("/v1/plans", key_of(owner), shared_circles(per_circle))


@pytest.mark.long
def test_what_clients_who_went_away_asked_for_is_not_computed(
    server: Server, ann: httpx2.Client
) -> None:
    children = family(server.popen.pid)
    with memory_given_back(server.popen.pid):
        for _ in range(2):
            with crowd_of(server.port, FLOOD // 2, planning("ann", 4)):
                # all have been read: an answer to a later request says so
                assert ann.get("/v1/plans").status_code == 200
    # computed, they would take minutes
    began = time.monotonic()
    assert ann.post("/v1/plans", json=document()).status_code == 201
    waited = time.monotonic() - began
    began = time.monotonic()
    assert ann.post("/v1/plans", json=shared_circles(4)).status_code == 201
    assert waited < 5 * (time.monotonic() - began)
    # nor were processes killed and begun by the dozen
    assert len(set(family(server.popen.pid)) - set(children)) <= 3


# --- a service that takes few requests and plans of an owner --------------------------------------


@pytest.fixture(scope="module")
def narrow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that takes few requests and plans of an owner, and keeps plans for seconds."""
    settings = {
        **QUICK,
        "SYNCPLAN_MAX_REQUESTS": "5",
        "SYNCPLAN_MAX_PLAN_QUEUE": "6",
        "SYNCPLAN_MAX_PLANS": "3",
        "SYNCPLAN_KEEP_PLANS_S": "5",
    }
    with serving(tmp_path_factory.mktemp("narrow"), "ann eve lea", **settings) as one:
        yield one


@pytest.mark.long
def test_an_owner_has_a_limited_number_of_requests_and_leaves_room_for_others(
    narrow: Server,
) -> None:
    with speaking(narrow, "ann") as ann, speaking(narrow, "eve") as eve:
        ann.post("/v1/plans", json=document())
        with (
            memory_given_back(narrow.popen.pid),
            crowd_of(narrow.port, 5 + FLOOD, planning("eve", 4)) as flood,
        ):
            wait_until(lambda: answered(flood) >= FLOOD)
            refused = eve.post("/v1/plans", json=document())
            assert "5 requests in progress" in problem(refused, 429).detail
            assert int(refused.headers["retry-after"]) >= 1
            assert ann.post("/v1/plans", json=document()).status_code == 201
            assert eve.get("/v1/plans").status_code == 200


@pytest.mark.long
def test_an_owner_stores_a_limited_number_of_plans_until_they_expire(narrow: Server) -> None:
    with speaking(narrow, "lea") as lea, speaking(narrow, "eve") as eve:
        answers = [lea.post("/v1/plans", json=document()) for _ in range(4)]
        assert [one.status_code for one in answers] == [201, 201, 201, 507]
        assert "3 stored plans" in problem(answers[3], 507).detail
        assert eve.post("/v1/plans", json=document()).status_code == 201
        assert lea.post("/v1/previews", json=document()).status_code == 200
        assert lea.delete(answers[0].headers["location"]).status_code == 204
        assert lea.post("/v1/plans", json=document()).status_code == 201
        wait_until(lambda: lea.get("/v1/plans").json()["items"] == [])


@pytest.mark.long
def test_an_owner_with_many_requests_delays_another_by_one(
    server: Server, ann: httpx2.Client
) -> None:
    with (
        memory_given_back(server.popen.pid),
        crowd_of(server.port, FLOOD, planning("eve", 4)) as flood,
    ):
        wait_until(lambda: answered(flood) >= 1)
        answer = ann.post("/v1/plans", json=document())
        assert answer.status_code == 201, answer.text
        # in the order of their arrival, all would have been answered first
        assert answered(flood) < FLOOD // 2
