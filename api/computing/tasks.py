"""Tasks of child processes: plain values in, plain values out, all computation by syncplan.

The trials of a validation or a flight are one run; those of a sweep are one run for each row. A
child keeps the set-up of the job it served last.
"""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from pydantic import BaseModel, ValidationError

from api.documents import (
    PlanRenaming,
    PlanText,
    RecordingRenaming,
    Syntax,
    as_plan_text,
    loaded_body,
    loaded_plan,
    overview_of_text,
    renamed_text,
)

# a task without a wrapper
from api.documents import packed_recording as packed_recording
from api.job_kinds.job_kind import (
    Batch,
    EarlierWork,
    JobReport,
    JobRequest,
    JobSpec,
    JobSubject,
    Progress,
    Shown,
)
from api.job_kinds.job_table import JOB_KINDS
from api.limits import RequestLimits
from syncplan.errors import InputError
from syncplan.estimation.divided_runs import RunOfTrials
from syncplan.estimation.trials import CHUNK_TRIALS
from syncplan.importing.import_options import ImportOptions
from syncplan.importing.imported_places import import_places
from syncplan.planning.loss_study import what_if
from syncplan.planning.plan_files import plan_of
from syncplan.planning.planner import BoundChoice, JudgementOptions, plan, with_flights
from syncplan.planning.plans import Plan
from syncplan.planning.validation import trial_run
from syncplan.recordings.log import unpack_log
from syncplan.reports.covariance_report import position_covariances_document
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.reports.presentations import report_of
from syncplan.reports.refinement_report import RefinementResult
from syncplan.results.stories import summary_of
from syncplan.runtime.files import as_text
from syncplan.scenario.loading import decoded, parse_document, scenario_from
from syncplan.scenario.quantities import validation_fault
from syncplan.studies.job_contract import JobKindName
from syncplan.studies.study import Execution, TrialStudy

if TYPE_CHECKING:
    from syncplan.exporting.format_table import ExportOptions
    from syncplan.plotting.canvas import Spec
    from syncplan.plotting.figure_style import FigureStyle

# --- requests -----------------------------------------------------------------------------------


M = TypeVar("M", bound=BaseModel)


def _checked(model: type[M], body: bytes, syntax: Syntax) -> M:
    """Return the request in a body, which may be empty; raises InputError."""
    document = parse_document(decoded(body, ""), "", syntax) if body.strip() else {}
    try:
        return model.model_validate(document)
    except ValidationError as error:
        validation_fault(error, model, "")


def made_plan(
    body: bytes, syntax: Syntax, limits: RequestLimits, steady: bool, paper: bool = False
) -> PlanText:
    """Return the plan of a scenario that was sent, or a plan with its own orbits judged afresh.

    Raises InputError, NoSolutionError.
    """
    return as_plan_text(plan_of(loaded_body(body, syntax, limits), steady=steady, pilot=not paper))


def checked_request(
    kind: JobKindName,
    body: bytes,
    syntax: Syntax,
    limits: RequestLimits,
    plan_text: str | None,
    overview: str | None = None,
) -> tuple[str, int]:
    """Return a job's request as JSON, checked and with defaults filled in, and its work.

    The request is about a plan, a recording with this overview, or neither. The work is in the
    kind's unit. Raises InputError.
    """
    request = _checked(JOB_KINDS[kind].request, body, syntax)
    subject: JobSubject = None
    if plan_text is not None:
        subject = loaded_plan(plan_text)
    elif overview is not None:
        subject = overview_of_text(overview)
    request = request.settled(subject, limits)
    work = request.work(subject, limits)
    return request.model_dump_json(exclude_none=True), work


def imported(body: bytes, name: str, options: ImportOptions) -> str:
    """Return the features of a file and what they become, as JSON; raises InputError."""
    return as_text(import_places({name: body}, **asdict(options)).as_json())


def renamed_plan(body: bytes, syntax: Syntax, text: str) -> tuple[str, str]:
    """Return the name that is asked for and the plan's text with it; raises InputError."""
    name = _checked(PlanRenaming, body, syntax).name
    return name, renamed_text(text, name)


def renamed_recording(body: bytes, syntax: Syntax, overview: str) -> str:
    """Return the overview, as JSON, with the name that is asked for; raises InputError."""
    name = _checked(RecordingRenaming, body, syntax).name
    return json.dumps({**json.loads(overview), "name": name})


# --- jobs ---------------------------------------------------------------------------------------


def computed_job(
    spec: JobSpec, earlier: EarlierWork, workers: int, progress: Progress
) -> PlanText | JobReport:
    """Return the result of a job computed whole, by up to `workers` processes."""
    kind, request = JOB_KINDS[spec.kind], _request_of(spec)

    def heard(done: int, **known: Any) -> None:
        progress(Shown(done, known) if known else done)

    how = Execution(workers=workers, progress=heard, earlier=earlier.resumed(progress))
    result = kind.study.run(_subject_of(spec, request), request.options(), how)
    return as_plan_text(result) if kind.report is None else _job_report(result)


