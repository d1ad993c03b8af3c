"""Refinements as documents: figures before and after, active constraints, all starts."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from syncplan.documents import Document, DocumentPart, OrAbsent, finite_or_none
from syncplan.phrases import listed
from syncplan.planning.plan_files import stated
from syncplan.planning.plan_records import RefinementRecord, StartResult
from syncplan.results.quantities import plain
from syncplan.results.stories import Grid, Report, Story
from syncplan.scenario.objectives import FIGURES, ROWS, Figures

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


KEPT_SHARE = 0.9
"""Share of a distance, or of a tolerance, that may be lost without a word."""

MOST_NAMED = 12
"""Most limits named in a line."""

_PAID = {
    "least_distance_m": "vehicles come nearer to each other; min_separation_m limits this",
    "least_tolerance_rad": "meetings bear less delay",
}
"""Figures that a smaller error may cost, and what that means."""


class RefinementResult(Document, Report):
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

    def body(self) -> Story:
        """Yield what was gained, what it cost, and the figures before and after."""
        if not self.improved:
            yield f"no better plan was found: {plain(self.reason)}"
        yield self._grid
        yield from self._costs
        if held := self.active_constraints:
            named = plain(listed(held, MOST_NAMED))
            yield f"limits reached (box: how far a centre may move): {named}"

    @property
    def _costs(self) -> Iterator[str]:
        """What was given for the smaller error: distances and time to spare."""
        for figure in ROWS:
            before = getattr(self.before, figure.key, None)
            after = getattr(self.after, figure.key, None)
            paid = _PAID.get(figure.key)
            if not paid or before is None or after is None:
                continue
            if after < KEPT_SHARE * before:
                fall = f"{figure.words(before)} to {figure.words(after)} {figure.unit}"
                yield f"[yellow]{figure.label} falls from {fall}[/]: {paid}"

    @property
    def _grid(self) -> Grid:
        rows = [
            [
                row.heading,
                *(row.words(getattr(plan, row.key)) for plan in (self.before, self.after)),
            ]
            for row in ROWS
        ]
        title = f"refined for {self.objective}, {len(self.starts)} starts"
        return Grid(title, ("figure", "before", "after"), rows)


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
