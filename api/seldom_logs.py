"""Log lines for what strangers can cause without end: a few, each with the number of cases."""

import logging
import time
from dataclasses import dataclass


@dataclass(slots=True)
class _Silence:
    until: float
    cases: int = 0


class SeldomLog:
    """Warnings of a logger, at most one of each kind in `every_s` seconds."""

    def __init__(self, logger: logging.Logger, every_s: float = 10.0) -> None:
        self._logger = logger
        self._every_s = every_s
        self._silences: dict[str, _Silence] = {}

    def warn(self, kind: str, message: str, **fields: object) -> None:
        """Log a case of `kind`, with how many there were since the last line; or count it alone.

        There must be few kinds: one is kept for each.
        """
        now = time.monotonic()
        silence = self._silences.get(kind)
        if silence is not None and now < silence.until:
            silence.cases += 1
            return
        cases = 1 if silence is None else silence.cases + 1
        self._silences[kind] = _Silence(now + self._every_s)
        self._logger.warning(message, extra={"kind": kind, "cases": cases, **fields})
