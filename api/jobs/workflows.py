"""The durable workflows: a job, and a batch of its trials.

    run_job:  start --> divide into batches --> run_batch on any worker, each --> conclude
              start --> compute whole --> conclude

Workflows only order steps. A step may run twice, even on two workers, when one of them is presumed
dead: it writes the same, and only once. What ends a job is its row in the database:
a step that finds its job ended does nothing.

Names of workflows, steps and queues are in the database of every job begun: they stay as they are.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Any, Literal, TypeVar

from dbos import DBOS, SetEnqueueOptions, SetWorkflowID
from sqlalchemy import Connection

from api.computing.child import ChildGoneError, TaskFailedError
from api.computing.pool import GivenUpError, Ticket
from api.job_kinds.job_kind import JobReport, TrialTask
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.batching import batches_of
from api.jobs.dbos_runtime import current
from api.jobs.queue import JOB_WORKFLOW
from api.plan_texts import PlanText
from api.storage import batch_records, job_queries, job_records
from api.storage.clock import moment, new_id
from api.storage.database import patiently, unavailable
from api.storage.plan_records import add_plan
from syncplan.errors import InputError, NoSolutionError
from syncplan.reports.job_contract import JobKindName

__all__ = ["BATCHES_QUEUE", "batch_id", "run_batch", "run_job"]

BATCHES_QUEUE = "syncplan-parts"

_LOOK_EVERY_S = 0.5
_RESULT_EVERY_S = 0.25
_DROPPED_AT_ONCE = 1000

_logger = logging.getLogger("syncplan.jobs")

T = TypeVar("T")


def batch_id(job_id: str, number: int | Literal[""]) -> str:
    """Return the identifier of a batch's workflow; without a number, the prefix of a job's."""
    return f"{job_id}-{number}"


@DBOS.workflow(name=JOB_WORKFLOW, max_recovery_attempts=1000)
async def run_job(job_id: str) -> None:
    """Do a job."""
    with current().at(job_id):
        kind = await _start(job_id)
        if kind is None:
            return
        if isinstance(JOB_KINDS[kind].task, TrialTask):
            await _run_batches(job_id)
        else:
            await _compute_whole(job_id)


async def _run_batches(job_id: str) -> None:
    handles = []
    for number in range(await _divide(job_id)):
        # a job's later batches wait for the first ones of others, so that none holds up all
        turn = SetEnqueueOptions(priority=number + 1)
        with SetWorkflowID(batch_id(job_id, number)), turn:
            queued = await DBOS.enqueue_workflow_async(BATCHES_QUEUE, run_batch, job_id, number)
            handles.append(queued)
    for handle in handles:
        if not await handle.get_result(polling_interval_sec=_RESULT_EVERY_S):
            await _drop_batches(job_id)
            return
    await _conclude(job_id)


@DBOS.workflow(name="syncplan-part", max_recovery_attempts=1000)
async def run_batch(job_id: str, number: int) -> bool:
    """Do a batch of a job's trials; return whether the job goes on."""
    with current().at(batch_id(job_id, number)):
        return await _compute_batch(job_id, number)


# --- steps --------------------------------------------------------------------------------------


@DBOS.step(name="start")
async def _start(job_id: str) -> JobKindName | None:
    def start(connection: Connection) -> JobKindName | None:
        if not job_queries.start_job(connection, job_id):
            return None
        spec = job_queries.spec_of(connection, job_id)
        return None if spec is None else spec.kind

    return await _in_transaction(start)


@DBOS.step(name="cut")
async def _divide(job_id: str) -> int:
    """Return the number of batches, or 0 where the job has ended."""
    runtime = current()
    spec = await _in_transaction(lambda connection: job_queries.spec_of(connection, job_id))
    if spec is None:
        return 0
    runs = await _computed(job_id, runtime.pool.submit("measured_runs", spec))
    if runs is None:
        return 0
    batches = batches_of(runs, runtime.settings.batch_s, runtime.settings.process_count)
    return await _in_transaction(
        lambda connection: batch_records.divide_job(connection, job_id, batches)
    )


@DBOS.step(name="fly")
async def _compute_batch(job_id: str, number: int) -> bool:
    def begin(connection: Connection) -> tuple[Any, bool]:
        goes_on = job_queries.spec_of(connection, job_id) is not None
        return batch_records.next_batch(connection, job_id, number), goes_on

    found, goes_on = await _in_transaction(begin)
    if found is None:
        return goes_on
    latest = _Latest()
    ticket = current().pool.submit("computed_batch", *found, progress=latest.take)
    data = await _computed(job_id, ticket, latest, number)
    if data is not None:
        await _in_transaction(
            lambda connection: batch_records.keep_batch(connection, job_id, number, data)
        )
    return data is not None


