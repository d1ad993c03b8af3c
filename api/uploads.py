"""How many recordings are taken in at a time, as each is held in memory meanwhile."""

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from api.problems import TooManyRequests

MOST = 4
MOST_OF_OWNER = 2
_RETRY_AFTER_S = 5.0


class Uploads:
    """The recordings that are taken in just now, by owner."""

    def __init__(self) -> None:
        self._held: Counter[str] = Counter()
        self._lock = threading.Lock()

    @contextmanager
    def one_of(self, owner: str) -> Iterator[None]:
        """Take part while one recording is taken in; raises TooManyRequests if there are enough."""
        with self._lock:
            if self._held[owner] >= MOST_OF_OWNER or self._held.total() >= MOST:
                raise TooManyRequests(
                    f"{self._held[owner]} of your recordings are being taken in, "
                    f"{self._held.total()} of all; allowed are {MOST_OF_OWNER} and {MOST}; send "
                    "one after the other",
                    retry_after_s=_RETRY_AFTER_S,
                )
            self._held[owner] += 1
        try:
            yield
        finally:
            with self._lock:
                self._held[owner] -= 1
                if not self._held[owner]:
                    del self._held[owner]
