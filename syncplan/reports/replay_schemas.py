"""The JSON contract of replays: the filter on a recording of real robots."""

from typing import ClassVar

from pydantic import Field

from syncplan.reports.document_base import Document, DocumentPart
from syncplan.reports.run_schemas import RunReport, Series, Spread

WALK = frozenset({"bearing_walk_sigma_rad", "bearing_walk_time_s"})
"""Keys of a bearing walk."""


class RobotFigures(Document):
    """Errors of one robot of a recording: a single trial, RMS over the samples after time 0.

    Where the recording has no truth, they are null and the filter's own figures take their place.
    """

    left_out_if_none: ClassVar[frozenset[str]] = frozenset(
        {
            *("final_x_m", "final_y_m", "final_heading_rad"),
            *("final_sigma_m", "final_sigma_heading_rad", "rms_sigma_m"),
        }
    )

    rms_m: float | None
    rms_second_half_m: float | None
    rms_x_m: float | None
    rms_y_m: float | None
    rms_heading_rad: float | None
    final_error_m: float | None = Field(description="At the last sample")
    coverage_3sigma: float | None = Field(
        description="Share of coordinates within 3 sigma; ideal 0.9973"
    )
    name: str
    final_x_m: float | None = Field(
        default=None, description="Estimate at the last sample; absent where the truth is known"
    )
    final_y_m: float | None = None
    final_heading_rad: float | None = None
    final_sigma_m: float | None = Field(
        default=None, description="The filter's own position sigma at the last sample"
    )
    final_sigma_heading_rad: float | None = None
    rms_sigma_m: float | None = Field(
        default=None, description="RMS of the filter's own position sigma over the run"
    )


class ReplayFilter(Document):
    """What the filter assumes of a recording; sigmas of motion are per sample.

    What is null in older files was not part of the filter then.
    """

    left_out_if_none: ClassVar[frozenset[str]] = WALK

    model: str | None = Field(default=None, description="Name of the filter", examples=["ekf"])
    bearing_sigma_rad: float
    range_sigma_m: float | None = Field(
        default=None, description="Null where distances are not recorded, or not asked for"
    )
    speed_sigma_mps: float
    turn_rate_sigma_rad_s: float
    speed_scale_sigma: float | None = Field(
        default=None, description="Of the share by which each robot's speed readings are wrong"
    )
    turn_rate_bias_sigma_rad_s: float | None = None
    bearing_bias_sigma_rad: float | None = None
    bearing_walk_sigma_rad: float | None = Field(
        default=None, description="Of the bearing error that changes slowly; not there: not a state"
    )
    bearing_walk_time_s: float | None = Field(
        default=None, description="Over which the correlation of that error falls to 1/e"
    )
    delay_s: float | None = Field(
        default=None, description="By which sightings are recorded later than they were made"
    )
    start: str | None = Field(
        default=None, description="Where the filter starts; at the truth where null"
    )
    position_sigma_m: float = Field(description="Of the start")
    heading_sigma_rad: float = Field(description="Of the start")
    sample_time_s: float = Field(description="Between the samples at which errors are taken")
    gate_probability: float = Field(description="Of the innovation gate; 1 accepts all")


class ReadingCounts(DocumentPart):
    """How many readings of one kind were used, and why others were not."""

    used: int
    rejected: int = Field(description="Rejected by the gate")
    unknown: int = Field(description="Of targets that nobody recognised")
    not_asked_for: int = Field(description="Of landmarks or robots left out on purpose")
    outside: int = Field(description="Asked for, but from before or after the run")


class LastingError(DocumentPart):
    """A lasting error of one robot's odometry or camera, as the filter has it at the end."""

    name: str = Field(examples=["speed_scale"])
    robot: str
    unit: str
    value: float
    sigma: float


class GapRecord(DocumentPart):
    """A time over which the team was not observable."""

    from_s: float = Field(description="Since the beginning of the run")
    to_s: float
    least_rank: int = Field(description="Of the windows that end in it")
    robots: list[str] = Field(description="Those of which some coordinate was not determined")


class SeenRecord(DocumentPart):
    """What the sightings of sliding windows determined, each judged for the step that ends it."""

    window_s: float
    step_s: float = Field(description="Between the ends of two windows")
    judged_s: float = Field(description="All in all, from when the first window ends")
    observable_s: float = Field(description="Of it, with full rank")
    certified_s: float = Field(description="Of it, with the certificate")
    longest_gap_s: float = Field(description="Longest time over which the team was not observable")
    state_dim: int
    gaps: list[GapRecord]
    median_position_sigma_m: float | None = Field(
        description="Of the worst robot from one window alone, median over windows; null where "
        "more than half of them determine less than all"
    )


