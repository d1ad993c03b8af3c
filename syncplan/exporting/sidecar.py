"""The sidecar of an export: start, phases, speeds, meetings, and how a vehicle joins in."""

import math
from collections.abc import Sequence

import numpy as np

from syncplan.arrays import Array
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.joining import procedure
from syncplan.exporting.scheduled_plan import ScheduledPlan, moment, places_of, start_of
from syncplan.exporting.sync_document import (
    EntryPoint,
    LandmarkSighting,
    SyncDocument,
    SyncedVehicle,
    VehicleMeeting,
)
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.circles import heading, position
from syncplan.orbits.contacts import reachable_pairs
from syncplan.reports.verdict_schemas import plan_verdict
from syncplan.runtime.files import as_text
from syncplan.synchronisation.phase_tolerance import separation_tolerances


def sidecar_file(flown: ScheduledPlan, format_: str, written: Written) -> ExportedFile:
    """Return the sidecar `TITLE.FORMAT.sync.json` of what was written."""
    document = sync_document(flown, format_, written)
    return ExportedFile(f"{flown.title}.{format_}.sync.json", as_text(document.as_json()).encode())


def sync_document(flown: ScheduledPlan, format_: str, written: Written) -> SyncDocument:
    """Return what the files of a format can't say of the flown, for the circles exported."""
    from syncplan import __version__

    plan, start = flown.plan, start_of(flown.plan)
    names, landmarks = flown.names, plan.scenario.landmark_names
    return SyncDocument(
        version=__version__,
        name=plan.scenario.name,
        format=format_,
        verdict=plan_verdict(plan.verdict),
        start_time=None if start is None else moment(start, 0.0),
        geo_origin=plan.scenario.geo_origin,
        period_s=plan.orbits.period,
        angular_rate_rad_s=plan.orbits.rate,
        min_separation_m=plan.scenario.separation,
        duration_s=flown.duration,
        procedure=procedure(flown, written),
        vehicles=_vehicles(flown, written),
        meetings=[
            VehicleMeeting(
                a=names[item.a],
                b=names[item.b],
                planned=planned,
                min_distance_m=item.min_distance,
                windows_s=_windows(item.windows),
                tolerance_s=_tolerance(flown, [item]),
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


def _vehicles(flown: ScheduledPlan, written: Written) -> list[SyncedVehicle]:
    orbits, start = flown.plan.orbits, start_of(flown.plan)
    where, ahead = position(orbits, 0.0), heading(orbits, 0.0) % (2.0 * np.pi)
    entries = _degrees(flown, where)
    centers = _degrees(flown, orbits.centers)
    separations, found = _separation_tolerances(flown), _found_in_flight(flown)
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
                altitude_m=flown.altitudes[k],
                heading_rad=float(ahead[k]),
                course_deg=(90.0 - math.degrees(float(ahead[k]))) % 360.0,
                time_s=0.0,
                time=None if start is None else moment(start, 0.0),
            ),
            speed_mps=float(orbits.speeds[k]),
            leg_speed_mps=written.leg_speeds[k] if written.leg_speeds else None,
            start_item=written.start_items[k] if written.start_items else None,
            autopilot_parameters=dict(written.parameters[k]) if written.parameters else {},
            tolerance_s=_tolerance(flown, _meetings_of(flown, k)),
            separation_tolerance_s=separations[k],
            phase_error_s=None if name not in found else found[name][0],
            speed_needed_mps=None if name not in found else found[name][1],
        )
        for k, name in enumerate(flown.names)
    ]


def _found_in_flight(
    flown: ScheduledPlan,
) -> dict[str, tuple[tuple[float, float], tuple[float, float]]]:
    """Of each vehicle that was flown: phase errors in s, RMS and worst; speeds in m/s it needed."""
    flight = flown.plan.flight
    vehicles = () if flight is None else flight.vehicles
    return {one.name: ((one.phase_rms, one.phase_worst), one.speeds) for one in vehicles}


def _meetings_of(flown: ScheduledPlan, k: int) -> list[LinkVerdict]:
    return [item for item in flown.plan.links if k in (item.a, item.b)]


def _tolerance(flown: ScheduledPlan, meetings: Sequence[LinkVerdict]) -> float | None:
    """Least time in s by which a phase may slip; None where no meeting can be lost."""
    least = min((item.tolerance for item in meetings), default=math.pi)
    return None if least >= math.pi else least / flown.plan.orbits.rate


def _separation_tolerances(flown: ScheduledPlan) -> list[float | None]:
    """How late or early each vehicle may be, s, before it comes too near; None for no limit."""
    orbits, apart = flown.plan.orbits, flown.plan.scenario.separation
    a, b = reachable_pairs(orbits, np.full(orbits.count, apart))
    pairs = np.column_stack([a, b])[a < b]
    least, allowed = np.full(orbits.count, np.pi), separation_tolerances(orbits, pairs, apart)
    for column in (0, 1):
        np.minimum.at(least, pairs[:, column], allowed)
    return [None if phase >= math.pi else phase / orbits.rate for phase in least.tolist()]


def _degrees(flown: ScheduledPlan, points: Array) -> list[tuple[float | None, float | None]]:
    places = places_of(flown, points)
    if places is None:
        return [(None, None)] * len(points)
    return [_pair(place) for place in places]


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _windows(windows: Array) -> list[tuple[float, float]]:
    return [(float(start), float(end)) for start, end in windows]
