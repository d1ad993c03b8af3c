"""Logs as JSON, one object a line on standard error; a request id ties lines to requests.

The same middleware gives each answer its request id and its security headers.
"""

import json
import logging
import re
import sys
import time
import traceback
import uuid
from collections.abc import Iterable
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send


@dataclass(slots=True)
class _Silence:
    until: float
    cases: int = 0


class SeldomLog:
    """Warnings of a logger, at most one of each kind in `every_s` seconds."""

    def __init__(self, logger: logging.Logger, every_s: float = 10.0) -> None:
        self._logger = logger
        self._every_s = every_s
        self._silences: dict[str, _Silence] = {}

    def warn(self, kind: str, message: str, **fields: object) -> None:
        """Log a case of `kind`, with how many there were since the last line; or count it alone.

        There must be few kinds: one is kept for each.
        """
        now = time.monotonic()
        silence = self._silences.get(kind)
        if silence is not None and now < silence.until:
            silence.cases += 1
            return
        cases = 1 if silence is None else silence.cases + 1
        self._silences[kind] = _Silence(now + self._every_s)
        self._logger.warning(message, extra={"kind": kind, "cases": cases, **fields})


# --- headers of every answer ----------------------------------------------------------------------


HeaderPair = tuple[bytes, bytes]

ALWAYS: tuple[HeaderPair, ...] = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), geolocation=(), microphone=(), payment=(), usb=()"),
)
"""Of all answers. Strict-Transport-Security is the matter of the proxy that speaks TLS."""

UNLESS_GIVEN: tuple[HeaderPair, ...] = (
    (b"cache-control", b"private, no-cache"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
)
"""Of answers without a rule of their own: nothing in them is run, framed or kept by proxies."""


def with_security(headers: Iterable[HeaderPair]) -> list[HeaderPair]:
    """Return the headers of an answer, names in lower case, with those above."""
    given = list(headers)
    names = {name for name, _ in given}
    return [*given, *ALWAYS, *(pair for pair in UNLESS_GIVEN if pair[0] not in names)]


# --- JSON lines -----------------------------------------------------------------------------------


REQUEST_LOGGER = "api.requests"
PROBES = frozenset({"/healthz", "/readyz", "/metrics"})
"""Paths that machines poll: logged only at level debug while they succeed."""

_HEADER = b"x-request-id"
_SANE = re.compile(r"[A-Za-z0-9._-]{1,64}")
_REQUEST_ID: ContextVar[str] = ContextVar("request_id", default="")
_ORDINARY = frozenset(vars(logging.makeLogRecord({}))) | {
    "asctime",
    "color_message",
    "message",
    "taskName",
}

_log = logging.getLogger(REQUEST_LOGGER)


def current_request_id() -> str:
    """Return the id of the request this code runs for, empty outside of requests."""
    return _REQUEST_ID.get()


class JsonLines(logging.Formatter):
    """One JSON object a record: time, level, logger, message, request_id, extra fields, trace."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line, in ASCII, without its end."""
        moment = datetime.fromtimestamp(record.created, UTC)
        line: dict[str, Any] = {
            "time": moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": _message(record),
        }
        request_id = current_request_id()
        if request_id:
            line["request_id"] = request_id
        for name, value in vars(record).items():
            if name not in _ORDINARY:
                line.setdefault(name, value)
        if record.exc_info and record.exc_info[0] is not None:
            line["exception"] = "".join(traceback.format_exception(*record.exc_info)).rstrip()
        if record.stack_info:
            line["stack"] = record.stack_info
        try:
            return json.dumps(line, default=str, allow_nan=False)
        except (ValueError, TypeError, RecursionError):
            return json.dumps({name: _plain(value) for name, value in line.items()})


def _message(record: logging.LogRecord) -> str:
    try:
        return record.getMessage()
    except (TypeError, ValueError, KeyError):
        return f"{record.msg} {record.args}"


def _plain(value: Any) -> str:
    try:
        return str(value)
    except Exception:
        return f"a {type(value).__name__} that can't be shown"


def configure_logs(level: str) -> None:
    """Send every logger's lines of `level` and above to standard error, as JSON.

    Call it before uvicorn and DBOS start, uvicorn with `log_config=None, access_log=False`: the
    requests are logged by RequestLog.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(level.upper())
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access"):
        logger = logging.getLogger(name)
        logger.handlers = []
        logger.propagate = True
        logger.setLevel(logging.WARNING if name == "uvicorn.access" else logging.NOTSET)
    # DBOS writes lines of its own kind unless its logger has a handler
    durable = logging.getLogger("dbos")
    durable.handlers = [handler]
    durable.propagate = False
    # and logs every migration and connection
    durable.setLevel(logging.getLogger().level if level == "debug" else logging.WARNING)
    logging.captureWarnings(True)


def route_template(scope: Scope) -> str:
    """Return the path of the route that answers, like /v1/plans/{plan_id}; empty for none."""
    context = scope.get("fastapi", {}).get("effective_route_context") or scope.get("route")
    found = getattr(context, "path_format", None) or getattr(context, "path", None)
    return str(found or "")


class RequestLog:
    """ASGI middleware, outermost: gives each request its id and logs one line when it ends.

    A sane X-Request-ID of the client is kept; the answer carries the id under the same name. It
    also carries the headers of api.logs.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request; anything but HTTP goes through untouched."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _SANE.fullmatch(given) else uuid.uuid4().hex
        entry = _Entry(request_id.encode(), send)
        scope.setdefault("state", {})["request_id"] = request_id
        token = _REQUEST_ID.set(request_id)
        try:
            await self.app(scope, receive, entry.send)
        finally:
            entry.log(scope)
            _REQUEST_ID.reset(token)


class _Entry:
    """What is seen of one answer while it is sent."""

    def __init__(self, request_id: bytes, send: Send) -> None:
        self.request_id = request_id
        self.forward = send
        self.started = time.perf_counter()
        self.status: int | None = None
        self.bytes = 0
        self.complete = False

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            headers = [pair for pair in message.get("headers", ()) if pair[0] != _HEADER]
            headers.append((_HEADER, self.request_id))
            message = {**message, "headers": with_security(headers)}
            await self.forward(message)
            return
        await self.forward(message)
        if message["type"] == "http.response.body":
            self.bytes += len(message.get("body", b""))
            self.complete = not message.get("more_body", False)

    def log(self, scope: Scope) -> None:
        quiet = scope["path"] in PROBES and self.status is not None and self.status < 400
        level = logging.DEBUG if quiet else logging.INFO
        if self.status is not None and self.status >= 500:
            level = logging.WARNING
        if not _log.isEnabledFor(level):
            return
        fields = {
            "method": scope["method"],
            "path": scope["path"],
            "route": route_template(scope) or None,
            "status": self.status,
            "duration_ms": round(1000.0 * (time.perf_counter() - self.started), 3),
            "bytes": self.bytes,
            "owner": scope.get("state", {}).get("owner"),
            "cut": None if self.complete else True,
        }
        present = {name: value for name, value in fields.items() if value is not None}
        _log.log(level, "%s %s", scope["method"], self.status or "unanswered", extra=present)
