"""Problem documents (RFC 9457), the errors that routes raise on purpose, and their documentation.

A problem and the faults it lists are made safe to send. Each error is answered with the problem of
its status.
"""

import json
import math
import reprlib
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

MEDIA_TYPE = "application/problem+json"

_RENAMED = {413: "Content Too Large", 422: "Unprocessable Content"}
"""Phrases of RFC 9110 that older versions of Python don't know."""

_LONGEST_TEXT = 2000
_LONGEST_VALUE = 200
_SAFE_INTEGER = 2**53
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60
_ID = "5b1f0c52a7c14f7e9d4b8a1a6f0b6f0e"
_FORM = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class FaultEntry(BaseModel):
    """One fault of a request: its place, the value there, and what is allowed."""

    model_config = _FORM

    path: str = Field(examples=["sensor.range_m"])
    """dotted path inside the body, or a name after query., path. or header."""
    value: Any = Field(default=None, examples=[-5])
    """the value there, shortened if it is long"""
    message: str = Field(examples=["-5: must be greater than 0"])
    """what is wrong, and what is allowed"""


class Problem(BaseModel):
    """Reason why a request was not served, in the form of RFC 9457."""

    model_config = _FORM

    type: str = "about:blank"
    """the kind of problem, beyond its status"""
    title: str = Field(examples=["Not Found"])
    """the status in words"""
    status: int = Field(ge=400, le=599, examples=[404])
    """the HTTP status"""
    detail: str = Field(examples=["there is nothing at this path"])
    """what happened to this request"""
    instance: str | None = Field(default=None, examples=["/v1/plans/0"])
    """the path of the request"""
    errors: list[FaultEntry] | None = None
    """the faults of the request, if known"""
    request_id: str = Field(examples=[_ID])
    """the id of this request in the log, also in x-request-id"""


def title_of(status: int) -> str:
    """Return the phrase of an HTTP status, or of its class if it has none."""
    try:
        return _RENAMED.get(status) or HTTPStatus(status).phrase
    except ValueError:
        return "Client Error" if status < 500 else "Server Error"


def problem_document(
    status: int, detail: str, request_id: str, title: str = "", **further: Any
) -> dict[str, Any]:
    """Return a problem for JSON; the title is that of the status unless another is given."""
    title = title or title_of(status)
    problem = Problem(title=title, status=status, detail=detail, request_id=request_id, **further)
    return problem.model_dump(exclude_none=True)


def printable(text: str, longest: int = _LONGEST_TEXT) -> str:
    """Return text as one line of printable characters, shortened to `longest`."""
    text = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shown(value: Any) -> Any:
    """Return a value fit for JSON: scalars and short collections as they are, others as text."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return printable(value, _LONGEST_VALUE)
    if isinstance(value, int) and abs(value) < _SAFE_INTEGER:
        return value
    if isinstance(value, float) and math.isfinite(value):
        return value
    try:
        text = _SHORT.repr(value)
        if isinstance(value, list | tuple | dict) and "..." not in text:
            return json.loads(json.dumps(value, allow_nan=False))
    except (ValueError, TypeError, RecursionError):
        text = f"a value of type {type(value).__name__} that can't be shown"
    return printable(text, _LONGEST_VALUE)


# --- errors ---------------------------------------------------------------------------------------


class ServiceError(Exception):
    """Refusal of a request: the reason in one line, with status, headers and faults to send."""

    status = 500

    def __init__(
        self,
        detail: str,
        *,
        status: int | None = None,
        headers: Mapping[str, str] | None = None,
        errors: Sequence[FaultEntry] = (),
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.status = self.status if status is None else status
        self.headers = dict(headers or {})
        self.errors = tuple(errors)


class NotFound(ServiceError):
    """404: there is no such resource, or it is another owner's."""

    status = 404


class Conflict(ServiceError):
    """409: the request does not fit the state of the resource."""

    status = 409


class PreconditionFailed(ServiceError):
    """412: the resource is not the one that If-Match names."""

    status = 412


class KeyReused(ServiceError):
    """422: the Idempotency-Key was used for another request."""

    status = 422


