"""Flights over time as documents."""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.flight.flight_records import RecordedSteps, Track
from syncplan.flight.flight_series import mean_series
from syncplan.flight.flying import Flight
from syncplan.planning.planner import Plan
from syncplan.reports.document_base import Point
from syncplan.reports.flight_series_schemas import (
    FlightGround,
    FlightOverTime,
    FlownTrack,
    GroundMark,
    PlaceEllipse,
    PlannedCircle,
    TrackedVehicle,
    VehicleOverTime,
)

_PLACES = 3
"""Decimals of m in tracks."""

_DECIMALS = 6


def flight_over_time(flight: Flight) -> FlightOverTime | None:
    """Return a flight over time; None where it kept no series."""
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
                tracking_rms_m=_values(kept.tracking[:, k], _DECIMALS),
                phase_rms_s=_values(kept.phase[:, k], _DECIMALS),
                rms_m=_values(kept.error[:, k], _DECIMALS),
                sigma_m=_values(kept.sigma[:, k], _DECIMALS),
                bound_m=_values(kept.bound[:, k], _DECIMALS),
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
            TrackedVehicle(
                name=name,
                true_x_m=_values(track.true[:, k, 0], _PLACES),
                true_y_m=_values(track.true[:, k, 1], _PLACES),
                estimated_x_m=_values(track.estimated[:, k, 0], _PLACES),
                estimated_y_m=_values(track.estimated[:, k, 1], _PLACES),
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
            center_m=_point(place, _PLACES),
            **_axes(covariance),
        )
        for step, place, covariance in zip(
            steps.moments.tolist(), places, track.covariances[:, k], strict=True
        )
        if np.isfinite(place).all()
    ]


def _axes(covariance: Array) -> dict[str, float]:
    """Sigmas along the axes of an ellipse in m, and the angle of the major one."""
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


def _values(values: Array, decimals: int) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in np.round(values, decimals)]
