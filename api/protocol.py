"""HTTP below the application: unreadable, endless and slow requests get a problem.

    connected -> head -> body -> answering -> idle -> head ...
                 10 s    30 s                 5 s          (the settings say otherwise)

A connection states when it is due. The server looks a few times a second and then calls `expire`.
"""

import json
import uuid
from collections.abc import Sized
from dataclasses import dataclass
from typing import Any

import httptools
from uvicorn.protocols.http.flow_control import HIGH_WATER_LIMIT, FlowControl
from uvicorn.protocols.http.httptools_impl import (
    STATUS_LINE,
    HttpToolsProtocol,
    RequestResponseCycle,
)

from api.answering import with_security
from api.connections import NEVER, ConnectionLimits, Connections
from api.problems import MEDIA_TYPE, problem_document
from api.security import network_of

# --- refusals -------------------------------------------------------------------------------------


LARGEST_HEAD_BYTES = 64 * 2**10
"""Most bytes of a request before its head ends."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Reason for closing a connection, with the status and the sentence of the answer.

    Attributes
    ----------
    reason : word for counts and logs
    retry_after_s : s, after which another try may succeed
    """

    reason: str
    status: int
    detail: str
    retry_after_s: int | None = None

    def as_bytes(self) -> bytes:
        """Return the whole answer, a problem document with its own request id."""
        request_id = uuid.uuid4().hex
        document = problem_document(self.status, self.detail, request_id)
        content = json.dumps(document).encode()
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


