"""The JSON contract of plans, shared by command line, files and service."""

from typing import ClassVar, Literal

from pydantic import Field

from syncplan.reports.document_base import Document, DocumentPart, Point, VersionedDocument, Window
from syncplan.reports.flown_plan_schemas import FlownPlan
from syncplan.reports.refinement_schemas import RefinementResult
from syncplan.reports.start_up_schemas import StartUpRecord
from syncplan.reports.verdict_schemas import PlanVerdict
from syncplan.scenario.specification import Scenario


class VehicleOrbit(DocumentPart):
    """One vehicle's circle and its pose at time 0."""

    name: str
    center_m: Point
    radius_m: float
    direction: Literal["ccw", "cw"]
    speed_mps: float
    phase_rad: float = Field(description="Angle from +x about the centre, in [0, 2 pi)")
    position_m: Point
    heading_rad: float = Field(description="Direction of flight from +x, in [0, 2 pi)")


class DirectedContact(DocumentPart):
    """When one vehicle sees the other."""

    from_: str = Field(alias="from", serialization_alias="from")
    to: str
    windows_s: list[Window]
    contact_s: float


class Link(Document):
    """A meeting of two vehicles, once a period."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"contact_share"})

    a: str
    b: str
    rule: Literal["same", "opposite"]
    phase_residual_rad: float
    min_distance_m: float
    contact_s: float
    contact_share: float | None = Field(
        default=None,
        description="contact_s over the longest that any phases give this link; only where phases "
        "were chosen for limited fields of view or among obstacles",
    )
    windows_s: list[Window] = Field(description="Union of both ways; an end may pass the period")
    directed: list[DirectedContact]
    phase_tolerance_rad: float = Field(
        description="How far either phase may slip before contact is lost; pi if it never is"
    )
    phase_tolerance_s: float = Field(description="The same as time: how late a vehicle may be")
    rank: int
    certified: bool
    reason: str


class LandmarkLink(DocumentPart):
    """When a vehicle sees a landmark."""

    vehicle: str
    landmark: str
    min_distance_m: float
    windows_s: list[Window]
    contact_s: float
    rank: int
    certified: bool
    reason: str


class DroppedLink(DocumentPart):
    """A listed link that never comes into contact."""

    a: str
    b: str
    reason: str


class CloseApproach(DocumentPart):
    """The nearest two vehicles come, and when first."""

    min_m: float
    between: tuple[str, str]
    time_s: float


class Separation(DocumentPart):
    """Least separation over all pairs, and the pairs below the least allowed."""

    min_m: float | None
    between: tuple[str, str] | None
    time_s: float | None
    required_m: float
    violations: list[CloseApproach]


class CertificateVerdict(DocumentPart):
    """The corrected Theorem 3.3."""

    holds: bool
    reason: str


class VehicleMotion(DocumentPart):
    """How one vehicle moves in an unobservable motion."""

    vehicle: str
    shift_m: Point
    turn_rad: float


class Unobservable(DocumentPart):
    """A motion of the team that no sighting can detect."""

    description: str
    vehicles: list[str]
    motion: list[VehicleMotion]
    cure: str


class StateVerdict(DocumentPart):
    """Whether one window determines a kind of state, whatever the others are."""

    state: str = Field(
        description="position, heading, or a kind of error", examples=["wind", "speed scale"]
    )
    unit: str = Field(examples=["m/s"])
    determined: bool
    undetermined: list[str] = Field(description="Which of them are not, by name")


class UndeterminedErrors(DocumentPart):
    """A change of errors, and of poses with them, that no sighting can detect."""

    description: str
    states: list[str] = Field(description="Errors that change")
    vehicles: list[str] = Field(description="Vehicles whose errors or poses change")
    moves_poses: bool = Field(description="Whether positions or headings change too")
    cure: str


class ExtendedRank(DocumentPart):
    """Rank with the constant errors that the filter estimates as states, priors left out."""

    rank: int
    state_dim: int
    rank_gap: float | None = Field(
        description="Last counted singular value over the first not counted; null if none is left"
    )
    poses_determined: bool = Field(
        description="Whether every position and heading is determined, whatever the errors are"
    )
    undetermined: list[UndeterminedErrors]


class ObservabilityVerdict(Document):
    """Rank and conditioning of the windowed matrix by poses, positions in mean radii."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"extended", "states"})

    rank: int
    state_dim: int
    observable: bool
    window_s: float
    rank_gap: float | None = Field(
        description="Last counted singular value over the first not counted; null if none is left"
    )
    certificate: CertificateVerdict
    condition_number: float | None
    min_eigenvalue: float = Field(
        description="Smallest eigenvalue of the windowed information, positions in mean radii; "
        "0 where unobservable"
    )
    singular_values: list[float]
    unobservable: list[Unobservable]
    extended: ExtendedRank | None = Field(
        default=None,
        description="Rank with errors as states; absent where the filter estimates none that are "
        "constant, or where there are too many states",
    )
    states: list[StateVerdict] | None = Field(
        default=None, description="What is determined, by kind of state; absent as `extended` is"
    )


