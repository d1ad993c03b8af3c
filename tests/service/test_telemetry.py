"""Telemetry: off by default, on where the settings ask for it and its packages are there."""

import importlib.util
import os
from unittest.mock import Mock

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from opentelemetry import metrics, trace

from api.settings import load_settings
from api.telemetry import EXPORTERS, export_spans, telemetry_options
from syncplan.errors import InputError

TIMEOUT = "OTEL_EXPORTER_OTLP_TIMEOUT"


class Reported(Exception):  # noqa: N818
    """A request reached the telemetry."""


TRACERS = Mock(spec=trace.TracerProvider, get_tracer=Mock(side_effect=Reported))
"""A provider that shows when it is asked."""


def _client(app: FastAPI, path: str) -> TestClient:
    @app.get(path)
    def nothing() -> None: ...

    return TestClient(app)


def test_telemetry_is_off_by_default(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FASTAPI_OTEL_AUTO_CONFIGURE", "true")
    options = telemetry_options(load_settings())
    assert not any(options.values())
    app = FastAPI(telemetry={**options, "tracer_provider": TRACERS})
    assert _client(app, "/v1").get("/v1").status_code == 200


@pytest.mark.parametrize("missing", [EXPORTERS[:1], EXPORTERS[1:], EXPORTERS])
def test_a_missing_exporter_is_reported_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...]
) -> None:
    def find_spec(name: str) -> object:
        if name in missing:
            raise ModuleNotFoundError(name)
        return object()

    monkeypatch.setattr(importlib.util, "find_spec", find_spec)
    with pytest.raises(InputError) as caught:
        telemetry_options(load_settings(telemetry=True))
    text = str(caught.value)
    assert text.startswith("SYNCPLAN_TELEMETRY: needs ")
    assert all((name in text) == (name in missing) for name in EXPORTERS)
    assert "pip install 'syncplan[telemetry]'" in text
    assert "\n" not in text


@pytest.mark.parametrize(("given", "kept"), [(None, "3"), ("20", "20")])
def test_a_collector_that_is_away_holds_up_no_end(
    monkeypatch: pytest.MonkeyPatch, given: str | None, kept: str
) -> None:
    """The exporters try for 10 s each otherwise, and the server's end waits for them."""
    settings = load_settings(telemetry=True)
    monkeypatch.setattr(os, "environ", {} if given is None else {TIMEOUT: given})
    telemetry_options(settings)
    assert os.environ[TIMEOUT] == kept


@pytest.mark.parametrize(
    ("given", "warned"),
    [({}, True), ({"OTEL_SDK_DISABLED": "true"}, False), ({"OTEL_TRACES_EXPORTER": "none"}, False)],
)
def test_a_worker_without_an_endpoint_says_so_unless_traces_are_switched_off(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    given: dict[str, str],
    warned: bool,
) -> None:
    settings = load_settings(telemetry=True)
    monkeypatch.setattr(importlib.util, "find_spec", Mock())
    monkeypatch.setattr(os, "environ", given)
    export_spans(settings)()
    assert ("OTEL_EXPORTER_OTLP_ENDPOINT is not set" in caplog.text) is warned


def test_telemetry_sees_requests_but_no_probes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", Mock())
    monkeypatch.setenv(TIMEOUT, "1")
    options = telemetry_options(load_settings(telemetry=True))
    assert options["auto_configure"]
    app = FastAPI(
        telemetry={
            **options,
            "tracer_provider": TRACERS,
            "meter_provider": metrics.NoOpMeterProvider(),
        }
    )
    assert _client(app, "/healthz").get("/healthz").status_code == 200
    with pytest.raises(Reported):
        _client(app, "/v1").get("/v1")
