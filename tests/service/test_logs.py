"""Logs: one JSON object a line, tied to requests by an id, whatever a client sends or does."""

import asyncio
import io
import json
import logging
import re
import socket
import time
import warnings
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, Mock

import pytest
from dbos._logger import init_logger
from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import StreamingResponse
from fastapi.testclient import TestClient
from starlette.types import Receive, Scope, Send

from api.answering import Answering
from api.logs import REQUEST_ID, JsonLines, configure_logs
from api.metrics import Metrics
from tests.tools.api_apps import ask, bare_app, served
from tests.tools.api_servers import problem
from tests.tools.processes import wait_until

Lines = Callable[[], list[dict[str, Any]]]
NAMES = ("", "uvicorn", "uvicorn.error", "uvicorn.access", "dbos", "py.warnings")


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> Iterator[Lines]:
    """Configure the service's logs; a call returns the lines since the last one."""
    loggers = [logging.getLogger(name) for name in NAMES]
    kept = [(logger.level, logger.propagate) for logger in loggers]
    stream = io.StringIO()
    # pytest changes sys.stderr between the phases of a test
    monkeypatch.setattr("api.logs.sys", SimpleNamespace(stderr=stream))
    configure_logs("info")

    def read() -> list[dict[str, Any]]:
        text = stream.getvalue()
        stream.seek(0)
        stream.truncate()
        found = [json.loads(line) for line in text.splitlines()]
        return [line for line in found if line["logger"] != "httpx2"]

    yield read
    logging.captureWarnings(False)
    for logger, (level, propagate) in zip(loggers, kept, strict=True):
        logger.handlers = [h for h in logger.handlers if not isinstance(h.formatter, JsonLines)]
        logger.propagate = propagate
        logger.setLevel(level)


def _app() -> FastAPI:
    app = bare_app()
    router = APIRouter()

    @router.get("/plans/{plan_id}")
    def plan(plan_id: str, request: Request) -> str:
        request.state.owner = "ops"
        logging.getLogger("api.other").warning("inside")
        return REQUEST_ID.get()

    @router.get("/crash")
    def crash() -> None:
        raise RuntimeError("asked to the log alone")

    @router.get("/stream")
    async def stream() -> StreamingResponse:
        async def pieces() -> Any:
            while True:
                yield b"data: tick\n\n"
                await asyncio.sleep(0.01)

        return StreamingResponse(pieces(), media_type="text/event-stream")

    @router.get("/brief")
    def brief() -> StreamingResponse:
        def pieces() -> Iterator[bytes]:
            for _ in range(3):
                time.sleep(0.02)
                yield b"data: tick\n\n"

        return StreamingResponse(pieces(), media_type="text/event-stream")

    app.include_router(router, prefix="/v1")

    @app.get("/healthz")
    def healthz(fail: bool = False) -> None:
        if fail:
            raise RuntimeError

    return app


