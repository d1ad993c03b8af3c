"""Flights over time as documents, the source of their figures and of a playback."""

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import DocumentPart, Point
from syncplan.guidance.flight_records import RecordedSteps, Track
from syncplan.planning.plans import Plan
from syncplan.reports.run_figures import PLACE_DECIMALS, GroundMark, PathOverTime, rounded_or_none

if TYPE_CHECKING:
    from syncplan.planning.plan_flights import Flight

Values = list[float | None]
"""Values over time; null where a vehicle is lost."""


class PlannedCircle(DocumentPart):
    """A vehicle's circle in the plan."""

    name: str
    center_m: Point
    radius_m: float
    direction: Literal["ccw", "cw"]
    phase_rad: float = Field(description="At time 0")


class FlightGround(DocumentPart):
    """Planned circles, landmarks and areas of a flight."""

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
    phase_rms_s: Values = Field(
        description="RMS of the phase error, ahead of the plan or behind it"
    )
    rms_m: Values = Field(description="Error of the estimated place")
    sigma_m: Values = Field(description="The filter's own position sigma")
    bound_m: Values = Field(description="The bound along the paths truly flown")


class PlaceEllipse(DocumentPart):
    """The filter's own covariance of a position at one moment, as axes of one sigma."""

    time_s: float
    center_m: Point = Field(description="The estimated place")
    major_sigma_m: float
    minor_sigma_m: float
    angle_rad: float = Field(description="Of the major axis, from +x, 0 to pi")


class TrackedVehicle(PathOverTime):
    """True and estimated positions of a vehicle at the times of `track_time_s`, to 1 mm."""

    ellipses: list[PlaceEllipse] = Field(
        description="At up to 12 moments over the run, each a twelfth of a turn further round"
    )


class FlownTrack(DocumentPart):
    """Tracks of one trial."""

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


_DECIMALS = 6


def flight_over_time(flight: "Flight") -> FlightOverTime | None:
    """Return a flight over time; None if it kept no series."""
    from syncplan.guidance.flights import mean_series

    if not flight.result.branches:
        return None
    team, names = flight.run.team, flight.run.plan.scenario.vehicle_names
    kept = mean_series(team, flight.result)
    time = team.setup.time
    steps = RecordedSteps.of(team.steps, time, flight.run.plan.orbits.period)
    return FlightOverTime(
        time_s=_listed(kept.times),
        vehicles=[
            VehicleOverTime(
                name=name,
                tracking_rms_m=rounded_or_none(kept.tracking[:, k], _DECIMALS),
                phase_rms_s=rounded_or_none(kept.phase[:, k], _DECIMALS),
                rms_m=rounded_or_none(kept.error[:, k], _DECIMALS),
                sigma_m=rounded_or_none(kept.sigma[:, k], _DECIMALS),
                bound_m=rounded_or_none(kept.bound[:, k], _DECIMALS),
            )
            for k, name in enumerate(names)
        ],
        track_time_s=_listed(np.asarray(steps.tracks * time, dtype=float)),
        tracks=[_track(track, names, steps, time) for track in flight.result.tracks],
        ground=_ground(flight.run.plan),
    )


def _track(track: Track, names: list[str], steps: RecordedSteps, time: float) -> FlownTrack:
    return FlownTrack(
        trial=track.trial,
        vehicles=[
            TrackedVehicle.of(
                name,
                track.true[:, k],
                track.estimated[:, k],
                ellipses=_ellipses(track, k, steps, time),
            )
            for k, name in enumerate(names)
        ],
    )


def _ellipses(track: Track, k: int, steps: RecordedSteps, time: float) -> list[PlaceEllipse]:
    places = track.estimated[np.searchsorted(steps.tracks, steps.moments), k]
    return [
        PlaceEllipse(
            time_s=round(step * time, _DECIMALS),
            center_m=_point(place, PLACE_DECIMALS),
            **_axes(covariance),
        )
        for step, place, covariance in zip(
            steps.moments.tolist(), places, track.covariances[:, k], strict=True
        )
        if np.isfinite(place).all()
    ]


def _axes(covariance: Array) -> dict[str, float]:
    """Sigmas in m along the axes of an ellipse, and the angle of the major axis."""
    xx, yy, xy = covariance.tolist()
    middle, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    return {
        "major_sigma_m": round(math.sqrt(middle + half), _DECIMALS),
        "minor_sigma_m": round(math.sqrt(max(middle - half, 0.0)), _DECIMALS),
        "angle_rad": round(0.5 * math.atan2(2.0 * xy, xx - yy) % math.pi, _DECIMALS),
    }


def _ground(plan: Plan) -> FlightGround:
    orbits, scenario = plan.orbits, plan.scenario
    return FlightGround(
        period_s=orbits.period,
        circles=[
            PlannedCircle(
                name=name,
                center_m=_point(orbits.centers[k]),
                radius_m=float(orbits.radii[k]),
                direction="ccw" if orbits.senses[k] > 0.0 else "cw",
                phase_rad=float(orbits.phases[k]),
            )
            for k, name in enumerate(scenario.vehicle_names)
        ],
        landmarks=[
            GroundMark(name=name, position_m=_point(place))
            for name, place in zip(
                scenario.landmark_names, plan.landmarks.reshape(-1, 2), strict=True
            )
        ],
        area_m=scenario.area_m,
        keep_out_m=scenario.keep_out_m or [],
        obstacles_m=scenario.obstacles_m or [],
    )


def _point(place: Array, decimals: int | None = None) -> Point:
    x, y = (place if decimals is None else np.round(place, decimals)).tolist()
    return x, y


def _listed(times: Array) -> list[float]:
    found: list[float] = np.round(times, _DECIMALS).tolist()
    return found