def late(part: str, limit_s: float) -> Refusal:
    """Return the refusal of the head or the body of a request that took too long."""
    return Refusal(
        f"late-{part}", 408, f"the {part} of the request did not arrive within {limit_s:g} s"
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


# --- the protocol ---------------------------------------------------------------------------------


PROBES = frozenset({b"/healthz", b"/readyz"})
"""Paths that are answered for connections in the reserve as well."""

_RESERVE_S = 1.0
_LINGER_S = 2.0
_MOST_PIPELINED = 64
_SLICE_BYTES = 8 * 2**10
"""Bytes parsed between two checks of how many requests wait."""
_FRAMING_PER_BYTE = 8
"""Most bytes of framing for each byte of a chunked body, in the long run."""
_LEAST_READ = HIGH_WATER_LIMIT
"""Bytes of an answer that its client has to read within the time limit."""


class _RefusedError(Exception):
    """Error that stops the parser; the refusal is in `_fault`."""


class _Flow(FlowControl):
    """Flow control that reads on only when no request waits, so that one read at most is held."""

    def __init__(self, transport: Any, waiting: Sized) -> None:
        super().__init__(transport)
        self._waiting = waiting

    def resume_reading(self) -> None:
        if not self._waiting:
            super().resume_reading()


class HttpProtocol(HttpToolsProtocol):
    """uvicorn's protocol with time limits, which refuses with problems as the application does.

    Connections are counted in `connections`, which also holds their limits. WebSockets are not
    supported; a request to upgrade to them is answered like any other.
    """

    def __init__(self, *arguments: Any, connections: Connections, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.counted = connections
        self.limits = self.counted.limits
        self.network = ""
        self._admitted = True
        self._now = 0.0
        self._in_head = True
        self._head_bytes = 0
        # bytes that the framing of a body may still take
        self._spare = LARGEST_HEAD_BYTES
        self._held = b""
        # uvicorn's `cycle` is the last one parsed
        self._running: RequestResponseCycle | None = None
        self._fault: Refusal | None = None
        self._refused = False
        self.due = NEVER
        self._body_due = NEVER
        self.stalled_due = NEVER
        self._unread = 0

    @property
    def engaged(self) -> bool:
        """Whether a completely received request is being answered."""
        return self._answering() and self._in_head

    def connection_made(self, transport: Any) -> None:
        """Admit a new connection, or put it into the reserve."""
        super().connection_made(transport)
        self.flow = _Flow(transport, self.pipeline)
        self.network = network_of(self._address())
        self._admitted = self.counted.enter(self)
        self.due = self.loop.time() + (self.limits.head_s if self._admitted else _RESERVE_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self.counted.leave(self)
        self._abandon()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take bytes from the client."""
        if self._held:
            self._held += data
            return
        for start in range(0, len(data), _SLICE_BYTES):
            if len(self.pipeline) >= _MOST_PIPELINED:
                # reading is paused, so this is all there is until requests are answered
                self._held = data[start:]
                return
            if not self._refused:
                self._parse(data[start : start + _SLICE_BYTES])

    def _parse(self, data: bytes) -> None:
        self._now = self.loop.time()
        if self._in_head:
            if not self._head_bytes and self._admitted and not self._answering():
                self.due = self._now + self.limits.head_s
            self._head_bytes += len(data)
        else:
            self._spare -= len(data)
        try:
            self.parser.feed_data(data)
        except httptools.HttpParserUpgrade:
            pass
        except httptools.HttpParserError:
            self._refuse(self._fault or UNREADABLE)
            return
        if self._in_head and self._head_bytes > LARGEST_HEAD_BYTES:
            self._refuse(LARGE_HEAD)
        elif not self._in_head and self._spare < 0:
            self._refuse(LARGE_FRAMING)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header; ignore those after the body."""
        if self._in_head:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Begin a request whose head has ended."""
        if not self._admitted:
            self._admitted = self.counted.promote(self)
        if not self._admitted and self.url.partition(b"?")[0] not in PROBES:
            self._fault = crowd(self.limits)
            raise _RefusedError
        super().on_headers_complete()
        if not self._admitted:
            self.cycle.keep_alive = False
        self._in_head, self._spare = False, LARGEST_HEAD_BYTES
        self.due = self._body_due = self._now + self.limits.body_s

    def on_body(self, body: bytes) -> None:
        """Take a part of a body."""
        self._spare = min(LARGEST_HEAD_BYTES, self._spare + (1 + _FRAMING_PER_BYTE) * len(body))
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Expect the head of the next request."""
        self._in_head, self._head_bytes = True, 0
        super().on_message_complete()
        self._expect_more(self._now)

    def on_response_complete(self) -> None:
        """Continue with the next request, if there is one.

        Same as uvicorn's method, without its timer.
        """
        self.server_state.total_requests += 1
        if self.transport.is_closing():
            self.due = self.loop.time() + self.limits.answer_s
            return
        if self.pipeline:
            cycle, app = self.pipeline.pop()
            self._start_asgi_task(cycle, app)
        if self._held:
            held, self._held = self._held, b""
            self.data_received(held)
        self.flow.resume_reading()
        self._expect_more(self.loop.time())

    def pause_writing(self) -> None:
        """Set the time by which the client must have read a part of its answer."""
        self._unread = self.transport.get_write_buffer_size()
        self.stalled_due = self.loop.time() + self.limits.answer_s
        super().pause_writing()

    def resume_writing(self) -> None:
        """Clear the time limit on reading, since the client reads."""
        self.stalled_due = NEVER
        super().resume_writing()

    def expire(self, now: float) -> None:
        """End the connection if it is due by `now`, in s of the loop's clock."""
        if self.stalled_due <= now and self._stalls(now):
            self.counted.refused("unread", "a client does not read its answer", self._address())
            self._abort()
            return
        if self.due > now:
            return
        if self._refused or self.transport.is_closing():
            self._abort()
        elif not self._in_head and self.flow.read_paused:
            # the service itself does not read on
            self.due = self._body_due = now + self.limits.body_s
        elif not self._in_head:
            self._refuse(late("body", self.limits.body_s))
        elif not self._admitted:
            self._refuse(crowd(self.limits))
        elif self._head_bytes:
            self._refuse(late("head", self.limits.head_s))
        else:
            self._close(now)

    def turn_away(self) -> None:
        """Answer that there is no room, unless already refused, and close."""
        if self._refused:
            self._abort()
        else:
            self._refuse(crowd(self.limits), linger=False)

    def shutdown(self) -> None:
        """End with the server: at once, unless a completely received request is being answered."""
        if self._answering() and (self.cycle.response_started or not self.cycle.more_body):
            self.cycle.keep_alive = False
        elif self._answering():
            self._refuse(ENDING, linger=False)
        else:
            self.transport.close()

    def send_400_response(self, msg: str) -> None:
        """Refuse an unreadable request."""
        self._refuse(UNREADABLE)

    def _unsupported_upgrade_warning(self) -> None:
        """No warning: other protocols are left out on purpose."""

    def _address(self) -> str:
        return self.client[0] if self.client else ""

    def _answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _expect_more(self, now: float) -> None:
        """Set the due time after a request or an answer has ended."""
        if not self._in_head:
            self.due = self._body_due
        elif self._answering():
            self.due = NEVER
        else:
            self.due = now + (self.limits.head_s if self._head_bytes else self.limits.idle_s)

    def _stalls(self, now: float) -> bool:
        """Whether the client has read too little; otherwise it has as long again for more."""
        unread = self.transport.get_write_buffer_size()
        stalls = unread > self._unread - _LEAST_READ
        self._unread, self.stalled_due = unread, now + self.limits.answer_s
        return stalls

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        self._running = cycle
        super()._start_asgi_task(cycle, app)

    def _abandon(self) -> None:
        """Notify the application that nobody waits for its answers; begin no more requests."""
        for cycle in (self._running, *(one for one, _ in self.pipeline)):
            if cycle is not None and not cycle.response_complete:
                cycle.disconnected = True
                cycle.message_event.set()
        self.pipeline.clear()

    def _abort(self) -> None:
        self._abandon()
        self.transport.abort()

    def _close(self, now: float) -> None:
        """Close; a client that does not read the end of an answer is cut off later."""
        self.due = now + self.limits.answer_s
        self.transport.close()

    def _refuse(self, refusal: Refusal, *, linger: bool = True) -> None:
        """Answer with a problem, unless another answer is due, and close the connection."""
        self._refused = True
        now = self.loop.time()
        self.due = now + _LINGER_S
        if refusal is not ENDING:
            self.counted.refused(refusal.reason, refusal.detail, self._address())
        if self.transport.is_closing():
            return
        cycle = self.cycle
        if self._answering():
            if not self.pipeline and not cycle.more_body:
                # the request before is still answered, as the last one
                cycle.keep_alive, self.due = False, NEVER
                return
            self._abandon()
            if cycle.response_started or cycle is not self._running:
                self._close(now)
                return
        elif not self._in_head:
            # it has been answered, and only its body is at fault
            self._close(now)
            return
        self.transport.write(refusal.as_bytes())
        if not linger or not self.transport.can_write_eof():
            self.transport.close()
            return
        # closing while bytes still arrive would reset the connection and lose the answer
        self.transport.write_eof()
        self.loop.call_later(_LINGER_S, self.transport.close)
