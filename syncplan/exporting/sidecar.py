"""The sidecar of an export: start, phases, speeds, meetings, and how a vehicle joins its circle.

The first part is its JSON contract, which holds what the exported files can't, above all the phase.
The second is the procedure by which a vehicle joins its circle at the right phase and stays in
step, for each kind of file.
"""

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydantic import Field

from syncplan.arrays import Array
from syncplan.documents import (
    DocumentPart,
    Point,
    VersionedDocument,
    Window,
    point_of,
    windows_of,
)
from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.mission_routes import ACCELERATION
from syncplan.exporting.scheduled_plan import ScheduledPlan, moment, places_of, start_of
from syncplan.observability.link_verdicts import LinkVerdict
from syncplan.orbits.circles import heading, position
from syncplan.orbits.contacts import reachable_pairs
from syncplan.planning.judged_team import PlanVerdict
from syncplan.runtime.files import as_text
from syncplan.scenario.models import GeoOrigin
from syncplan.synchronisation.contact_tables import separation_tolerances


class EntryPoint(DocumentPart):
    """Point at which a vehicle joins its circle, at time_s and again every period."""

    position_m: Point
    lat_deg: float | None = Field(description="Null without a geo_origin")
    lon_deg: float | None
    altitude_m: float = Field(description="Flown, above the ground at the origin")
    heading_rad: float = Field(description="Direction of flight there, from +x, in [0, 2 pi)")
    course_deg: float = Field(description="The same from north, clockwise, in [0, 360)")
    time_s: float = Field(description="Since time 0")
    time: str | None = Field(description="The same as a moment in UTC; null without a start_time")


