"""Durable workflows: each is one part of a job, and none waits for another.

    begin_job:  start --> measure, divide into batches --> compute_batch each --> conclude_job
                start --> compute whole

A part is entered in the transaction that finishes the one before: the first batches when the job is
divided, each later one when an earlier one ends, the conclusion when the last one ends. A part may
run twice, even on two workers, if one of them is presumed dead: it writes the same, and only once.
The row of a job in the database decides whether it has ended: a part that finds its job ended, or
begun by another version, does nothing.

Names of workflows and queues are stored with every job begun, so they must not change.
"""

import asyncio
from collections.abc import Sequence
from itertools import pairwise

from dbos import DBOS
from sqlalchemy import Connection

from api.documents import PlanText
from api.job_kinds.job_kind import Batch, JobReport
from api.job_kinds.job_table import JOB_KINDS
from api.jobs.parts import Part, computed, current, in_transaction
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
from api.storage.part_records import BEGINNING, CONCLUSION
from api.storage.tables import next_id, plans
from syncplan.estimation.trials import CHUNK_TRIALS

SHORTEST_S = 1.0


def batches_of(runs: Sequence[tuple[int, float]], batch_s: float, processes: int) -> list[Batch]:
    """Return the batches of runs given as (trials, seconds per trial).

    A batch takes about `batch_s`, or less if that would leave processes idle. A single run has
    equally many batches for each process, so that none waits for another's last one. A batch begins
    at a multiple of CHUNK_TRIALS, so that no division changes a byte of the result.
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


_AHEAD = 256
"""Most batches of a job in the queue."""


@DBOS.workflow(name=BEGIN_WORKFLOW, max_recovery_attempts=1000)
async def begin_job(job_id: str) -> None:
    """Divide a job into batches, or compute it whole."""
    with current().at(job_id):
        job = await in_transaction(job_records.start_job, job_id, VERSION)
        if job is None:
            return
        if JOB_KINDS[job.spec.kind].divided:
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
        runs = await computed(Part(job, BEGINNING, "measuring", "measured_runs"))
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
    data = await computed(Part(job, number, name, "computed_batch", (batch,)))
    if data is None:
        return

    def keep(connection: Connection) -> None:
        shows = JOB_KINDS[job.spec.kind].keeps_trials
        if part_records.keep_batch(connection, job_id, number, data, shows=shows):
            _enter_next(connection, job, range(_AHEAD - 1, _AHEAD))

    await in_transaction(keep)


def _enter_next(connection: Connection, job: BegunJob, places: range) -> None:
    """Enter the batches at these places among those without a result.

    Enters the conclusion if no batch is without a result.
    """
    queue, job_id = current().queue, job.spec.id
    entered = part_records.unfinished_batches(
        connection, job_id, most=len(places), skipped=places.start
    )
    queue.add_batches(connection, job_id, job.owner, entered)
    if not entered and not part_records.unfinished_batches(connection, job_id, most=1):
        queue.add_conclusion(connection, job_id, job.owner)


async def _conclude(job: BegunJob) -> None:
    batches = await in_transaction(part_records.finished_batches, job.spec.id)
    part = Part(job, CONCLUSION, "the report", "concluded_job", (batches,))
    await _succeed(job, await computed(part))


async def _compute_whole(job: BegunJob) -> None:
    runtime = current()
    # processes of its own, in addition to those at work for others
    workers = max(runtime.settings.process_count - runtime.pool.depth().running, 1)
    part = Part(job, BEGINNING, f"the {job.spec.kind}", "computed_job", (workers,), resumes=True)
    await _succeed(job, await computed(part))


async def _succeed(job: BegunJob, result: PlanText | JobReport | None) -> None:
    """End a job and store its result, if there is one, in one transaction."""
    if result is None:
        return
    job_id = job.spec.id

    def keep(connection: Connection) -> bool:
        if isinstance(result, JobReport):
            return job_records.end_job(connection, job_id, "succeeded", report=result)
        plan_id, _ = next_id(connection, plans, job.owner)
        if not job_records.end_job(connection, job_id, "succeeded", plan_id=plan_id):
            return False
        add_plan(connection, job.owner, result, plan_id=plan_id, parent_id=job.plan_id)
        return True

    if await in_transaction(keep):
        await asyncio.to_thread(current().counts.job_over, job_id)
