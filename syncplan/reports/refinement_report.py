"""Refinements as documents: figures before and after, active constraints, all starts."""

from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from syncplan.documents import Document, DocumentPart, OrAbsent, finite_or_none
from syncplan.planning.plan_files import stated
from syncplan.planning.plan_records import RefinementRecord, StartResult
from syncplan.scenario.objectives import FIGURES, Figures

if TYPE_CHECKING:
    from syncplan.refinement.refiner import BetterPlan


class _ComparedPlan(DocumentPart):
    """First fields of the figures of merit; FIGURES gives the others."""

    rank: int
    certified: bool
    meetings: int | None = Field(
        default=None, description="Pairs of vehicles that meet; null, like others, in older files"
    )


def _merit_fields() -> dict[str, Any]:
    """Type and field of each figure of merit by its key, in order."""
    return {
        one.key: (
            float if one.finite else float | None,
            Field(default=... if one.finite else None, description=one.description or None),
        )
        for one in FIGURES
        if one.name not in _ComparedPlan.model_fields
    }


if TYPE_CHECKING:
    FiguresOfMerit = _ComparedPlan
else:
    FiguresOfMerit = create_model(
        "FiguresOfMerit",
        __base__=_ComparedPlan,
        __module__=__name__,
        __doc__="Figures of merit of a plan; positions in the mean radius of the plan that was "
        "refined. Predicted errors allow for all states of the filter; rank, certificate, "
        "information and window bound are of the poses, as if all else were known.",
        **_merit_fields(),
    )


class PlanSoFar(Document):
    """The best plan that a refinement has found so far, better than the one given."""

    before: FiguresOfMerit
    after: FiguresOfMerit
    formation: dict[str, Any] = Field(description="`scenario` and `vehicles`, as in a plan file")


def plan_so_far(found: "BetterPlan") -> PlanSoFar:
    """Return the document of the best plan so far."""
    return PlanSoFar(
        before=_figures(found.before),
        after=_figures(found.after),
        formation=stated(found.scenario, found.orbits),
    )


class RefinementResult(Document):
    """Record of a refinement; `improved` states whether the plan is better or the input itself."""

    objective: str
    improved: bool
    reason: str
    cut_short: bool = Field(description="Whether time or an interrupt ended the search early")
    before: FiguresOfMerit
    after: FiguresOfMerit
    active_constraints: list[str]
    starts: list[StartResult]
    start_up_before: dict[str, Any] | None = Field(
        default=None, description="null; in older files, the start-up of the input"
    )
    expected_rms_before_m: OrAbsent[float] = Field(
        default=None,
        description="RMS of the input's `expected_rms_m` over all vehicles. Only where its filter "
        "leaves errors out",
    )


def refinement_result(record: RefinementRecord) -> RefinementResult:
    """Return the document of a refinement; infinite and missing figures are null."""
    return RefinementResult(
        objective=record.objective,
        improved=record.improved,
        reason=record.reason,
        cut_short=record.cut_short,
        before=_figures(record.before),
        after=_figures(record.after),
        active_constraints=list(record.active),
        starts=list(record.starts),
        expected_rms_before_m=record.expected_before,
    )


def _figures(figures: Figures) -> FiguresOfMerit:
    values: dict[str, Any] = {}
    for one in FIGURES:
        value = getattr(figures, one.name)
        values[one.key] = value if one.finite else finite_or_none(value)
    return FiguresOfMerit(**values)
