"""The JSON contracts of plans and reports, shared by command line, files and service."""

import math
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from syncplan.scenario.specification import Scenario

__all__ = [
    "PlanDocument",
    "RefinementResult",
    "ReplayDocument",
    "Series",
    "Spread",
    "SweepReport",
    "SweepRow",
    "ValidationDocument",
    "VehicleSeries",
    "finite_or_none",
]

Point = tuple[float, float]
Window = tuple[float, float]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class VehicleOrbit(_Part):
    """One vehicle's circle and its pose at time 0."""

    name: str
    center_m: Point
    radius_m: float
    direction: Literal["ccw", "cw"]
    speed_mps: float
    phase_rad: float = Field(description="Angle from +x about the centre, in [0, 2 pi)")
    position_m: Point
    heading_rad: float = Field(description="Direction of flight from +x, in [0, 2 pi)")


class DirectedContact(_Part):
    """When one vehicle sees the other."""

    from_: str = Field(alias="from", serialization_alias="from")
    to: str
    windows_s: list[Window]
    contact_s: float


class Link(_Part):
    """A meeting of two vehicles, once a period."""

    a: str
    b: str
    rule: Literal["same", "opposite"]
    phase_residual_rad: float
    min_distance_m: float
    contact_s: float
    windows_s: list[Window] = Field(description="Union of both ways; an end may pass the period")
    directed: list[DirectedContact]
    phase_tolerance_rad: float = Field(
        description="How far either phase may slip before contact is lost; pi if it never is"
    )
    phase_tolerance_s: float = Field(description="The same as time: how late a vehicle may be")
    rank: int
    certified: bool
    reason: str


class LandmarkLink(_Part):
    """When a vehicle sees a landmark."""

    vehicle: str
    landmark: str
    min_distance_m: float
    windows_s: list[Window]
    contact_s: float
    rank: int
    certified: bool
    reason: str


class DroppedLink(_Part):
    """A listed link that never comes into contact."""

    a: str
    b: str
    reason: str


class CloseApproach(_Part):
    """The nearest two vehicles come, and when first."""

    min_m: float
    between: tuple[str, str]
    time_s: float


class Separation(_Part):
    """Least separation over all pairs, and the pairs below the least allowed."""

    min_m: float | None
    between: tuple[str, str] | None
    time_s: float | None
    required_m: float
    violations: list[CloseApproach]


class CertificateVerdict(_Part):
    """The corrected Theorem 3.3."""

    holds: bool
    reason: str


class VehicleMotion(_Part):
    """How one vehicle moves in an unobservable motion."""

    vehicle: str
    shift_m: Point
    turn_rad: float


class Unobservable(_Part):
    """A motion of the team that no sighting tells."""

    description: str
    vehicles: list[str]
    motion: list[VehicleMotion]
    cure: str


class ObservabilityVerdict(_Part):
    """Rank and conditioning of the windowed matrix, positions in mean radii."""

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


class Witness(_Part):
    """One component of the certificate: two landmark links and a tree of rank-3 links."""

    vehicles: list[str]
    landmark_links: list[tuple[str, str]]
    vehicle_links: list[tuple[str, str]]


class ErrorPrediction(_Part):
    """Predicted RMS position error: per vehicle and over all."""

    overall: float | None
    vehicles: dict[str, float | None]
    note: str = ""


class SynchronisationRecord(_Part):
    """How the phases were found."""

    method: str
    smallest_margin_m: float | None
    bound_m: float | None
    bound_note: str
    odd_cycle: list[str]
    alternating_proven_largest: bool | None


class FiguresOfMerit(_Part):
    """What a plan is measured by; positions in the mean radius of the plan that was refined."""

    rank: int
    certified: bool
    logdet: float | None = Field(description="Of the windowed information; null if unobservable")
    min_eigenvalue: float
    trace: float
    window_bound_m: float | None = Field(description="Of the worst vehicle; null if unobservable")
    predicted_rms_m: float | None = Field(description="Of all vehicles, over the second half")
    worst_predicted_rms_m: float | None = Field(description="Of the worst vehicle")
    least_distance_m: float | None = Field(description="The closest two vehicles come")
    contact_margin_m: float | None = Field(
        description="By how much the link or landmark nearest to being lost stays within range"
    )


class StartResult(_Part):
    """What one start of the solver came to."""

    start: int = Field(description="0 the plan, 1 the rules desynchronised, then random ones")
    status: str = Field(description="IPOPT's")
    iterations: int
    constraint_violation: float | None = Field(description="IPOPT's, scaled")
    dual_infeasibility: float | None = Field(description="IPOPT's, scaled")
    value: float | None = Field(description="Exact objective of the best candidate")
    violations: list[str] = Field(description="What the input met and the candidate does not")
    unmet: list[str] = Field(description="What the solver could not meet")


class RefinementResult(_Part):
    """How a plan was refined; `improved` says whether this is a better plan or the input."""

    objective: str
    improved: bool
    reason: str
    cut_short: bool = Field(description="Whether time or an interrupt ended the search early")
    before: FiguresOfMerit
    after: FiguresOfMerit
    active_constraints: list[str]
    starts: list[StartResult]


class PlanDocument(_Part):
    """A plan: orbits, meetings and the verdict on observability."""

    version: str = Field(description="Version of syncplan that made the plan")
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
    refinement: RefinementResult | None = Field(
        default=None, description="How the plan was refined, where it was"
    )
    notes: list[str]

    def as_json(self) -> dict[str, Any]:
        """Return the document as JSON values, unset keys of the scenario left out."""
        left_out = {"scenario"} if self.refinement else {"scenario", "refinement"}
        values = self.model_dump(mode="json", by_alias=True, exclude=left_out)
        scenario = self.scenario.model_dump(mode="json", exclude_none=True)
        return {"version": values.pop("version"), "scenario": scenario, **values}


