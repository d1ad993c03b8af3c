"""The figures there are: names, titles, what each shows, and which belong to what."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from syncplan.errors import InputError
from syncplan.estimation.replays import Replay
from syncplan.planning.planner import Plan
from syncplan.planning.validation import Validation
from syncplan.plotting.accuracy_figure import accuracy_spec, prediction_spec, replay_spec
from syncplan.plotting.animation_figure import animation_spec
from syncplan.plotting.canvas import Spec
from syncplan.plotting.comparison_figure import comparison_spec, refinement_spec
from syncplan.plotting.consistency_figure import consistency_spec
from syncplan.plotting.errors_figure import errors_spec
from syncplan.plotting.formation_figure import formation_spec
from syncplan.plotting.palette import Theme, themed
from syncplan.plotting.spectrum_figure import spectrum_spec
from syncplan.plotting.sweep_figure import sweep_spec
from syncplan.plotting.timeline_figure import timeline_spec
from syncplan.reports.refinement_report import refinement_result
from syncplan.reports.refinement_schemas import RefinementResult
from syncplan.reports.replay_report import replay_document
from syncplan.reports.run_schemas import ReplayDocument, SweepReport, ValidationDocument
from syncplan.reports.validation_report import validation_document

__all__ = ["ENTRIES", "Entry", "Run", "Subject", "makers", "report_of", "specs_of"]

Run = Validation | ValidationDocument | Replay | ReplayDocument
Subject = Plan | SweepReport | Run


@dataclass(frozen=True, slots=True)
class Entry:
    """A figure's title, and in a sentence what it shows."""

    title: str
    sentence: str


ENTRIES: Mapping[str, Entry] = {
    "formation": Entry(
        "Formation",
        "Circles with their senses, vehicles at time 0, links by rank and certificate, landmarks; "
        "arrows show motions that no sighting tells.",
    ),
    "animation": Entry(
        "One period",
        "Where the vehicles are and who sees whom, through one period.",
    ),
    "timeline": Entry(
        "Contacts",
        "When each vehicle sees which other vehicle or landmark, and what the union of these "
        "sightings joins the longer one watches.",
    ),
    "spectrum": Entry(
        "Singular values",
        "Singular values of the windowed observability matrix; the rank rests on the gap.",
    ),
    "prediction": Entry(
        "Predicted error",
        "The least RMS position error that any unbiased filter can reach, vehicle by vehicle.",
    ),
    "refinement": Entry(
        "Refinement",
        "What the plan was measured by before it was refined, and after.",
    ),
    "comparison": Entry(
        "Before and after",
        "Circles and predicted errors of two plans of the same vehicles.",
    ),
    "accuracy": Entry(
        "Error found",
        "RMS position errors of the filter, beside the predicted ones where these are known.",
    ),
    "errors": Entry(
        "Errors over time",
        "Errors in x, y and heading with the filter's own 3-sigma band.",
    ),
    "consistency": Entry(
        "Consistency",
        "Whether the filter's errors are as large as it says: ANEES, NIS, 3-sigma coverage.",
    ),
    "sweep": Entry(
        "Sweep",
        "Errors over the value that was varied.",
    ),
}
"""Every figure by its name, in the order they are shown."""


def makers(
    subject: Subject, *, refined: RefinementResult | None = None, after: Plan | None = None
) -> dict[str, Callable[[], Spec]]:
    """Return what draws each figure that a subject has, by name, in order.

    `refined` is the record of a plan read from a file, which Plan.refinement does not hold; `after`
    a second plan to compare with.
    """
    if isinstance(subject, Plan):
        return _of_plan(subject, refined, after)
    if after is not None:
        raise InputError("only a plan can be compared with a plan", key="compare")
    if isinstance(subject, SweepReport):
        return {"sweep": lambda: sweep_spec(subject)}
    return _of_run(subject)


def specs_of(
    subject: Subject,
    names: Sequence[str] = (),
    *,
    theme: Theme = "light",
    refined: RefinementResult | None = None,
    after: Plan | None = None,
) -> dict[str, Spec]:
    """Return the figures of a subject as Plotly's plain values, by name: all, or the ones named.

    Needs no Plotly. Raises InputError for a name that the subject does not have.
    """
    known = makers(subject, refined=refined, after=after)
    for name in names:
        if name not in known:
            raise InputError(f"{name!r}: {_why_not(name, list(known))}", key="figure")
    return {name: themed(known[name](), theme) for name in names or known}


def report_of(run: Run) -> ValidationDocument | ReplayDocument:
    """Return the report of a run of the filter, which may be that already."""
    if isinstance(run, Validation):
        return validation_document(run)
    return replay_document(run) if isinstance(run, Replay) else run


def _of_run(subject: Run) -> dict[str, Callable[[], Spec]]:
    report = report_of(subject)
    found: dict[str, Callable[[], Spec]] = {
        "accuracy": lambda: (
            replay_spec(report) if isinstance(report, ReplayDocument) else accuracy_spec(report)
        )
    }
    if report.series is not None:
        found["errors"] = lambda: errors_spec(report)
    return {**found, "consistency": lambda: consistency_spec(report)}


def _of_plan(
    plan: Plan, refined: RefinementResult | None, after: Plan | None
) -> dict[str, Callable[[], Spec]]:
    found: dict[str, Callable[[], Spec]] = {
        "formation": lambda: formation_spec(plan),
        "animation": lambda: animation_spec(plan),
        "timeline": lambda: timeline_spec(plan),
        "spectrum": lambda: spectrum_spec(plan),
        "prediction": lambda: prediction_spec(plan),
    }
    if plan.refinement is not None:
        refined = refinement_result(plan.refinement)
    if refined is not None:
        record = refined
        found["refinement"] = lambda: refinement_spec(record, plan.scenario.name)
    if after is not None:
        second = after
        found["comparison"] = lambda: comparison_spec(plan, second)
    return found


def _why_not(name: str, known: list[str]) -> str:
    choices = f"choose from {', '.join(known)}"
    if name == "errors" and "accuracy" in known:
        return f"the report has no errors over time (--series keeps them); {choices}"
    if name == "refinement" and "formation" in known:
        return f"the plan was not refined; {choices}"
    if name == "comparison" and "formation" in known:
        return f"there is no second plan (--compare); {choices}"
    if name in ENTRIES:
        return f"this file has no such figure; {choices}"
    return choices
