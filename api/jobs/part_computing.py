"""Computing a part of a job in a child process: tried again if the child dies, up to a limit.

A part that can't be computed ends its job, as failed and with the reason.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from api.computing.child import (
    ChildGoneError,
    ChildNotStartedError,
    OutOfMemoryError,
    TaskFailedError,
    TooSlowError,
)
from api.computing.tickets import GivenUpError, PoolFullError, Ticket
from api.jobs.dbos_runtime import current, in_transaction
from api.jobs.part_watch import WatchedPart
from api.jobs.queue import VERSION
from api.storage import job_records, part_records
from api.storage.database import patiently
from api.storage.part_records import PartHistory
from syncplan.errors import InputError, NoSolutionError

MOST_DEATHS = 5
"""How many children may end while they compute one part."""

MOST_ATTEMPTS = 200
"""How often a part may be begun: workers that are killed with all their children count here."""

_PAUSE_S = 0.5
_LONGEST_PAUSE_S = 30.0

_logger = logging.getLogger("syncplan.jobs")


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a job.

    Attributes
    ----------
    number : of its row; see api.storage.part_records
    name : as messages call it
    limit_s : s that it may take
    """

    job_id: str
    number: int
    name: str
    limit_s: float


Submit = Callable[[WatchedPart, PartHistory], Awaitable[Ticket]]
"""Hands a part's task in, knowing what became of the part so far."""


async def computed(part: Part, submit: Submit) -> Any:
    """Return what the task of a part returns; None where its job has ended, or fails with it.

    `submit` hands the task in, each time that it is tried.
    """
    try:
        return await _tried(part, submit)
    except (GivenUpError, PoolFullError):
        # its job has ended, or the pool is closed
        await _stay_if_closing(part)
    except _FailedError as failed:
        document = dict(failed.document)
        ended = await in_transaction(
            lambda connection: job_records.end_job(
                connection, part.job_id, "failed", error=document
            )
        )
        if ended:
            await asyncio.to_thread(current().counts.job_over, part.job_id)
    return None


async def _tried(part: Part, submit: Submit) -> Any:
    pause_s = _PAUSE_S
    while True:
        history = await in_transaction(
            lambda connection: part_records.begin_part(
                connection, part.job_id, part.number, VERSION
            )
        )
        if history is None:
            return None
        if history.attempts > MOST_ATTEMPTS:
            raise _internal(f"{part.name} was begun {MOST_ATTEMPTS} times and never finished")
        try:
            return await _tried_once(part, history, submit)
        except ChildNotStartedError as error:
            # no fault of the part's
            _logger.error("%s of job %s waits: %s", part.name, part.job_id, error)
            await _withdraw(part)
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, _LONGEST_PAUSE_S)
        except ChildGoneError as error:
            await _stay_if_closing(part)
            await _count_death(part, error)
            await asyncio.sleep(_PAUSE_S)


async def _count_death(part: Part, error: ChildGoneError) -> None:
    """Count that a child ended at a part; raises the job's failure if that was once too often."""
    deaths = await in_transaction(
        lambda connection: part_records.count_death(connection, part.job_id, part.number)
    )
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


async def _tried_once(part: Part, history: PartHistory, submit: Submit) -> Any:
    runtime = current()
    outcome = "failed"
    with runtime.watch.over(part.job_id, part.number) as watched:
        watched.ticket = await submit(watched, history)
        try:
            value = await asyncio.wrap_future(watched.ticket.future)
            outcome = "done"
            return value
        except GivenUpError:
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
    """What a job fails with, as a problem's title and detail."""

    def __init__(self, title: str, detail: str, **more: object) -> None:
        super().__init__(detail)
        self.document: Mapping[str, object] = {"title": title, "detail": detail, **more}


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
    """Never return in a process that is about to end: another one continues the workflow."""
    if current().closing.is_set():
        await _withdraw(part)
    while current().closing.is_set():
        await asyncio.sleep(1.0)


async def _withdraw(part: Part) -> None:
    await in_transaction(
        lambda connection: part_records.withdraw_part(connection, part.job_id, part.number)
    )
