"""Problems: every failure of a request is one document, and no trace leaves the house."""

import errno
import json
import logging
import sqlite3
from collections.abc import Iterable, Iterator
from typing import Annotated, Any
from unittest.mock import Mock

import httpx2
import pytest
from fastapi import APIRouter, Body, FastAPI, Request
from fastapi.responses import StreamingResponse
from fastapi.testclient import TestClient
from pydantic import BaseModel
from sqlalchemy.exc import IntegrityError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from api import problems
from api.computing.child import TaskFailedError
from api.failures import failure_of
from api.problems import printable, shown, title_of
from syncplan.errors import Fault, InputError, NoSolutionError, SyncplanError
from tests.tools.api_apps import BODY_LIMIT, ask, bare_app, served

SECRET = "hush-hush"


class DiskFullError(Exception):
    """What psycopg raises when the server's disk is full."""

    sqlstate = "53100"


LISTED = [Fault("sensor.range_m", "must be greater than 0", "-5"), Fault("name", "no", "x")]


def _locked(text: str) -> OperationalError:
    return OperationalError(f"INSERT {SECRET}", {}, sqlite3.OperationalError(text))


RAISED: dict[str, tuple[Exception, int]] = {
    "input": (InputError("-5: must be greater than 0", key="sensor.range_m"), 422),
    "listing": (InputError.of(LISTED), 422),
    "solution": (NoSolutionError("no phases keep every link"), 422),
    "task": (TaskFailedError(f"Traceback {SECRET}"), 500),
    "purpose": (SyncplanError("the search broke down"), 500),
    "locked": (_locked("database is locked"), 503),
    "full": (_locked("database or disk is full"), 507),
    "full-server": (OperationalError(SECRET, {}, DiskFullError(SECRET)), 507),
    "interface": (InterfaceError(SECRET, {}, sqlite3.InterfaceError("closed")), 503),
    "pool": (PoolTimeout("QueuePool limit reached"), 503),
    "integrity": (IntegrityError(SECRET, {}, sqlite3.IntegrityError(SECRET)), 500),
    "invalidated": (
        IntegrityError(SECRET, {}, sqlite3.IntegrityError(), connection_invalidated=True),
        503,
    ),
    "memory": (MemoryError(), 503),
    "disk": (OSError(errno.ENOSPC, "No space left on device", SECRET), 507),
    "file": (OSError(errno.ENOENT, SECRET), 500),
    "gone": (ClientDisconnect(), 400),
    "runtime": (RuntimeError(SECRET), 500),
    "group": (ExceptionGroup(SECRET, [ValueError(SECRET)]), 500),
    "teapot": (HTTPException(418, "short and stout", {"x-spout": "left"}), 418),
    "not-found": (problems.NotFound("no plan has the id 7"), 404),
    "many": (problems.TooManyRequests("20 jobs are unfinished", retry_after_s=1.2), 429),
    "unavailable": (problems.Unavailable("starting", retry_after_s=0.0), 503),
    "work": (problems.TooMuchWork("1e6: at most 100", path="trials", value=10**6), 422),
}


FAULTS = {
    "input": [{"path": "sensor.range_m", "message": "-5: must be greater than 0"}],
    "listing": [
        {"path": "sensor.range_m", "value": "-5", "message": "must be greater than 0"},
        {"path": "name", "value": "x", "message": "no"},
    ],
    "work": [{"path": "trials", "value": 10**6, "message": "1e6: at most 100"}],
}
RETRY_AFTER = dict.fromkeys(
    ("many", "locked", "interface", "pool", "invalidated", "memory"), "2"
) | {"unavailable": "1"}


class Given(BaseModel):
    """A body with one number in it."""

    numbers: list[float]


def _app() -> FastAPI:
    app = bare_app()
    router = APIRouter()

    @router.get("/raise/{name}")
    def fail(name: str) -> None:
        raise RAISED[name][0]

    @router.post("/numbers")
    def numbers(given: Given) -> None: ...

    @router.get("/numbers")
    def no_numbers() -> None: ...

    @router.post("/raw")
    async def raw(request: Request) -> int:
        return len(await request.body())

    @router.post("/embedded")
    def embedded(number: Annotated[int, Body(embed=True)]) -> int:
        return number

    @router.get("/broken/{name}")
    def broken(name: str) -> StreamingResponse:
        def pieces() -> Iterator[bytes]:
            yield b"first"
            raise RAISED[name][0]

        return StreamingResponse(pieces())

    app.include_router(router, prefix="/v1")
    return app


