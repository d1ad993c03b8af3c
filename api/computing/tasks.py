"""What child processes do: plain values in, plain values out, all numbers by syncplan.

The trials of a validation or a flight are one run; those of a sweep one for each of its rows. A
child keeps what it set up for the job it served last.
"""

import time
from collections.abc import Sequence
from typing import Any

from api.job_kinds.job_kind import JobSubject
from api.job_kinds.job_table import JOB_KINDS
from api.job_kinds.job_tasks import (
    Batch,
    EarlierWork,
    JobReport,
    JobSpec,
    Progress,
    TrialTask,
    WholeTask,
)
from api.limits import RequestLimits
from api.packed_recordings import overview_of_text, packed_recording
from api.plan_texts import PlanText, Syntax, as_plan_text, loaded_body, loaded_plan
from syncplan.estimation.trials import CHUNK_TRIALS
from syncplan.reports.job_contract import JobKindName
from syncplan.scenario.loading import decoded, parse_document, scenario_from

__all__ = [
    "checked_request",
    "computed_batch",
    "computed_job",
    "concluded_job",
    "made_plan",
    "measured_runs",
    "packed_recording",
    "warm_up",
]


# --- requests -----------------------------------------------------------------------------------


def made_plan(body: bytes, syntax: Syntax, limits: RequestLimits, steady: bool) -> PlanText:
    """Return the plan of a scenario as it was sent, or of a plan's orbits, judged afresh.

    Raises InputError, NoSolutionError.
    """
    from syncplan.planning.plan_files import plan_of

    return as_plan_text(plan_of(loaded_body(body, syntax, limits), steady=steady))


def checked_request(
    kind: JobKindName,
    body: bytes,
    syntax: Syntax,
    limits: RequestLimits,
    plan_text: str | None,
    overview: str | None = None,
) -> tuple[str, int]:
    """Return a job's request, checked and with defaults filled in, as JSON, and its work.

    It is about a plan, or a recording in short, or neither. The work is counted in the kind's
    unit. Raises InputError.
    """
    from pydantic import ValidationError

    from syncplan.scenario.quantities import validation_fault

    model = JOB_KINDS[kind].request
    document = parse_document(decoded(body, ""), "", syntax) if body.strip() else {}
    try:
        request = model.model_validate(document)
    except ValidationError as error:
        validation_fault(error, model, "")
    subject: JobSubject = None
    if plan_text is not None:
        subject = loaded_plan(plan_text)
    elif overview is not None:
        subject = overview_of_text(overview)
    request = request.settled(subject, limits)
    work = request.work(subject, limits)
    return request.model_dump_json(exclude_none=True), work


# --- jobs ---------------------------------------------------------------------------------------


def computed_job(
    spec: JobSpec, earlier: EarlierWork, workers: int, progress: Progress
) -> PlanText | JobReport:
    """Return the result of a job that is computed whole, by up to `workers` processes."""
    task = JOB_KINDS[spec.kind].task
    assert isinstance(task, WholeTask)
    return task.compute(spec, earlier, workers, progress)


def measured_runs(spec: JobSpec) -> list[tuple[int, float]]:
    """Return the trials, and about how many seconds a trial takes here, for each run of a job.

    The first run is timed; the others count by their effort.
    """
    task = _trial_task(spec)
    runs, method = task.runs(spec), task.method
    count = min(CHUNK_TRIALS, runs[0].trials)
    method.compute(runs[0], 0, 1, None)
    began = time.perf_counter()
    method.compute(runs[0], 0, count, None)
    seconds = (time.perf_counter() - began) / count
    efforts = [method.effort(run) for run in runs]
    return [
        (run.trials, seconds * effort / efforts[0])
        for run, effort in zip(runs, efforts, strict=True)
    ]


def computed_batch(spec: JobSpec, batch: Batch, progress: Progress) -> bytes:
    """Return the trials of a batch as bytes."""
    task = _trial_task(spec)
    run = task.runs(spec)[batch.run]
    return task.method.compute(run, batch.first_trial, batch.trials, progress)


def concluded_job(spec: JobSpec, batches: Sequence[tuple[Batch, bytes]]) -> JobReport:
    """Return the report of a job whose batches are all computed."""
    task = _trial_task(spec)
    ordered = sorted(batches, key=lambda item: (item[0].run, item[0].first_trial))
    concluded = [
        task.method.conclude(run, [data for batch, data in ordered if batch.run == k])
        for k, run in enumerate(task.runs(spec))
    ]
    return task.report(spec, concluded)


def _trial_task(spec: JobSpec) -> TrialTask[Any, Any]:
    task = JOB_KINDS[spec.kind].task
    assert isinstance(task, TrialTask)
    return task


def warm_up(trials: bool) -> None:
    """Load what the first task would otherwise wait for; with `trials`, the filter as well."""
    from syncplan.planning.planner import plan

    made = plan(scenario_from(_SMALL))
    as_plan_text(made)
    if trials:
        from syncplan.planning.validation import run_part, trial_run

        run_part(trial_run(made, trials=1, duration=1.0), 0, 1, threads=1)


_SMALL = {
    "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
    "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
    "landmarks_m": [[0.0, 40.0], [70.0, 40.0]],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
}
