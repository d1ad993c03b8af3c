"""OpenTelemetry, off unless the settings ask for it: FastAPI's support, and a worker's spans."""

import importlib.util
import logging
import os
import threading
from collections.abc import Callable

from fastapi.telemetry import TelemetryConfig
from opentelemetry import trace

from api.logs import PROBES
from api.settings import Settings
from syncplan.errors import InputError

EXPORTERS = ("opentelemetry.sdk", "opentelemetry.exporter.otlp.proto.http")
REMEDY = "pip install 'syncplan[telemetry]'"
OFF: TelemetryConfig = {
    "tracing": False,
    "metrics": False,
    "logs": False,
    "operation_spans": False,
    "auto_configure": False,
}
"""The argument that exports nothing."""

_ENDPOINTS = ("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT")
_EXPORT_S = 3.0

_log = logging.getLogger("syncplan.telemetry")


def telemetry_options(settings: Settings) -> TelemetryConfig:
    """Return FastAPI's argument `telemetry`; OTEL_* variables say where to export to.

    Raises InputError if telemetry is asked for and the packages that export it are missing.
    """
    if not settings.telemetry:
        return OFF
    _prepare_exporters()
    return {"auto_configure": True, "exclude": lambda scope: scope.get("path") in PROBES}


def export_spans(settings: Settings) -> Callable[[], None]:
    """Export the spans of a process that FastAPI does not configure, a worker's.

    As FastAPI does, it takes OTEL_* variables and exports nothing where they name no endpoint.
    Returns what sends the last spans, for a few seconds at most. Raises InputError if the packages
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
        # whoever collects them may be away
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
    # a process that ends sends what is left, of each signal, and its collector may be away
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
