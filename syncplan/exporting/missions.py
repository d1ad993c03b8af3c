"""Missions of autopilots, one file for each vehicle: QGroundControl plans, ArduPilot's WPL 110.

QGroundControl's files are JSON (QGroundControl developer guide, "Plan File Format"). ArduPilot's
have one item a line, tab-separated: index, current, frame, command, parameters 1 to 4, latitude,
longitude, altitude, autocontinue; item 0 is home (MAVLink, "File Formats").
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.fences import Fence, fence_notes, fences_of
from syncplan.exporting.mission_routes import (
    WAYPOINT,
    Mission,
    MissionItem,
    loiter_missions,
    waypoint_missions,
)
from syncplan.exporting.scheduled_plan import ScheduledPlan, start_of, start_second
from syncplan.runtime.files import as_text
from syncplan.scenario.ground import DEGREE_DIGITS

_GRAVITY = 9.81
_STEEP = 45.0


def flies_loiter_turns(flown: ScheduledPlan) -> bool:
    """Return whether the missions are loiter turns, not waypoints; PX4 refuses loiter turns."""
    return flown.autopilot.loiter_turns and not flown.options.waypoints


def missions_of(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, and notes for the reader.

    Raises InputError without a geo_origin, for a radius that loiter turns can't have, and if
    missions would be too long.
    """
    made = loiter_missions if flies_loiter_turns(flown) else waypoint_missions
    missions, notes = made(flown)
    notes = [*notes, *_airspeed_notes(flown), *_waiting_notes(flown), *fence_notes(flown)]
    return missions, notes


def write_missions(
    flown: ScheduledPlan, ending: str, text: Callable[[ScheduledPlan, Mission], str]
) -> Written:
    """Return a file with this ending for each vehicle; `text` turns its mission into the content.

    Raises InputError as missions_of does.
    """
    missions, notes = missions_of(flown)
    turns = flies_loiter_turns(flown)
    names = tuple(f"{flown.title}-{label}.{ending}" for label in flown.labels)
    return Written(
        files=tuple(
            ExportedFile(name, text(flown, mission).encode())
            for name, mission in zip(names, missions, strict=True)
        ),
        kind="loiter_turns" if turns else "waypoints",
        own_files=names,
        start_items=tuple(one.start_item for one in missions),
        leg_speeds=() if turns else tuple(one.speed for one in missions),
        parameters=tuple(one.parameters for one in missions),
        notes=tuple(notes),
    )


def _airspeed_notes(flown: ScheduledPlan) -> list[str]:
    if not flown.vehicle.holds_airspeed:
        return []
    orbits = flown.plan.orbits
    slow, fast = float(orbits.speeds.min()), float(orbits.speeds.max())
    notes = [
        "autopilots of fixed wings hold airspeed: in wind the speed over ground varies along "
        "the circle; correct it by the times at which entry points are to be passed",
        f"missions command airspeeds from {slow:.3g} to {fast:.3g} m/s; Plane ignores one outside "
        "AIRSPEED_MIN to AIRSPEED_MAX",
    ]
    bank = np.degrees(np.arctan(orbits.speeds * orbits.rate / _GRAVITY))
    steepest = int(np.argmax(bank))
    if bank[steepest] > _STEEP:
        notes.append(
            f"{flown.names[steepest]} would bank {bank[steepest]:.0f} deg: more than autopilots "
            "allow by default; fly larger circles or a longer period"
        )
    return notes


def _waiting_notes(flown: ScheduledPlan) -> list[str]:
    """Note on a start between the whole seconds that a mission can wait for."""
    start, second = start_of(flown.plan), start_second(flown)
    if not flown.is_copter or start is None or second is None or start == second:
        return []
    late = (second - start).total_seconds()
    return [
        f"missions wait for whole seconds: all vehicles begin {late:.3g} s after start_time, "
        "alike, and meet as planned"
    ]


# --- QGroundControl -----------------------------------------------------------------------------


RELATIVE_TO_HOME = 1


def write_qgc(flown: ScheduledPlan) -> Written:
    """Return a .plan file for each vehicle; altitudes are above home.

    Raises InputError as missions_of does.
    """
    fences = _qgc_fences(flown)
    return write_missions(
        flown, "plan", lambda flown, mission: as_text(_plan(flown, mission, fences))
    )


