"""A collector of OpenTelemetry spans: what servers and workers export to it over HTTP."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from opentelemetry.proto.trace.v1.trace_pb2 import ResourceSpans, Span

__all__ = ["SpanCollector", "attributes_of", "collecting"]


class SpanCollector(ThreadingHTTPServer):
    """The exports that came so far, by the service that sent them."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.taken: list[ResourceSpans] = []

    @property
    def spans(self) -> list[Span]:
        """All spans."""
        return [span for one in self.taken for scope in one.scope_spans for span in scope.spans]

    @property
    def settings(self) -> dict[str, str]:
        """The environment of a process that exports here, soon after each span."""
        return {
            "SYNCPLAN_TELEMETRY": "true",
            "OTEL_EXPORTER_OTLP_ENDPOINT": f"http://127.0.0.1:{self.server_address[1]}",
            "OTEL_SERVICE_NAME": "syncplan",
            "OTEL_BSP_SCHEDULE_DELAY": "200",
            "OTEL_METRICS_EXPORTER": "none",
            "OTEL_LOGS_EXPORTER": "none",
        }


class _Handler(BaseHTTPRequestHandler):
    server: SpanCollector

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["content-length"]))
        if self.path == "/v1/traces":
            self.server.taken += ExportTraceServiceRequest.FromString(body).resource_spans
        self.send_response(200)
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing on standard error."""


def attributes_of(of: Any) -> dict[str, str]:
    """Return the attributes of a span, or of the service that sent it, that are text."""
    return {one.key: one.value.string_value for one in of.attributes}


@contextmanager
def collecting() -> Iterator[SpanCollector]:
    """A collector on a loopback port, closed at the end."""
    with SpanCollector() as collector:
        thread = threading.Thread(target=collector.serve_forever)
        thread.start()
        try:
            yield collector
        finally:
            collector.shutdown()
            thread.join()
