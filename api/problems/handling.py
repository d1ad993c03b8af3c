"""Every failed request is answered with a problem document; the trace goes to the log alone."""

import json
import logging
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.logs import current_request_id, route_template
from api.problems.openapi_problems import document_problems
from api.problems.problem_document import MEDIA_TYPE, Problem, printable, title_of
from api.problems.table import TABLE, FailedRequest, Logged, failure_of

_MOST_DIGITS = 18
"""Digits of a length beyond any limit, and short enough to be read."""

_log = logging.getLogger("api.problems")


def install_handlers(
    app: FastAPI, body_limit_bytes: int, larger: Mapping[str, int] | None = None
) -> None:
    """Let `app` answer every failure with a problem document, and document them.

    Call it before other middleware is added. It limits bodies, those at the paths of `larger` to
    the figures there; FastAPI's own `max_body_size` answers in plain text.
    """
    for kind in TABLE:
        if kind is not Exception:
            app.add_exception_handler(kind, _answered)
    # what fails outside Answered: the server logs it
    app.add_exception_handler(Exception, _unlogged)
    app.add_middleware(Answered, body_limit_bytes=body_limit_bytes, larger=larger or {})
    document_problems(app)


class Answered:
    """ASGI middleware that lets no exception escape and no body exceed the limit."""

    def __init__(self, app: ASGIApp, body_limit_bytes: int, larger: Mapping[str, int]) -> None:
        self.app = app
        self.limit = body_limit_bytes
        self.larger = larger

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, whatever happens inside."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = False

        async def watched(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            limit = self.larger.get(scope["path"], self.limit)
            self._check_announced(scope, limit)
            await self.app(scope, self._limited(receive, limit), watched)
        except Exception as error:
            if started:
                # the server sees an answer without its end and closes the connection
                _log.error("answer cut short: %s", type(error).__name__, exc_info=error)
                return
            response = await _answered(Request(scope), error)
            await response(scope, receive, send)

    def _check_announced(self, scope: Scope, limit: int) -> None:
        length = Headers(scope=scope).get("content-length", "")
        if not length.isdecimal():
            return
        if len(length) > _MOST_DIGITS or int(length) > limit:
            raise self._too_large(limit)

    def _limited(self, receive: Receive, limit: int) -> Receive:
        size = 0

        async def limited() -> Message:
            nonlocal size
            message = await receive()
            if message["type"] == "http.request":
                size += len(message.get("body", b""))
                if size > limit:
                    raise self._too_large(limit)
            return message

        return limited

    @staticmethod
    def _too_large(limit: int) -> HTTPException:
        # an HTTPException goes through the reading of bodies untouched
        return HTTPException(413, f"the body is larger than {limit} bytes")


async def _answered(request: Request, error: Exception) -> Response:
    failure = failure_of(error)
    if failure.logged is Logged.TRACE:
        _log.error("unforeseen: %s", type(error).__name__, exc_info=error)
    elif failure.logged is Logged.LINE:
        cause = printable(str(getattr(error, "orig", None) or error))
        _log.warning("%s: %s", type(error).__name__, cause)
    return _response(request, failure)


async def _unlogged(request: Request, error: Exception) -> Response:
    return _response(request, failure_of(error))


def _response(request: Request, failure: FailedRequest) -> Response:
    headers = failure.headers
    if failure.status >= 400:
        # for the metrics, which stand around the application
        request.scope.setdefault("state", {})["reason"] = failure.reason
    if failure.status in (204, 304):
        return Response(status_code=failure.status, headers=headers)
    if failure.status == 405:
        headers = {**headers, "Allow": ", ".join(_methods(request))}
    problem = Problem(
        type=failure.type,
        title=failure.title or title_of(failure.status),
        status=failure.status,
        detail=printable(failure.detail),
        instance=quote(request.url.path),
        errors=list(failure.errors) or None,
        request_id=_request_id(request.scope),
    )
    # in ASCII: a fault may hold what UTF-8 can't
    content = json.dumps(problem.model_dump(exclude_none=True)).encode()
    return Response(content, failure.status, headers=headers, media_type=MEDIA_TYPE)


def _request_id(scope: Mapping[str, Any]) -> str:
    return current_request_id() or str(scope.get("state", {}).get("request_id", ""))


def _methods(request: Request) -> list[str]:
    """Every method of the path; a route on its own knows only those it was declared with."""
    template = route_template(request.scope)
    found: set[str] = set()
    for context in iter_route_contexts(request.app.routes):
        if context.path_format == template:
            found |= context.methods or set()
    return sorted(found)
