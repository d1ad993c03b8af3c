"""The durable workflows: each is one part of a job, and none waits for another.

    begin_job:  start --> measure, divide into batches --> compute_batch each --> conclude_job
                start --> compute whole

A part is entered in the transaction that finishes the one before: the first batches where the job
is divided, each later one where an earlier one ends, the conclusion where the last one ends. A part
may run twice, even on two workers, when one of them is presumed dead: it writes the same, and only
once. What ends a job is its row in the database: a part that finds its job ended, or begun by
another version, does nothing.

Names of workflows and queues are in the database of every job begun: they stay as they are.
"""

import asyncio
from collections.abc import Sequence
from itertools import pairwise

from dbos import DBOS
from sqlalchemy import Connection

from api.computing.turns import Ticket
from api.documents import PlanText
from api.job_kinds.job_kind import Batch, EarlierWork, JobReport, Progress, TrialTask
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.parts import Part, Submit, WatchedPart, computed, current, in_transaction
from api.jobs.queue import (
    BATCH_WORKFLOW,
    BEGIN_WORKFLOW,
    CONCLUDE_WORKFLOW,
    VERSION,
    batch_id,
    conclusion_id,
)
from api.storage import job_records, part_records
from api.storage.holdings import add_plan
from api.storage.job_records import BegunJob
from api.storage.part_records import BEGINNING, CONCLUSION, PartHistory
from api.storage.tables import moment, new_id
from syncplan.estimation.trials import CHUNK_TRIALS

SHORTEST_S = 1.0