def _requests(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [line for line in found if line["logger"] == "api.requests"]


def test_a_line_shows_when_who_and_what(lines: Lines) -> None:
    logging.getLogger("api.any").info("value %d", 7, extra={"job": "j1", "parts": [1, 2]})
    (line,) = lines()
    moment = line.pop("time")
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", moment)
    assert abs((datetime.now(UTC) - datetime.fromisoformat(moment)).total_seconds()) < 60
    assert line == {
        "level": "info",
        "logger": "api.any",
        "message": "value 7",
        "job": "j1",
        "parts": [1, 2],
    }


def test_lines_below_the_level_are_left_out(lines: Lines) -> None:
    logging.getLogger("api.any").debug("no")
    logging.getLogger("uvicorn.access").info("no")
    assert lines() == []
    configure_logs("error")
    logging.getLogger("api.any").warning("no")
    assert lines() == []


@pytest.mark.parametrize("name", ["uvicorn.error", "uvicorn", "dbos", "dbos.inner", "any"])
def test_libraries_write_json_and_each_line_once(lines: Lines, name: str) -> None:
    # DBOS finds a handler and adds none of its own
    init_logger()
    logging.getLogger(name).warning("reported", extra={"color_message": "\x1b[1m"})
    (line,) = lines()
    assert (line["logger"], line["message"]) == (name, "reported")
    assert "color_message" not in line


def test_warnings_are_lines_too(lines: Lines) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        logging.captureWarnings(False)
        configure_logs("info")
        warnings.warn("stale\nconfiguration", stacklevel=1)
    (line,) = lines()
    assert line["logger"] == "py.warnings"
    assert "stale\nconfiguration" in line["message"]


def test_a_trace_stays_on_its_line(lines: Lines) -> None:
    try:
        raise ValueError("broken")
    except ValueError:
        logging.getLogger("api.any").exception("failed")
    (line,) = lines()
    assert line["exception"].startswith("Traceback")
    assert line["exception"].endswith("ValueError: broken")


UNPRINTABLE = MagicMock(__str__=Mock(side_effect=ValueError))
"""Something that can't be shown."""

HOLDS_ITSELF: list[object] = []
HOLDS_ITSELF.append(HOLDS_ITSELF)


@pytest.mark.parametrize(
    "value", [float("nan"), {(1, 2): 3}, UNPRINTABLE, "\ud800\n\u2028", b"\xff", HOLDS_ITSELF]
)
def test_whatever_a_line_holds_it_is_json(value: object) -> None:
    record = logging.makeLogRecord({"msg": "%s %s", "args": (1,), "value": value})
    text = JsonLines().format(record)
    assert text.isascii()
    assert "\n" not in text
    json.loads(text, parse_constant=lambda name: pytest.fail(name))


def test_a_request_is_one_line_without_its_query(lines: Lines) -> None:
    response = TestClient(_app()).get("/v1/plans/7?token=hush-hush")
    found = lines()
    (line,) = _requests(found)
    (inside,) = [line for line in found if line["logger"] == "api.other"]
    assert inside["request_id"] == response.json()
    assert line["request_id"] == response.headers["x-request-id"] == response.json()
    assert REQUEST_ID.get() == ""
    assert line["duration_ms"] > 0
    reported = {
        name: line[name] for name in ("method", "path", "route", "status", "owner", "bytes")
    }
    assert reported == {
        "method": "GET",
        "path": "/v1/plans/7",
        "route": "/v1/plans/{plan_id}",
        "status": 200,
        "owner": "ops",
        "bytes": len(response.content),
    }
    assert "cut" not in line
    assert "hush-hush" not in json.dumps(found)


def test_a_path_without_route_has_no_template(lines: Lines) -> None:
    TestClient(_app()).get("/nothing%0A")
    (line,) = _requests(lines())
    assert "route" not in line
    assert (line["path"], line["status"]) == ("/nothing\n", 404)


def test_a_sane_request_id_is_kept_and_any_other_replaced() -> None:
    client = TestClient(_app())

    def answered(given: str) -> list[str]:
        headers = {b"x-request-id": given.encode()}
        return client.get("/v1/plans/7", headers=headers).headers.get_list("x-request-id")

    for given in ("a", "A1._-", "x" * 64):
        assert answered(given) == [given]
    for given in ("", "x" * 65, "a b", 'a"b', "a/b", "a%0ab", "\u00e9"):
        made = [*answered(given), *answered(given)]
        assert len(set(made)) == 2
        assert all(re.fullmatch(r"[0-9a-f]{32}", one) for one in made)


def test_the_id_ends_with_its_request() -> None:
    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        assert REQUEST_ID.get()

    async def nobody(*_: Any) -> Any: ...

    async def call() -> str:
        scope = {"type": "http", "method": "GET", "path": "/", "headers": []}
        await Answering(app, Metrics(), 1000, {})(scope, nobody, nobody)
        return REQUEST_ID.get()

    assert asyncio.run(call()) == ""


def test_probes_are_quiet_while_they_succeed(lines: Lines) -> None:
    client = TestClient(_app())
    assert client.get("/healthz").headers["x-request-id"]
    assert _requests(lines()) == []
    client.get("/healthz?fail=true")
    assert [line["level"] for line in _requests(lines())] == ["warning"]
    client.post("/healthz")
    assert [line["status"] for line in _requests(lines())] == [405]
    configure_logs("debug")
    client.get("/healthz")
    assert [line["level"] for line in _requests(lines())] == ["debug"]


def test_a_crash_is_one_trace_and_one_line_under_one_id(lines: Lines) -> None:
    with served(_app()) as port:
        lines()
        answer = ask(port, "GET", "/v1/crash")
        found = lines()
    problem(answer, 500)
    assert "connection" not in answer.headers
    trace, request = found
    assert trace["logger"] == "api.problems"
    assert "asked to the log alone" not in answer.text
    assert trace["request_id"] == request["request_id"] == answer.headers["x-request-id"]
    assert "asked to the log alone" in trace["exception"]
    assert (request["status"], request["level"]) == (500, "warning")


def test_a_stream_is_logged_when_it_ends(lines: Lines) -> None:
    TestClient(_app()).get("/v1/brief")
    (line,) = _requests(lines())
    assert line["duration_ms"] >= 60
    assert line["bytes"] == 3 * len(b"data: tick\n\n")
    assert "cut" not in line


def test_a_client_that_goes_away_leaves_one_line_and_the_server_whole(lines: Lines) -> None:
    with served(_app()) as port:
        with socket.create_connection(("127.0.0.1", port)) as connection:
            connection.sendall(b"GET /v1/stream HTTP/1.1\r\nhost: here\r\n\r\n")
            assert b"200 OK" in connection.recv(4096)
        found: list[dict[str, Any]] = []

        def logged() -> bool:
            found.extend(_requests(lines()))
            return bool(found)

        wait_until(logged)
        assert ask(port, "GET", "/v1/plans/7").status_code == 200
    (line,) = found
    assert line["cut"] is True
    assert (line["status"], line["route"]) == (200, "/v1/stream")


def test_the_whole_life_of_a_server_is_json(lines: Lines) -> None:
    with served(_app()) as port:
        ask(port, "GET", "/v1/plans/7")
    found = lines()
    assert {line["logger"] for line in found} == {"uvicorn.error", "api.other", "api.requests"}
    assert len(_requests(found)) == 1
