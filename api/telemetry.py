"""OpenTelemetry through FastAPI's own support: off unless the settings ask for it."""

import importlib.util

from fastapi.telemetry import TelemetryConfig

from api.logs import PROBES
from api.settings import Settings
from syncplan.errors import InputError

__all__ = ["OFF", "telemetry_options"]

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


def telemetry_options(settings: Settings) -> TelemetryConfig:
    """Return FastAPI's argument `telemetry`; OTEL_* variables say where to export to.

    Raises InputError if telemetry is asked for and the packages that export it are missing.
    """
    if not settings.telemetry:
        return OFF
    missing = [name for name in EXPORTERS if not _installed(name)]
    if missing:
        raise InputError(
            f"needs {' and '.join(missing)}, not installed here; install with: {REMEDY}",
            key="SYNCPLAN_TELEMETRY",
        )
    return {"auto_configure": True, "exclude": lambda scope: scope.get("path") in PROBES}


def _installed(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False