def batches_of(runs: Sequence[tuple[int, float]], batch_s: float, processes: int) -> list[Batch]:
    """Return the batches of runs given as (trials, seconds a trial takes).

    A batch takes about `batch_s`, or less where that leaves processes idle. The batches of a single
    run are as many for each process, so that none waits for another's last one. A batch begins at a
    multiple of CHUNK_TRIALS, so that no division changes a byte of the result.
    """
    total_s = sum(trials * seconds for trials, seconds in runs)
    aim_s = min(batch_s, max(total_s / processes, SHORTEST_S))
    batches = []
    for number, (trials, seconds) in enumerate(runs):
        chunks = -(-trials // CHUNK_TRIALS)
        count = max(round(trials * seconds / aim_s), 1)
        if len(runs) == 1 and count > 1:
            count = -(-count // processes) * processes
        count = min(count, chunks)
        # as even as whole chunks allow
        edges = [CHUNK_TRIALS * (chunks * k // count) for k in range(count)] + [trials]
        batches += [Batch(number, first, last - first) for first, last in pairwise(edges)]
    return batches


# --- workflows ------------------------------------------------------------------------------------


_BEYOND_OWN_LIMIT = 2.0
"""A job computed whole may take so many times as long as it may be asked to, at least."""

_AHEAD = 256
"""How many batches of a job are in the queue at most."""


@DBOS.workflow(name=BEGIN_WORKFLOW, max_recovery_attempts=1000)
async def begin_job(job_id: str) -> None:
    """Divide a job into batches, or compute it whole."""
    with current().at(job_id):
        job = await in_transaction(job_records.start_job, job_id, VERSION)
        if job is None:
            return
        if isinstance(JOB_KINDS[job.spec.kind].task, TrialTask):
            await _divide(job)
        else:
            await _compute_whole(job)


@DBOS.workflow(name=BATCH_WORKFLOW, max_recovery_attempts=1000)
async def compute_batch(job_id: str, number: int) -> None:
    """Compute a batch of a job's trials."""
    with current().at(batch_id(job_id, number)):
        job = await in_transaction(job_records.begun_job, job_id, VERSION)
        if job is None:
            await asyncio.to_thread(current().queue.drop, job_id)
        else:
            await _compute_batch(job, number)


@DBOS.workflow(name=CONCLUDE_WORKFLOW, max_recovery_attempts=1000)
async def conclude_job(job_id: str) -> None:
    """Make the report of a job whose batches are all computed."""
    with current().at(conclusion_id(job_id)):
        job = await in_transaction(job_records.begun_job, job_id, VERSION)
        if job is not None:
            await _conclude(job)


# --- parts --------------------------------------------------------------------------------------


async def _divide(job: BegunJob) -> None:
    runtime, job_id = current(), job.spec.id
    batches = []
    if not await in_transaction(part_records.is_divided, job_id):
        runs = await computed(
            Part(job_id, BEGINNING, "measuring", _limit_s(job)),
            _task(job, "measured_runs", job.spec),
        )
        if runs is None:
            return
        batches = batches_of(runs, runtime.settings.batch_s, runtime.settings.process_count)

    def divide(connection: Connection) -> None:
        if part_records.divide_job(connection, job_id, batches, job.begun):
            _enter_next(connection, job, range(_AHEAD))

    await in_transaction(divide)


async def _compute_batch(job: BegunJob, number: int) -> None:
    job_id = job.spec.id
    batch = await in_transaction(part_records.next_batch, job_id, number)
    if batch is None:
        return
    name = f"the batch of trials {batch.first_trial} to {batch.first_trial + batch.trials - 1}"
    data = await computed(
        Part(job_id, number, name, _limit_s(job)),
        _task(job, "computed_batch", job.spec, batch, with_progress=True),
    )
    if data is None:
        return

    def keep(connection: Connection) -> None:
        if part_records.keep_batch(connection, job_id, number, data):
            _enter_next(connection, job, range(_AHEAD - 1, _AHEAD))

    await in_transaction(keep)


def _enter_next(connection: Connection, job: BegunJob, places: range) -> None:
    """Enter those of the batches without a result that are at some places among them.

    The conclusion is entered where there are none.
    """
    queue, job_id = current().queue, job.spec.id
    entered = part_records.unfinished_batches(
        connection, job_id, most=len(places), skipped=places.start
    )
    queue.add_batches(connection, job_id, job.owner, entered)
    if not entered and not part_records.unfinished_batches(connection, job_id, most=1):
        queue.add_conclusion(connection, job_id, job.owner)


async def _conclude(job: BegunJob) -> None:
    job_id = job.spec.id
    batches = await in_transaction(part_records.finished_batches, job_id)
    result = await computed(
        Part(job_id, CONCLUSION, "the report", _limit_s(job)),
        _task(job, "concluded_job", job.spec, batches),
    )
    await _succeed(job, result)


async def _compute_whole(job: BegunJob) -> None:
    runtime = current()
    # processes of its own, beside those at work for others
    workers = max(runtime.settings.process_count - runtime.pool.depth().running, 1)

    async def submit(watched: WatchedPart, history: PartHistory) -> Ticket:
        # each time: an attempt that died has left some
        starts = await in_transaction(part_records.finished_starts, job.spec.id)
        earlier = EarlierWork(starts, history.computed_s)
        return _submitted(job, "computed_job", job.spec, earlier, workers, progress=watched.take)

    kind = JOB_KINDS[job.spec.kind].title
    await _succeed(
        job, await computed(Part(job.spec.id, BEGINNING, f"the {kind}", _limit_s(job)), submit)
    )


def _task(job: BegunJob, task: str, *arguments: object, with_progress: bool = False) -> Submit:
    """How a task of a job is handed in."""

    async def submit(watched: WatchedPart, _history: PartHistory) -> Ticket:
        progress = watched.take if with_progress else None
        return _submitted(job, task, *arguments, progress=progress)

    return submit


def _submitted(job: BegunJob, task: str, *arguments: object, progress: Progress | None) -> Ticket:
    """A task of a job, handed in; a child that dies is for the part to count."""
    runtime = current()
    return runtime.pool.submit(
        task,
        *arguments,
        owner=job.owner,
        timeout_s=_limit_s(job),
        retries=0,
        progress=progress,
    )


def _limit_s(job: BegunJob) -> float:
    """How long a part of a job may take; a job computed whole has a limit of its own, too."""
    settings = current().settings
    if isinstance(JOB_KINDS[job.spec.kind].task, TrialTask):
        return settings.job_task_s
    return max(settings.job_task_s, _BEYOND_OWN_LIMIT * settings.max_refine_s)


async def _succeed(job: BegunJob, result: PlanText | JobReport | None) -> None:
    """End a job with its result, if there is one: the job and what is stored of it, or neither."""
    if result is None:
        return
    job_id = job.spec.id

    def keep(connection: Connection) -> bool:
        if isinstance(result, JobReport):
            return job_records.end_job(connection, job_id, "succeeded", report=result)
        plan_id = new_id(moment(connection))
        if not job_records.end_job(connection, job_id, "succeeded", plan_id=plan_id):
            return False
        owner, parent_id = job_records.owner_and_plan(connection, job_id)
        add_plan(connection, owner, result, plan_id=plan_id, parent_id=parent_id)
        return True

    if await in_transaction(keep):
        await asyncio.to_thread(current().counts.job_over, job_id)