@pytest.fixture(scope="module")
def client() -> TestClient:
    return TestClient(_app())


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with served(_app()) as number:
        yield number


def _check(response: Any, status: int) -> dict[str, Any]:
    assert response.status_code == status
    assert response.headers["content-type"] == "application/problem+json"
    document: dict[str, Any] = response.json()
    problems.Problem.model_validate(document)
    assert document["status"] == status
    unsolved = document["title"] == "No solution"
    assert document["type"] == ("urn:syncplan:no-solution" if unsolved else "about:blank")
    assert document["request_id"] == response.headers["x-request-id"] != ""
    assert SECRET not in response.text
    return document


@pytest.mark.parametrize("name", RAISED)
def test_each_exception_is_answered_with_its_status_and_faults(
    client: TestClient, name: str
) -> None:
    answer = client.get(f"/v1/raise/{name}")
    document = _check(answer, RAISED[name][1])
    assert document["instance"] == f"/v1/raise/{name}"
    assert document["title"] == ("No solution" if name == "solution" else title_of(RAISED[name][1]))
    assert document.get("errors") == FAULTS.get(name)
    assert answer.headers.get("retry-after") == RETRY_AFTER.get(name)
    if name in FAULTS and name != "work":
        assert document["detail"].startswith("sensor.range_m: -5: must be greater than 0")


def test_of_many_faults_the_first_ones_are_listed() -> None:
    assert len(failure_of(InputError.of(LISTED * 100)).errors) == 50


def test_headers_of_an_http_exception_are_kept(client: TestClient) -> None:
    response = client.get("/v1/raise/teapot")
    assert response.headers["x-spout"] == "left"
    assert response.json()["detail"] == "short and stout"


def test_a_path_without_route_is_a_404(client: TestClient) -> None:
    document = _check(client.get("/v1/no%20thing?x=1"), 404)
    assert document["detail"] == "there is nothing at this path"
    assert document["instance"] == "/v1/no%20thing"


def test_a_405_allows_every_method_of_the_path(client: TestClient) -> None:
    response = client.put("/v1/numbers")
    _check(response, 405)
    assert response.headers["allow"] == "GET, POST"


@pytest.mark.parametrize(
    ("body", "path", "value"),
    [
        ('{"numbers": [1, "x"]}', "numbers[1]", "x"),
        ('{"numbers": [NaN, {"a": [1]}]}', "numbers[1]", {"a": [1]}),
        ('{"numbers": ["\\ud800\\n"]}', "numbers[0]", "\\ud800\\n"),
        ('{"numbers": ["%s"]}' % ("long" * 100), "numbers[0]", "long" * 49 + "l..."),
        ("{}", "numbers", None),
        ("[1]", "", [1]),
    ],
)
def test_an_invalid_body_is_a_422_that_says_where(
    client: TestClient, body: str, path: str, value: object
) -> None:
    response = client.post(
        "/v1/numbers", content=body, headers={"content-type": "application/json"}
    )
    first = _check(response, 422)["errors"][0]
    assert first["path"] == path
    assert first.get("value") == value


def test_many_faults_are_counted_and_the_first_ones_listed(client: TestClient) -> None:
    document = _check(client.post("/v1/numbers", json={"numbers": ["x"] * 90}), 422)
    assert len(document["errors"]) == 50
    assert document["detail"].endswith("(and 89 more)")


@pytest.mark.parametrize(
    ("body", "status"), [(b'{"numbers": }', 422), (b'{"numbers": "\xff"}', 400), (b"9" * 900, 422)]
)
def test_a_body_that_is_no_json_is_refused(client: TestClient, body: bytes, status: int) -> None:
    response = client.post(
        "/v1/numbers", content=body, headers={"content-type": "application/json"}
    )
    document = _check(response, status)
    assert status != 422 or document["errors"][0]["path"] == ""