def _plan(flown: ScheduledPlan, mission: Mission, fences: list[dict[str, Any]]) -> dict[str, Any]:
    origin = flown.origin
    return {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "mission": {
            "version": 2,
            "firmwareType": flown.autopilot.code,
            "vehicleType": flown.vehicle.code,
            "globalPlanAltitudeMode": RELATIVE_TO_HOME,
            "cruiseSpeed": mission.speed,
            "hoverSpeed": mission.speed,
            "plannedHomePosition": [origin.lat_deg, origin.lon_deg, origin.alt_m],
            "items": [
                _qgc_item(item, number) for number, item in enumerate(mission.items, start=1)
            ],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": fences},
        "rallyPoints": {"version": 2, "points": []},
    }


def _qgc_fences(flown: ScheduledPlan) -> list[dict[str, Any]]:
    return [
        {
            "version": 1,
            "inclusion": fence.kind == "area",
            "polygon": fence.places.round(DEGREE_DIGITS).tolist(),
        }
        for fence in fences_of(flown)
    ]


def _qgc_item(item: MissionItem, number: int) -> dict[str, Any]:
    values: dict[str, Any] = {
        "type": "SimpleItem",
        "command": item.command,
        "frame": item.frame,
        "doJumpId": number,
        "autoContinue": True,
        "params": [
            *item.parameters,
            round(item.latitude, 9),
            round(item.longitude, 9),
            item.altitude,
        ],
    }
    if item.placed:
        altitude = {"AMSLAltAboveTerrain": None, "AltitudeMode": RELATIVE_TO_HOME}
        values.update(altitude, Altitude=item.altitude)
    return values


# --- ArduPilot ----------------------------------------------------------------------------------


HEADER = "QGC WPL 110"
FRAME_GLOBAL = 0
INCLUSION, EXCLUSION = 5001, 5002
"""Commands of the corners of fences; their first parameter is the number of corners."""

MOST_CORNERS = 255
"""Most corners of a fence that ArduPilot stores: it counts them in one byte."""


def write_ardupilot(flown: ScheduledPlan) -> Written:
    """Return a .waypoints file for each vehicle; altitudes are above home, home's above the sea.

    The fences are a list of their own, for all vehicles. Raises InputError as missions_of does.
    """
    written, fences = write_missions(flown, "waypoints", _wpl_text), fences_of(flown)
    if not fences:
        return written
    notes, most = written.notes, max(len(fence.places) for fence in fences)
    if most > MOST_CORNERS:
        notes += (f"a fence has {most} corners, and ArduPilot stores up to {MOST_CORNERS}",)
    file = ExportedFile(f"{flown.title}-fence.txt", _fence_text(fences).encode())
    return replace(written, files=(*written.files, file), notes=notes)


def _fence_text(fences: list[Fence]) -> str:
    items = [
        MissionItem(
            INCLUSION if fence.kind == "area" else EXCLUSION,
            FRAME_GLOBAL,
            (float(len(fence.places)), 0.0, 0.0, 0.0),
            latitude,
            longitude,
            0.0,
        )
        for fence in fences
        for latitude, longitude in fence.places.tolist()
    ]
    return "\n".join([HEADER, *map(_wpl_line, items, range(len(items)))]) + "\n"


def _wpl_text(flown: ScheduledPlan, mission: Mission) -> str:
    origin = flown.origin
    home = MissionItem(
        WAYPOINT,
        FRAME_GLOBAL,
        (0.0, 0.0, 0.0, 0.0),
        origin.lat_deg,
        origin.lon_deg,
        origin.alt_m,
    )
    lines = [_wpl_line(item, number) for number, item in enumerate((home, *mission.items))]
    return "\n".join([HEADER, *lines]) + "\n"


def _wpl_line(item: MissionItem, number: int) -> str:
    fields = [
        str(number),
        "1" if number == 0 and item.command == WAYPOINT else "0",
        str(item.frame),
        str(item.command),
        *(f"{value or 0.0:.6f}" for value in item.parameters),
        f"{item.latitude:.9f}",
        f"{item.longitude:.9f}",
        f"{item.altitude:.6f}",
        "1",
    ]
    return "\t".join(fields)