class Witness(DocumentPart):
    """One component of the certificate: two landmark links and a tree of rank-3 links."""

    vehicles: list[str]
    landmark_links: list[tuple[str, str]]
    vehicle_links: list[tuple[str, str]]


class ErrorPrediction(DocumentPart):
    """Predicted RMS position error: per vehicle and over all."""

    overall: float | None
    vehicles: dict[str, float | None]
    note: str = ""


class PredictedStateError(DocumentPart):
    """Predicted RMS error of a state of the filter that is no pose."""

    state: str = Field(description="What it is", examples=["wind x", "speed scale of v1"])
    unit: str = Field(examples=["m/s"])
    sigma: float = Field(description="Its standard deviation before anything is seen")
    predicted_rms: float = Field(
        description="Over the second half of the run, as predicted_rms_m, for circles flown in "
        "still air: in a wind of a quarter of the speed, the wind itself is known half as well"
    )


class SynchronisationRecord(DocumentPart):
    """How the phases were found."""

    method: str
    smallest_margin_m: float | None
    bound_m: float | None
    bound_note: str
    odd_cycle: list[str]
    alternating_proven_largest: bool | None


class PlanDocument(VersionedDocument):
    """A plan: orbits, meetings and the verdict on observability."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset(
        {"expected_rms_m", "flight", "predicted_errors", "refinement", "start_up", "verdict"}
    )

    verdict: PlanVerdict | None = Field(
        default=None, description="Go or no-go, with all findings; absent from older files"
    )
    scenario: Scenario
    period_s: float
    vehicles: list[VehicleOrbit]
    links: list[Link]
    landmark_links: list[LandmarkLink]
    incidental_links: list[Link]
    dropped_links: list[DroppedLink]
    synchronisation: SynchronisationRecord
    connectivity_period_s: float | None
    separation: Separation
    observability: ObservabilityVerdict
    witness: list[Witness]
    predicted_rms_m: ErrorPrediction
    steady_rms_m: ErrorPrediction | None
    window_bound_m: ErrorPrediction
    expected_rms_m: ErrorPrediction | None = Field(
        default=None,
        description="RMS position error to be expected of the filter, which leaves out errors that "
        "the scenario states and does not know what they cost; absent where it leaves out none",
    )
    predicted_errors: list[PredictedStateError] | None = Field(
        default=None,
        description="States of the filter that are no poses; absent where there are none",
    )
    start_up: StartUpRecord | None = Field(
        default=None,
        description="Whether the filter reaches the predicted error; absent where none is "
        "predicted, from plans that are not observable and from older files",
    )
    refinement: RefinementResult | None = Field(
        default=None, description="How the plan was refined, where it was"
    )
    flight: FlownPlan | None = Field(
        default=None, description="What flying the plan has found; absent where it was not flown"
    )
    notes: list[str] = Field(description="The messages of the verdict's findings")