@pytest.mark.parametrize("path", ["/v1/raw", "/v1/numbers", "/v1/embedded", "/v1/nothing"])
def test_a_body_beyond_the_limit_is_a_413_problem(port: int, path: str) -> None:
    header = {"content-type": "application/json", "x-request-id": "too-large"}
    bodies: list[bytes | Iterable[bytes]] = [b"x" * (BODY_LIMIT + 1), b"x" * 5_000_000]
    # what nothing reads is not counted in pieces
    if path != "/v1/nothing":
        bodies.append(iter([b"x" * 400] * 3))
    for body in bodies:
        answer = ask(port, "POST", path, content=body, headers=header)
        assert answer.status_code == 413
        assert answer.headers["content-type"] == "application/problem+json"
        document = answer.json()
        assert document["request_id"] == answer.headers["x-request-id"] == "too-large"
        assert document["title"] == "Content Too Large"
        assert document["detail"] == "the body is larger than 1000 bytes"


def test_a_length_too_long_to_be_read_is_beyond_the_limit(client: TestClient) -> None:
    length = {"content-length": "9" * 5000}
    _check(client.post("/v1/raw", content=b"x", headers=length), 413)


def test_a_body_of_just_the_limit_is_read(port: int) -> None:
    text = {"content-type": "text/plain"}
    for body in (b"x" * BODY_LIMIT, iter([b"x" * 500] * 2)):
        answer = ask(port, "POST", "/v1/raw", content=body, headers=text)
        assert (answer.status_code, answer.content) == (200, b"1000")


def test_trouble_of_the_database_is_one_line_and_what_is_raised_on_purpose_none(
    client: TestClient, caplog: pytest.LogCaptureFixture
) -> None:
    for name in ("locked", "not-found", "input", "many", "unavailable"):
        client.get(f"/v1/raise/{name}")
    lines = [record for record in caplog.records if record.name == "api.problems"]
    assert [line.getMessage() for line in lines] == ["OperationalError: database is locked"]
    assert not lines[0].exc_info


@pytest.mark.parametrize("name", ["runtime", "input"])
def test_an_answer_that_breaks_off_is_cut_and_its_trace_is_logged_once(
    port: int, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    received: list[bytes] = []
    with (
        httpx2.stream("GET", f"http://127.0.0.1:{port}/v1/broken/{name}") as answer,
        pytest.raises(httpx2.RemoteProtocolError, match="incomplete"),
    ):
        received += answer.iter_raw()
    assert received == [b"first"]
    traces = [record for record in caplog.records if record.exc_info]
    assert [record.name for record in traces] == ["api.problems"]


def test_what_fails_outside_the_guard_is_a_problem_too() -> None:
    app = _app()
    app.add_middleware(Mock(return_value=Mock(side_effect=RuntimeError(SECRET))))
    response = TestClient(app, raise_server_exceptions=False).get("/v1/numbers")
    assert response.status_code == 500
    assert response.headers["content-type"] == "application/problem+json"
    assert SECRET not in response.text


@pytest.mark.parametrize("status", [204, 304])
def test_a_status_without_body_stays_without(status: int) -> None:
    app = bare_app()

    @app.get("/")
    def nothing() -> None:
        raise HTTPException(status, headers={"etag": '"1"'})

    response = TestClient(app).get("/")
    assert (response.status_code, response.content) == (status, b"")
    assert response.headers["etag"] == '"1"'


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        (None, None),
        (True, True),
        (2**53, str(2**53)),
        (float("inf"), "inf"),
        ([1, "a", None], [1, "a", None]),
        (list(range(1000)), "[0, 1, 2, 3, 4, 5, ...]"),
        ([float("nan")], "a value of type list that can't be shown"),
        (b"\x00\xff", "b'\\x00\\xff'"),
        ({(1, 2): 3}, "a value of type dict that can't be shown"),
        (10**5000, "a value of type int that can't be shown"),
    ],
    ids=range(10),
)
def test_values_are_shown_as_json_can_carry_them(value: object, reported: object) -> None:
    assert shown(value) == reported
    json.dumps(shown(value), allow_nan=False)


def test_text_is_one_line_of_printing_characters() -> None:
    assert printable("a\nb\x1b\ud800é") == "a\\nb\\x1b\\ud800é"
    assert printable("x" * 50, 10) == "x" * 7 + "..."


@pytest.fixture(autouse=True)
def _heard(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
