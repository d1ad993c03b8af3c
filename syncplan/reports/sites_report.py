"""A choice of landmark sites as a document and as a table."""

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field

from syncplan.landmarks.site_choice import SiteChoice
from syncplan.reports.plan_report import plan_document
from syncplan.reports.schemas import PlanDocument, finite_or_none

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["SitesDocument", "show_sites", "sites_document"]

Point = tuple[float, float]

_MOST_ROWS = 40
_OPEN_GAP = 0.01


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class CandidateSite(_Part):
    """One candidate."""

    name: str
    position_m: Point
    chosen: bool
    share: float = Field(description="Its share in the convex relaxation, 0 to 1")
    seen_by: int = Field(description="Number of vehicles that see it at some time")


class VehicleBounds(_Part):
    """Window bound of one vehicle's position without and with the chosen sites."""

    name: str
    before_m: float | None = Field(description="Null where its position is not determined")
    after_m: float


class SitesDocument(_Part):
    """The landmark sites chosen among candidates."""

    version: str
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

    def as_json(self) -> dict[str, Any]:
        """Return the document as JSON values, unset keys of the scenario left out."""
        values = self.model_dump(mode="json", exclude={"plan", "notes"})
        return {**values, "plan": self.plan.as_json(), "notes": self.notes}


def sites_document(choice: SiteChoice) -> SitesDocument:
    """Return the document of a choice; bounds that are not determined are null."""
    from syncplan import __version__

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
    """What the reader must not miss, in plain words."""
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


def show_sites(document: SitesDocument, console: "Console") -> None:
    """Print a choice of sites: the verdict, the sites by share, and each vehicle's bound."""
    from rich import box
    from rich.markup import escape
    from rich.table import Table

    console.print(
        f"[bold]{escape(document.name or 'sites')}[/]: chosen {escape(', '.join(document.chosen))}"
    )
    proof = "proven best" if document.proven_best else "not proven best"
    console.print(
        f"window bound of the worst vehicle {document.value_m:.4g} m, before "
        f"{_shown(document.before_m)}; no choice below {document.bound_m:.4g} m "
        f"(gap {100.0 * document.gap:.1f} %), {proof}"
    )
    style: Any = {"box": box.SIMPLE_HEAD, "title_justify": "left", "pad_edge": False}
    sites = Table("site", "position m", "share", "seen by", "chosen", title="candidates", **style)
    order = sorted(document.candidates, key=lambda site: (not site.chosen, -site.share))
    for site in order[:_MOST_ROWS]:
        x, y = site.position_m
        chosen = "[green]yes[/]" if site.chosen else ""
        sites.add_row(
            escape(site.name), f"{x:.5g}, {y:.5g}", f"{site.share:.3f}", str(site.seen_by), chosen
        )
    console.print(sites)
    bounds = Table("vehicle", "before m", "after m", title="window bound of each vehicle", **style)
    for vehicle in document.window_bounds[:_MOST_ROWS]:
        bounds.add_row(escape(vehicle.name), _shown(vehicle.before_m), f"{vehicle.after_m:.3g}")
    console.print(bounds)
    hidden = max(len(order), len(document.window_bounds)) - _MOST_ROWS
    if hidden > 0:
        console.print(f"... and up to {hidden} more rows (see the JSON)")
    for note in document.notes:
        console.print(f"[yellow]note[/]: {escape(note)}")


def _shown(value: float | None) -> str:
    return "undetermined" if value is None else f"{value:.3g}"
