"""Validations: Monte Carlo runs of the filter on a plan."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from api.documents import loaded_plan
from api.job_kinds.filter_requests import DEFAULTS, FilterRequest
from api.job_kinds.job_kind import (
    JobKind,
    JobOperation,
    JobReport,
    JobSpec,
    JobSubject,
    TrialMethod,
    TrialProgress,
    TrialTask,
)
from api.limits import RequestLimits, check_trials
from syncplan.estimation.filters import MotionName
from syncplan.planning.plan_files import Loaded
from syncplan.planning.validation import TrialRun, Validation
from syncplan.planning.variations import joined_worlds, stress_runs, stress_worlds
from syncplan.reports.run_schemas import ValidationDocument

if TYPE_CHECKING:
    from syncplan.planning.validation import TrialRun, Validation


def _computed(run: "TrialRun", first: int, trials: int, progress: TrialProgress) -> bytes:
    from syncplan.estimation.trial_archive import pack
    from syncplan.planning.validation import run_part

    return pack(run_part(run, first, trials, threads=1, progress=progress))


def _concluded(run: "TrialRun", parts: Sequence[bytes]) -> "Validation":
    from syncplan.estimation.trial_archive import unpack
    from syncplan.planning.validation import conclude

    return conclude(run, [unpack(one) for one in parts])


def _effort(run: "TrialRun") -> float:
    """Samples and sightings of a trial."""
    return run.steps + len(run.sightings.observers)


FILTER_TRIALS: "TrialMethod[TrialRun, Validation]" = TrialMethod(_computed, _concluded, _effort)


class ValidationRequest(FilterRequest):
    """A Monte Carlo run of the filter on a plan."""

    model: MotionName | None = Field(
        default=None,
        description="Former name of filter: arc is ekf, euler is paper",
        deprecated=True,
    )
    substeps: Annotated[int, Field(ge=1, le=1000)] = Field(
        default=DEFAULTS.substeps, description="Euler sub-steps per sample"
    )
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        default=None,
        description="Probability of the innovation gate; no gate if not given",
        examples=[0.999],
    )
    series: bool = Field(default=False, description="Add errors and sigmas over time")
    stress: bool = Field(
        default=False,
        description="Validate in worse worlds too: each stated sigma doubled, one by one and all, "
        "20 % of the sightings missed, 1 % of the bearings false",
    )

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of trials; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        world = self.in_world(scenario)
        trials = self.trials * (1 + len(stress_worlds(world)) if self.stress else 1)
        check_trials(trials, scenario.size, limits)
        return trials


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> list[TrialRun]:
    from syncplan.planning.plan_files import plan_of
    from syncplan.planning.validation import trial_run

    assert spec.plan is not None
    request = ValidationRequest.model_validate_json(spec.request)
    plan, options = plan_of(loaded_plan(spec.plan), pilot=False), request.run_options()
    if request.stress:
        return list(stress_runs(plan, options).values())
    return [trial_run(plan, options)]


def _report(spec: JobSpec, concluded: Sequence[Validation]) -> JobReport:
    from syncplan.estimation.trial_archive import pack
    from syncplan.reports.validation_report import stress_document, validation_document
    from syncplan.runtime.files import as_text

    nominal, *others = concluded
    if others:
        worlds = ["", *stress_worlds(nominal.plan.scenario)]
        report = stress_document(joined_worlds(worlds, concluded))
    else:
        report = validation_document(nominal)
    return JobReport(as_text(report.as_json()), trials=pack(nominal.result))


VALIDATION = JobKind(
    name="validation",
    title="validation",
    plural="validations",
    unit="trials",
    request=ValidationRequest,
    operation=JobOperation(
        id="validatePlan",
        path="/plans/{plan_id}/validations",
        summary="Validate a plan",
        description="Fly a plan many times with the filter: a job that reports errors and "
        "consistency.",
        body="How to fly; defaults if empty",
        body_required=False,
    ),
    task=TrialTask(runs=_runs, method=FILTER_TRIALS, report=_report),
    report=ValidationDocument,
    figures="run",
    keeps_trials=True,
)
