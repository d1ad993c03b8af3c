"""The durable workflows: a job, and a part of its trials.

    run_job:  start --> cut into parts --> run_part on any worker, each --> conclude
              start --> refine --> conclude

Workflows only order steps. A step may run twice, on two workers even, when one of them is taken
for dead: what it writes is the same, and written once. What ends a job is its row in the database:
a step that finds its job ended does nothing.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Any, Literal, TypeVar

from dbos import DBOS, SetEnqueueOptions, SetWorkflowID
from sqlalchemy import Connection

from api.computing.child import ChildGoneError, TaskFailedError
from api.computing.pool import GivenUpError, Ticket
from api.computing.tasks import Cut, PlanText
from api.jobs.batching import cuts_of
from api.jobs.dbos_runtime import current
from api.jobs.queue import JOB_WORKFLOW
from api.storage import job_queries, job_records, part_records
from api.storage.database import patiently, unavailable
from api.storage.plan_records import add_plan
from api.storage.tables import new_id
from syncplan.errors import InputError, NoSolutionError

__all__ = ["PARTS_QUEUE", "part_id", "run_job", "run_part"]

PARTS_QUEUE = "syncplan-parts"

_LOOK_EVERY_S = 0.5
_RESULT_EVERY_S = 0.25
_BATCH = 1000

_logger = logging.getLogger("syncplan.jobs")

T = TypeVar("T")


def part_id(job_id: str, number: int | Literal[""]) -> str:
    """Return the identifier of the workflow of a part; without a number, what all begin with."""
    return f"{job_id}-{number}"


@DBOS.workflow(name=JOB_WORKFLOW, max_recovery_attempts=1000)
async def run_job(job_id: str) -> None:
    """Do a job."""
    with current().at(job_id):
        kind = await _start(job_id)
        if kind == "refinement":
            await _refine(job_id)
        elif kind is not None:
            await _run_trials(job_id)


async def _run_trials(job_id: str) -> None:
    handles = []
    for number in range(await _cut(job_id)):
        # a job's later parts wait for the first ones of others, so that none holds up all
        turn = SetEnqueueOptions(priority=number + 1)
        with SetWorkflowID(part_id(job_id, number)), turn:
            handles.append(await DBOS.enqueue_workflow_async(PARTS_QUEUE, run_part, job_id, number))
    for handle in handles:
        if not await handle.get_result(polling_interval_sec=_RESULT_EVERY_S):
            await _drop_parts(job_id)
            return
    await _conclude(job_id)


@DBOS.workflow(name="syncplan-part", max_recovery_attempts=1000)
async def run_part(job_id: str, number: int) -> bool:
    """Do a part of a job's trials; return whether the job goes on."""
    with current().at(part_id(job_id, number)):
        return await _fly(job_id, number)


# --- steps --------------------------------------------------------------------------------------


@DBOS.step(name="start")
async def _start(job_id: str) -> str | None:
    def start(connection: Connection) -> str | None:
        if not job_queries.start_job(connection, job_id):
            return None
        spec = job_queries.spec_of(connection, job_id)
        return None if spec is None else spec.kind

    return await _in_transaction(start)


@DBOS.step(name="cut")
async def _cut(job_id: str) -> int:
    """Return the number of parts, or 0 where the job has ended."""
    runtime = current()
    spec = await _in_transaction(lambda connection: job_queries.spec_of(connection, job_id))
    if spec is None:
        return 0
    runs = await _computed(job_id, runtime.pool.submit("measured_runs", spec))
    if runs is None:
        return 0
    cuts: list[Cut] = cuts_of(runs, runtime.settings.batch_s, runtime.settings.process_count)
    return await _in_transaction(lambda connection: part_records.cut_job(connection, job_id, cuts))


@DBOS.step(name="fly")
async def _fly(job_id: str, number: int) -> bool:
    def begin(connection: Connection) -> tuple[Any, bool]:
        goes_on = job_queries.spec_of(connection, job_id) is not None
        return part_records.next_part(connection, job_id, number), goes_on

    found, goes_on = await _in_transaction(begin)
    if found is None:
        return goes_on
    latest = _Latest()
    ticket = current().pool.submit("flown_part", *found, progress=latest.take)
    data = await _computed(job_id, ticket, latest, number)
    if data is not None:
        await _in_transaction(
            lambda connection: part_records.keep_part(connection, job_id, number, data)
        )
    return data is not None


@DBOS.step(name="drop")
async def _drop_parts(job_id: str) -> None:
    """Take parts out of the queue, where they would hold up those of other jobs for nothing."""
    waiting = await DBOS.list_workflows_async(
        workflow_id_prefix=part_id(job_id, ""),
        status="ENQUEUED",
        load_input=False,
        load_output=False,
    )
    for first in range(0, len(waiting), _BATCH):
        dropped = [one.workflow_id for one in waiting[first : first + _BATCH]]
        await DBOS.cancel_workflows_async(dropped)


@DBOS.step(name="conclude")
async def _conclude(job_id: str) -> None:
    def gather(connection: Connection) -> Any:
        spec = job_queries.spec_of(connection, job_id)
        return None if spec is None else (spec, part_records.finished_parts(connection, job_id))

    gathered = await _in_transaction(gather)
    if gathered is None:
        return
    finished = await _computed(job_id, current().pool.submit("finished_report", *gathered))
    if finished is not None:
        report, trials = finished
        await _in_transaction(
            lambda connection: job_records.end_job(
                connection, job_id, "succeeded", report=report, trials=trials
            )
        )


@DBOS.step(name="refine")
async def _refine(job_id: str) -> None:
    runtime = current()
    spec = await _in_transaction(lambda connection: job_queries.spec_of(connection, job_id))
    if spec is None:
        return
    latest = _Latest()
    # processes of its own, beside those at work for others
    workers = max(runtime.settings.process_count - runtime.pool.busy, 1)
    ticket = runtime.pool.submit("refined_plan", spec, workers, progress=latest.take)
    made = await _computed(job_id, ticket, latest)
    if made is not None:
        await _in_transaction(lambda connection: _keep_refined(connection, job_id, made))


def _keep_refined(connection: Connection, job_id: str, made: PlanText) -> None:
    """End the job and store its plan, both or neither."""
    plan_id = new_id()
    if job_records.end_job(connection, job_id, "succeeded", plan_id=plan_id):
        owner, parent_id = job_queries.owner_and_plan(connection, job_id)
        add_plan(connection, owner, made, plan_id=plan_id, parent_id=parent_id)


# --- computing ----------------------------------------------------------------------------------


class _Latest:
    """The newest progress a child has told of."""

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
            return part_records.note_progress(connection, job_id, done, number)

    try:
        return await asyncio.to_thread(note)
    except Exception as error:
        if not unavailable(error):
            raise
        return True


async def _stay_if_closing() -> None:
    """Never come back in a process that is about to end: another one takes the workflow up."""
    while current().closing.is_set():
        await asyncio.sleep(1.0)


async def _in_transaction(function: Callable[[Connection], T]) -> T:
    """Return what a function does in a transaction, waiting for the database if it is away."""

    def transact() -> T:
        with current().database.writing() as connection:
            return function(connection)

    return await asyncio.to_thread(patiently, transact)
