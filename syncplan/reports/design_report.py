"""Designs as documents."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import Field

from syncplan import __version__
from syncplan.documents import Document, DocumentPart, OrAbsent, VersionedDocument, finite_or_none
from syncplan.phrases import percent
from syncplan.planning.judged_team import PlanFinding, Remark, purpose_measure
from syncplan.planning.plan_files import stated
from syncplan.reports.flight_report import FlightDocument, flight_document
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.reports.validation_report import ValidationDocument, validation_document
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.stories import Report, Row, Story, Table
from syncplan.scenario.brief import Brief

if TYPE_CHECKING:
    from syncplan.designs.cell_search import BestCandidate
    from syncplan.designs.designer import Design
    from syncplan.designs.judgement import Judgement
    from syncplan.planning.plan_flights import Flight
    from syncplan.planning.validation import Validation


_CUT_SHORT = "the search was ended early: teams may be missing, and better formations may exist"


class FrontPoint(Document):
    """What was found for so many vehicles and landmarks."""

    vehicles: int = quantity("vehicles")
    landmarks: int = quantity("landmarks")
    worst_rms_m: float | None = quantity(
        "worst error",
        "Predicted error of the worst vehicle, on a coarse sample grid and without the "
        "refinement of a winner; null where no formation without a fault was found",
        "m",
        missing="none fits",
        order=1,
    )
    cost: float = quantity("cost", "Of vehicles and landmarks, by `prefer`", form=".4g")
    formation: OrAbsent[dict[str, Any]] = Field(
        default=None,
        description="`scenario` and `vehicles` of the formation found, as in a plan file; absent "
        "where none without a fault was found, and while the design is under way",
    )


class ImpossibilityProof(DocumentPart):
    """Why no formation meets the brief."""

    kind: Literal["limits", "rank", "area"]
    reason: str


class DesignedTeam(Document):
    """The winner, or the best formation found, by the exact code."""

    vehicles: int
    landmarks: int
    cost: float
    predicted_worst_rms_m: float | None = Field(
        description="Predicted error of the worst vehicle over the second half of ten periods"
    )
    validated_worst_rms_m: float | None = Field(
        description="The same in a validation; null where none was run"
    )
    flown_worst_rms_m: float | None = Field(
        description="The same in flights in closed loop; null where none was flown"
    )
    covered_share: OrAbsent[float] = Field(
        default=None, description="Share of the area covered; absent for other purposes"
    )

    @property
    def words(self) -> str:
        """The team, its cost, its errors and what it covers, in a line."""
        errors = {
            "predicted": self.predicted_worst_rms_m,
            "validated": self.validated_worst_rms_m,
            "flown": self.flown_worst_rms_m,
        }
        said = [f"{name} {value:.3g} m" for name, value in errors.items() if value is not None]
        if self.covered_share is not None:
            said.append(f"covers {percent(self.covered_share)}")
        team = f"{self.vehicles} vehicles and {self.landmarks} landmarks"
        return f"{team}, cost {self.cost:.4g}: {', '.join(said)}"


class OfferedPurchase(DocumentPart):
    """What a change of the brief brings to the best formation found, searched anew."""

    change: str = quantity("change")
    worst_rms_m: float = quantity(
        "worst error", "Predicted error of the worst vehicle, refined", "m", order=1
    )
    met: bool = quantity(
        "meets the need",
        "Whether that meets the need with its margin",
        words=each(lambda offer: "[green]yes[/]" if offer.met else "no"),
        order=2,
    )
    cost: float | None = quantity(
        "cost", "By `prefer`; null where it states none", form=".4g", missing=""
    )
    formation: dict[str, Any] = Field(
        description="`scenario` and `vehicles` of the formation with that error, as in a plan file"
    )


class DesignDocument(VersionedDocument, Report):
    """The cheapest formation found for a brief, or what stands in its way."""

    drawn_as: ClassVar[str] = "design"

    name: str
    status: Literal["met", "not_found", "impossible"] = Field(
        description="impossible only with a proof; a search that finds nothing proves nothing"
    )
    binding: str = Field(
        description="The requirement that decides: limits, rank, area, landmarks, separation, "
        "error, losses, filter, flight, time, or the code of a finding; empty if the brief is met"
    )
    proof: ImpossibilityProof | None
    best: DesignedTeam | None = Field(description="Null where no formation without fault was found")
    front: list[FrontPoint]
    purchases: list[OfferedPurchase] = Field(
        description="Changes of the brief that help, each searched on from `best`, the best first; "
        "none where it is met"
    )
    evaluations: int = Field(description="Number of formations looked at")
    seed: int
    cut_short: bool = Field(description="Whether the search was ended early")
    findings: tuple[PlanFinding, ...] = Field(
        default=(), description="A note `search-cut-short` where the search was ended early"
    )
    brief: Brief
    plan: PlanDocument | None = Field(description="The formation of `best`, an ordinary plan")
    validation: ValidationDocument | None
    flight: FlightDocument | None

    def body(self) -> Story:
        """Yield the status, the front and the purchases."""
        state = f"[{'green' if self.status == 'met' else 'red'}]{self.status.replace('_', ' ')}[/]"
        decides = f"; what decides: {plain(self.binding)}" if self.binding else ""
        yield (
            f"[bold]{plain(self.name or 'design')}[/]: {state}, need "
            f"{self.brief.need.worst_rms_m:g} m for the worst vehicle{decides}"
        )
        if self.proof is not None:
            yield plain(self.proof.reason)
        yield from (f"{finding.code}: {finding.message}" for finding in self.findings)
        if self.best is not None:
            yield self.best.words
        if self.front:
            yield Table("best found for each team; worst predicted error, coarse", self.front)
        if self.purchases:
            yield Table("what would help", self.purchases)

    def frame_rows(self) -> Iterator[Row]:
        """Yield the front as rows of a data frame."""
        return (team.model_dump() for team in self.front)


def design_document(designed: "Design") -> DesignDocument:
    """Return the document of a design."""
    best, proof = designed.best, designed.proof
    checked = None if best is None else best.validation
    flown = None if best is None else best.flight
    return DesignDocument(
        version=__version__,
        name=designed.brief.name,
        status=designed.status,
        binding=designed.binding,
        proof=None if proof is None else ImpossibilityProof(kind=proof.kind, reason=proof.reason),
        best=None if best is None else _team(designed.brief, best),
        front=[_with_formation(designed.brief, team) for team in designed.front],
        purchases=[
            OfferedPurchase(
                change=purchase.words,
                worst_rms_m=purchase.worst,
                met=purchase.met,
                cost=purchase.cost,
                formation=stated(purchase.plan.scenario, purchase.plan.orbits),
            )
            for purchase in designed.purchases
        ],
        evaluations=designed.evaluations,
        seed=designed.brief.seed,
        cut_short=designed.cut_short,
        findings=(PlanFinding.of("search-cut-short", Remark("note", _CUT_SHORT)),)
        if designed.cut_short
        else (),
        brief=designed.brief,
        plan=None if best is None else plan_document(best.plan),
        validation=None if checked is None else validation_document(checked),
        flight=None if flown is None else flight_document(flown),
    )


def front_point(brief: Brief, team: "BestCandidate") -> FrontPoint:
    """Return a point of the front of a design, done or under way."""
    return FrontPoint(
        vehicles=team.cell.vehicles,
        landmarks=team.cell.landmarks,
        worst_rms_m=team.value if team.fits else None,
        cost=team.cell.cost(brief.prefer),
    )


def _with_formation(brief: Brief, team: "BestCandidate") -> FrontPoint:
    # not at the top: a search is only loaded by what searches
    from syncplan.designs.candidates import Space

    point = front_point(brief, team)
    if not team.fits:
        return point
    formation = stated(*Space(brief, team.cell).formation(team.point))
    return point.model_copy(update={"formation": formation})


def _team(brief: Brief, best: "Judgement") -> DesignedTeam:
    orbits, cell = best.plan.orbits, best.start.cell
    measure = purpose_measure(best.plan.scenario)
    return DesignedTeam(
        vehicles=cell.vehicles,
        landmarks=cell.landmarks,
        cost=cell.cost(brief.prefer),
        predicted_worst_rms_m=finite_or_none(best.worst),
        validated_worst_rms_m=_worst(best.validation),
        flown_worst_rms_m=_worst(best.flight),
        covered_share=measure.covered(orbits.centers, orbits.radii) if measure else None,
    )


def _worst(run: "Validation | Flight | None") -> float | None:
    return None if run is None else finite_or_none(float(run.accuracy.late_position.max()))
