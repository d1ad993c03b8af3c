"""Requests: their media types, tasks computed while a client waits, and idempotent answers.

The service answers 406 and 415 where it can't serve a media type. A task waits its turn, has a time
limit and is given up when its client leaves. The same Idempotency-Key gets the same answer.
"""

import asyncio
import hashlib
import logging
import re
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypeVar

from fastapi import Depends, Header, Request, Response
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect

from api.computing.child import ChildGoneError, OutOfMemoryError, TooSlowError
from api.computing.turns import GivenUpError, OwnerBusyError, PoolFullError, Ticket
from api.problems import (
    STARTING,
    KeyReused,
    ServiceError,
    TooManyRequests,
    TooMuchWork,
    Unavailable,
)
from api.security import CurrentOwner
from api.service import Service, service_of
from api.storage.holdings import Answer, AnswerTakenError, find_answer, keep_answer
from api.storage.owner_bytes import excess

# --- media types ----------------------------------------------------------------------------------


_TOKEN = r"[!#$%&'*+.^_`|~0-9A-Za-z-]+"
_RANGE = re.compile(rf"({_TOKEN})/({_TOKEN})", re.ASCII)
_PARAMETER = re.compile(rf'({_TOKEN})=({_TOKEN}|"[^"]*")', re.ASCII)
_WEIGHT = re.compile(r"0(\.\d{0,3})?|1(\.0{0,3})?", re.ASCII)
_JSON = re.compile(rf"application/(json|{_TOKEN}\+json)", re.ASCII)
_YAML = {"application/yaml", "text/yaml", "application/x-yaml"}
_UTF8 = {"utf-8", "utf8", "us-ascii"}
ARCHIVES = (
    "application/zip",
    "application/x-tar",
    "application/gzip",
    "application/x-xz",
    "application/x-bzip2",
    "application/octet-stream",
)
"""Media types of archives; the kind of an archive is detected from its bytes."""

FILES = (
    "application/octet-stream",
    "application/vnd.google-earth.kml+xml",
    "application/vnd.google-earth.kmz",
    "application/geo+json",
    "application/gpx+xml",
    "application/json",
    "application/xml",
    "application/zip",
    "text/csv",
    "text/plain",
    "text/xml",
)
"""Media types of files of the field; the kind of a file is detected from its bytes."""

_ALLOWED = "the body must be application/json or application/yaml, in UTF-8"


def accepts(*media: str) -> Callable[[Request], Awaitable[str]]:
    """Return a dependency that picks the client's preferred one of `media`, the first of equals.

    It raises the problem 406 if the Accept header excludes them all; a header that can't be read
    accepts everything (RFC 9110, section 12.5.1).
    """

    async def chosen(request: Request) -> str:
        ranges = _ranges(",".join(request.headers.getlist("accept")))
        best = max(media, key=lambda medium: _weight(medium, ranges))
        if _weight(best, ranges) > 0.0:
            return best
        raise ServiceError(
            f"the Accept header excludes {' and '.join(media)}, all that this answer comes in",
            status=406,
        )

    return chosen


IN_JSON = [Depends(accepts("application/json"))]
"""Dependencies of a route that answers in JSON alone."""


def _ranges(header: str) -> dict[str, float]:
    """Weights by media range; `*/*` alone if the header is empty or can't be read."""
    found: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in header.split(","))):
        medium, *parameters = (piece.strip() for piece in part.split(";"))
        medium = medium.lower()
        named = _RANGE.fullmatch(medium)
        weight = _quality(parameters)
        if named is None or weight is None or (named[1] == "*" and named[2] != "*"):
            return {"*/*": 1.0}
        found[medium] = max(weight, found.get(medium, 0.0))
    return found or {"*/*": 1.0}


def _quality(parameters: list[str]) -> float | None:
    weight = 1.0
    for parameter in filter(None, parameters):
        named = _PARAMETER.fullmatch(parameter)
        if named is None:
            return None
        if named[1].lower() == "q":
            if not _WEIGHT.fullmatch(named[2]):
                return None
            weight = float(named[2])
    return weight


