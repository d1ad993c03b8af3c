"""POST requests: their body, who asks, and the same answer for the same Idempotency-Key."""

import hashlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Annotated, Literal, TypeVar

from fastapi import Depends, Header, Request, Response
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool

from api.callers import Caller, CurrentCaller
from api.negotiation import body_kind
from api.problems import KeyReused
from api.service import Service
from api.storage.kept_answers import Answer, AnswerTakenError, find_answer, keep_answer

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
class Call:
    """A POST request.

    Attributes
    ----------
    key : Idempotency-Key, if one was given
    digest : of all that makes two requests the same
    """

    caller: Caller
    body: bytes
    syntax: Literal["json", "yaml"]
    key: str | None
    digest: str

    @property
    def service(self) -> Service:
        """The service that is asked."""
        return self.caller.service

    @property
    def owner(self) -> str:
        """Whose request it is."""
        return self.caller.owner


async def call_of(
    request: Request,
    caller: CurrentCaller,
    idempotency_key: IdempotencyKey = None,
) -> Call:
    """Return a POST request with its body, whatever that holds."""
    body = await request.body()
    digest = hashlib.sha256()
    for part in (request.method, request.url.path, request.url.query):
        digest.update(part.encode() + b"\n")
    if len(body) > _LONG:
        # for as long as some requests take
        await run_in_threadpool(digest.update, body)
    else:
        digest.update(body)
    return Call(caller, body, "json", idempotency_key, digest.hexdigest())


EmptyCall = Annotated[Call, Depends(call_of)]
"""Parameter type of a route that takes no body: one that is sent is ignored."""


async def _call(request: Request, call: EmptyCall) -> Call:
    return replace(call, syntax=body_kind(request))


CurrentCall = Annotated[Call, Depends(_call)]
"""Parameter type of a route that takes a body, JSON or YAML."""


async def answer_once(
    call: Call,
    compute: Callable[[], Awaitable[T]],
    store: Callable[[Connection, T], Answer],
    *,
    together: bool = False,
) -> Response:
    """Return the answer to a request: compute, then store result and answer together.

    With an Idempotency-Key that was answered before, that answer. Raises KeyReused where it was
    given to another request. Where `store` meets no lock of others, `together` stores the results
    of several requests in one transaction.
    """
    if call.key is not None:
        known = await run_in_threadpool(_known, call)
        if known is not None:
            return _response(known)
    value = await compute()
    if together and call.key is None:
        return _response(await call.service.writer.write(lambda open_: store(open_, value)))
    return _response(await run_in_threadpool(_stored, call, value, store))


def _known(call: Call) -> Answer | None:
    assert call.key is not None
    with call.service.database.reading() as connection:
        known = find_answer(connection, call.owner, call.key)
    if known is not None and known.request_digest != call.digest:
        raise KeyReused(
            f"Idempotency-Key {call.key!r} was used for another request; take a new one"
        )
    return known


def _stored(call: Call, value: T, store: Callable[[Connection, T], Answer]) -> Answer:
    try:
        with call.service.database.writing() as connection:
            answer = store(connection, value)
            if call.key is not None:
                keep_answer(connection, call.owner, call.key, answer)
            return answer
    except AnswerTakenError:
        known = _known(call)
        assert known is not None
        return known


def _response(answer: Answer) -> Response:
    return Response(
        answer.body, answer.status, headers=answer.headers, media_type="application/json"
    )
