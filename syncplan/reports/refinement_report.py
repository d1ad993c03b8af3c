"""Refinements as documents: before and after, what holds the result where it is, every start."""

from typing import Any

from syncplan.planning.refinement_record import RefinementRecord, StartRecord
from syncplan.planning.start_up import StartBefore
from syncplan.reports.document_base import finite_or_none
from syncplan.reports.refinement_schemas import (
    FiguresOfMerit,
    InputStart,
    RefinementResult,
    StartResult,
)
from syncplan.scenario.objectives import FIGURES, Figures


def refinement_result(record: RefinementRecord) -> RefinementResult:
    """Return the document of a refinement; infinities and what was not computed as null."""
    return RefinementResult(
        objective=record.objective,
        improved=record.improved,
        reason=record.reason,
        cut_short=record.cut_short,
        before=_figures(record.before),
        after=_figures(record.after),
        active_constraints=list(record.active),
        starts=[_start(item) for item in record.starts],
        start_up_before=None if record.start_before is None else _before(record.start_before),
        expected_rms_before_m=record.expected_before,
    )


def _before(start: StartBefore) -> InputStart:
    return InputStart(index=start.index, worst_rms_over_predicted=finite_or_none(start.worst_ratio))


def _figures(figures: Figures) -> FiguresOfMerit:
    values: dict[str, Any] = {}
    for one in FIGURES:
        value = getattr(figures, one.name)
        values[one.key] = value if one.finite else finite_or_none(value)
    return FiguresOfMerit(**values)


def _start(item: StartRecord) -> StartResult:
    return StartResult(
        start=item.start,
        status=item.status,
        iterations=item.iterations,
        constraint_violation=finite_or_none(item.violation),
        dual_infeasibility=finite_or_none(item.dual_residual),
        value=None if item.value is None else finite_or_none(item.value),
        violations=list(item.violations),
        unmet=list(item.unmet),
    )
