"""Large answers read slowly or never: memory stays bounded, and no one else pays for it."""

import asyncio
import contextlib
import socket
import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx2
import pytest
from fastapi import FastAPI, Request, Response
from starlette.types import Message

from api import answering
from api.answering import PIECE_BYTES
from api.job_kinds.job_kind import JobReport
from api.storage.database import open_database
from api.storage.job_records import end_job
from tests.tools.api_apps import bare_app
from tests.tools.api_servers import key_of, planned, problem, serving, speaking
from tests.tools.processes import memory, wait_until, worked
from tests.tools.raw_connections import Said, answered, crowd_of, read_until, request_of
from tests.tools.serving import Server

SLOW = 40
REPORT = '{"figures": "' + "3.14159, " * (15 * 2**20 // 9) + '"}'
SIZE = len(REPORT)
LOOK_S, IDLE_S = 3.0, 0.15
"""Time of a look at a server, and the processor time in it of one that still answers, at least."""

# --- a server -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server that does no jobs, and waits as long as the attack takes for slow readers."""
    given = {"SYNCPLAN_ANSWER_TIMEOUT_S": "600"}
    with serving(tmp_path_factory.mktemp("site"), "ann bob", "--no-worker", **given) as attacked:
        yield attacked


def job_with_report(server: Server, http: httpx2.Client) -> str:
    """Return the path of the large report of a job, as one of many trials would have left it."""
    plan = planned(http)["id"]
    job_id = str(http.post(f"/v1/plans/{plan}/validations", json={"trials": 1000}).json()["id"])
    with (
        contextlib.closing(
            open_database(f"sqlite:///{server.log.parent}/data/syncplan.db")
        ) as database,
        database.writing() as connection,
    ):
        assert end_job(connection, job_id, "succeeded", report=JobReport(REPORT))
    return f"/v1/jobs/{job_id}/result"


@contextlib.contextmanager
def peak_of(process: int) -> Iterator[list[int]]:
    """The most bytes of memory that a process has held so far, looked at often until the end."""
    peak, over = [memory(process)], threading.Event()

    def look() -> None:
        while not over.wait(0.005):
            peak[0] = max(peak[0], memory(process))

    looking = threading.Thread(target=look)
    looking.start()
    try:
        yield peak
    finally:
        over.set()
        looking.join()


def wait_until_idle(process: int) -> None:
    """Wait until a process has done what it can do without its clients."""

    def idle() -> bool:
        before = worked(process)
        time.sleep(LOOK_S)
        return worked(process) - before < IDLE_S

    wait_until(idle)


def reads_whole(http: httpx2.Client, path: str) -> bool:
    """Return whether an owner gets a report, to its last byte."""
    return http.get(path).text == REPORT


def rest_of(connection: socket.socket) -> Said:
    """Return an answer that is read at last."""
    text = bytearray(read_until(connection, b"\r\n\r\n"))
    head = bytes(text).partition(b"\r\n\r\n")[0].lower()
    length = int(head.partition(b"content-length: ")[2].split()[0])
    while len(text) < len(head) + 4 + length and (piece := connection.recv(2**20)):
        text += piece
    return Said(bytes(text))


@pytest.mark.long
def test_large_answers_that_nobody_reads_take_bounded_memory_from_no_one_else(
    server: Server,
) -> None:
    process = server.popen.pid
    with speaking(server, "ann") as ann, speaking(server, "bob") as bob:
        path, his = job_with_report(server, ann), job_with_report(server, bob)
        # once, so that all that is loaded later is there
        for http, at in ((ann, path), (bob, his)):
            assert reads_whole(http, at)
        before = memory(process)
        with peak_of(process) as peak:
            with crowd_of(server.port, SLOW, request_of(path, key_of("ann"))) as slow:
                wait_until(lambda: answered(slow) == SLOW)
                wait_until_idle(process)
                held = memory(process)
                assert held - before < 8 * SIZE, f"{(held - before) / 2**20:.0f} MiB"
                # others are served, large answers too; and she herself, but for large ones
                assert reads_whole(bob, his)
                assert ann.get("/v1/plans").status_code == 200
                assert "allowed are 64 and 512" in problem(ann.get(path), 429).detail
                said = [rest_of(reader) for reader in slow]
            wait_until(lambda: reads_whole(ann, path))
        wholes = [answer.body == REPORT.encode() for answer in said if answer.status == 200]
        assert wholes == [True] * 4
        assert {answer.status for answer in said} == {200, 429}
        assert all("retry-after: " in answer.head for answer in said if answer.status == 429)
        assert 'reason="unread-answers"' in ann.get("/metrics").text
    growth = [f"{(value - before) / 2**20:.0f} MiB" for value in (held, peak[0], memory(process))]
    print("held, at most, afterwards:", *growth)
    # four answers, and beside them a few that were being read or refused
    assert peak[0] - before < SLOW * SIZE / 2, growth
    wait_until(lambda: memory(process) - before < 4 * SIZE, otherwise=lambda: str(growth))


@pytest.mark.long
def test_readers_that_go_away_give_their_room_back(server: Server) -> None:
    with speaking(server, "ann") as ann:
        path = job_with_report(server, ann)
        for _ in range(3):
            with crowd_of(server.port, 8, request_of(path, key_of("ann"))) as slow:
                wait_until(lambda: answered(slow) == 8)
                wait_until_idle(server.popen.pid)
                assert ann.get(path).status_code == 429
            wait_until(lambda: ann.get(path).status_code == 200)


@pytest.mark.long
def test_what_is_the_same_for_all_is_kept_once_however_many_read_it_slowly(server: Server) -> None:
    """Without a key: each connection asks for more than what the system takes off the server."""
    with httpx2.Client(base_url=server.url) as http:
        size = len(http.get("/openapi.json").content)
    crowd, process = 200, server.popen.pid
    before = memory(process)
    with crowd_of(server.port, crowd, 16 * request_of("/openapi.json", "")) as slow:
        wait_until(lambda: answered(slow) == crowd)
        wait_until_idle(process)
        held = memory(process) - before
    print(f"{held / crowd / 1024:.0f} KiB a connection, the document has {size / 1024:.0f}")
    assert held < crowd * size / 3


# --- the middleware -------------------------------------------------------------------------------


def _app() -> FastAPI:
    app = bare_app()

    @app.get("/{owner}/{size}")
    async def answer(request: Request, owner: str, size: int) -> Response:
        if owner != "nobody":
            request.state.owner = owner
        return Response(bytes(range(256)) * (size // 256))

    return app


async def asked_at_once(app: FastAPI, *asked: tuple[str, int]) -> list[int]:
    """Return the statuses of answers to owners, of so many pieces; none is read before all came."""
    read = asyncio.Event()

    async def nothing() -> Any:
        return {"type": "http.request"}

    async def ask(owner: str, pieces: int) -> int:
        answers: list[Message] = []

        async def send(message: Message) -> None:
            answers.append(message)
            await read.wait()

        path = f"/{owner}/{pieces * PIECE_BYTES}"
        scope = {"type": "http", "method": "GET", "path": path, "headers": [], "query_string": b""}
        await app(scope, nothing, send)
        start, *parts = answers
        bodies = [bytes(part["body"]) for part in parts]
        assert [part.get("more_body", False) for part in parts] == [True] * len(parts[1:]) + [False]
        assert max(map(len, bodies)) <= PIECE_BYTES
        if start["status"] == 200:
            assert b"".join(bodies) == bytes(range(256)) * (pieces * PIECE_BYTES // 256)
        return int(start["status"])

    tasks = []
    for request in asked:
        tasks.append(asyncio.create_task(ask(*request)))
        # until it has come to its first piece
        for _ in range(100):
            await asyncio.sleep(0.0)
    read.set()
    return await asyncio.gather(*tasks)


@pytest.mark.parametrize(
    ("asked", "statuses"),
    [
        # one may be of any size
        ([("ann", 9)], [200]),
        ([("ann", 9), ("ann", 2), ("bob", 9)], [200, 429, 200]),
        # what is small, or the same for all, does not count
        ([("ann", 4), ("ann", 1), ("ann", 0), ("nobody", 9), ("nobody", 9)], [200] * 5),
        ([("ann", 2), ("ann", 2), ("ann", 2)], [200, 200, 429]),
        # no more than eight of all but the first of each
        ([("ann", 4), ("bob", 2), ("eve", 2), ("bob", 2), ("dan", 9)], [200, 200, 200, 429, 200]),
    ],
)
def test_unread_answers_are_bounded_by_owner_and_in_all(
    asked: list[tuple[str, int]], statuses: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answering, "MOST_UNREAD_OF_OWNER", 4 * PIECE_BYTES)
    monkeypatch.setattr(answering, "MOST_UNREAD", 8 * PIECE_BYTES)

    async def twice() -> list[list[int]]:
        app = _app()
        return [await asked_at_once(app, *asked) for _ in range(2)]

    # the second time, what was read no longer counts
    assert asyncio.run(twice()) == [statuses, statuses]
