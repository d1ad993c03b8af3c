"""HTTP below the application: what can't be read as HTTP gets a problem as well."""

import json
import uuid
from typing import Any

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from api.problems.problem_document import MEDIA_TYPE, Problem, title_of

__all__ = ["LARGEST_HEAD_BYTES", "HttpProtocol"]

LARGEST_HEAD_BYTES = 64 * 2**10
"""Most that may come before the head of a request ends."""

_LINGER_S = 2.0
_DETAILS = {
    400: "this can't be read as HTTP/1.1",
    431: f"the request line and the headers are larger than {LARGEST_HEAD_BYTES} bytes",
}


class HttpProtocol(HttpToolsProtocol):
    """uvicorn's protocol: refuses with problems as the application does, and endless heads.

    WebSockets are not spoken; a request to change to them is answered like any other.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._in_head = True
        self._head_bytes = 0
        self._refused = False

    def data_received(self, data: bytes) -> None:
        """Take bytes from the client."""
        if self._refused:
            return
        if self._in_head:
            self._head_bytes += len(data)
        super().data_received(data)
        if self._in_head and self._head_bytes > LARGEST_HEAD_BYTES and not self._refused:
            self.logger.warning("head of a request too large")
            self._refuse(431)

    def on_headers_complete(self) -> None:
        """Begin with a request, whose head has ended."""
        self._in_head = False
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Expect the head of the next request."""
        self._in_head, self._head_bytes = True, 0
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:
        """Refuse what can't be read."""
        self._refuse(400)

    def _unsupported_upgrade_warning(self) -> None:
        """No warning: other protocols are left out on purpose."""

    def _refuse(self, status: int) -> None:
        """Answer with a problem, unless another answer is to come, and close the connection."""
        self._refused = True
        if self.transport.is_closing():
            return
        if self.pipeline:
            self.transport.close()
            return
        cycle = self.cycle
        under_way = cycle is not None and not cycle.response_complete
        if under_way and (cycle.response_started or not cycle.more_body):
            # what was asked before is answered, and is the last
            cycle.keep_alive = False
            return
        self.transport.write(_refusal(status))
        if not self.transport.can_write_eof():
            self.transport.close()
            return
        # closed while bytes still arrive, the connection would be reset and the answer lost
        self.transport.write_eof()
        self.loop.call_later(_LINGER_S, self.transport.close)


def _refusal(status: int) -> bytes:
    request_id = uuid.uuid4().hex
    problem = Problem(
        title=title_of(status), status=status, detail=_DETAILS[status], request_id=request_id
    )
    content = json.dumps(problem.model_dump(exclude_none=True)).encode()
    headers = {
        "content-type": MEDIA_TYPE,
        "content-length": str(len(content)),
        "x-request-id": request_id,
        "connection": "close",
    }
    lines = [f"{name}: {value}\r\n".encode() for name, value in headers.items()]
    return b"".join([STATUS_LINE[status], *lines, b"\r\n", content])
