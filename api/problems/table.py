"""One table from the exceptions that reach the service to the statuses it answers with."""

import errno
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from fastapi.exceptions import RequestValidationError
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from api.problems.problem_document import FaultEntry, printable, shown, title_of
from api.problems.service_errors import ServiceError, StorageFull, Unavailable
from syncplan.errors import InputError, NoGoError, NoSolutionError, SyncplanError

MOST_ERRORS = 50
"""Most faults that are listed of one request."""

INTERNAL = "the service failed on this request; its log says why, under this request id"
NO_SOLUTION = "urn:syncplan:no-solution"
"""The type of problem that is not the request's form: nothing fulfils what it asks for."""

NO_GO = "urn:syncplan:no-go"
"""The type of problem that a plan's verdict stops what is asked for."""

NO_DATABASE = "the database can't be used just now; try again"
NO_WRITING = "the database can only be read just now; nothing was stored"
NO_MEMORY = "there is no memory left for this request just now; try again"
SENTENCES = {
    "Not Found": "there is nothing at this path",
    "Method Not Allowed": "this path does not take the method",
    "There was an error parsing the body": "the body can't be read; send JSON in UTF-8",
}
"""The framework's sentences, in words that help."""

_PLACES = {"query", "path", "header", "cookie"}
_DISK_FULL = "53100"
_READ_ONLY = ("25006", "attempt to write a readonly database")


class Logged(Enum):
    """What the log holds of a failure beside the line of its request."""

    NOTHING = "nothing"
    LINE = "line"
    TRACE = "trace"


@dataclass(frozen=True, slots=True)
class FailedRequest:
    """What to answer with, and what to log; without a title the problem is its status alone.

    Attributes
    ----------
    reason : the class of the failure, as metrics count it; one of few
    """

    status: int
    detail: str
    reason: str
    headers: dict[str, str] = field(default_factory=dict)
    errors: tuple[FaultEntry, ...] = ()
    logged: Logged = Logged.NOTHING
    type: str = "about:blank"
    title: str = ""


def _deliberate(error: ServiceError) -> FailedRequest:
    return FailedRequest(error.status, error.detail, _named(error), error.headers, error.errors)


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


def _no_solution(error: NoSolutionError) -> FailedRequest:
    return FailedRequest(422, str(error), "no-solution", type=NO_SOLUTION, title="No solution")


def _no_go(error: NoGoError) -> FailedRequest:
    return FailedRequest(409, str(error), "no-go", type=NO_GO, title="No go")


def _on_purpose(error: SyncplanError) -> FailedRequest:
    return FailedRequest(500, str(error), "internal", logged=Logged.TRACE)


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
    """The path of a fault; that of the body starts inside it, as the library's own paths do."""
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


def _gone(error: ClientDisconnect) -> FailedRequest:
    return FailedRequest(400, "the client went away before its request was complete", "client-gone")


def _database(error: DBAPIError) -> FailedRequest:
    state = getattr(error.orig, "sqlstate", None)
    if state == _DISK_FULL or "disk is full" in str(error.orig):
        return _with_line(StorageFull())
    if state in _READ_ONLY or str(error.orig) in _READ_ONLY:
        return _with_line(Unavailable(NO_WRITING))
    if isinstance(error, OperationalError | InterfaceError) or error.connection_invalidated:
        return _with_line(Unavailable(NO_DATABASE))
    return _unforeseen(error)


def _no_connection(error: PoolTimeout) -> FailedRequest:
    return _with_line(Unavailable(NO_DATABASE))


def _no_memory(error: MemoryError) -> FailedRequest:
    return _with_line(Unavailable(NO_MEMORY))


def _system(error: OSError) -> FailedRequest:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return _with_line(StorageFull())
    return _unforeseen(error)


def _unforeseen(error: Exception) -> FailedRequest:
    return FailedRequest(500, INTERNAL, "internal", logged=Logged.TRACE)


def _with_line(error: ServiceError) -> FailedRequest:
    return FailedRequest(
        error.status, error.detail, _named(error), error.headers, logged=Logged.LINE
    )


def _named(error: ServiceError) -> str:
    """The class of an error that is raised on purpose, as in too-many-requests."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "-", type(error).__name__).lower()


TABLE: dict[type[Exception], Callable[[Any], FailedRequest]] = {
    ServiceError: _deliberate,
    InputError: _input,
    NoGoError: _no_go,
    NoSolutionError: _no_solution,
    SyncplanError: _on_purpose,
    RequestValidationError: _invalid,
    HTTPException: _http,
    ClientDisconnect: _gone,
    DBAPIError: _database,
    PoolTimeout: _no_connection,
    MemoryError: _no_memory,
    OSError: _system,
    Exception: _unforeseen,
}
"""By the nearest class of an exception."""


def failure_of(error: Exception) -> FailedRequest:
    """Return what to answer an exception with, by the nearest of its classes in the table."""
    kind = next(kind for kind in type(error).__mro__ if kind in TABLE)
    return TABLE[kind](error)
