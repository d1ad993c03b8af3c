"""Validations: Monte Carlo runs of the filter on a plan."""

import json
from collections.abc import Sequence
from functools import lru_cache

from api.documents import loaded_plan
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
from api.job_kinds.option_requests import SUBSTEPS, TRUTH, TrialRequest, takes_options
from api.limits import RequestLimits, check_trials
from syncplan.estimation.filter_options import ValidationOptions
from syncplan.planning.plan_files import Loaded
from syncplan.planning.validation import TrialRun, Validation
from syncplan.planning.variations import joined_worlds, stress_runs, stress_worlds
from syncplan.reports.validation_report import ValidationDocument


@takes_options(ValidationOptions, substeps=SUBSTEPS, truth=TRUTH)
class ValidationRequest(TrialRequest):
    """A Monte Carlo run of the filter on a plan."""

    def run_options(self) -> ValidationOptions:
        """Return the options of the trials."""
        return ValidationOptions.of_request(self.model_dump(exclude_none=True))

    def work(self, subject: JobSubject, limits: RequestLimits) -> int:
        """Return the number of trials; raises InputError if it exceeds a limit."""
        assert isinstance(subject, Loaded)
        scenario = subject.scenario
        self.check_run(scenario, limits)
        world = self.in_world(scenario)
        options = self.run_options()
        trials = options.trials * (1 + len(stress_worlds(world)) if options.stress else 1)
        check_trials(trials, scenario.size, limits)
        return trials


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


@lru_cache(maxsize=2)
def _runs(spec: JobSpec) -> list[TrialRun]:
    from syncplan.planning.plan_files import plan_of
    from syncplan.planning.validation import trial_run

    assert spec.plan is not None
    options = ValidationOptions.of_request(json.loads(spec.request))
    plan = plan_of(loaded_plan(spec.plan), pilot=False)
    if options.stress:
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
