"""What flying has found of a plan: what its verdict takes into account, as its file holds it."""

from typing import ClassVar

from pydantic import Field

from syncplan.documents import Document, DocumentPart, Words
from syncplan.scenario.quantities import Many


class PhasesFlown(DocumentPart):
    """How one vehicle flew, over the second half of all trials."""

    name: str
    phase_rms_s: float = Field(description="Ahead of the plan, or behind it")
    phase_worst_s: float = Field(description="In any trial")
    tracking_rms_m: float = Field(description="From the plan's place")
    speed_mps: tuple[float, float] = Field(
        description="Least and largest airspeed that was commanded, once a steady state is "
        "reached, holds apart: what it needs in the wind"
    )


class MeetingsFlown(DocumentPart):
    """Two that meet in the plan: vehicles, or a vehicle and a landmark."""

    between: tuple[str, str]
    meetings: int = Field(description="In the plan, in each trial")
    kept_share: float = Field(description="In which a sighting was made, of all trials'")


class FlownPlan(Document):
    """What flying the plan has found; the circumstances are those of the scenario."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"saturated_share"})

    trials: int
    seed: int
    duration_s: float
    guidance: str
    filter: str
    events: Many[Words] = Field(description="What happened on the way, in every trial")
    filter_lost_share: float
    out_of_contact_share: float
    least_separation_m: tuple[float, float] | None = Field(
        description="Of the median and of the worst trial; null for a single vehicle"
    )
    too_close_share: float | None = Field(
        description="Share of trials below min_separation_m; null where none is asked for"
    )
    vehicles: Many[PhasesFlown] = Field(description="Those that are there to the end")
    meetings_kept: Many[MeetingsFlown] = Field(
        default_factory=list, description="Of each pair that meets; empty in older files"
    )
    saturated_share: float | None = Field(
        default=None,
        description="Share of samples with a command at a limit; missing in older files",
    )
