"""The problem document (RFC 9457) and the faults it lists, made fit to be sent."""

import json
import math
import reprlib
from http import HTTPStatus
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

MEDIA_TYPE = "application/problem+json"

_RENAMED = {413: "Content Too Large", 422: "Unprocessable Content"}
"""Phrases of RFC 9110 that older Pythons don't know."""

_LONGEST_TEXT = 2000
_LONGEST_VALUE = 200
_SAFE_INTEGER = 2**53
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 60


class FaultEntry(BaseModel):
    """One fault of a request: where it is, what stands there, and what is allowed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str = Field(
        description="dotted path inside the body, or query., path., header. and the name",
        examples=["sensor.range_m"],
    )
    value: Any = Field(
        default=None, description="what stands there, shortened where it is long", examples=[-5]
    )
    message: str = Field(
        description="what is wrong, and what is allowed", examples=["-5: must be greater than 0"]
    )


class Problem(BaseModel):
    """Why a request was not served, as RFC 9457 has it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    type: str = Field(default="about:blank", description="the kind of problem, beyond its status")
    title: str = Field(description="the status in words", examples=["Not Found"])
    status: int = Field(ge=400, le=599, description="the HTTP status", examples=[404])
    detail: str = Field(
        description="what happened to this request", examples=["there is nothing at this path"]
    )
    instance: str | None = Field(
        default=None, description="the path of the request", examples=["/v1/plans/0"]
    )
    errors: list[FaultEntry] | None = Field(
        default=None, description="the faults of the request, if known"
    )
    request_id: str = Field(
        description="the id under which the log holds this request, also in x-request-id",
        examples=["5b1f0c52a7c14f7e9d4b8a1a6f0b6f0e"],
    )


def title_of(status: int) -> str:
    """Return the phrase of an HTTP status, or its class for one without."""
    try:
        return _RENAMED.get(status) or HTTPStatus(status).phrase
    except ValueError:
        return "Client Error" if status < 500 else "Server Error"


def printable(text: str, longest: int = _LONGEST_TEXT) -> str:
    """Return text in one line of printing characters, shortened to `longest`."""
    text = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shown(value: Any) -> Any:
    """Return a value as JSON may carry it back: scalars and short lists as they are, else text."""
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
