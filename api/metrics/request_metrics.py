"""Requests as they are answered: counted, timed, and by the reason of a refusal."""

import time

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.logs import route_template
from api.metrics.registry import Metrics


class RequestMetrics:
    """ASGI middleware that counts and times requests.

    A stream counts when it begins to answer, and stays in flight until it ends.
    """

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request; anything but HTTP goes through untouched."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = time.perf_counter()
        answered = False

        async def watched(message: Message) -> None:
            nonlocal answered
            if message["type"] == "http.response.start" and not answered:
                answered = True
                self._observe(scope, str(message["status"]), started)
            await send(message)

        with self.metrics.in_flight.track_inprogress():
            try:
                await self.app(scope, receive, watched)
            finally:
                if not answered:
                    self._observe(scope, "unanswered", started)

    def _observe(self, scope: Scope, status: str, started: float) -> None:
        elapsed = time.perf_counter() - started
        self.metrics.observe(scope["method"], route_template(scope), status, elapsed)
        reason = scope.get("state", {}).get("reason")
        if reason is not None:
            self.metrics.refused(status, reason)
