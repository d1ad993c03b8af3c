"""What child processes do: plain values in, plain values out, all numbers by syncplan.

Jobs are described by a JobSpec. The trials of a validation are one run; those of a sweep one for
each of its rows. A child keeps what it set up for the job it served last.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

from api.computing.inputs import Syntax, loaded_body, loaded_plan
from api.limits import Limits
from api.requests import REQUESTS, RefinementRequest, SweepRequest, ValidationRequest
from syncplan.estimation.trials import CHUNK_TRIALS
from syncplan.planning.validation import TrialRun
from syncplan.scenario.loading import decoded, parse_document, scenario_from

__all__ = [
    "Cut",
    "JobSpec",
    "PlanText",
    "checked_request",
    "finished_report",
    "flown_part",
    "made_plan",
    "measured_runs",
    "refined_plan",
    "warm_up",
]

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class PlanText:
    """A plan as the bytes that a file of it would hold, and what lists show of it."""

    text: str
    name: str | None
    vehicles: int
    observable: bool
    predicted_rms_m: float | None


@dataclass(frozen=True, slots=True)
class JobSpec:
    """A job: what kind, what was asked, and the plan it is about (None for a sweep)."""

    id: str
    kind: Literal["refinement", "validation", "sweep"]
    request: str
    plan: str | None


@dataclass(frozen=True, slots=True)
class Cut:
    """A part of a job: trials of one of its runs."""

    run: int
    first_trial: int
    trials: int


# --- requests -----------------------------------------------------------------------------------


def made_plan(body: bytes, syntax: Syntax, limits: Limits, steady: bool) -> PlanText:
    """Return the plan of a scenario as it was sent, or of a plan's orbits, judged afresh.

    Raises InputError, NoSolutionError.
    """
    from syncplan.planning.plan_files import plan_of

    return _as_plan_text(plan_of(loaded_body(body, syntax, limits), steady=steady))


def checked_request(
    kind: str, body: bytes, syntax: Syntax, limits: Limits, plan_text: str | None
) -> tuple[str, int]:
    """Return a job's request, checked and with defaults filled in, as JSON, and its work.

    The work of a refinement is counted in starts, that of others in trials. Raises InputError.
    """
    from pydantic import ValidationError

    from syncplan.scenario.loading import validation_fault

    model = REQUESTS[kind]
    document = parse_document(decoded(body, ""), "", syntax) if body.strip() else {}
    try:
        request = model.model_validate(document)
    except ValidationError as error:
        validation_fault(error, model, "")
    subject = None if plan_text is None else loaded_plan(plan_text)
    request = request.settled(subject, limits)
    work = request.work(subject, limits)
    return request.model_dump_json(exclude_none=True), work


# --- jobs ---------------------------------------------------------------------------------------


def refined_plan(spec: JobSpec, workers: int, progress: Progress) -> PlanText:
    """Return the refined plan, or the plan itself with the reason why it could not be bettered.

    Progress is told in starts that must have ended, since others have begun.
    """
    from syncplan.planning.plan_files import plan_of
    from syncplan.refinement.refiner import refine

    assert spec.plan is not None
    changes = RefinementRequest.model_validate_json(spec.request).changes()
    begun: set[int] = set()

    def told(start: int, iteration: int, objective: float) -> None:
        begun.add(start)
        progress(max(len(begun) - workers, 0))

    better = refine(plan_of(loaded_plan(spec.plan)), workers=workers, progress=told, **changes)
    return _as_plan_text(better)


def measured_runs(spec: JobSpec) -> list[tuple[int, float]]:
    """Return the trials, and about how many seconds a trial takes here, for each run of a job.

    The first run is timed; the others count by their samples and sightings.
    """
    from syncplan.planning.validation import run_part

    runs = _runs(spec)
    count = min(CHUNK_TRIALS, runs[0].trials)
    run_part(runs[0], 0, 1, threads=1)
    began = time.perf_counter()
    run_part(runs[0], 0, count, threads=1)
    seconds = (time.perf_counter() - began) / count
    sizes = [run.steps + len(run.sightings.observers) for run in runs]
    return [(run.trials, seconds * size / sizes[0]) for run, size in zip(runs, sizes, strict=True)]


def flown_part(spec: JobSpec, cut: Cut, progress: Progress) -> bytes:
    """Return a part of a job's trials as bytes."""
    from syncplan.estimation.trial_archive import pack
    from syncplan.planning.validation import run_part

    run = _runs(spec)[cut.run]
    return pack(run_part(run, cut.first_trial, cut.trials, threads=1, progress=progress))


def finished_report(spec: JobSpec, parts: Sequence[tuple[Cut, bytes]]) -> tuple[str, bytes | None]:
    """Return the report that all parts of a job come to, as the text a file of it would hold.

    Beside it, the figures of each trial of a validation, packed.
    """
    from syncplan.estimation.trial_archive import pack, unpack
    from syncplan.planning.sweeps import ValidatedRow
    from syncplan.planning.validation import conclude
    from syncplan.reports.validation_report import sweep_document, validation_document
    from syncplan.runtime.files import as_text

    runs = _runs(spec)
    ordered = sorted(parts, key=lambda item: (item[0].run, item[0].first_trial))
    concluded = [
        conclude(run, [unpack(data) for cut, data in ordered if cut.run == k])
        for k, run in enumerate(runs)
    ]
    reports = [validation_document(one) for one in concluded]
    if spec.kind == "validation":
        return as_text(reports[0].as_json()), pack(concluded[0].result)
    request = SweepRequest.model_validate_json(spec.request)
    rows = [
        ValidatedRow(row.label, row.value, one)
        for row, one in zip(_planned(spec), concluded, strict=True)
    ]
    return as_text(sweep_document(request.swept()[0], rows, reports).as_json()), None


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> list[TrialRun]:
    from syncplan.planning.plan_files import plan_of
    from syncplan.planning.validation import trial_run

    if spec.kind == "sweep":
        options = SweepRequest.model_validate_json(spec.request).run_options()
        return [trial_run(row.plan, **options) for row in _planned(spec)]
    assert spec.plan is not None
    options = ValidationRequest.model_validate_json(spec.request).run_options()
    return [trial_run(plan_of(loaded_plan(spec.plan)), **options)]


@lru_cache(maxsize=2)
def _planned(spec: JobSpec) -> list[Any]:
    from syncplan.planning.sweeps import planned_rows

    request = SweepRequest.model_validate_json(spec.request)
    scenario = scenario_from(request.scenario)
    name, values = request.swept()
    return planned_rows(scenario, name, values, connected=request.connected)


def _as_plan_text(made: Any) -> PlanText:
    from syncplan.reports.plan_report import plan_document
    from syncplan.runtime.files import as_text

    document = plan_document(made)
    predicted = document.predicted_rms_m
    return PlanText(
        text=as_text(document.as_json()),
        name=made.scenario.name,
        vehicles=made.orbits.count,
        observable=made.observable,
        predicted_rms_m=None if predicted is None else predicted.overall,
    )


def warm_up(trials: bool) -> None:
    """Load what the first task would otherwise wait for; with `trials`, the filter as well."""
    from syncplan.planning.planner import plan

    made = plan(scenario_from(_SMALL))
    _as_plan_text(made)
    if trials:
        from syncplan.planning.validation import run_part, trial_run

        run_part(trial_run(made, trials=1, duration=1.0), 0, 1, threads=1)


_SMALL = {
    "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
    "formation": {"centers_m": [[0.0, 0.0], [70.0, 0.0]]},
    "landmarks_m": [[0.0, 40.0], [70.0, 40.0]],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 0.1},
}