def _weight(medium: str, ranges: dict[str, float]) -> float:
    """Weight of a media type: that of the most specific range that contains it."""
    family = medium.partition("/")[0]
    for name in (medium, f"{family}/*", "*/*"):
        if name in ranges:
            return ranges[name]
    return 0.0


def body_kind(request: Request) -> Literal["json", "yaml"]:
    """Return the syntax of a request's body, from its Content-Type.

    Raises the problem 415 for anything but JSON and YAML in UTF-8. An empty body needs no type.
    """
    _check_coding(request)
    headers = request.headers
    given = headers.getlist("content-type")
    if not given or not given[0].strip():
        if headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers:
            return "json"
        raise _unsupported("no Content-Type", _ALLOWED)
    medium, *parameters = (piece.strip() for piece in given[0].split(";"))
    medium = medium.lower()
    is_json = _JSON.fullmatch(medium) is not None
    if len(given) > 1 or not (is_json or medium in _YAML):
        raise _unsupported(", ".join(given), _ALLOWED)
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "charset" and value.strip(' "').lower() not in _UTF8:
            raise _unsupported(given[0], _ALLOWED)
    return "json" if is_json else "yaml"


def check_medium(request: Request, media: Sequence[str], what: str) -> None:
    """Raise the problem 415 if the body of a request is not sent as one of `media`."""
    _check_coding(request)
    given = request.headers.getlist("content-type")
    medium = given[0].partition(";")[0].strip().lower() if len(given) == 1 else ""
    if medium not in media:
        accepted = ", ".join(media)
        allowed = f"the body must be {what}, sent as one of {accepted}"
        raise _unsupported(", ".join(given) or "no Content-Type", allowed, accepted)


def _check_coding(request: Request) -> None:
    coding = request.headers.get("content-encoding", "identity").strip().lower()
    if coding not in ("", "identity"):
        raise _unsupported(f"Content-Encoding {coding}", "the body must not be compressed")


def _unsupported(
    what: str, allowed: str, accepted: str = "application/json, application/yaml"
) -> ServiceError:
    return ServiceError(f"{what[:100]}: {allowed}", status=415, headers={"Accept": accepted})


# --- callers --------------------------------------------------------------------------------------


_RETRY_AFTER_S = 2.0

_logger = logging.getLogger("syncplan.calls")


@dataclass(frozen=True, slots=True)
class Caller:
    """An owner, and the request whose client waits for an answer."""

    request: Request
    owner: str

    @property
    def service(self) -> Service:
        """Service that received the request."""
        return service_of(self.request)


async def _caller(request: Request, owner: CurrentOwner) -> Caller:
    return Caller(request, owner)


CurrentCaller = Annotated[Caller, Depends(_caller)]
"""Parameter type of a route that runs a task."""


async def computed(caller: Caller, task: str, *arguments: Any) -> Any:
    """Return the result of a task in a child process, or raise its problem.

    The time limit starts here and includes the wait for a process. The body of the request, if any,
    must have been read. Once the client has gone, gives the task up and raises ClientDisconnect.
    """
    settings = caller.service.settings
    limit, pool = settings.plan_timeout_s, caller.service.pool
    # one that arrived before a process was ready waited for the start, whenever it ends
    crowded = "too many requests are being computed; try again" if pool.ready else STARTING
    try:
        ticket = pool.submit(task, *arguments, owner=caller.owner, deadline_s=limit)
        return await _while_present(caller.request, ticket)
    except OwnerBusyError:
        raise TooManyRequests(
            f"you have {settings.max_requests} requests in progress, the most allowed; wait until "
            "one is answered",
            retry_after_s=_RETRY_AFTER_S,
        ) from None
    except PoolFullError:
        raise Unavailable(crowded) from None
    except GivenUpError:
        raise Unavailable("the service is closing; try again") from None
    except TooSlowError:
        raise TooMuchWork(
            f"takes longer than the {limit:g} s a request may; ask for fewer vehicles or samples"
        ) from None
    except OutOfMemoryError:
        raise TooMuchWork(
            f"needs more than the {settings.task_memory / 2**20:.0f} MiB of memory a request may "
            "use; ask for fewer vehicles or samples"
        ) from None
    except ChildGoneError as error:
        _logger.error("the process computing %s ended twice: %s", task, error)
        raise TooMuchWork(
            "can't be computed: its process ended twice; ask for fewer vehicles or samples"
        ) from None


