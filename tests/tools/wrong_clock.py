"""A process whose clock is wrong, as far as Python can see: for its environment, no package needed.

The interpreter imports `sitecustomize` before anything else; the one made here shifts `time.time`
and `datetime.now`. What C libraries read stays right, among it SQLite's clock.
"""

from pathlib import Path

__all__ = ["AHEAD_S", "clock_ahead"]

AHEAD_S = 8 * 86400.0
"""Eight days: longer than results are kept."""

_SHIFT = """
import datetime, os, time

ahead_s = float(os.environ["WRONG_CLOCK_AHEAD_S"])
right, right_ns, day = time.time, time.time_ns, datetime.datetime
time.time = lambda: right() + ahead_s
time.time_ns = lambda: right_ns() + int(ahead_s * 1e9)


class Kind(type):
    def __instancecheck__(cls, one):
        return isinstance(one, day)


class Ahead(day, metaclass=Kind):
    @classmethod
    def now(cls, tz=None):
        return day.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls):
        return day.fromtimestamp(time.time(), datetime.UTC).replace(tzinfo=None)


datetime.datetime = Ahead
"""


def clock_ahead(folder: Path, seconds: float = AHEAD_S) -> dict[str, str]:
    """Return what to add to a process's environment so that its clock is ahead."""
    folder.mkdir(parents=True, exist_ok=True)
    folder.joinpath("sitecustomize.py").write_text(_SHIFT)
    return {"PYTHONPATH": str(folder), "WRONG_CLOCK_AHEAD_S": str(seconds)}
