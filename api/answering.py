"""Outermost middleware, which answers, limits, logs and counts every request.

    request id --> size of the body --> the application --> headers, counts, a line
                                             |                        |
                                   any exception: a problem    unread answers: in pieces

One middleware that passes on every message replaces three. FastAPI's `max_body_size` answers in
plain text, not with a problem (tests/service/test_problems.py).
"""

import logging
import re
import time
import uuid
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from fastapi import FastAPI
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.failures import TABLE, answer_to, failure_of, problem_answer, route_template
from api.logs import REQUEST_ID
from api.metrics import Metrics
from api.problems import UnreadAnswers

REQUEST_LOGGER = "api.requests"
PROBES = frozenset({"/healthz", "/readyz", "/metrics"})
"""Paths that machines poll: logged only at level debug while they succeed."""

PIECE_BYTES = 64 * 2**10
"""Bytes of an answer passed on at a time; a larger one counts as unread until its last piece."""
MOST_UNREAD_OF_OWNER = 64 * 2**20
"""Most bytes of large answers that an owner has asked for and not read; one may be larger."""
MOST_UNREAD = 512 * 2**20
"""Most of all owners together, beside the first of each."""
_RETRY_AFTER_S = 5.0

_ID_HEADER = b"x-request-id"
_SANE = re.compile(r"[A-Za-z0-9._-]{1,64}")
_MOST_DIGITS = 18
"""Most digits of a Content-Length that is parsed; a longer one exceeds any limit."""

_log = logging.getLogger(REQUEST_LOGGER)
_failures = logging.getLogger("api.problems")


# --- headers of every answer ----------------------------------------------------------------------


HeaderPair = tuple[bytes, bytes]

ALWAYS: tuple[HeaderPair, ...] = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), geolocation=(), microphone=(), payment=(), usb=()"),
)
"""Headers of every answer; Strict-Transport-Security is left to the proxy that speaks TLS."""