async def _while_present(request: Request, ticket: Ticket) -> Any:
    """Return a task's result; if the client leaves, give it up and raise ClientDisconnect."""
    answer = asyncio.wrap_future(ticket.future)
    gone = asyncio.create_task(_gone(request))
    try:
        await asyncio.wait({answer, gone}, return_when=asyncio.FIRST_COMPLETED)
        if not answer.done():
            gone.result()
            raise ClientDisconnect
        return answer.result()
    finally:
        gone.cancel()
        # gives the task up if it is not done
        answer.cancel()


async def _gone(request: Request) -> None:
    """Return once the client has gone; drop the unread rest of its body."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


# --- calls ----------------------------------------------------------------------------------------


T = TypeVar("T")

_LONG = 2**20

IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=255,
        pattern=r"^[\x21-\x7e]+$",
        description="Any name of your choice, such as a UUID: repeated with the same body, the "
        "request has no further effect and gets the same answer",
    ),
]


@dataclass(frozen=True, slots=True)
class Call(Caller):
    """A POST or PATCH request.

    Attributes
    ----------
    key : Idempotency-Key, if one was given
    digest : SHA-256 of method, path, query and body
    """

    body: bytes
    syntax: Literal["json", "yaml"]
    key: str | None
    digest: str


async def call_of(
    request: Request, owner: CurrentOwner, idempotency_key: IdempotencyKey = None
) -> Call:
    """Return a POST or PATCH request with its body, of any media type."""
    body = await request.body()
    digest = hashlib.sha256()
    for part in (request.method, request.url.path, request.url.query):
        digest.update(part.encode() + b"\n")
    if len(body) > _LONG:
        # takes as long as some requests do
        await run_in_threadpool(digest.update, body)
    else:
        digest.update(body)
    return Call(request, owner, body, "json", idempotency_key, digest.hexdigest())


EmptyCall = Annotated[Call, Depends(call_of)]
"""Parameter type of a route that takes no body and ignores one that is sent."""


async def _call(call: EmptyCall) -> Call:
    return replace(call, syntax=body_kind(call.request))


CurrentCall = Annotated[Call, Depends(_call)]
"""Parameter type of a route that takes a JSON or YAML body."""


async def answer_once(
    call: Call,
    compute: Callable[[], Awaitable[T]],
    store: Callable[[Connection, T], Answer],
    *,
    together: bool = False,
    adds: bool = True,
) -> Response:
    """Compute the result of a request, store it with its answer, and return the answer.

    A repeated Idempotency-Key gets the earlier answer; raises KeyReused if the key belongs to
    another request. With `together`, the results of several requests may be stored in one
    transaction; `store` must then meet no lock of others. Raises StorageFull if the owner would
    keep more bytes than allowed; unless the request `adds` any, only its answer is not kept then.
    """
    if call.key is not None:
        known = await run_in_threadpool(_known, call)
        if known is not None:
            return _response(known)

    def change(connection: Connection) -> Answer:
        answer = store(connection, value)
        full = excess(connection, call.owner, call.service.settings.max_owner_bytes)
        if full is not None and adds:
            raise full
        if full is None and call.key is not None:
            keep_answer(connection, call.owner, call.key, answer)
        return answer

    try:
        value = await compute()
        if together and call.key is None:
            return _response(await call.service.writer.write(change))
        return _response(await run_in_threadpool(call.service.database.write, change))
    except (AnswerTakenError, ServiceError):
        # what refuses this request may be the effect of an equal one
        known = None if call.key is None else await run_in_threadpool(_known, call)
        if known is None:
            raise
        return _response(known)


def _known(call: Call) -> Answer | None:
    assert call.key is not None
    known = call.service.database.read(find_answer, call.owner, call.key)
    if known is not None and known.request_digest != call.digest:
        raise KeyReused(
            f"Idempotency-Key {call.key!r} was used for another request; take a new one"
        )
    return known


def _response(answer: Answer) -> Response:
    return Response(
        answer.body, answer.status, headers=answer.headers, media_type="application/json"
    )
