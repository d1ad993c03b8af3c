"""Table from exceptions to the statuses with which the service answers.

Every failed request is answered with a problem document; the trace goes to the log alone.
"""

import errno
import json
import logging
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Literal
from urllib.parse import quote

from fastapi.exceptions import RequestValidationError
from fastapi.routing import iter_route_contexts
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Scope

from api.logs import REQUEST_ID
from api.problems import (
    MEDIA_TYPE,
    FaultEntry,
    ServiceError,
    StorageFull,
    Unavailable,
    printable,
    problem_document,
    shown,
    title_of,
)
from syncplan.errors import InputError, NoGoError, NoSolutionError, SyncplanError

MOST_ERRORS = 50
"""Most faults listed for one request."""

INTERNAL = "the service failed on this request; its log says why, under this request id"
NO_SOLUTION = "urn:syncplan:no-solution"
"""Problem type of a well-formed request that no solution fulfils."""

NO_GO = "urn:syncplan:no-go"
"""Problem type of a request that a plan's verdict forbids."""

NO_DATABASE = "the database can't be used just now; try again"
NO_WRITING = "the database can only be read just now; nothing was stored"
NO_MEMORY = "there is no memory left for this request just now; try again"
SENTENCES = {
    "Not Found": "there is nothing at this path",
    "Method Not Allowed": "this path does not take the method",
    "There was an error parsing the body": "the body can't be read; send JSON in UTF-8",
}
"""More helpful messages in place of the framework's."""

_PLACES = {"query", "path", "header", "cookie"}
_DISK_FULL = "53100"
_READ_ONLY = ("25006", "attempt to write a readonly database")


Logged = Literal["nothing", "line", "trace"]
"""Log entry of a failure, in addition to the line of its request."""


@dataclass(frozen=True, slots=True)
class FailedRequest:
    """Answer and log entry of a failure; the title defaults to that of the status.

    Attributes
    ----------
    reason : class of the failure for the metrics, one of few
    """

    status: int
    detail: str
    reason: str
    headers: dict[str, str] = field(default_factory=dict)
    errors: tuple[FaultEntry, ...] = ()
    logged: Logged = "nothing"
    type: str = "about:blank"
    title: str = ""


def _deliberate(error: ServiceError, logged: Logged = "nothing") -> FailedRequest:
    # the class of the error, such as too-many-requests
    reason = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", type(error).__name__).lower()
    return FailedRequest(error.status, error.detail, reason, error.headers, error.errors, logged)


def _input(error: InputError) -> FailedRequest:
    entries = [
        FaultEntry(
            path=printable(fault.key),
            value=None if fault.value == "" else shown(fault.value),
            message=printable(fault.problem),
        )
        for fault in error.faults[:MOST_ERRORS]
    ]
    return FailedRequest(422, str(error), "invalid-input", errors=tuple(entries))


def _invalid(error: RequestValidationError) -> FailedRequest:
    faults = error.errors()
    entries = tuple(_entry(fault) for fault in faults[:MOST_ERRORS])
    first = entries[0]
    detail = f"{first.path}: {first.message}" if first.path else first.message
    if len(faults) > 1:
        detail += f" (and {len(faults) - 1} more)"
    return FailedRequest(422, detail, "invalid-request", errors=entries)


def _entry(fault: dict[str, Any]) -> FaultEntry:
    location = tuple(fault["loc"])
    message = str(fault["msg"])
    if fault["type"] == "json_invalid":
        at = location[-1]
        message = f"not valid JSON: {fault.get('ctx', {}).get('error', message)} at character {at}"
        return FaultEntry(path="", message=printable(message))
    value = None if fault["type"] == "missing" else shown(fault.get("input"))
    return FaultEntry(path=_dotted(location), value=value, message=printable(message))


def _dotted(location: Iterable[int | str]) -> str:
    """Path of a fault; a path in the body starts inside it, as the library's own paths do."""
    place, *inner = location
    path = str(place) if place in _PLACES else ""
    for part in inner:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part}" if path else part
    return printable(path)


def _http(error: HTTPException) -> FailedRequest:
    detail = str(error.detail)
    reason = title_of(error.status_code).lower().replace(" ", "-")
    return FailedRequest(
        error.status_code, SENTENCES.get(detail, detail), reason, dict(error.headers or {})
    )


