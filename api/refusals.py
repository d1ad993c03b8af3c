"""What is answered below the application: a problem for what can't be read, or comes too late."""

import json
import uuid
from dataclasses import dataclass

from uvicorn.protocols.http.httptools_impl import STATUS_LINE

from api.connections import ConnectionLimits
from api.problems.problem_document import MEDIA_TYPE, Problem, title_of
from api.security_headers import with_security

LARGEST_HEAD_BYTES = 64 * 2**10
"""Most that may come before the head of a request ends."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a connection is closed: the status and the sentence to answer with.

    Attributes
    ----------
    reason : a word for counts and logs
    retry_after_s : s, after which another try may go well
    """

    reason: str
    status: int
    detail: str
    retry_after_s: int | None = None

    def as_bytes(self) -> bytes:
        """Return the whole answer, a problem document with a request id of its own."""
        request_id = uuid.uuid4().hex
        problem = Problem(
            title=title_of(self.status),
            status=self.status,
            detail=self.detail,
            request_id=request_id,
        )
        content = json.dumps(problem.model_dump(exclude_none=True)).encode()
        headers = [
            (b"content-type", MEDIA_TYPE.encode()),
            (b"content-length", str(len(content)).encode()),
            (b"x-request-id", request_id.encode()),
            (b"connection", b"close"),
        ]
        if self.retry_after_s is not None:
            headers.append((b"retry-after", str(self.retry_after_s).encode()))
        lines = [b"%b: %b\r\n" % pair for pair in with_security(headers)]
        return b"".join([STATUS_LINE[self.status], *lines, b"\r\n", content])


UNREADABLE = Refusal("unreadable", 400, "this can't be read as HTTP/1.1")
LARGE_HEAD = Refusal(
    "large-head",
    431,
    f"the request line and the headers are larger than {LARGEST_HEAD_BYTES} bytes",
)
LARGE_FRAMING = Refusal(
    "large-framing",
    431,
    f"sizes, extensions and trailers of chunks are more than {LARGEST_HEAD_BYTES} bytes beyond "
    "their share of the body",
)
ENDING = Refusal("ending", 503, "the service is about to end; try again", retry_after_s=2)


def late_head(limits: ConnectionLimits) -> Refusal:
    """Return the refusal of a head that took too long."""
    return Refusal(
        "late-head", 408, f"the head of the request did not arrive within {limits.head_s:g} s"
    )


def late_body(limits: ConnectionLimits) -> Refusal:
    """Return the refusal of a body that took too long."""
    return Refusal(
        "late-body", 408, f"the body of the request did not arrive within {limits.body_s:g} s"
    )


def crowd(limits: ConnectionLimits) -> Refusal:
    """Return the refusal of a connection beyond the limits."""
    return Refusal(
        "connections",
        503,
        f"there are too many connections, {limits.total} in all or {limits.per_address} of your "
        "address; close some, or try again later",
        retry_after_s=1,
    )
