"""A look at all parts that this process computes, twice a second.

One thread does it for all, so that the database is asked once however many parts there are: it
enters their progress, what they have finished and how long they took, and gives up those of jobs
that have ended or that another version works on.
"""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from api.computing.tickets import Ticket
from api.job_kinds.job_tasks import FinishedStart
from api.storage import batch_records, part_records
from api.storage.database import Database, unavailable

_LOOK_EVERY_S = 0.5
_NOTE_EVERY_S = 5.0

_logger = logging.getLogger("syncplan.jobs")


@dataclass(slots=True, eq=False)
class WatchedPart:
    """A part that is computed here: what it has reported, and how much of that is entered.

    Attributes
    ----------
    ticket : of its task in the pool; None before it is handed in
    number : of the part; progress is that of a batch where it is not below zero
    starts : finished starts of a refinement that are not entered yet
    """

    job_id: str
    number: int
    ticket: Ticket | None = None
    done: int = 0
    starts: list[FinishedStart] = field(default_factory=list)
    _noted_done: int = 0
    _noted_s: float = 0.0
    _noting: threading.Lock = field(default_factory=threading.Lock)

    def take(self, done: int | FinishedStart) -> None:
        """Take what the child reports; called from another thread."""
        if isinstance(done, FinishedStart):
            self.starts.append(done)
        else:
            self.done = max(self.done, done)

    def note(self, database: Database, *, over: bool = False) -> None:
        """Enter what is new; all of it at the end."""
        with self._noting:
            ran_s = 0.0 if self.ticket is None else self.ticket.ran_s
            seconds = ran_s - self._noted_s
            done, starts = self.done, self.starts[:]
            if not (over or done > self._noted_done or starts or seconds >= _NOTE_EVERY_S):
                return
            with database.writing() as connection:
                if done > self._noted_done:
                    number = self.number if self.number >= 0 else None
                    batch_records.note_progress(connection, self.job_id, done, number)
                for start in starts:
                    part_records.keep_start(connection, self.job_id, start.number, start.data)
                if seconds > 0.0:
                    part_records.add_seconds(connection, self.job_id, self.number, seconds)
            del self.starts[: len(starts)]
            self._noted_done, self._noted_s = done, ran_s


class PartWatch:
    """A thread that looks after the parts at work.

    Parameters
    ----------
    version : of this process; a job that another one has begun is given up
    """

    def __init__(self, database: Database, version: str) -> None:
        self._database = database
        self._version = version
        self._parts: list[WatchedPart] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="part-watch")
        self._thread.start()

    @contextmanager
    def over(self, job_id: str, number: int) -> Iterator[WatchedPart]:
        """Watch a part until the block ends."""
        part = WatchedPart(job_id, number)
        self._parts.append(part)
        try:
            yield part
        finally:
            self._parts.remove(part)

    def close(self) -> None:
        """Stop."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while not self._stop.wait(_LOOK_EVERY_S):
            _unless_away(self.look)

    def look(self) -> None:
        """Enter what is new of all parts, and give up those that nobody waits for."""
        parts = list(self._parts)
        if not parts:
            return
        with self._database.reading() as connection:
            job_ids = {part.job_id for part in parts}
            wanted = part_records.worked_on(connection, job_ids, self._version)
        for part in parts:
            if part.job_id in wanted:
                part.note(self._database)
            elif part.ticket is not None:
                part.ticket.cancel()


def _unless_away(function: Callable[[], None]) -> None:
    """Call a function; while the database is away, there is a next time."""
    try:
        function()
    except Exception as error:
        if unavailable(error):
            _logger.warning("the database is away: %s", error)
        else:
            _logger.exception("could not look after the parts at work")
