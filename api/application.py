"""An application without routes that answers, logs, counts and checks keys as the service does."""

from typing import Any

from fastapi import FastAPI

from api.hosts import LocalOnly, names_here
from api.key_throttle import KeyThrottle
from api.logs import RequestLog
from api.metrics import JobTally, Metrics, RequestMetrics
from api.problems import install_handlers
from api.security import Keyring
from api.service import Ending
from api.settings import Settings
from syncplan import __version__

UPLOADS = "/v1/recordings"
"""Where bodies may be larger than elsewhere."""


def without_routes(settings: Settings, *, tally: JobTally | None = None, **options: Any) -> FastAPI:
    """Return an application for routes to be added to; `options` are FastAPI's.

    Its metrics include the jobs that `tally` counts.
    """
    app = FastAPI(
        title="syncplan",
        version=__version__,
        docs_url=None,
        redoc_url=None,
        **options,
    )
    app.state.settings = settings
    app.state.keyring = Keyring(settings)
    app.state.key_throttle = KeyThrottle(settings.max_refused_keys)
    app.state.metrics = Metrics(tally)
    app.state.ending = Ending()
    if not settings.asks_for_keys:
        names = names_here((settings.host, settings.worker_host), settings.allowed_hosts)
        app.add_middleware(LocalOnly, names=names)
    install_handlers(
        app, settings.body_limit_bytes, larger={UPLOADS: settings.recording_limit_bytes}
    )
    app.add_middleware(RequestMetrics, metrics=app.state.metrics)
    app.add_middleware(RequestLog)
    return app
