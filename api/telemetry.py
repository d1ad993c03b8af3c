"""OpenTelemetry, off unless the settings ask for it: FastAPI's support, and spans of jobs.

Spans of a job and its parts belong to the trace of the request that submitted the job. They state
the job's kind and outcome, never its contents or its owner. Without an exporter nothing is
recorded.
"""

import importlib.util
import logging
import os
import threading
from collections.abc import Callable, Mapping
from datetime import datetime
from uuid import UUID

from fastapi.telemetry import TelemetryConfig
from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.trace import NonRecordingSpan, SpanContext, StatusCode, TraceFlags
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator
from opentelemetry.util.types import AttributeValue

from api.answering import PROBES
from api.settings import Settings
from syncplan.errors import InputError

# --- spans of jobs --------------------------------------------------------------------------------


_FORM = TraceContextTextMapPropagator()
_LOW_64 = 2**64 - 1


def current_traceparent() -> str | None:
    """Return the current span in the form of W3C Trace Context; None outside of a trace."""
    carrier: dict[str, str] = {}
    _FORM.inject(carrier)
    return carrier.get("traceparent")


def spans_wanted() -> bool:
    """Return whether anything records spans."""
    return not isinstance(trace.get_tracer_provider(), trace.ProxyTracerProvider)


def record_span(
    name: str,
    job_id: str,
    traceparent: str | None,
    times: tuple[datetime, datetime],
    attributes: Mapping[str, AttributeValue],
    failure: str | None = None,
) -> None:
    """Record a span of work on a job between two times; `failure` is the class of a failure.

    A job whose request has no trace gets its own, whose identifier is the job's.
    """
    began, ended = (int(when.timestamp() * 1e6) * 1000 for when in times)
    span = trace.get_tracer("syncplan.jobs").start_span(
        name,
        context=_trace_of(job_id, traceparent),
        attributes={"syncplan.job.id": job_id, **attributes},
        start_time=began,
    )
    if failure is not None:
        span.set_attribute("error.type", failure)
        span.set_status(StatusCode.ERROR)
    span.end(end_time=ended)


def _trace_of(job_id: str, traceparent: str | None) -> Context:
    if traceparent is not None:
        return _FORM.extract({"traceparent": traceparent})
    number = UUID(job_id).int
    own = SpanContext(number, number & _LOW_64, is_remote=True, trace_flags=TraceFlags(1))
    return trace.set_span_in_context(NonRecordingSpan(own))


# --- exporters ------------------------------------------------------------------------------------


EXPORTERS = ("opentelemetry.sdk", "opentelemetry.exporter.otlp.proto.http")
REMEDY = "pip install 'syncplan[telemetry]'"
OFF: TelemetryConfig = {
    "tracing": False,
    "metrics": False,
    "logs": False,
    "operation_spans": False,
    "auto_configure": False,
}
"""Value of FastAPI's argument `telemetry` that exports nothing."""

_ENDPOINTS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
_EXPORT_S = 3.0

_log = logging.getLogger("syncplan.telemetry")


def telemetry_options(settings: Settings) -> TelemetryConfig:
    """Return FastAPI's argument `telemetry`; OTEL_* variables set the endpoint.

    Raises InputError if telemetry is asked for and the packages that export it are missing.
    """
    if not settings.telemetry:
        return OFF
    _prepare_exporters()
    return {"auto_configure": True, "exclude": lambda scope: scope.get("path") in PROBES}


def export_spans(settings: Settings) -> Callable[[], None]:
    """Export the spans of a worker, a process that FastAPI does not configure.

    Like FastAPI, it reads OTEL_* variables and exports nothing if they name no endpoint. Returns a
    function that sends the last spans, for a few seconds at most. Raises InputError if the packages
    that export are missing.
    """
    if not settings.telemetry:
        return lambda: None
    _prepare_exporters()
    if _switched_off():
        return lambda: None
    if not any(map(os.environ.get, _ENDPOINTS)):
        _log.warning("no spans are exported: %s is not set", _ENDPOINTS[-1])
        return lambda: None
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor

    provider = TracerProvider(shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    trace.set_tracer_provider(provider)

    def send_last() -> None:
        # the collector may be away
        sender = threading.Thread(target=provider.shutdown, daemon=True, name="last-spans")
        sender.start()
        sender.join(_EXPORT_S)

    return send_last


def _prepare_exporters() -> None:
    missing = [name for name in EXPORTERS if not _installed(name)]
    if missing:
        raise InputError(
            f"needs {' and '.join(missing)}, not installed here; install with: {REMEDY}",
            key="SYNCPLAN_TELEMETRY",
        )
    # a process that ends sends what is left of each signal, and its collector may be away
    os.environ.setdefault("OTEL_EXPORTER_OTLP_TIMEOUT", f"{_EXPORT_S:g}")


def _switched_off() -> bool:
    return (
        os.environ.get("OTEL_SDK_DISABLED", "").lower() == "true"
        or os.environ.get("OTEL_TRACES_EXPORTER", "").lower() == "none"
    )


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