class Spread(_Part):
    """A normalised squared error: its mean, the 95 % band it should lie in, and what that says."""

    value: float | None
    band: tuple[float, float] | None = Field(description="Two-sided 95 % chi-square band")
    verdict: Literal["consistent", "optimistic", "conservative", "unknown"]
    count: int = Field(description="Degrees of freedom the band rests on")


class _Errors(_Part):
    """Errors over all trials; RMS over the samples after time 0."""

    rms_m: float
    rms_second_half_m: float
    rms_x_m: float
    rms_y_m: float
    rms_heading_rad: float
    final_error_m: float = Field(description="RMS over the trials at the last sample")
    coverage_3sigma: float = Field(description="Share of coordinates within 3 sigma; ideal 0.9973")


class ErrorFigures(_Errors):
    """Errors over all trials; RMS over the samples after time 0."""

    predicted_rms_m: float | None
    rms_over_predicted: float | None = Field(description="Second-half RMS over predicted RMS")


class VehicleFigures(ErrorFigures):
    """Errors of one vehicle."""

    name: str


class FilterRecord(_Part):
    """The filter that was run."""

    model: Literal["arc", "euler"]
    substeps: int
    gate_probability: float | None
    gated: int = Field(description="Bearings rejected by the gate")
    used: int = Field(description="Bearings used")


class VehicleSeries(_Part):
    """Errors of one vehicle over time: RMS, mean and the filter's own sigma over the trials."""

    name: str
    rms_m: list[float]
    rms_x_m: list[float]
    rms_y_m: list[float]
    rms_heading_rad: list[float]
    mean_x_m: list[float]
    mean_y_m: list[float]
    mean_heading_rad: list[float]
    sigma_m: list[float] = Field(description="The filter's own position sigma")
    sigma_x_m: list[float]
    sigma_y_m: list[float]
    sigma_heading_rad: list[float]


class Series(_Part):
    """Errors over time."""

    time_s: list[float]
    vehicles: list[VehicleSeries]


class _RunReport(_Part):
    """A report of a run, which may hold `series`."""

    def as_json(self) -> dict[str, Any]:
        """Return the report as JSON values, without `series` where it was not asked for."""
        left_out = {"series"} if getattr(self, "series", None) is None else set()
        return self.model_dump(mode="json", exclude=left_out)


class ValidationDocument(_RunReport):
    """A Monte Carlo run of the filter on a plan."""

    version: str
    name: str
    trials: int
    seed: int
    duration_s: float
    filter: FilterRecord
    observable: bool
    vehicles: list[VehicleFigures]
    overall: ErrorFigures
    anees: Spread
    nis: Spread
    series: Series | None = None
    notes: list[str]

    @property
    def run(self) -> str:
        """How much was run, in words."""
        return f"{self.trials} trials of {self.duration_s:g} s, seed {self.seed}"


class RobotFigures(_Errors):
    """Errors of one robot of a recording: a single trial."""

    name: str


class ReplayFilter(_Part):
    """What the filter was told of a recording; sigmas of motion are per sample."""

    bearing_sigma_rad: float
    speed_sigma_mps: float
    turn_rate_sigma_rad_s: float
    position_sigma_m: float = Field(description="Of the start, which is at the truth")
    heading_sigma_rad: float = Field(description="Of the start, which is at the truth")
    sample_time_s: float
    gate_probability: float = Field(description="Of the innovation gate; 1 accepts all")


class ReadingCounts(_Part):
    """What became of the readings of bearings."""

    used: int
    rejected: int = Field(description="Rejected by the gate")
    unknown: int = Field(description="Of a barcode that nobody carries")
    not_asked_for: int = Field(description="Of landmarks or robots left out on purpose")
    outside: int = Field(description="Asked for, but from before or after the run")


class ReplayDocument(_RunReport):
    """The filter on a recording of real robots, beside where they truly were."""

    version: str
    name: str
    begin_s: float = Field(description="When the run begins by the recording's clock")
    duration_s: float
    landmarks: list[int] = Field(description="Numbers of those whose bearings were asked for")
    meetings: bool = Field(description="Whether bearings that robots took of each other were")
    filter: ReplayFilter
    position_rmse_m: float = Field(description="Over all robots and samples after the first")
    heading_rmse_rad: float
    robots: list[RobotFigures]
    coverage_3sigma: float
    anees: Spread
    nis: Spread
    readings: ReadingCounts
    series: Series | None = None
    notes: list[str]

    @property
    def run(self) -> str:
        """How much was run, in words."""
        return f"a recording of {self.duration_s:g} s"

    @property
    def vehicles(self) -> list[RobotFigures]:
        """The robots, as figures of any run know them."""
        return self.robots

    @property
    def trials(self) -> int:
        """One: a recording is a single trial."""
        return 1


class SweepRow(_Part):
    """One value of a sweep: what came of its plan, and of the trials."""

    label: str = Field(examples=["0.4"])
    value: float = Field(description="What the swept key was set to", examples=[0.4])
    range_m: list[float] = Field(description="Range of each vehicle's sensor")
    rank: int
    state_dim: int
    connectivity_period_s: float | None
    mean_rms_x_m: float
    mean_rms_y_m: float
    validation: ValidationDocument


class SweepReport(_Part):
    """A sweep: a row for each value."""

    swept: Literal[
        "orbit.angular_rate_rad_s", "sensor.range_m", "orbit.radius_m", "formation.spacing_m"
    ]
    rows: list[SweepRow] = Field(min_length=1)


def finite_or_none(value: float) -> float | None:
    """Return a number as documents hold it: infinity and NaN as null."""
    return value if math.isfinite(value) else None