UNLESS_GIVEN: tuple[HeaderPair, ...] = (
    (b"cache-control", b"private, no-cache"),
    (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'"),
)
"""Defaults for headers that an answer does not set: nothing is run, framed or kept by proxies."""

OF_DOCUMENTS = frozenset(
    (b"cross-origin-opener-policy", b"permissions-policy", b"content-security-policy")
)
"""Headers that scripts and styles do without, as the page's own apply to them; there are many."""

_PARTS_OF_DOCUMENTS = (b"text/javascript", b"text/css")


def with_security(headers: Iterable[HeaderPair]) -> list[HeaderPair]:
    """Return the headers of an answer, names in lower case, with the security headers added."""
    own = list(headers)
    given = dict(own)
    every = [*own, *ALWAYS, *(pair for pair in UNLESS_GIVEN if pair[0] not in given)]
    if given.get(b"content-type", b"").startswith(_PARTS_OF_DOCUMENTS):
        return [pair for pair in every if pair[0] not in OF_DOCUMENTS]
    return every


# --- the middleware -------------------------------------------------------------------------------


def answer_requests(
    app: FastAPI,
    metrics: Metrics,
    body_limit_bytes: int,
    larger: Mapping[str, int] | None = None,
) -> None:
    """Make `app` answer every failure with a problem, and log and count all its answers.

    Call it after other middleware is added. Bodies are limited to `body_limit_bytes`, or at the
    paths in `larger` to the values there.
    """
    for kind in TABLE:
        if kind is not Exception:
            app.add_exception_handler(kind, answer_to)
    # failures outside the middleware, which the server logs
    app.add_exception_handler(Exception, _unlogged)
    app.add_middleware(
        Answering, metrics=metrics, body_limit_bytes=body_limit_bytes, larger=larger or {}
    )


async def _unlogged(request: Request, error: Exception) -> Response:
    return problem_answer(request, failure_of(error))


@dataclass(frozen=True, slots=True)
class Answering:
    """Outermost ASGI middleware: no exception escapes it and no body exceeds its limit.

    A sane X-Request-ID of the client is kept. The answer carries the id under the same name, and
    the headers above. A line is logged when the request ends. The request is counted when its
    answer begins; a stream stays in flight until it ends.
    """

    app: ASGIApp
    metrics: Metrics
    body_limit_bytes: int
    larger: Mapping[str, int]
    unread: Counter[str] = field(default_factory=Counter)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, whatever happens inside; pass on anything but HTTP untouched."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _SANE.fullmatch(given) else uuid.uuid4().hex
        scope.setdefault("state", {})["request_id"] = request_id
        token = REQUEST_ID.set(request_id)
        limit = self.larger.get(scope["path"], self.body_limit_bytes)
        exchange = _Exchange(
            scope, receive, send, self.metrics, request_id.encode(), limit, self.unread
        )
        with self.metrics.in_flight.track_inprogress():
            try:
                await exchange.run(self.app)
            finally:
                exchange.over()
                REQUEST_ID.reset(token)


@dataclass(slots=True, eq=False)
class _Exchange:
    """A request and its answer as they pass through."""

    scope: Scope
    _receive: Receive
    _send: Send
    _metrics: Metrics
    _request_id: bytes
    _limit: int
    _unread: Counter[str]
    _started: float = field(default_factory=time.perf_counter)
    _taken: int = 0
    _status: int | None = None
    _sent: int = 0
    _complete: bool = False
    _held: int = 0

    async def run(self, app: ASGIApp) -> None:
        """Send the application's answer, or a problem if it fails."""
        try:
            self._check_announced()
            await app(self.scope, self.receive, self.send)
        except Exception as error:
            if self._status is not None:
                # the server sees an answer without its end and closes the connection
                _failures.error("answer cut short: %s", type(error).__name__, exc_info=error)
                return
            # Starlette takes an answer that `send` refuses for begun, and wraps the error
            cause = error.__cause__ if isinstance(error.__cause__, UnreadAnswers) else error
            response = await answer_to(Request(self.scope), cause)
            # or the error, through its trace, would keep itself and the refused answer
            del cause
            await response(self.scope, self._receive, self.send)

    async def receive(self) -> Message:
        message = await self._receive()
        if message["type"] == "http.request":
            self._taken += len(message.get("body", b""))
            if self._taken > self._limit:
                raise self._too_large()
        return message

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = [pair for pair in message.get("headers", ()) if pair[0] != _ID_HEADER]
            self._hold(int(dict(headers).get(b"content-length", 0)))
            self._status = message["status"]
            self._count(str(self._status))
            headers.append((_ID_HEADER, self._request_id))
            message = {**message, "headers": with_security(headers)}
        body = message.get("body", b"")
        last = max(0, len(body) - 1) // PIECE_BYTES * PIECE_BYTES
        # pieces of an owner's answer are copied: one that waits would keep the whole
        parts = body if self._held or not last else memoryview(body)
        for start in range(0, last, PIECE_BYTES):
            piece = parts[start : start + PIECE_BYTES]
            await self._send({**message, "body": piece, "more_body": True})
        await self._send({**message, "body": parts[last:]} if last else message)
        if message["type"] == "http.response.body":
            self._sent += len(body)
            self._complete = not message.get("more_body", False)

    def over(self) -> None:
        """Log the request, count it if nothing was answered, and forget its unread answer."""
        scope, status = self.scope, self._status
        if self._held:
            self._unread[scope["state"]["owner"]] -= self._held
        if status is None:
            self._count("unanswered")
        quiet = scope["path"] in PROBES and status is not None and status < 400
        level = logging.DEBUG if quiet else logging.INFO
        if status is not None and status >= 500:
            level = logging.WARNING
        if not _log.isEnabledFor(level):
            return
        fields = {
            "method": scope["method"],
            "path": scope["path"],
            "route": route_template(scope) or None,
            "status": status,
            "duration_ms": round(1000.0 * (time.perf_counter() - self._started), 3),
            "bytes": self._sent,
            "owner": scope.get("state", {}).get("owner"),
            "cut": None if self._complete else True,
        }
        present = {name: value for name, value in fields.items() if value is not None}
        _log.log(level, "%s %s", scope["method"], status or "unanswered", extra=present)

    def _count(self, status: str) -> None:
        elapsed = time.perf_counter() - self._started
        self._metrics.observe(self.scope["method"], route_template(self.scope), status, elapsed)
        reason = self.scope.get("state", {}).get("reason")
        if reason is not None:
            self._metrics.refused(status, reason)

    def _hold(self, size: int) -> None:
        """Count a large answer as unread; raises UnreadAnswers, though never for an owner's first.

        Answers without an owner are the same for all and take no memory of their own.
        """
        owner = self.scope["state"].get("owner")
        if owner is None or size <= PIECE_BYTES:
            return
        of_owner, of_all = self._unread[owner], self._unread.total()
        if of_owner and (of_owner + size > MOST_UNREAD_OF_OWNER or of_all + size > MOST_UNREAD):
            raise UnreadAnswers(
                f"{of_owner / 2**20:.1f} MiB of your answers are unread, {of_all / 2**20:.1f} of "
                f"all; this one of {size / 2**20:.1f} is too much: allowed are "
                f"{MOST_UNREAD_OF_OWNER / 2**20:g} and {MOST_UNREAD / 2**20:g}; read them first",
                retry_after_s=_RETRY_AFTER_S,
            )
        self._unread[owner] += size
        self._held = size

    def _check_announced(self) -> None:
        length = Headers(scope=self.scope).get("content-length", "")
        if not length.isdecimal():
            return
        if len(length) > _MOST_DIGITS or int(length) > self._limit:
            raise self._too_large()

    def _too_large(self) -> HTTPException:
        # FastAPI lets an HTTPException through while it reads a body
        return HTTPException(413, f"the body is larger than {self._limit} bytes")
