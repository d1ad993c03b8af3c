"""The JSON contract of the sidecar: what the exported files can't say, phase above all."""

from typing import Literal

from pydantic import Field

from syncplan.reports.document_base import DocumentPart, Point, VersionedDocument, Window
from syncplan.reports.verdict_schemas import PlanVerdict
from syncplan.scenario.models import GeoOrigin


class EntryPoint(DocumentPart):
    """Where a vehicle joins its circle, and when: at time_s, and again every period."""

    position_m: Point
    lat_deg: float | None = Field(description="Null without a geo_origin")
    lon_deg: float | None
    altitude_m: float = Field(description="Flown, above the origin")
    heading_rad: float = Field(description="Direction of flight there, from +x, in [0, 2 pi)")
    course_deg: float = Field(description="The same from north, clockwise, in [0, 360)")
    time_s: float = Field(description="Since time 0")
    time: str | None = Field(description="The same as a moment in UTC; null without a start_time")


class SyncedVehicle(DocumentPart):
    """One vehicle: its file, its circle, how it joins it and what it holds from then on."""

    name: str
    file: str | None = Field(description="Its own file; null where all share one")
    topic: str | None = Field(description="Its ROS topic; null in other formats")
    center_m: Point
    center_lat_deg: float | None
    center_lon_deg: float | None
    radius_m: float = Field(description="As exported: snapped where that was asked for")
    direction: Literal["ccw", "cw"]
    phase_rad: float = Field(description="At time 0: angle from +x about the centre, in [0, 2 pi)")
    entry: EntryPoint
    speed_mps: float = Field(description="Over ground, to hold on the circle")
    leg_speed_mps: float | None = Field(
        description="To hold on the straight legs between waypoints; null without"
    )
    start_item: int | None = Field(
        description="Number, home being 0, of the mission's item that begins at time 0; null "
        "without a mission"
    )
    autopilot_parameters: dict[str, float] = Field(
        description="To be set on this vehicle, where its autopilot needs it"
    )
    tolerance_s: float | None = Field(
        description="How early or late it alone may be before a planned meeting is lost; null if "
        "none is"
    )
    separation_tolerance_s: float | None = Field(
        description="How early or late it alone may be before it comes nearer than "
        "min_separation_m to another in the plane (0: before it would hit it); null if it never "
        "does"
    )
    phase_error_s: tuple[float, float] | None = Field(
        default=None,
        description="RMS and worst error of its phase that flying the plan has found, over the "
        "second half, to compare with the tolerances; null where the plan was not flown "
        "(syncplan plan --fly)",
    )
    speed_needed_mps: tuple[float, float] | None = Field(
        default=None,
        description="Least and largest airspeed that it commanded over the second half of these "
        "flights, when a steady state is reached, holds apart: the margin about speed_mps that "
        "wind and errors take from then on; null where the plan was not flown",
    )


class VehicleMeeting(DocumentPart):
    """When two vehicles are in contact, in each period."""

    a: str
    b: str
    planned: bool = Field(description="False for those that come about by the way")
    min_distance_m: float
    windows_s: list[Window] = Field(description="Since time 0; again every period_s")
    tolerance_s: float | None = Field(
        description="How early or late one of the two may be; null if never too much"
    )


class LandmarkSighting(DocumentPart):
    """When a vehicle sees a landmark, in each period."""

    vehicle: str
    landmark: str
    min_distance_m: float
    windows_s: list[Window]


class SyncDocument(VersionedDocument):
    """What goes with exported files: start, phases, speeds, who meets whom and when."""

    name: str
    format: str
    verdict: PlanVerdict | None = Field(
        default=None, description="Go or no-go for what was exported; absent from older files"
    )
    start_time: str | None = Field(description="Moment of time 0 in UTC; null: agree on one")
    geo_origin: GeoOrigin | None
    period_s: float
    angular_rate_rad_s: float
    min_separation_m: float = Field(description="As the scenario asks for")
    duration_s: float
    procedure: list[str] = Field(description="How the vehicles join at the right phase")
    vehicles: list[SyncedVehicle]
    meetings: list[VehicleMeeting]
    landmark_sightings: list[LandmarkSighting]
    notes: list[str]
