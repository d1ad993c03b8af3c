"""Computation of a part of a job in a child process, retried up to a limit if the child dies.

A part that can't be computed fails its job, with the reason. Twice a second, one thread looks at
all parts that this process computes, so that the database is asked once however many there are. It
enters their progress, finished searches and computing time, and gives up the parts of jobs that
have ended or that another version works on.
"""

import asyncio
import logging
import math
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event
from typing import Any, Concatenate, ParamSpec, TypeVar

from sqlalchemy import Connection

from api.computing.child import (
    ChildGoneError,
    ChildNotStartedError,
    OutOfMemoryError,
    TaskFailedError,
    TooSlowError,
)
from api.computing.pool import Pool
from api.computing.turns import GaveWayError, GivenUpError, PoolFullError, Ticket
from api.job_kinds.job_kind import EarlierWork, FinishedSearch, Shown
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.job_counts import JobCounts
from api.jobs.queue import VERSION, JobQueue
from api.settings import Settings
from api.storage import job_records, part_records
from api.storage.database import Database, patiently, unavailable
from api.storage.job_records import BegunJob
from api.storage.part_records import PartHistory
from syncplan.errors import InputError, NoSolutionError

# --- parts at work --------------------------------------------------------------------------------


_LOOK_EVERY_S = 0.5
_NOTE_EVERY_S = 5.0

_logger = logging.getLogger("syncplan.jobs")


@dataclass(slots=True, eq=False)
class WatchedPart:
    """A part being computed here: its reports, and how much of them is entered.

    Attributes
    ----------
    ticket : ticket of its task in the pool; None before it is submitted
    number : number of the part; its progress is that of a batch unless this is below zero
    searches : finished searches that are not entered yet
    shown : further keys of the job's next event
    finish_s : computing time in s after which it is to end with the best found so far
    """

    job_id: str
    number: int
    ticket: Ticket | None = None
    done: int = 0
    searches: list[FinishedSearch] = field(default_factory=list)
    shown: Mapping[str, Any] = field(default_factory=dict)
    finish_s: float = math.inf
    _noted_done: int = 0
    _noted_shown: Mapping[str, Any] = field(default_factory=dict)
    _noted_s: float = 0.0
    _noting: threading.Lock = field(default_factory=threading.Lock)

    def take(self, report: int | Shown | FinishedSearch) -> None:
        """Take a report of the child; called from another thread."""
        if isinstance(report, FinishedSearch):
            self.searches.append(report)
        elif isinstance(report, Shown):
            self.done, self.shown = max(self.done, report.done), report.keys
        else:
            self.done = max(self.done, report)

    def note(self, database: Database, *, over: bool = False) -> None:
        """Enter new reports; all of them if the part is over."""
        with self._noting:
            ran_s = 0.0 if self.ticket is None else self.ticket.ran_s
            seconds = ran_s - self._noted_s
            done, shown, searches = self.done, self.shown, self.searches[:]
            news = done > self._noted_done or shown != self._noted_shown
            if not (over or news or searches or seconds >= _NOTE_EVERY_S):
                return
            with database.writing() as connection:
                if news:
                    number = self.number if self.number >= 0 else None
                    part_records.note_progress(connection, self.job_id, done, number, shown)
                for one in searches:
                    part_records.keep_search(connection, self.job_id, one.number, one.data)
                if seconds > 0.0:
                    part_records.add_seconds(connection, self.job_id, self.number, seconds)
            del self.searches[: len(searches)]
            self._noted_done, self._noted_shown, self._noted_s = done, shown, ran_s


