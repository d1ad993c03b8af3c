"""Choices of landmark sites as documents, with notes on their figures."""

from collections.abc import Iterator, Sequence

from pydantic import Field

from syncplan import __version__
from syncplan.documents import DocumentPart, Point, VersionedDocument, finite_or_none
from syncplan.landmarks.site_choice import SiteChoice
from syncplan.phrases import Places
from syncplan.reports.plan_report import PlanDocument, plan_document
from syncplan.results.quantities import each, plain, quantity
from syncplan.results.stories import Report, Row, Story, Table, flat


def _positions(sites: Sequence["CandidateSite"]) -> Iterator[str]:
    places = Places([site.position_m for site in sites])
    return (places.words(site.position_m) for site in sites)


class CandidateSite(DocumentPart):
    """A candidate site."""

    name: str = quantity("site")
    position_m: Point = quantity("position", unit="m", words=_positions, drop=3)
    chosen: bool = quantity(
        "chosen", words=each(lambda site: "[green]yes[/]" if site.chosen else ""), order=1
    )
    share: float = quantity(
        "share", "Its share in the convex relaxation, 0 to 1", form=".3f", drop=1
    )
    seen_by: int = quantity("seen by", "Number of vehicles that see it at some time", drop=2)


class VehicleBounds(DocumentPart):
    """Window bound of one vehicle's position without and with the chosen sites."""

    name: str = quantity("vehicle")
    before_m: float | None = quantity(
        "before", "Null where its position is not determined", "m", missing="undetermined"
    )
    after_m: float = quantity("after", unit="m")


class SitesDocument(VersionedDocument, Report):
    """The landmark sites chosen among candidates."""

    name: str
    chosen: list[str]
    positions_m: dict[str, Point] = Field(description="Positions of the chosen sites")
    value_m: float = Field(description="Window bound of the worst vehicle with the chosen sites")
    bound_m: float = Field(
        description="No choice of as many sites has a smaller value; from the convex relaxation"
    )
    gap: float = Field(description="value_m / bound_m - 1")
    proven_best: bool = Field(description="Every other choice was tried or ruled out")
    before_m: float | None = Field(
        description="Window bound of the worst vehicle without the sites; null if undetermined"
    )
    window_bounds: list[VehicleBounds]
    candidates: list[CandidateSite]
    plan: PlanDocument = Field(description="Judged with the chosen sites as landmarks")
    notes: list[str]

    def body(self) -> Story:
        """Yield the verdict, the sites by share, and each vehicle's bound."""
        yield f"[bold]{plain(self.name or 'sites')}[/]: chosen {plain(', '.join(self.chosen))}"
        before = "undetermined" if self.before_m is None else f"{self.before_m:.3g}"
        yield (
            f"window bound of the worst vehicle {self.value_m:.4g} m, before {before} m; no choice "
            f"below {self.bound_m:.4g} m (gap {100.0 * self.gap:.1f} %), "
            f"{'' if self.proven_best else 'not '}proven best"
        )
        order = sorted(self.candidates, key=lambda site: (not site.chosen, -site.share))
        yield Table("candidates", order)
        yield Table("window bound of each vehicle", self.window_bounds)

    def frame_rows(self) -> Iterator[Row]:
        """Yield the candidates as rows of a data frame."""
        return (flat(site.model_dump()) for site in self.candidates)


_OPEN_GAP = 0.01
"""Gap to the bound above which a choice that is not proven best is worth a note."""


def sites_document(choice: SiteChoice) -> SitesDocument:
    """Return the document of a choice; bounds that are not determined are null."""
    places = [(float(x), float(y)) for x, y in choice.candidates]
    names, scenario = choice.names, choice.plan.scenario
    vehicles = zip(
        scenario.vehicle_names, choice.before, choice.plan.prediction.window, strict=True
    )
    return SitesDocument(
        version=__version__,
        name=scenario.name,
        chosen=[names[k] for k in choice.chosen],
        positions_m={names[k]: places[k] for k in choice.chosen},
        value_m=choice.value,
        bound_m=choice.bound,
        gap=choice.gap,
        proven_best=choice.proven,
        before_m=finite_or_none(float(choice.before.max())),
        window_bounds=[
            VehicleBounds(name=name, before_m=finite_or_none(float(before)), after_m=float(after))
            for name, before, after in vehicles
        ],
        candidates=[
            CandidateSite(
                name=names[k],
                position_m=places[k],
                chosen=k in choice.chosen,
                share=float(choice.shares[k]),
                seen_by=int(choice.seen_by[k]),
            )
            for k in range(len(names))
        ],
        plan=plan_document(choice.plan),
        notes=_notes(choice),
    )


def _notes(choice: SiteChoice) -> list[str]:
    """Notes for the reader."""
    notes = []
    idle = [choice.names[k] for k in choice.chosen if choice.seen_by[k] == 0]
    if idle:
        notes.append(f"no vehicle sees {', '.join(idle)}: fewer sites serve as well")
    if not choice.proven and choice.gap > _OPEN_GAP:
        notes.append(
            f"not proven best: another choice may be better by up to "
            f"{100.0 * (1.0 - choice.bound / choice.value):.0f} %"
        )
    return notes
