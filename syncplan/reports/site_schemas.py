"""The JSON contract of a choice of landmark sites."""

from pydantic import Field

from syncplan.reports.document_base import DocumentPart, Point, VersionedDocument
from syncplan.reports.plan_schemas import PlanDocument


class CandidateSite(DocumentPart):
    """One candidate."""

    name: str
    position_m: Point
    chosen: bool
    share: float = Field(description="Its share in the convex relaxation, 0 to 1")
    seen_by: int = Field(description="Number of vehicles that see it at some time")


class VehicleBounds(DocumentPart):
    """Window bound of one vehicle's position without and with the chosen sites."""

    name: str
    before_m: float | None = Field(description="Null where its position is not determined")
    after_m: float


class SitesDocument(VersionedDocument):
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