class PartWatch:
    """Thread that watches the parts at work.

    Parameters
    ----------
    version : version of this process; parts of jobs that another one has begun are given up
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
        """Stop the thread."""
        self._stop.set()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while not self._stop.wait(_LOOK_EVERY_S):
            try:
                self.look()
            except Exception as error:
                # the next look tries again
                if unavailable(error):
                    _logger.warning("the database is away: %s", error)
                else:
                    _logger.exception("could not look after the parts at work")

    def look(self) -> None:
        """Enter new reports of all parts, interrupt those that are to end early, give up others.

        Given up are the parts that nobody waits for.
        """
        parts = list(self._parts)
        if not parts:
            return
        job_ids = {part.job_id for part in parts}
        wanted = self._database.read(part_records.worked_on, job_ids, self._version)
        for part in parts:
            if part.job_id in wanted:
                part.note(self._database)
                if part.ticket is not None and (
                    wanted[part.job_id] or part.ticket.ran_s > part.finish_s
                ):
                    # again at each look: a child that is not searching just now ignores it
                    part.ticket.interrupt()
            elif part.ticket is not None:
                part.ticket.cancel()


# --- the runtime ----------------------------------------------------------------------------------


T = TypeVar("T")
P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class Runtime:
    """Database, queue, child processes and settings of the process.

    Attributes
    ----------
    counts : counts of the jobs that end here
    at_work : workflows that this process runs; one restarted while it ran is there twice
    closing : set before the process ends, so that parts killed then do not count as failed
    """

    settings: Settings
    database: Database
    queue: JobQueue
    pool: Pool
    counts: JobCounts
    watch: PartWatch
    at_work: list[str] = field(default_factory=list)
    closing: Event = field(default_factory=Event)

    @contextmanager
    def at(self, workflow_id: str) -> Iterator[None]:
        """Count a workflow as running until the block ends."""
        self.at_work.append(workflow_id)
        try:
            yield
        finally:
            self.at_work.remove(workflow_id)


_in_use: list[Runtime] = []


def use(runtime: Runtime | None) -> None:
    """Make the workflows of this process use a runtime; None ends its use."""
    _in_use[:] = [] if runtime is None else [runtime]


def current() -> Runtime:
    """Return the runtime in use."""
    return _in_use[0]


async def in_transaction(
    function: Callable[Concatenate[Connection, P], T], *arguments: P.args, **named: P.kwargs
) -> T:
    """Call a function in a transaction, waiting for the database if it is away."""

    def transact() -> T:
        return current().database.write(function, *arguments, **named)

    return await asyncio.to_thread(patiently, transact)


# --- computing ------------------------------------------------------------------------------------


MOST_DEATHS = 5
"""Number of children lost to one part at which its job fails."""

MOST_ATTEMPTS = 200
"""Most attempts at a part; those of workers killed with all their children count as well."""

_BEYOND_OWN_LIMIT = 2.0
"""Least time limit of a job computed whole, relative to the longest time it may be asked for."""

_FINISH_SHARE = 0.8
"""Share of the time limit after which a job that can end early does."""

_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a job.

    Attributes
    ----------
    number : number of its row; see api.storage.part_records
    name : name in messages
    task : task that computes it from the job and `arguments`
    resumes : whether the task also gets the work kept from earlier attempts, before `arguments`
    """

    job: BegunJob
    number: int
    name: str
    task: str
    arguments: tuple[object, ...] = ()
    resumes: bool = False

    @property
    def job_id(self) -> str:
        """Identifier of the job."""
        return self.job.spec.id

    @property
    def limit_s(self) -> float:
        """Time limit (s); a job computed whole has a limit of its own, too."""
        settings = current().settings
        if JOB_KINDS[self.job.spec.kind].divided:
            return settings.job_task_s
        return max(settings.job_task_s, _BEYOND_OWN_LIMIT * settings.max_refine_s)


async def computed(part: Part) -> Any:
    """Return the result of the task of a part; None if its job has ended, or fails with it."""
    try:
        return await _tried(part)
    except (GivenUpError, PoolFullError):
        # its job has ended, or the pool is closed
        await _stay_if_closing(part)
    except _FailedError as failed:
        if await in_transaction(job_records.end_job, part.job_id, "failed", error=failed.document):
            await asyncio.to_thread(current().counts.job_over, part.job_id)
    return None


async def _tried(part: Part) -> Any:
    pause_s = _PAUSE_S
    while True:
        history = await in_transaction(part_records.begin_part, part.job_id, part.number, VERSION)
        if history is None:
            return None
        if history.attempts > MOST_ATTEMPTS:
            raise _internal(f"{part.name} was begun {MOST_ATTEMPTS} times and never finished")
        try:
            return await _tried_once(part, history)
        except GaveWayError:
            # it has finished a search at least, and takes its next turn
            await _withdraw(part)
        except ChildNotStartedError as error:
            # not the part's fault
            _logger.error("%s of job %s waits: %s", part.name, part.job_id, error)
            await _withdraw(part)
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, _LONGEST_PAUSE_S)
        except ChildGoneError as error:
            await _stay_if_closing(part)
            await _count_death(part, error)
            await asyncio.sleep(_PAUSE_S)


