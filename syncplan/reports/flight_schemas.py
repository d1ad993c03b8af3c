"""The JSON contract of flights."""

from typing import Literal

from pydantic import Field

from syncplan.reports.document_base import DocumentPart
from syncplan.reports.flight_series_schemas import FlightOverTime
from syncplan.reports.run_schemas import Errors, FilterRecord, Spread, TrueWorldReport
from syncplan.reports.verdict_schemas import PlanVerdict
from syncplan.scenario.disturbances import ReadingsKind


class PhaseError(DocumentPart):
    """How far ahead of the plan a vehicle is, or behind it, over the second half."""

    rms: float
    worst: float = Field(description="In any trial")


class FlightErrors(Errors):
    """Errors of the estimates against the truth as flown, over all trials."""

    predicted_rms_m: float | None = Field(
        description="The plan's bound, of circles flown exactly; null for another duration"
    )
    bound_rms_m: float = Field(
        description="The bound along the paths truly flown, by the sightings truly made, RMS over "
        "the second half"
    )
    rms_over_bound: float | None = Field(description="Second-half RMS over bound_rms_m")
    tracking_rms_m: float = Field(description="True distance from the plan's place, second half")


class FlownVehicle(DocumentPart):
    """How one vehicle flew."""

    name: str
    errors: FlightErrors | None = Field(description="Null for a vehicle that is lost on the way")
    phase_error_s: PhaseError | None
    phase_tolerance_s: float | None = Field(
        description="The least of its links' in the plan: how late it may be until one never comes "
        "into contact; null where it has none"
    )
    meetings_kept: float | None = Field(
        description="Share of its meetings in the plan in which a sighting was made; null where "
        "it has none"
    )
    longest_without_sighting_s: float = Field(description="In any trial, from time 0 on")
    saturated_share: float = Field(description="Share of samples with a command at a limit")
    refused_share: float | None = Field(
        description="Share of decisions of guidance mpc whose program was not solved: the vehicle "
        "then flies the best of its guesses; null for other guidances"
    )
    anchor: str | None = Field(description="By whom it keeps in contact; null for none")
    sought_share: float = Field(
        description="Share of samples at which its circle was moved to be sure of its anchor"
    )


class FlownLink(DocumentPart):
    """Two that meet in the plan: vehicles, or a vehicle and a landmark."""

    between: tuple[str, str]
    meetings: int = Field(description="In the plan, in each trial")
    kept_share: float = Field(description="In which a sighting was made")


class FlownSeparation(DocumentPart):
    """The closest that any two vehicles came, over trials."""

    median: float
    worst: float
    between: tuple[str, str] = Field(description="Which two, in the worst trial")
    time_s: float = Field(description="When, in the worst trial")
    planned: float = Field(description="The plan's own")
    asked: float | None = Field(description="min_separation_m; null where none is asked for")
    quantiles: list[float] = Field(
        description="Of the closest in each trial, at 41 shares of the trials from 0 to 1"
    )
    below_asked_share: float | None = Field(
        description="Share of trials below min_separation_m; null where none is asked for"
    )


class FlightEvent(DocumentPart):
    """What happened in every trial."""

    event: str = Field(description="As it was asked for", examples=["v3@60", "v2@100:20"])
    kind: Literal["loss", "hold"]
    subject: str = Field(description="What is lost or held", examples=["v3", "sensor of v3"])
    begin_s: float
    end_s: float | None = Field(description="Null for what is lost")
    what: str = Field(examples=["v3 is lost at 60 s"])
    settled_s: float | None = Field(
        default=None,
        description="Of a hold: median time from its end until the vehicle keeps its phase within "
        "1 s for a period; null where half of the trials never do, where less than a period is "
        "left to say, and for losses",
    )


class FlightConditions(DocumentPart):
    """What sightings suffer in every trial, and the air, as it was asked for."""

    dropout: float = Field(description="Share of sightings that are lost on their way")
    outliers: float = Field(description="Share of bearings that are false, anywhere in view")
    mistaken: float = Field(
        description="Share of sightings of another vehicle in sight than is thought"
    )
    late: int = Field(description="Samples after which sightings arrive")
    wind_mps: tuple[float, float] | None = Field(
        description="True wind x, y of all trials; null where each draws its own by wind.sigma_mps"
    )


class FlownStateError(DocumentPart):
    """Errors of a state of the filter that is no pose, over all trials."""

    state: str = Field(description="What it is", examples=["wind x", "speed scale of v1"])
    unit: str = Field(description="Of the errors", examples=["m/s"])
    rms: float = Field(description="Over the samples after time 0")
    rms_second_half: float
    bound_rms: float = Field(
        description="The bound along the paths truly flown, by the sightings truly made, RMS over "
        "the second half"
    )
    ratio: float | None = Field(description="Second-half RMS over bound_rms")
    coverage: float = Field(description="Share of samples within 3 sigma; ideal 0.9973")


LimitsFrom = Literal["scenario", "default"]


class VehicleModel(DocumentPart):
    """What the vehicles were taken to be."""

    speed_mps: tuple[float, float] = Field(description="Least and largest airspeed of any vehicle")
    turn_rate_rad_s: float = Field(description="Largest turn rate")
    speed_from: LimitsFrom = Field(description="default: up to twice the plan's speed")
    turn_rate_from: LimitsFrom = Field(description="default: up to 4 times the plan's turn rate")
    lag_s: float
    readings: ReadingsKind


class FlightDocument(TrueWorldReport):
    """Many flights of a plan, in closed loop."""

    verdict: PlanVerdict = Field(description="Of the plan that was flown")
    trials: int
    seed: int
    duration_s: float
    guidance: str
    conditions: FlightConditions
    vehicle_model: VehicleModel
    filter: FilterRecord
    observable: bool
    filter_lost_share: float = Field(
        description="Share of trials in which some vehicle's error in the second half is over 5 "
        "times the bound along the path it truly took"
    )
    out_of_contact_share: float = Field(
        description="Share of trials in which some vehicle made no sighting, and was in none, for "
        "more than two periods"
    )
    least_separation_m: FlownSeparation | None = Field(description="Null for a single vehicle")
    saturated_share: float
    wind_error_mps: float | None = Field(
        description="RMS error of the estimated wind, second half; null where it is no state"
    )
    events: list[FlightEvent]
    vehicles: list[FlownVehicle]
    overall: FlightErrors
    errors: list[FlownStateError] | None = Field(
        default=None,
        description="Of states of the filter that are no poses; absent where there are none",
    )
    links: list[FlownLink]
    anees: Spread
    nis: Spread
    series: FlightOverTime | None = Field(
        default=None, description="Over time; absent unless asked for"
    )
    notes: list[str]

    @property
    def run(self) -> str:
        """How much was flown, in words."""
        return f"{self.trials} flights of {self.duration_s:g} s, seed {self.seed}"
