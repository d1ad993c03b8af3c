"""A collector of OpenTelemetry spans: what servers and workers export to it over HTTP."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

__all__ = ["CollectedSpan", "SpanCollector", "collecting"]


@dataclass(frozen=True, slots=True)
class CollectedSpan:
    """A span as it came; `raw` is all that was sent of it."""

    name: str
    service: str
    trace_id: str
    parent_id: str
    attributes: Mapping[str, Any]
    failed: bool
    raw: str


class SpanCollector:
    """The spans that came so far, and where to send them."""

    def __init__(self) -> None:
        self.spans: list[CollectedSpan] = []
        self.endpoint = ""

    @property
    def settings(self) -> dict[str, str]:
        """The environment of a process that exports here, soon after each span."""
        return {
            "SYNCPLAN_TELEMETRY": "true",
            "OTEL_EXPORTER_OTLP_ENDPOINT": self.endpoint,
            "OTEL_SERVICE_NAME": "syncplan",
            "OTEL_BSP_SCHEDULE_DELAY": "200",
            "OTEL_METRICS_EXPORTER": "none",
            "OTEL_LOGS_EXPORTER": "none",
        }

    def take(self, body: bytes) -> None:
        """Take an export."""
        sent = ExportTraceServiceRequest()
        sent.ParseFromString(body)
        for group in sent.resource_spans:
            service = {one.key: one.value.string_value for one in group.resource.attributes}
            for scope in group.scope_spans:
                for span in scope.spans:
                    values = {
                        one.key: getattr(one.value, one.value.WhichOneof("value"))
                        for one in span.attributes
                    }
                    self.spans.append(
                        CollectedSpan(
                            name=span.name,
                            service=service["service.name"],
                            trace_id=span.trace_id.hex(),
                            parent_id=span.parent_span_id.hex(),
                            attributes=values,
                            failed=span.status.code == 2,
                            raw=str(span),
                        )
                    )


@contextmanager
def collecting() -> Iterator[SpanCollector]:
    """A collector on a loopback port, closed at the end."""
    collector = SpanCollector()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            if self.path == "/v1/traces":
                collector.take(body)
            self.send_response(200)
            self.send_header("content-length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Nothing on standard error."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    collector.endpoint = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield collector
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