class SyncedVehicle(DocumentPart):
    """One vehicle: its file, its circle, its entry point, the speed it holds and its tolerances."""

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
        description="Delay or lead of it alone that loses a planned meeting; null if none does"
    )
    separation_tolerance_s: float | None = Field(
        description="Delay or lead of it alone that brings it nearer than "
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
    """Contact of two vehicles in each period."""

    a: str
    b: str
    planned: bool = Field(description="False for a meeting of vehicles without a link")
    min_distance_m: float
    windows_s: list[Window] = Field(description="Since time 0; again every period_s")
    tolerance_s: float | None = Field(
        description="Delay or lead of one of the two that loses the meeting; null if none does"
    )


class LandmarkSighting(DocumentPart):
    """Sightings of a landmark by a vehicle in each period."""

    vehicle: str
    landmark: str
    min_distance_m: float
    windows_s: list[Window]


class SyncDocument(VersionedDocument):
    """Sidecar of exported files: start, phases, speeds, and meetings with their times."""

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
    procedure: list[str] = Field(description="Steps by which vehicles join at the right phase")
    vehicles: list[SyncedVehicle]
    meetings: list[VehicleMeeting]
    landmark_sightings: list[LandmarkSighting]
    notes: list[str]


# --- how vehicles join their circles ------------------------------------------------------------


def procedure(flown: ScheduledPlan, written: Written) -> list[str]:
    """Return the steps for the operators, in order."""
    if written.kind in ("loiter_turns", "waypoints"):
        return [*_before_a_mission(flown, written), *_start_of_a_mission(flown, written)]
    if written.kind == "trajectories":
        return [*_start_of_trajectories(flown), *_off_time(flown)]
    return [*_start_by_oneself(flown), *_off_time(flown)]


# --- missions -----------------------------------------------------------------------------------


def _before_a_mission(flown: ScheduledPlan, written: Written) -> list[str]:
    steps = [
        "Take-off and landing are not in the mission: take off first, then start the mission in "
        "the air (ArduPilot refuses one without a take-off from the ground). Until a vehicle is on "
        "its circle, keep it at an altitude of its own and clear of all circles."
    ]
    if any(written.parameters):
        steps.insert(
            0, "Set the autopilot_parameters of each vehicle on it; CIRCLE_RATE is signed."
        )
    return steps


def _start_of_a_mission(flown: ScheduledPlan, written: Written) -> list[str]:
    known = start_of(flown.plan) is not None
    period = f"{flown.plan.orbits.period:.6g} s"
    again = (
        "A vehicle that misses time 0 holds at entry.position_m; make start_item its current item "
        f"a whole number of periods ({period}) later."
    )
    if flown.is_copter:
        join = [
            "The mission flies to entry.position_m and stops there. "
            + (
                "It waits for entry.time by the vehicle's own UTC clock, then begins to circle: "
                "start it early enough. A vehicle without a clock (it takes GPS, or a ground "
                "station that sends SYSTEM_TIME) does not wait at all, and one that arrives too "
                "late waits for the next day."
                if known
                else "Then it circles at once, so that its phase depends on when it arrives: hold "
                "each vehicle at its entry.position_m and make start_item the current item of all "
                "at the same moment, time 0. With a start_time in the scenario, missions wait for "
                "it by themselves."
            ),
            _lag(flown),
            again,
        ]
    else:
        when = "entry.time" if known else "a moment that all agree on, time 0,"
        join = [
            "A mission does not wait: start each one so that its vehicle passes entry.position_m "
            f"at {when} on entry.course_deg, and hold the vehicle nearby until then.",
            again,
        ]
    hold = (
        "Between waypoints the mission commands leg_speed_mps, because legs are shorter than "
        "arcs; see the notes on corners."
        if written.leg_speeds
        else "On the circle every vehicle takes one period for a turn, whatever its radius."
    )
    return [*join, hold, _check(), _stand_by()]


def _lag(flown: ScheduledPlan) -> str:
    speeds = flown.plan.orbits.speeds
    spread = float(speeds.max() - speeds.min()) / (2.0 * ACCELERATION)
    between = (
        "the same for all, because all fly at one speed"
        if spread < 0.01
        else f"up to {spread:.2g} s apart"
    )
    return (
        "A start from rest costs speed_mps / (2 a), where a is the acceleration in waypoint flight "
        f"({ACCELERATION:g} m/s^2 by default): {between}. Only the difference between vehicles "
        "matters."
    )


def _stand_by() -> str:
    return (
        "A vehicle that is further off leaves its circle, holds at its entry point at an altitude "
        "of its own, and joins again as if it had missed time 0."
    )


# --- other files --------------------------------------------------------------------------------


def _start_of_trajectories(flown: ScheduledPlan) -> list[str]:
    return [
        "Let every vehicle take off and hover at entry.position_m with yaw entry.heading_rad, one "
        "after the other where paths cross; then start all trajectories by one broadcast, at time "
        "0.",
        "A trajectory begins at speed_mps. From hover a vehicle lags behind it at first and "
        "catches up; vehicles of the same speed lag alike.",
        "Have the next command ready at the end of the trajectory, or start it again: after whole "
        "turns it ends where it began.",
    ]


def _start_by_oneself(flown: ScheduledPlan) -> list[str]:
    known = flown.plan.scenario.start_time is not None
    when = "start_time" if known else "a moment that all agree on (time 0)"
    period = flown.plan.orbits.period
    return [
        "Take-off and landing are the operator's; wait clear of all circles, each vehicle at an "
        "altitude of its own.",
        f"Be at entry.position_m at {when}, under way on entry.course_deg at speed_mps; come in "
        "along the tangent. A vehicle that starts there from rest loses speed / (2 acceleration) "
        "seconds: start it that much earlier.",
        "A vehicle that misses it passes the same point a whole number of periods "
        f"({period:.6g} s) later.",
        "From then on hold speed_mps over ground on the circle: every vehicle then takes one "
        "period for a turn, whatever its radius.",
    ]


def _off_time(flown: ScheduledPlan) -> list[str]:
    return [
        _check(),
        "A vehicle late by s seconds (s < 0: early), at most half a period, flies one turn at "
        "speed_mps period_s / (period_s - s); if that is too fast or too slow, it waits at an "
        "altitude of its own and joins a period later.",
    ]


def _check() -> str:
    return (
        "Check the time at which each entry point is passed, every turn. While all others are on "
        "time, one vehicle may be off by tolerance_s before a planned meeting is lost, and by "
        "separation_tolerance_s before it comes nearer than min_separation_m to another; two that "
        "are both off share the tolerance."
    )


# --- the document of a plan ---------------------------------------------------------------------


def sidecar_file(flown: ScheduledPlan, format_: str, written: Written) -> ExportedFile:
    """Return the sidecar `TITLE.FORMAT.sync.json` of the files written."""
    document = sync_document(flown, format_, written)
    return ExportedFile(f"{flown.title}.{format_}.sync.json", as_text(document.as_json()).encode())


def sync_document(flown: ScheduledPlan, format_: str, written: Written) -> SyncDocument:
    """Return the sidecar of the exported circles, which holds what the files of a format can't."""
    from syncplan import __version__

    plan, start = flown.plan, start_of(flown.plan)
    names, landmarks = flown.names, plan.scenario.landmark_names
    return SyncDocument(
        version=__version__,
        name=plan.scenario.name,
        format=format_,
        verdict=plan.verdict,
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
                windows_s=windows_of(item.windows),
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
                windows_s=windows_of(item.windows),
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
    separations, flight = _separation_tolerances(flown), flown.plan.flight
    in_flight = {} if flight is None else {one.name: one for one in flight.vehicles}
    found = [in_flight.get(name) for name in flown.names]
    return [
        SyncedVehicle(
            name=name,
            file=written.own_files[k] if written.own_files else None,
            topic=written.topics[k] if written.topics else None,
            center_m=point_of(orbits.centers[k]),
            center_lat_deg=centers[k][0],
            center_lon_deg=centers[k][1],
            radius_m=float(orbits.radii[k]),
            direction="ccw" if orbits.senses[k] > 0.0 else "cw",
            phase_rad=float(orbits.phases[k] % (2.0 * np.pi)),
            entry=EntryPoint(
                position_m=point_of(where[k]),
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
            tolerance_s=_tolerance(
                flown, [item for item in flown.plan.links if k in (item.a, item.b)]
            ),
            separation_tolerance_s=separations[k],
            phase_error_s=(one.phase_rms_s, one.phase_worst_s) if one else None,
            speed_needed_mps=one.speed_mps if one else None,
        )
        for k, (name, one) in enumerate(zip(flown.names, found, strict=True))
    ]


def _tolerance(flown: ScheduledPlan, meetings: Sequence[LinkVerdict]) -> float | None:
    """Smallest time tolerance of the meetings in s; None if none can be lost."""
    least = min((item.tolerance for item in meetings), default=math.pi)
    return None if least >= math.pi else least / flown.plan.orbits.rate


def _separation_tolerances(flown: ScheduledPlan) -> list[float | None]:
    """Time in s by which each vehicle may be off before it comes too near; None for no limit."""
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
    return [point_of(place) for place in places]