@dataclass(frozen=True, slots=True)
class DividedJob:
    """A job whose study consists of trials, with the set-ups of its runs."""

    study: TrialStudy
    subject: Any
    options: Any
    runs: list[RunOfTrials]

    def report(self, results: Sequence[Any]) -> JobReport:
        """Return the report on the results of the runs."""
        trials = self.runs[0].pack(results[0].result) if self.study.keeps_trials else None
        return _job_report(self.study.joined(self.subject, self.options, results), trials)


@lru_cache(maxsize=2)
def _divided(spec: JobSpec) -> DividedJob:
    study, request = JOB_KINDS[spec.kind].study, _request_of(spec)
    assert isinstance(study, TrialStudy)
    subject, options = _subject_of(spec, request), request.options()
    return DividedJob(study, subject, options, [*study.runs(subject, options)])


def _request_of(spec: JobSpec) -> JobRequest:
    return JOB_KINDS[spec.kind].request.model_validate_json(spec.request)


def _subject_of(spec: JobSpec, request: JobRequest) -> Any:
    """What a job is about: its plan, its recording, or what its request states."""
    if spec.plan is not None:
        return _judged(spec.plan)
    if JOB_KINDS[spec.kind].about != "recording":
        return request.subject()
    if spec.recording is None or spec.overview is None:
        raise InputError("the recording was deleted; send it again", key="recording_id")
    # it may have been renamed since it was packed
    return replace(unpack_log(spec.recording), name=json.loads(spec.overview)["name"])


def _job_report(result: Any, trials: bytes | None = None) -> JobReport:
    return JobReport(as_text(report_of(result).as_json()), trials=trials)


def measured_runs(spec: JobSpec) -> list[tuple[int, float]]:
    """Return (trials, approximate seconds per trial on this machine) for each run of a job.

    The first run is timed; the others are scaled by their effort.
    """
    runs = _divided(spec).runs
    first = runs[0]
    count = min(CHUNK_TRIALS, first.trials)
    first.part(0, 1, threads=1)
    began = time.perf_counter()
    first.part(0, count, threads=1)
    seconds = (time.perf_counter() - began) / count
    return [(run.trials, seconds * run.effort / first.effort) for run in runs]


def computed_batch(spec: JobSpec, batch: Batch, progress: Progress) -> bytes:
    """Return the trials of a batch as bytes."""
    run = _divided(spec).runs[batch.run]
    return run.pack(run.part(batch.first_trial, batch.trials, threads=1, progress=progress))


def concluded_job(spec: JobSpec, batches: Sequence[tuple[Batch, bytes]]) -> JobReport:
    """Return the report of a job whose batches are all computed."""
    job = _divided(spec)
    ordered = sorted(batches, key=lambda item: (item[0].run, item[0].first_trial))
    return job.report(
        [
            run.concluded([run.unpack(data) for batch, data in ordered if batch.run == k])
            for k, run in enumerate(job.runs)
        ]
    )


def load() -> Iterator[None]:
    """Load what tasks would otherwise wait for: first what plans need, then the rest."""
    flown = plan(scenario_from(_FLOWN))
    text = as_plan_text(flown).text
    ready()
    yield
    plan(scenario_from(_ODD_CYCLE), pilot=False)
    trial_run(flown, trials=1, duration=1.0).part(0, 1, threads=1)
    judged_losses(text, [], 1, "auto")
    printed_report(text, "")
    import syncplan.refinement.smooth_team  # noqa: F401


def ready() -> None:
    """Load what the first preview would otherwise wait for."""
    import syncplan.plotting.figures  # noqa: F401


_FLOWN = {
    "orbit": {"radius_m": 20.0, "angular_rate_rad_s": 0.2, "direction": "ccw"},
    "formation": {"centers_m": [[0, 0], [70, 0], [140, 0], [140, 70], [70, 70], [0, 70]]},
    "landmarks_m": [[190, 0], [190, 70]],
    "sensor": {"range_m": 50.0, "bearing_sigma_rad": 0.1, "sample_time_s": 1.0},
    "motion": {"speed_sigma_mps": 0.1, "turn_rate_sigma_rad_s": 0.01},
    "initial_sigma": {"position_m": 5.0, "heading_rad": 0.1},
}
"""Scenario of the usual size and few samples, whose plan is flown."""
_ODD_CYCLE = {**_FLOWN, "formation": {"centers_m": [[0, 0], [70, 0], [35, 60]]}}
"""Scenario whose phases no rule gives."""


# --- previews, figures, losses, exports -----------------------------------------------------------


_QUICK: JudgementOptions = {
    "bound": "never",
    "single_points": False,
    "connectivity": False,
}
"""Judgements left out while a user drags, in addition to the bound of the margin."""