@DBOS.step(name="drop")
async def _drop_batches(job_id: str) -> None:
    """Take batches out of the queue, where they would hold up those of other jobs for nothing."""
    waiting = await DBOS.list_workflows_async(
        workflow_id_prefix=batch_id(job_id, ""),
        status="ENQUEUED",
        load_input=False,
        load_output=False,
    )
    for first in range(0, len(waiting), _DROPPED_AT_ONCE):
        dropped = [one.workflow_id for one in waiting[first : first + _DROPPED_AT_ONCE]]
        await DBOS.cancel_workflows_async(dropped)


@DBOS.step(name="conclude")
async def _conclude(job_id: str) -> None:
    def gather(connection: Connection) -> Any:
        spec = job_queries.spec_of(connection, job_id)
        return None if spec is None else (spec, batch_records.finished_batches(connection, job_id))

    gathered = await _in_transaction(gather)
    if gathered is not None:
        result = await _computed(job_id, current().pool.submit("concluded_job", *gathered))
        await _succeed(job_id, result)


@DBOS.step(name="refine")
async def _compute_whole(job_id: str) -> None:
    runtime = current()
    spec = await _in_transaction(lambda connection: job_queries.spec_of(connection, job_id))
    if spec is None:
        return
    latest = _Latest()
    # processes of its own, beside those at work for others
    workers = max(runtime.settings.process_count - runtime.pool.busy, 1)
    ticket = runtime.pool.submit("computed_job", spec, workers, progress=latest.take)
    await _succeed(job_id, await _computed(job_id, ticket, latest))


async def _succeed(job_id: str, result: PlanText | JobReport | None) -> None:
    """End a job with its result, if there is one: the job and what is stored of it, or neither."""
    if result is None:
        return

    def keep(connection: Connection) -> None:
        if isinstance(result, JobReport):
            job_records.end_job(connection, job_id, "succeeded", report=result)
            return
        plan_id = new_id(moment(connection))
        if job_records.end_job(connection, job_id, "succeeded", plan_id=plan_id):
            owner, parent_id = job_queries.owner_and_plan(connection, job_id)
            add_plan(connection, owner, result, plan_id=plan_id, parent_id=parent_id)

    await _in_transaction(keep)


# --- computing ----------------------------------------------------------------------------------


class _Latest:
    """The newest progress that a child has reported."""

    def __init__(self) -> None:
        self.done = 0

    def take(self, done: int) -> None:
        self.done = done


async def _computed(
    job_id: str, ticket: Ticket, latest: _Latest | None = None, number: int | None = None
) -> Any:
    """Return what a task returns; None where the job was cancelled, or fails with the task.

    While waiting, the progress is entered and the job looked at: the child of a job that has ended
    is killed.
    """
    future = asyncio.wrap_future(ticket.future)
    while not future.done():
        await asyncio.wait({future}, timeout=_LOOK_EVERY_S)
        done = 0 if latest is None else latest.done
        if not future.done() and not await _goes_on(job_id, done, number):
            ticket.cancel()
    try:
        return future.result()
    except GivenUpError:
        await _stay_if_closing()
        return None
    except InputError as error:
        faults = [
            {"path": one.key, "value": one.value, "message": one.problem} for one in error.faults
        ]
        failure = {"title": "Bad input", "detail": str(error), "errors": faults}
    except NoSolutionError as error:
        failure = {"title": "No solution", "detail": str(error)}
    except ChildGoneError as error:
        await _stay_if_closing()
        _logger.error("a process computing job %s ended: %s", job_id, error)
        failure = {
            "title": "Internal fault",
            "detail": "the process computing this ended; out of memory?",
        }
    except TaskFailedError as error:
        _logger.error("job %s failed: %s", job_id, error)
        failure = {"title": "Internal fault", "detail": "an internal fault; see the service's log"}
    await _in_transaction(
        lambda connection: job_records.end_job(connection, job_id, "failed", error=failure)
    )
    return None


async def _goes_on(job_id: str, done: int, number: int | None) -> bool:
    """Enter the progress and return whether the job still wants a result; yes when in doubt."""

    def note() -> bool:
        with current().database.writing() as connection:
            return batch_records.note_progress(connection, job_id, done, number)

    try:
        return await asyncio.to_thread(note)
    except Exception as error:
        if not unavailable(error):
            raise
        return True


async def _stay_if_closing() -> None:
    """Never return in a process that is about to end: another one continues the workflow."""
    while current().closing.is_set():
        await asyncio.sleep(1.0)


async def _in_transaction(function: Callable[[Connection], T]) -> T:
    """Return what a function does in a transaction, waiting for the database if it is away."""

    def transact() -> T:
        with current().database.writing() as connection:
            return function(connection)

    return await asyncio.to_thread(patiently, transact)
