"""Spans of jobs and their parts, in the trace of the request that asked for the job.

Without an exporter (`api.telemetry`) nothing is recorded. A span says of which kind a job is and
how it ended, never what was asked for or by whom.
"""

from collections.abc import Mapping
from datetime import datetime
from uuid import UUID

from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.trace import NonRecordingSpan, SpanContext, StatusCode, TraceFlags
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator
from opentelemetry.util.types import AttributeValue

_FORM = TraceContextTextMapPropagator()
_LOW_64 = 2**64 - 1


def current_traceparent() -> str | None:
    """Return the current span as W3C Trace Context writes it; None outside of a trace."""
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
    """Record that something was done for a job between two times; `failure` is its reason's class.

    A job without a trace of its request has one of its own, whose identifier is the job's.
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