def previewed(
    body: bytes,
    syntax: Syntax,
    limits: RequestLimits,
    quick: bool,
    names: Sequence[str],
    style: "FigureStyle",
    covariances: bool = False,
    paper: bool = False,
) -> str:
    """Return the plan of `made_plan`, with its figures, as JSON; raises the same errors.

    A `quick` plan leaves out what takes most of the time; its findings name what is missing.
    `covariances` adds those of positions.
    """
    if quick:
        made = plan_of(loaded_body(body, syntax, limits), margin_bound=False, **_QUICK)
    else:
        made = with_flights(_on_paper(body, syntax, limits), pilot=not paper)
    specs = _specs(made, names, style) if names else {}
    added = {"covariances": position_covariances_document(made).as_json()} if covariances else {}
    return _compact({"plan": plan_document(made).as_json(), "figures": specs, **added})


@lru_cache(maxsize=1)
def _on_paper(body: bytes, syntax: Syntax, limits: RequestLimits) -> Plan:
    # the page asks for a plan on paper, and then for its flights
    return plan_of(loaded_body(body, syntax, limits))


def plan_figure(text: str, name: str, style: "FigureStyle", parent_text: str | None) -> str:
    """Return a figure of a plan as JSON; raises InputError if the plan does not have it.

    With its parent's text, the plan is shown beside its parent.
    """
    if parent_text is not None:
        return _compact(_specs(_judged(parent_text), [name], style, after=_judged(text))[name])
    record = json.loads(text).get("refinement")
    refined = None if record is None else RefinementResult.model_validate(record)
    return _compact(_specs(_judged(text), [name], style, refined=refined)[name])


def report_figure(text: str, kind: JobKindName, name: str, style: "FigureStyle") -> str:
    """Return a figure of a job's report as JSON; raises InputError."""
    return _compact(_specs(_report(text, kind), [name], style)[name])


def _report(text: str, kind: JobKindName) -> Any:
    """The result of a job: its report, or the plan that it made."""
    return (JOB_KINDS[kind].report or PlanDocument).model_validate_json(text)


def figure_so_far(
    spec: JobSpec, batches: Sequence[tuple[Batch, bytes]], name: str, style: "FigureStyle"
) -> str:
    """Return a figure of a job under way as JSON: of the report on the first trials of its run.

    Raises InputError.
    """
    job = _divided(spec)
    whole: Any = job.runs[0]
    trials = sum(batch.trials for batch, _ in batches)
    run = replace(whole, options=replace(whole.options, trials=trials))
    report = job.report([run.concluded([run.unpack(data) for _, data in batches])])
    return report_figure(report.text, spec.kind, name, style)


def summary(text: str, kind: JobKindName) -> str:
    """Return the result of a job, a report or a plan, in lines and tables of HTML."""
    report = _report(text, kind)
    return summary_of(getattr(report, "refinement", report))


def _specs(
    subject: Any, names: Sequence[str], style: "FigureStyle", **beside: Any
) -> dict[str, "Spec"]:
    from syncplan.plotting.figures import specs_of

    return specs_of(subject, names, style=style, **beside)


def plan_covariances(text: str) -> str:
    """Return the covariances of a plan's positions as JSON; raises NoSolutionError."""
    return _compact(position_covariances_document(_judged(text)).as_json())


def printed_report(text: str, plan_id: str) -> str:
    """Return a plan's report for printed sheets, as HTML."""
    from syncplan.plotting.printed_report import report_page

    return report_page(_judged(text), identifier=plan_id)


def judged_losses(text: str, lose: Sequence[str], losses: Literal[1, 2], bound: BoundChoice) -> str:
    """Return the effects of losses on a plan as JSON; raises InputError for an unknown name."""
    found = what_if(_judged(text), lose, losses=losses, bound=bound, threads=1)
    return as_text(found.as_json())


def chosen_landmarks(text: str, candidates: Sequence[str], choose: int, seed: int) -> str:
    """Return the best of a plan's own landmarks as JSON; raises InputError, NoSolutionError."""
    from syncplan.landmarks.site_choice import choose_landmarks
    from syncplan.reports.sites_report import sites_document

    found = choose_landmarks(_judged(text), candidates, choose, seed=seed)
    return as_text(sites_document(found).as_json())


def exported(text: str, name: str, options: "ExportOptions") -> tuple[bytes, tuple[str, ...]]:
    """Return the files of an export of a plan, zipped, and its notes; raises InputError."""
    from syncplan.exporting.formats import as_archive, export

    made = export(_judged(text), name, options)
    return as_archive(made), made.notes


@lru_cache(maxsize=4)
def _judged(text: str) -> Plan:
    return plan_of(loaded_plan(text))


def _compact(values: Any) -> str:
    return json.dumps(values, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
