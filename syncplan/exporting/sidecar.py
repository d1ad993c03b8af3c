"""The sidecar of an export: start, phases, speeds, meetings, and how a vehicle joins in."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from syncplan.exporting.files import ExportedFile, Written
from syncplan.exporting.flight import Flight, moment, places_of, start_of
from syncplan.exporting.sync_document import (
    EntryPoint,
    LandmarkSighting,
    SyncDocument,
    SyncedVehicle,
    VehicleMeeting,
)
from syncplan.meetings import Meeting
from syncplan.orbits import heading, position
from syncplan.output import as_text

__all__ = ["sidecar_file", "sync_document"]

Array = NDArray[np.float64]


def sidecar_file(flight: Flight, format_: str, written: Written) -> ExportedFile:
    """Return the sidecar `TITLE.sync.json` of what was written."""
    document = sync_document(flight, format_, written)
    return ExportedFile(f"{flight.title}.sync.json", as_text(document.as_json()).encode())


def sync_document(flight: Flight, format_: str, written: Written) -> SyncDocument:
    """Return what the files of a format can't say of the flight, for the circles exported."""
    from syncplan import __version__

    plan, start = flight.plan, start_of(flight.plan)
    names, landmarks = flight.names, plan.scenario.landmark_names
    return SyncDocument(
        version=__version__,
        name=plan.scenario.name,
        format=format_,
        start_time=None if start is None else moment(start, 0.0),
        geo_origin=plan.scenario.geo_origin,
        period_s=plan.orbits.period,
        angular_rate_rad_s=plan.orbits.rate,
        altitude_m=flight.altitude,
        duration_s=flight.duration,
        autopilot_parameters=dict(written.parameters),
        procedure=_procedure(flight, written),
        vehicles=_vehicles(flight, written),
        meetings=[
            VehicleMeeting(
                a=names[item.a],
                b=names[item.b],
                planned=planned,
                min_distance_m=item.min_distance,
                windows_s=_windows(item.windows),
                tolerance_s=_tolerance(flight, [item]),
            )
            for planned, items in ((True, plan.links), (False, plan.incidental_links))
            for item in items
        ],
        landmark_sightings=[
            LandmarkSighting(
                vehicle=names[item.a],
                landmark=landmarks[item.b - plan.orbits.count],
                min_distance_m=item.min_distance,
                windows_s=_windows(item.windows),
            )
            for item in plan.landmark_links
        ],
        notes=list(written.notes),
    )


def _vehicles(flight: Flight, written: Written) -> list[SyncedVehicle]:
    orbits, start = flight.plan.orbits, start_of(flight.plan)
    where, ahead = position(orbits, 0.0), heading(orbits, 0.0) % (2.0 * np.pi)
    entries = _degrees(flight, where)
    centers = _degrees(flight, orbits.centers)
    return [
        SyncedVehicle(
            name=name,
            file=written.own_files[k] if written.own_files else None,
            topic=written.topics[k] if written.topics else None,
            center_m=_pair(orbits.centers[k]),
            center_lat_deg=centers[k][0],
            center_lon_deg=centers[k][1],
            radius_m=float(orbits.radii[k]),
            direction="ccw" if orbits.senses[k] > 0.0 else "cw",
            phase_rad=float(orbits.phases[k] % (2.0 * np.pi)),
            entry=EntryPoint(
                position_m=_pair(where[k]),
                lat_deg=entries[k][0],
                lon_deg=entries[k][1],
                altitude_m=flight.altitude,
                heading_rad=float(ahead[k]),
                course_deg=(90.0 - math.degrees(float(ahead[k]))) % 360.0,
                time_s=0.0,
                time=None if start is None else moment(start, 0.0),
            ),
            speed_mps=float(orbits.speeds[k]),
            leg_speed_mps=written.leg_speeds[k] if written.leg_speeds else None,
            tolerance_s=_tolerance(flight, _meetings_of(flight, k)),
        )
        for k, name in enumerate(flight.names)
    ]


def _procedure(flight: Flight, written: Written) -> list[str]:
    """How a vehicle joins its circle at the right phase, step by step."""
    period, known = flight.plan.orbits.period, flight.plan.scenario.start_time is not None
    when = "start_time" if known else "a moment that all agree on (time 0)"
    steps = [
        "Take-off and landing are the operator's; wait clear of all circles, each vehicle at a "
        "height of its own.",
        f"Be at entry.position_m at {when}, under way on entry.course_deg at speed_mps; come in "
        "along the tangent. A vehicle that starts there from rest loses speed / (2 acceleration) "
        "seconds: let it start that much earlier.",
        f"Who misses it passes the same point at any whole number of periods ({period:.6g} s) "
        "later.",
        "From then on hold speed_mps over ground on the circle: every vehicle then takes one "
        "period for a turn, whatever its radius.",
        "Check the time at which the entry point is passed in each turn. Late by s seconds: fly "
        "one turn at speed_mps period_s / (period_s - s). Within tolerance_s no meeting is lost.",
    ]
    if written.leg_speeds:
        steps.insert(
            4,
            "Between waypoints hold leg_speed_mps, which the mission sets: the legs are shorter "
            "than the arcs, and the corners are then passed on time.",
        )
    if written.parameters:
        told = ", ".join(f"{name} {value:.6g}" for name, value in written.parameters)
        steps.insert(0, f"Set on every vehicle: {told}.")
    return steps


def _meetings_of(flight: Flight, k: int) -> list[Meeting]:
    return [item for item in flight.plan.links if k in (item.a, item.b)]


def _tolerance(flight: Flight, meetings: Sequence[Meeting]) -> float | None:
    """Least time in s by which a phase may slip; None where no meeting can be lost."""
    least = min((item.tolerance for item in meetings), default=math.pi)
    return None if least >= math.pi else least / flight.plan.orbits.rate


def _degrees(flight: Flight, points: Array) -> list[tuple[float | None, float | None]]:
    places = places_of(flight, points)
    if places is None:
        return [(None, None)] * len(points)
    return [_pair(place) for place in places]


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _windows(windows: Array) -> list[tuple[float, float]]:
    return [(float(start), float(end)) for start, end in windows]