class TooMuchWork(ServiceError):
    """422: the request is valid but exceeds a limit of this service; `path` is the key at fault."""

    status = 422

    def __init__(self, detail: str, *, path: str = "", value: object = None) -> None:
        fault = FaultEntry(path=path, value=shown(value), message=detail)
        super().__init__(detail, errors=[fault])


class Unauthorized(ServiceError):
    """401: the key is missing or unknown."""

    status = 401

    def __init__(self) -> None:
        super().__init__(
            "send a known key as 'Authorization: Bearer KEY'",
            headers={"WWW-Authenticate": "Bearer"},
        )


class TooManyRequests(ServiceError):
    """429: the owner has as much work under way as allowed; try again after `retry_after_s`."""

    status = 429

    def __init__(self, detail: str, *, retry_after_s: float) -> None:
        super().__init__(detail, headers=_retry_after(retry_after_s))


class KeysThrottled(TooManyRequests):
    """429: the address has presented too many wrong keys."""


class UnreadAnswers(TooManyRequests):
    """429: the owner has too many large answers that it does not read."""


class WrongHost(ServiceError):
    """421: a service without keys does not answer under this name."""

    status = 421


class ForeignPage(ServiceError):
    """403: a service without keys refuses requests from foreign pages."""

    status = 403


STARTING = "the processes that compute are starting; try again"
"""Detail of answers before a process is there to compute."""


class Unavailable(ServiceError):
    """503: the service can't answer now; try again after `retry_after_s`."""

    status = 503

    def __init__(self, detail: str, *, retry_after_s: float = 2.0) -> None:
        super().__init__(detail, headers=_retry_after(retry_after_s))


class StorageFull(ServiceError):
    """507: nothing more can be stored until the operator makes room."""

    status = 507

    def __init__(self, detail: str = "the storage is full; nothing was stored") -> None:
        super().__init__(detail)


def _retry_after(seconds: float) -> dict[str, str]:
    return {"Retry-After": str(max(1, math.ceil(seconds)))}


# --- the OpenAPI document -------------------------------------------------------------------------


REFERENCE = "#/components/schemas/{model}"
"""Reference to a schema of the document by its name."""
_FAULT = FaultEntry(path="sensor.range_m", value=-5, message="-5: must be greater than 0")
_RETRY = {
    "Retry-After": {
        "description": "seconds to wait before another try",
        "schema": {"type": "integer", "minimum": 1},
    }
}
_CHALLENGE = {
    "WWW-Authenticate": {
        "description": "how to present a key",
        "schema": {"type": "string", "const": "Bearer"},
    }
}
_HEADERS = {401: _CHALLENGE, 429: _RETRY, 503: _RETRY}
_DETAILS = {
    400: "the body can't be read; send JSON in UTF-8",
    401: "send a known key as 'Authorization: Bearer KEY'",
    404: "no plan has this id",
    405: "this path does not take the method",
    406: "the Accept header excludes application/json, all that this answer comes in",
    409: "the job has already ended",
    412: "the plan is not the one If-Match names",
    413: "the body is larger than 1048576 bytes",
    415: "text/plain: the body must be application/json or application/yaml",
    422: "sensor.range_m: -5: must be greater than 0",
    429: "you have 20 unfinished jobs, the most allowed; wait for one to end, or cancel one",
    500: "the service failed on this request; its log says why, under this request id",
    503: "the database can't be used just now; try again",
    507: "the storage is full; nothing was stored",
}


def problem_responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """Return FastAPI's `responses=` for these statuses of an operation.

    An operation that checks its input names 422; otherwise FastAPI documents its own answer.
    """
    return {status: _response(status) for status in statuses}


def _response(status: int) -> dict[str, Any]:
    title = title_of(status)
    errors = [_FAULT] if status == 422 else None
    example = problem_document(status, _DETAILS.get(status, title.lower()), _ID, errors=errors)
    response: dict[str, Any] = {
        "description": title,
        "content": {
            MEDIA_TYPE: {
                "schema": {"$ref": REFERENCE.format(model="Problem")},
                "example": example,
            }
        },
    }
    if status in _HEADERS:
        response["headers"] = dict(_HEADERS[status])
    return response
