"""The JSON contracts of runs of the filter along plans: validations and sweeps."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field

from syncplan.errors import InputError
from syncplan.estimation.filters import FilterName, MotionName
from syncplan.reports.document_base import Document, DocumentPart, VersionedDocument
from syncplan.reports.state_error_schemas import StateErrorFigures, StateErrorSeries
from syncplan.reports.truth_schemas import ExpectedErrors, TrueKey
from syncplan.reports.verdict_schemas import PlanVerdict
from syncplan.scenario.dotted_keys import swept_key


class Spread(DocumentPart):
    """A normalised squared error: its mean, that mean's confidence interval, and what that says."""

    value: float | None = Field(description="1 for a consistent filter; null without samples")
    band: tuple[float, float] | None = Field(
        description="Two-sided 95 % confidence interval of `value`; null where too few trials "
        "were run. In files without `basis`, the chi-square band of a consistent filter"
    )
    verdict: Literal["consistent", "optimistic", "conservative", "unknown"] = Field(
        description="optimistic where the whole interval is above 1.1 (sigmas too small), "
        "conservative where it is below 0.9; unknown without an interval, or where one over trials "
        "is wider than 0.4; otherwise consistent"
    )
    count: int = Field(description="Of what the interval rests on: trials or degrees of freedom")
    basis: Literal["trials", "chi-square"] | None = Field(
        default=None,
        description="What the interval rests on: the spread over trials or, for a single run, a "
        "chi-square variable; null in older files",
    )


class Errors(DocumentPart):
    """Errors over all trials; RMS over the samples after time 0."""

    rms_m: float
    rms_second_half_m: float
    rms_x_m: float
    rms_y_m: float
    rms_heading_rad: float
    final_error_m: float = Field(description="RMS over the trials at the last sample")
    coverage_3sigma: float = Field(description="Share of coordinates within 3 sigma; ideal 0.9973")


class ErrorFigures(Errors):
    """Errors over all trials; RMS over the samples after time 0."""

    predicted_rms_m: float | None
    rms_over_predicted: float | None = Field(description="Second-half RMS over predicted RMS")
    median_rms_second_half_m: float | None = Field(
        default=None,
        description="Median over the trials of each trial's second-half RMS; null in older files",
    )
    share_over_3_predicted: float | None = Field(
        default=None,
        description="Share of trials whose second-half RMS is over 3 times the predicted RMS; "
        "overall, of trials in which any vehicle's is. Null where nothing is predicted",
    )
    share_over_10_predicted: float | None = Field(
        default=None, description="The same over 10 times the predicted RMS"
    )


class VehicleFigures(ErrorFigures):
    """Errors of one vehicle."""

    name: str


class FilterRecord(DocumentPart):
    """The filter that was run."""

    model: MotionName = Field(description="How readings are integrated: exact arcs, or Euler's way")
    kind: FilterName | None = Field(
        default=None, description="Which filter; null in older files, whose filter is ekf or paper"
    )
    chosen_because: str | None = Field(
        default=None, description="Why this filter; null in older files"
    )
    judged_from_s: float = Field(
        default=0.0,
        description="Time from which on ANEES, NIS and coverage count: robust looks for its start "
        "until then",
    )
    substeps: int
    gate_probability: float | None
    gated: int = Field(description="Bearings rejected by the gate")
    used: int = Field(description="Bearings used")


class VehicleSeries(DocumentPart):
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


class Series(Document):
    """Errors over time."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"errors"})

    time_s: list[float]
    vehicles: list[VehicleSeries]
    errors: list[StateErrorSeries] | None = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )


class RunReport(VersionedDocument):
    """A report of a run, which may hold `series`."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset({"series"})

    name: str

    @property
    def has_errors(self) -> bool:
        """Whether errors are known: of all runs but of recordings without truth."""
        return True


class TrueWorldReport(RunReport):
    """A report of a run in a simulated world."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset(
        {"series", "errors", "truth", "expected_rms_m"}
    )

    truth: list[TrueKey] | None = Field(
        default=None,
        description="Keys of which the simulated world differs; absent where the scenario and the "
        "request give no truth",
    )
    expected_rms_m: ExpectedErrors | None = Field(
        default=None,
        description="What the filter is to be expected to make of that world along the circles, by "
        "a linear recursion; absent where there is no truth, or it was not computed",
    )


class StressedWorld(DocumentPart):
    """A world that is worse in one way than the scenario states."""

    world: str = Field(examples=["wind.gust_sigma_mps doubled"])
    truth: list[TrueKey] = Field(description="Keys of which it differs from the scenario")
    rms_second_half_m: float = Field(description="Over all vehicles")
    harm: float = Field(description="That over the one of the world as stated")
    expected_rms_m: float | None = Field(
        description="What was to be expected, by a linear recursion; null where not computed"
    )
    anees: Spread


class ValidationDocument(TrueWorldReport):
    """A Monte Carlo run of the filter on a plan."""

    left_out_if_none: ClassVar[frozenset[str]] = frozenset(
        {"series", "errors", "truth", "expected_rms_m", "stress"}
    )

    verdict: PlanVerdict | None = Field(
        default=None, description="Of the plan that was flown; null in older files"
    )
    trials: int
    seed: int
    duration_s: float
    filter: FilterRecord
    observable: bool
    vehicles: list[VehicleFigures]
    overall: ErrorFigures
    errors: list[StateErrorFigures] | None = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )
    anees: Spread = Field(description="Of the poses alone")
    nis: Spread
    stress: list[StressedWorld] | None = Field(
        default=None,
        description="Worlds that are worse than the scenario states, the most harmful first; "
        "absent unless asked for",
    )
    series: Series | None = None
    notes: list[str]

    @property
    def run(self) -> str:
        """How much was run, in words."""
        return f"{self.trials} trials of {self.duration_s:g} s, seed {self.seed}"


class SweepRow(Document):
    """One value of a sweep: the verdict on its plan, and its validation."""

    label: str = Field(examples=["0.4"])
    value: float = Field(description="What the swept key was set to", examples=[0.4])
    range_m: list[float] = Field(description="Range of each vehicle's sensor")
    rank: int
    state_dim: int
    connectivity_period_s: float | None
    mean_rms_x_m: float
    mean_rms_y_m: float
    validation: ValidationDocument


def _only_numeric_keys(schema: dict[str, Any]) -> None:
    from syncplan.scenario.dotted_keys import numeric_keys

    schema["enum"] = list(numeric_keys())


def _known(key: str) -> str:
    try:
        return swept_key(key).key
    except InputError as error:
        raise ValueError(error.problem) from None


SweptName = Annotated[str, AfterValidator(_known), Field(json_schema_extra=_only_numeric_keys)]


class SweepReport(Document):
    """A sweep: a row for each value."""

    swept: SweptName
    rows: list[SweepRow] = Field(min_length=1)

    @property
    def name(self) -> str:
        """Name of the scenario that was varied."""
        return self.rows[0].validation.name