async def _count_death(part: Part, error: ChildGoneError) -> None:
    """Count that a child ended at a part; raises the job's failure at the limit."""
    deaths = await in_transaction(part_records.count_death, part.job_id, part.number)
    _logger.error(
        "a process computing %s of job %s ended (%d of %d): %s",
        part.name,
        part.job_id,
        deaths,
        MOST_DEATHS,
        error,
    )
    if deaths >= MOST_DEATHS:
        raise _internal(
            f"{MOST_DEATHS} processes ended while they computed {part.name}: killed, or out of "
            "memory; ask for less, or give the workers more memory"
        )


async def _tried_once(part: Part, history: PartHistory) -> Any:
    runtime = current()
    outcome = "failed"
    arguments = part.arguments
    if part.resumes:
        # read for each attempt: one that died has left some
        searches = await in_transaction(part_records.finished_searches, part.job_id)
        arguments = (EarlierWork(searches, history.computed_s), *arguments)
    with runtime.watch.over(part.job_id, part.number) as watched:
        if JOB_KINDS[part.job.spec.kind].study.ends_early:
            watched.finish_s = _FINISH_SHARE * part.limit_s
        watched.ticket = runtime.pool.submit(
            part.task,
            part.job.spec,
            *arguments,
            owner=part.job.owner,
            timeout_s=part.limit_s,
            # the part itself counts the children that die
            retries=0,
            progress=watched.take,
            resumes=part.resumes,
        )
        try:
            value = await asyncio.wrap_future(watched.ticket.future)
            outcome = "done"
            return value
        except (GivenUpError, GaveWayError):
            outcome = "given-up"
            raise
        except ChildGoneError:
            outcome = "process-ended"
            raise
        except InputError as error:
            faults = [
                {"path": one.key, "value": one.value, "message": one.problem}
                for one in error.faults
            ]
            raise _FailedError("Bad input", str(error), errors=faults) from None
        except NoSolutionError as error:
            raise _FailedError("No solution", str(error)) from None
        except TooSlowError:
            _logger.error("%s of job %s took too long", part.name, part.job_id)
            raise _too_slow(part) from None
        except OutOfMemoryError:
            _logger.error("%s of job %s needed too much memory", part.name, part.job_id)
            raise _too_large(part) from None
        except TaskFailedError as error:
            _logger.error("job %s failed: %s", part.job_id, error)
            raise _internal("an internal fault; see the service's log") from None
        finally:
            await asyncio.to_thread(patiently, watched.note, runtime.database, over=True)
            await asyncio.to_thread(
                runtime.counts.part_over, part.job_id, part.number, watched.ticket, outcome
            )


class _FailedError(Exception):
    """Failure of a job, as a problem's title and detail."""

    def __init__(self, title: str, detail: str, **more: object) -> None:
        super().__init__(detail)
        self.document = {"title": title, "detail": detail, **more}


def _internal(detail: str) -> _FailedError:
    return _FailedError("Internal fault", detail)


def _too_slow(part: Part) -> _FailedError:
    return _FailedError(
        "Too slow",
        f"{part.name} took longer than the {part.limit_s:g} s that a part of a job may take here "
        "(SYNCPLAN_JOB_TASK_S); ask for fewer vehicles, shorter runs or less time",
    )


def _too_large(part: Part) -> _FailedError:
    limit_bytes = current().settings.task_memory
    return _FailedError(
        "Too large",
        f"{part.name} needs more than the {limit_bytes / 2**20:.0f} MiB of memory that a process "
        "may use here (SYNCPLAN_TASK_MEMORY_BYTES); ask for fewer vehicles or samples",
    )


async def _stay_if_closing(part: Part) -> None:
    """Never return in a process that is about to end; another one continues the workflow."""
    if current().closing.is_set():
        await _withdraw(part)
    while current().closing.is_set():
        await asyncio.sleep(1.0)


async def _withdraw(part: Part) -> None:
    await in_transaction(part_records.withdraw_part, part.job_id, part.number)
