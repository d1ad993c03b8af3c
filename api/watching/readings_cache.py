"""A source that is read once a second, however often it is asked."""

import threading
import time
from collections.abc import Callable

from api.metrics import Readings, Source

KEPT_S = 1.0


class Cached:
    """A source whose readings, or whose failure, hold for `kept_s`; one thread at a time reads.

    So scrapes cost the database no more than one reading a second. While a reading takes long,
    the others get the last one: a database that hangs costs one thread, not one for each scrape.
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
        self._until: float | None = None
        self._last: Readings | Exception = {}

    def __call__(self) -> Readings:
        """Return the newest readings there are; raises what reading raised."""
        # the first one is waited for
        if self._lock.acquire(blocking=self._until is None):
            try:
                if self._until is None or self._clock() >= self._until:
                    self._last = self._read()
                    self._until = self._clock() + self._kept_s
            finally:
                self._lock.release()
        last = self._last
        if isinstance(last, Exception):
            raise last
        return last

    def _read(self) -> Readings | Exception:
        try:
            return self._source()
        except Exception as error:
            return error
