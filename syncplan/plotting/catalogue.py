"""What figures a subject has, and the figures drawn: plans, reports and sweeps alike."""

from collections.abc import Sequence

from syncplan.errors import InputError
from syncplan.estimation.replay_results import Replay
from syncplan.flight.flying import Flight
from syncplan.planning.loss_study import WhatIf
from syncplan.planning.planner import Plan
from syncplan.planning.validation import Validation
from syncplan.plotting.canvas import Spec
from syncplan.plotting.figure_style import PLAIN, FigureStyle
from syncplan.plotting.figure_table import FIGURES, FigureInput, SubjectKind
from syncplan.reports.flight_report import flight_document
from syncplan.reports.flight_schemas import FlightDocument
from syncplan.reports.loss_report import what_if_document
from syncplan.reports.loss_schemas import WhatIfDocument
from syncplan.reports.refinement_report import refinement_result
from syncplan.reports.refinement_schemas import RefinementResult
from syncplan.reports.replay_report import replay_document
from syncplan.reports.replay_schemas import ReplayDocument
from syncplan.reports.run_schemas import SweepReport, ValidationDocument
from syncplan.reports.validation_report import validation_document

Run = Validation | ValidationDocument | Replay | ReplayDocument
Subject = Plan | SweepReport | WhatIf | WhatIfDocument | Flight | FlightDocument | Run


def specs_of(
    subject: Subject,
    names: Sequence[str] = (),
    *,
    style: FigureStyle = PLAIN,
    refined: RefinementResult | None = None,
    after: Plan | None = None,
) -> dict[str, Spec]:
    """Return the figures of a subject as Plotly's plain values, by name: all, or the ones named.

    `refined` is the record of a plan read from a file, which Plan.refinement does not hold; `after`
    a second plan to compare with. Needs no Plotly. Raises InputError for a name that the subject
    does not have.
    """
    of, given = _given(subject, refined, after, style)
    known = _known(of, given)
    for name in names:
        if name not in known:
            raise InputError(f"{name!r}: {_why_not(name, of, known)}", key="figure")
    return {name: FIGURES[name].draw(given) for name in names or known}


def first_figure(
    subject: Subject, *, refined: RefinementResult | None = None, after: Plan | None = None
) -> str:
    """Return the name of the figure to show where there is room for one; see specs_of."""
    known = _known(*_given(subject, refined, after, PLAIN))
    return next((name for name in known if FIGURES[name].compares), known[0])


def report_of(run: Run) -> ValidationDocument | ReplayDocument:
    """Return the report of a run of the filter, which may be that already."""
    if isinstance(run, Validation):
        return validation_document(run)
    return replay_document(run) if isinstance(run, Replay) else run


def _given(
    subject: Subject, refined: RefinementResult | None, after: Plan | None, style: FigureStyle
) -> tuple[SubjectKind, FigureInput]:
    if isinstance(subject, Plan):
        if subject.refinement is not None:
            refined = refinement_result(subject.refinement)
        return "plan", FigureInput(subject, style, refined, after)
    if after is not None:
        raise InputError("only a plan can be compared with a plan", key="compare")
    if isinstance(subject, SweepReport):
        return "sweep", FigureInput(subject, style)
    if isinstance(subject, WhatIf | WhatIfDocument):
        report = what_if_document(subject) if isinstance(subject, WhatIf) else subject
        return "losses", FigureInput(report, style)
    if isinstance(subject, Flight | FlightDocument):
        flown = flight_document(subject) if isinstance(subject, Flight) else subject
        return "flight", FigureInput(flown, style)
    return "run", FigureInput(report_of(subject), style)


def _known(of: SubjectKind, given: FigureInput) -> list[str]:
    return [name for name, one in FIGURES.items() if one.of == of and one.fits(given)]


def _why_not(name: str, of: SubjectKind, known: list[str]) -> str:
    choices = f"choose from {', '.join(known)}"
    if name not in FIGURES:
        return choices
    figure = FIGURES[name]
    why = figure.why_not if figure.of == of else "this file has no such figure"
    return f"{why}; {choices}"
