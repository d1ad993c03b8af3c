"""The JSON contract of flights over time: what their figures and a playback are drawn from."""

from typing import Literal

from pydantic import Field

from syncplan.reports.document_base import DocumentPart, Point

Values = list[float | None]
"""Null where a vehicle is lost."""


class PlannedCircle(DocumentPart):
    """A vehicle's circle, as the plan has it."""

    name: str
    center_m: Point
    radius_m: float
    direction: Literal["ccw", "cw"]
    phase_rad: float = Field(description="At time 0")


class GroundMark(DocumentPart):
    """A landmark."""

    name: str
    position_m: Point


class FlightGround(DocumentPart):
    """What was to be flown, and where."""

    period_s: float
    circles: list[PlannedCircle]
    landmarks: list[GroundMark]
    area_m: list[Point] | None
    keep_out_m: list[list[Point]]
    obstacles_m: list[list[Point]]


class VehicleOverTime(DocumentPart):
    """One vehicle at the times of `time_s`: root mean squares over all trials."""

    name: str
    tracking_rms_m: Values = Field(description="True distance from the plan's place")
    phase_rms_s: Values = Field(description="Ahead of the plan, or behind it")
    rms_m: Values = Field(description="Error of the estimated place")
    sigma_m: Values = Field(description="The filter's own position sigma")
    bound_m: Values = Field(description="The bound along the paths truly flown")


class PlaceEllipse(DocumentPart):
    """The filter's own covariance of a place at a moment, as axes of one sigma."""

    time_s: float
    center_m: Point = Field(description="The estimated place")
    major_sigma_m: float
    minor_sigma_m: float
    angle_rad: float = Field(description="Of the major axis, from +x, 0 to pi")


class TrackedVehicle(DocumentPart):
    """Where a vehicle was, and was taken to be, at the times of `track_time_s`; to 1 mm."""

    name: str
    true_x_m: Values
    true_y_m: Values
    estimated_x_m: Values
    estimated_y_m: Values
    ellipses: list[PlaceEllipse] = Field(
        description="At up to 12 moments over the run, each a twelfth of a turn further round"
    )


class FlownTrack(DocumentPart):
    """One trial."""

    trial: int = Field(description="Its number, from 0 on")
    vehicles: list[TrackedVehicle]


class FlightOverTime(DocumentPart):
    """A flight over time."""

    time_s: list[float]
    vehicles: list[VehicleOverTime]
    track_time_s: list[float]
    tracks: list[FlownTrack] = Field(
        description="Of the first three trials; of the first alone where there are over 20 vehicles"
    )
    ground: FlightGround