def _database(error: DBAPIError) -> FailedRequest:
    state = getattr(error.orig, "sqlstate", None)
    if state == _DISK_FULL or "disk is full" in str(error.orig):
        return _with_line(StorageFull())
    if state in _READ_ONLY or str(error.orig) in _READ_ONLY:
        return _with_line(Unavailable(NO_WRITING))
    if isinstance(error, OperationalError | InterfaceError) or error.connection_invalidated:
        return _with_line(Unavailable(NO_DATABASE))
    return _unforeseen(error)


def _system(error: OSError) -> FailedRequest:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return _with_line(StorageFull())
    return _unforeseen(error)


def _unforeseen(error: Exception, detail: str = INTERNAL) -> FailedRequest:
    return FailedRequest(500, detail, "internal", logged="trace")


def _with_line(error: ServiceError) -> FailedRequest:
    return _deliberate(error, "line")


TABLE: dict[type[Exception], Callable[[Any], FailedRequest]] = {
    ServiceError: _deliberate,
    InputError: _input,
    NoGoError: lambda error: FailedRequest(409, str(error), "no-go", type=NO_GO, title="No go"),
    NoSolutionError: lambda error: FailedRequest(
        422, str(error), "no-solution", type=NO_SOLUTION, title="No solution"
    ),
    SyncplanError: lambda error: _unforeseen(error, str(error)),
    RequestValidationError: _invalid,
    HTTPException: _http,
    ClientDisconnect: lambda _: FailedRequest(
        400, "the client went away before its request was complete", "client-gone"
    ),
    DBAPIError: _database,
    PoolTimeout: lambda _: _with_line(Unavailable(NO_DATABASE)),
    MemoryError: lambda _: _with_line(Unavailable(NO_MEMORY)),
    OSError: _system,
    Exception: _unforeseen,
}
"""Conversions by exception class; the nearest class of an exception decides."""


def failure_of(error: Exception) -> FailedRequest:
    """Return the answer to an exception, by the nearest of its classes in the table."""
    kind = next(kind for kind in type(error).__mro__ if kind in TABLE)
    return TABLE[kind](error)


# --- answers --------------------------------------------------------------------------------------

_log = logging.getLogger("api.problems")


async def answer_to(request: Request, error: Exception) -> Response:
    """Return the problem that answers an exception, and write its log entry."""
    failure = failure_of(error)
    if failure.logged == "trace":
        _log.error("unforeseen: %s", type(error).__name__, exc_info=error)
    elif failure.logged == "line":
        cause = printable(str(getattr(error, "orig", None) or error))
        _log.warning("%s: %s", type(error).__name__, cause)
    return problem_answer(request, failure)


def problem_answer(request: Request, failure: FailedRequest) -> Response:
    """Return the answer to a request that failed."""
    headers = failure.headers
    if failure.status >= 400:
        # for the metrics, which are counted outside the application
        request.scope.setdefault("state", {})["reason"] = failure.reason
    if failure.status in (204, 304):
        return Response(status_code=failure.status, headers=headers)
    if failure.status == 405:
        headers = {**headers, "Allow": ", ".join(_methods(request))}
    document = problem_document(
        failure.status,
        printable(failure.detail),
        REQUEST_ID.get() or str(request.scope.get("state", {}).get("request_id", "")),
        failure.title,
        type=failure.type,
        instance=quote(request.url.path),
        errors=list(failure.errors) or None,
    )
    # in ASCII: a fault may hold characters that UTF-8 can't encode
    content = json.dumps(document).encode()
    return Response(content, failure.status, headers=headers, media_type=MEDIA_TYPE)


def route_template(scope: Scope) -> str:
    """Return the path of the matched route, such as /v1/plans/{plan_id}; empty if there is none."""
    context = scope.get("fastapi", {}).get("effective_route_context") or scope.get("route")
    found = getattr(context, "path_format", None) or getattr(context, "path", None)
    return str(found or "")


def _methods(request: Request) -> list[str]:
    """All methods of the path; a single route knows only those that it was declared with."""
    template = route_template(request.scope)
    found: set[str] = set()
    for context in iter_route_contexts(request.app.routes):
        if context.path_format == template:
            found |= context.methods or set()
    return sorted(found)
