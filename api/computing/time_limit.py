"""A time limit that asks: an alarm raises in the task, which cleans up as after any error."""

import contextlib
import signal
from collections.abc import Iterator

_AGAIN_S = 2.0
_LEAST_S = 0.001


class TimeUp(BaseException):
    """The time of the task is over; no `except Exception` of its code stops it."""


class Alarm:
    """Raises TimeUp in the main thread once a task's time is over, again and again until cleared.

    Code that never returns to Python is not asked: whoever waits for it ends the process. Does
    nothing on systems without interval timers.
    """

    def __init__(self) -> None:
        self._set = False
        self._possible = hasattr(signal, "setitimer")
        if self._possible:
            signal.signal(signal.SIGALRM, self._ring)

    def set(self, seconds: float | None) -> None:
        """Start the time of a task; None for one without limit."""
        if self._possible and seconds is not None:
            self._set = True
            signal.setitimer(signal.ITIMER_REAL, max(seconds, _LEAST_S), _AGAIN_S)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        """Raise nothing within; what is due is raised later."""
        before, self._set = self._set, False
        try:
            yield
        finally:
            self._set = before

    def clear(self) -> None:
        """End the time of a task."""
        # first: nothing is raised from here on
        self._set = False
        if self._possible:
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _ring(self, *_: object) -> None:
        if self._set:
            raise TimeUp
