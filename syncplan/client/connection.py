"""Requests to a service: repeated while it is unavailable or busy, problems raised as errors."""

import importlib.util
import json
import random
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from syncplan.errors import Fault, InputError, NoSolutionError, SyncplanError

if TYPE_CHECKING:
    from httpx2 import Response

_AGAIN = {429, 502, 503, 504}
_NOT_FOUND = 404
_LONGEST_WAIT_S = 5.0
_CONNECT_S = 10.0


class RemoteError(SyncplanError):
    """Raised if the service can't be reached, or refuses for a reason other than the request.

    `status` is the HTTP status; None if there was no answer.
    """

    def __init__(self, message: str, status: int | None = None) -> None:
        super().__init__(message)
        self.status = status


class Remote:
    """A connection to a service; arguments as in syncplan.client.service_client.Client."""

    def __init__(self, url: str, api_key: str | None, timeout_s: float, patience_s: float) -> None:
        if importlib.util.find_spec("httpx2") is None:
            raise InputError(
                "needs httpx2; install the extra: pip install 'syncplan[client]'",
                source="the client",
            )
        import httpx2

        headers = {"accept": "application/json"}
        if api_key is not None:
            if not (api_key.isascii() and api_key.isprintable()):
                raise InputError("must be printable ASCII characters", key="api_key")
            headers["authorization"] = f"Bearer {api_key}"
        timeout = httpx2.Timeout(timeout_s, connect=min(timeout_s, _CONNECT_S))
        try:
            self._http = httpx2.Client(base_url=url, headers=headers, timeout=timeout)
            address = self._http.base_url
        except (httpx2.InvalidURL, TypeError, ValueError) as error:
            raise InputError(f"{url!r}: {error}", key="url") from None
        if address.scheme not in ("http", "https") or not address.host:
            raise InputError(
                f"{url!r}: must begin with http:// or https:// and name a host", key="url"
            )
        # without the user name and password that the URL may hold
        self._shown = f"{address.scheme}://{address.netloc.decode()}"
        self._patience_s = patience_s

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def send(
        self,
        method: str,
        path: str,
        body: Mapping[str, Any] | bytes | None = None,
        parameters: Mapping[str, Any] | None = None,
        accept: str | None = None,
    ) -> "Response":
        """Return the answer to a request, repeated while the service is unavailable or busy.

        A mapping is sent as JSON, bytes unchanged. Raises InputError, NoSolutionError or
        RemoteError, depending on the problem.
        """
        import httpx2

        headers = {} if accept is None else {"accept": accept}
        if method == "POST":
            headers["idempotency-key"] = str(uuid4())
        content = None
        if isinstance(body, bytes):
            headers["content-type"] = "application/octet-stream"
            content = body
        elif body is not None:
            headers["content-type"] = "application/json"
            try:
                content = json.dumps(body, allow_nan=False).encode()
            except (TypeError, ValueError) as error:
                raise InputError(f"can't be sent as JSON: {error}", key="options") from None
        began, pause, repeated = time.monotonic(), 0.2, False
        while True:
            answer, fault, asked = None, "", 0.0
            try:
                answer = self._http.request(
                    method, path, content=content, params=parameters, headers=headers
                )
            except httpx2.RequestError as error:
                fault = f"{self._shown}: {error or type(error).__name__}"
            if answer is not None and answer.status_code not in _AGAIN:
                # already deleted: the answer to the first request was lost
                done = repeated and method == "DELETE" and answer.status_code == _NOT_FOUND
                return answer if done else _checked(answer)
            if answer is not None:
                asked = _seconds(answer.headers.get("retry-after"))
            wait = max(pause * (0.5 + random.random()), asked)
            if time.monotonic() - began + wait > self._patience_s:
                if answer is not None:
                    return _checked(answer)
                raise RemoteError(f"can't be reached: {fault}")
            time.sleep(wait)
            repeated = True
            pause = min(2.0 * pause, _LONGEST_WAIT_S)


def values_of(answer: "Response", key: str | None = "id") -> dict[str, Any]:
    """Return the JSON object of an answer; raises RemoteError if it is none or lacks the key."""
    try:
        values = answer.json()
    except ValueError:
        values = None
    if not isinstance(values, dict) or (key is not None and key not in values):
        raise RemoteError(f"{answer.url.path}: the answer is not one of syncplan's service")
    return values


def _checked(answer: "Response") -> "Response":
    """Return the answer; raise the error of a problem."""
    if answer.is_success:
        return answer
    try:
        problem = answer.json()
        detail = str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        problem, detail = {}, answer.text[:200]
    raise error_of(problem, f"{answer.status_code}: {detail}", answer.status_code)


def error_of(problem: Mapping[str, Any], message: str, status: int | None) -> SyncplanError:
    """Return the error to raise for a problem or for the failure of a job."""
    errors = problem.get("errors") or []
    if errors:
        return InputError.of(
            [Fault(one["path"], one["message"], str(one.get("value", ""))) for one in errors]
        )
    if problem.get("title") == "No solution":
        return NoSolutionError(message)
    return RemoteError(message, status)


def _seconds(text: str | None) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        return 0.0
