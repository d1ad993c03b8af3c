"""Missions of autopilots: loiter turns where the autopilot has them, else waypoints."""

from collections.abc import Callable

import numpy as np

from syncplan.exporting.exported_files import ExportedFile, Written
from syncplan.exporting.loiter_turns import loiter_missions
from syncplan.exporting.mission_items import Mission
from syncplan.exporting.polygons import waypoint_missions
from syncplan.exporting.scheduled_plan import ScheduledPlan, start_of, start_second

_GRAVITY = 9.81
_STEEP = 45.0


def flies_loiter_turns(flown: ScheduledPlan) -> bool:
    """Whether the missions are loiter turns, not waypoints; PX4 refuses loiter turns."""
    return flown.autopilot.loiter_turns and not flown.options.waypoints


def missions_of(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, and what the reader must not miss.

    Raises InputError without a geo_origin, for a radius that loiter turns can't have, and where
    missions would be too long.
    """
    made = loiter_missions if flies_loiter_turns(flown) else waypoint_missions
    missions, notes = made(flown)
    return missions, [*notes, *_airspeed_notes(flown), *_waiting_notes(flown)]


def write_missions(
    flown: ScheduledPlan, ending: str, text: Callable[[ScheduledPlan, Mission], str]
) -> Written:
    """Return a file for each vehicle, its name with this ending, its `text` that of its mission.

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
    """Where whole seconds are all that a mission can wait for."""
    start, second = start_of(flown.plan), start_second(flown)
    if not flown.is_copter or start is None or second is None or start == second:
        return []
    late = (second - start).total_seconds()
    return [
        f"missions wait for whole seconds: all vehicles begin {late:.3g} s after start_time, "
        "alike, and meet as planned"
    ]