class Sigmas(Document):
    """What a replay fits; sigmas of motion are per sample."""

    left_out_if_none: ClassVar[frozenset[str]] = WALK

    bearing_sigma_rad: float
    range_sigma_m: float
    speed_sigma_mps: float
    turn_rate_sigma_rad_s: float
    bearing_walk_sigma_rad: float | None = Field(
        default=None, description="Of the bearing error that changes slowly; not there: not a state"
    )
    bearing_walk_time_s: float | None = Field(
        default=None, description="Over which the correlation of that error falls to 1/e"
    )
    delay_s: float


class TuningRecord(Document):
    """How sigmas and delay were fitted to the beginning of a recording, without its truth.

    Gains are in the log-likelihood of a sighting that the filter is not given, on average.
    """

    fitted_s: float = Field(description="Length of what was fitted to; figures are of the rest")
    runs: int = Field(description="Of the filter")
    accepted: bool | None = Field(
        default=None,
        description="Whether the rest ran with what was fitted; with what was given if false. Null "
        "in older files, where it always did",
    )
    before: Sigmas
    after: Sigmas
    gain: float | None = Field(
        description="Over those fitted to; null where the filter diverges with what was given"
    )
    gain_on_rest: float | None = Field(
        description="Over the rest, which the fit has not seen; null where the filter diverges"
    )
    gain_on_rest_sigma: float | None = Field(
        default=None, description="Standard error of that; null in older files"
    )
    error_ratio: float | None = Field(
        default=None,
        description="RMS by which withheld sightings of the rest differ from predictions on "
        "average over 10 s, fitted over given; null where the filter diverges, and in older files",
    )
    error_ratio_sigma: float | None = Field(
        default=None, description="Standard error of that; null in older files"
    )
    white: bool | None = Field(
        default=None,
        description="Whether innovations of the rest are white, by NIS and sums over 10 s; if not, "
        "only a smaller error makes a fit acceptable. Null in older files",
    )
    bearing_growth: float = Field(
        description="By what the sigma of a bearing is larger as its errors last; at least 1"
    )
    range_growth: float = Field(description="The same of a distance")


class EstimatedPath(DocumentPart):
    """Where the filter takes one robot to be over time, and its own sigmas."""

    name: str
    x_m: list[float]
    y_m: list[float]
    heading_rad: list[float]
    sigma_m: list[float] = Field(description="Of the position")
    sigma_x_m: list[float]
    sigma_y_m: list[float]
    sigma_heading_rad: list[float]


class EstimateSeries(DocumentPart):
    """Estimates over time."""

    time_s: list[float]
    robots: list[EstimatedPath]


class ReplayDocument(RunReport):
    """The filter on a recording of real robots, beside where they truly were if that is known.

    Where the recording has no truth, all that compares with it is null.
    """

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"series", "estimates"})

    begin_s: float = Field(description="When the run begins by the recording's clock")
    duration_s: float
    landmarks: list[int | str] = Field(
        description="Names, or numbers, of those whose sightings were asked for"
    )
    meetings: bool = Field(description="Whether sightings between robots were")
    filter: ReplayFilter
    position_rmse_m: float | None = Field(
        description="Over all robots and samples after the first; null without truth"
    )
    heading_rmse_rad: float | None
    robots: list[RobotFigures]
    coverage_3sigma: float | None
    anees: Spread | None
    nis: Spread = Field(description="Of all kinds of sighting")
    readings: ReadingCounts = Field(description="Of bearings")
    distances: ReadingCounts | None = Field(
        default=None, description="Null where distances are not recorded, or not asked for"
    )
    observability: SeenRecord | None = Field(
        default=None, description="Null where no windows were judged, and in older files"
    )
    tuning: TuningRecord | None = Field(
        default=None, description="Null where sigmas and delay were stated"
    )
    lasting_errors: list[LastingError] | None = Field(
        default=None, description="Those that are states of the filter; null in older files"
    )
    series: Series | None = None
    estimates: EstimateSeries | None = Field(
        default=None, description="In place of `series` where the recording has no truth"
    )
    notes: list[str]

    @property
    def has_errors(self) -> bool:
        """Whether errors are known."""
        return self.position_rmse_m is not None

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
