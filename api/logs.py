"""Logs as JSON, one object a line on standard error; a request id ties lines to requests.

logging does not limit how often a line is written; SeldomLog limits the lines that strangers could
cause without end (tests/attacks/test_edge_connections.py).
"""

import json
import logging
import sys
import time
import traceback
from contextvars import ContextVar
from datetime import UTC, datetime
from typing import Any


class SeldomLog:
    """Warnings of a logger, at most one of each kind in `every_s` seconds."""

    def __init__(self, logger: logging.Logger, every_s: float = 10.0) -> None:
        self._logger = logger
        self._every_s = every_s
        # of each kind: until when it is silent, and the number of cases since its last line
        self._silences: dict[str, tuple[float, int]] = {}

    def warn(self, kind: str, message: str, **fields: object) -> None:
        """Log a case of `kind` with the number of cases since the last line, or only count it.

        There must be few kinds: an entry is kept for each.
        """
        now = time.monotonic()
        until, before = self._silences.get(kind, (now, 0))
        if now < until:
            self._silences[kind] = until, before + 1
            return
        self._silences[kind] = now + self._every_s, 0
        self._logger.warning(message, extra={"kind": kind, "cases": before + 1, **fields})


# --- JSON lines -----------------------------------------------------------------------------------


REQUEST_ID: ContextVar[str] = ContextVar("request_id", default="")
"""Id of the request being served; empty outside of requests."""

_ORDINARY = frozenset(vars(logging.makeLogRecord({}))) | {
    "asctime",
    "color_message",
    "message",
    "taskName",
}


class JsonLines(logging.Formatter):
    """Formatter as JSON: time, level, logger, message, request_id, extra fields and trace."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line in ASCII, without a line end."""
        moment = datetime.fromtimestamp(record.created, UTC)
        line: dict[str, Any] = {
            "time": moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": _message(record),
        }
        request_id = REQUEST_ID.get()
        if request_id:
            line["request_id"] = request_id
        for name, value in vars(record).items():
            if name not in _ORDINARY:
                line.setdefault(name, value)
        if record.exc_info and record.exc_info[0] is not None:
            line["exception"] = "".join(traceback.format_exception(*record.exc_info)).rstrip()
        if record.stack_info:
            line["stack"] = record.stack_info
        try:
            return json.dumps(line, default=str, allow_nan=False)
        except (ValueError, TypeError, RecursionError):
            return json.dumps({name: _plain(value) for name, value in line.items()})


def _message(record: logging.LogRecord) -> str:
    try:
        return record.getMessage()
    except (TypeError, ValueError, KeyError):
        return f"{record.msg} {record.args}"


def _plain(value: Any) -> str:
    try:
        return str(value)
    except Exception:
        return f"a {type(value).__name__} that can't be shown"


def configure_logs(level: str) -> None:
    """Send every logger's lines of `level` and above to standard error, as JSON.

    Call it before uvicorn and DBOS start. Start uvicorn with `log_config=None, access_log=False`:
    api.answering logs the requests.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(level.upper())
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access"):
        logger = logging.getLogger(name)
        logger.handlers = []
        logger.propagate = True
        logger.setLevel(logging.WARNING if name == "uvicorn.access" else logging.NOTSET)
    # DBOS writes lines in its own format unless its logger has a handler
    durable = logging.getLogger("dbos")
    durable.handlers = [handler]
    durable.propagate = False
    # it also logs every migration and connection
    durable.setLevel(logging.getLogger().level if level == "debug" else logging.WARNING)
    logging.captureWarnings(True)
