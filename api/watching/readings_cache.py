"""A source that is read once a second, however often it is asked."""

import threading
import time
from collections.abc import Callable

from api.metrics import Readings, Source

__all__ = ["Cached"]

KEPT_S = 1.0


class Cached:
    """A source whose readings, or whose failure, hold for `kept_s`; one thread at a time reads.

    So scrapes cost the database no more than one reading a second, and one that waits for a
    database that is away costs a thread, not one for each scrape.
    """

    def __init__(
        self,
        source: Source,
        *,
        kept_s: float = KEPT_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._source = source
        self._kept_s = kept_s
        self._clock = clock
        self._lock = threading.Lock()
        self._until = -1.0
        self._readings: Readings = {}
        self._failure: Exception | None = None

    def __call__(self) -> Readings:
        """Return readings that are at most `kept_s` old; raises what reading raised."""
        with self._lock:
            if self._clock() >= self._until:
                self._readings, self._failure = {}, None
                try:
                    self._readings = self._source()
                except Exception as error:
                    self._failure = error
                self._until = self._clock() + self._kept_s
            if self._failure is not None:
                raise self._failure
            return self._readings
