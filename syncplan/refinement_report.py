"""Refinements as documents: before and after, what holds the result where it is, every start."""

import math

from syncplan.document import FiguresOfMerit, RefinementResult, StartResult
from syncplan.refining.measures import Figures
from syncplan.refining.record import RefinementRecord, StartRecord

__all__ = ["refinement_result"]


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
    )


def _figures(figures: Figures) -> FiguresOfMerit:
    return FiguresOfMerit(
        rank=figures.rank,
        certified=figures.certified,
        logdet=_finite(figures.logdet),
        min_eigenvalue=figures.min_eigenvalue,
        trace=figures.trace,
        window_bound_m=_finite(figures.window_bound),
        predicted_rms_m=_finite(figures.predicted_rms),
        worst_predicted_rms_m=_finite(figures.worst_predicted_rms),
        least_distance_m=_finite(figures.least_distance),
        contact_margin_m=_finite(figures.contact_margin),
    )


def _start(item: StartRecord) -> StartResult:
    return StartResult(
        start=item.start,
        status=item.status,
        iterations=item.iterations,
        constraint_violation=_finite(item.violation),
        dual_infeasibility=_finite(item.dual_residual),
        value=None if item.value is None else _finite(item.value),
        violations=list(item.violations),
        unmet=list(item.unmet),
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
