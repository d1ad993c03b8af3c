"""Missions as autopilots fly them: loiter turns about the centre, or a polygon of waypoints.

Commands and their parameters are MAVLink's (common.xml). What autopilots make of them:

- A positive loiter radius is clockwise, a negative one counter-clockwise.
- ArduPilot keeps turns and radius in one byte each (AP_Mission.cpp): the radius in whole metres up
  to 255, in tens of metres up to 2,550, fractions cut off, not rounded; turns up to 255, and of
  more than one turn the fraction is cut off as well.
- Copter turns at the rate of its parameter CIRCLE_RATE, whatever speed it was told; older ones take
  the direction from it as well (ArduPilot pull request 22834). Plane holds the airspeed told.
- PX4 refuses loiter turns.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from syncplan.errors import InputError
from syncplan.exporting.flight import Flight, check_amount
from syncplan.exporting.geodesy import geodetic
from syncplan.orbits import Orbits, position, unit

__all__ = ["Mission", "MissionItem", "flies_loiter_turns", "missions_of", "snapped_radii"]

Array = NDArray[np.float64]

WAYPOINT, LOITER_TURNS, CHANGE_SPEED = 16, 18, 178
FRAME_MISSION, FRAME_RELATIVE_ALTITUDE = 2, 3

WHOLE_METRES_UP_TO = 255.0
TENS_UP_TO = 2550.0
MOST_TURNS_PER_ITEM = 255
LARGE_MISSION = 500
"""Items from which on some autopilots' storage is too small."""

FEWEST_LEGS = 6
_AIRSPEED, _GROUND_SPEED, _UNCHANGED = 0.0, 1.0, -1.0
_NAMED = 6


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item: MAVLink command and frame, parameters 1 to 4, latitude, longitude, altitude.

    A parameter of None is not set. Items without a place have zeros.
    """

    command: int
    frame: int
    parameters: tuple[float | None, float, float, float | None]
    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0


@dataclass(frozen=True, slots=True)
class Mission:
    """One vehicle's mission.

    Attributes
    ----------
    items : without home
    speed : m/s, as told to the autopilot; along the chords where the items are waypoints
    parameters : autopilot parameters it rests on
    """

    items: tuple[MissionItem, ...]
    speed: float
    parameters: tuple[tuple[str, float], ...] = ()


def flies_loiter_turns(flight: Flight) -> bool:
    """Whether the missions are loiter turns, not waypoints."""
    return flight.options.autopilot == "ardupilot" and not flight.options.waypoints


def missions_of(flight: Flight) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, and what the reader must not miss.

    Each sets the speed, flies to where the vehicle is at time 0, and circles from there for as many
    whole turns as cover the duration (as many legs, with waypoints). Raises InputError without a
    geo_origin, and for a radius that loiter turns can't have.
    """
    origin = flight.origin
    if not flies_loiter_turns(flight):
        return _polygons(flight)
    orbits = flight.plan.orbits
    entries = geodetic(origin, position(orbits, 0.0))
    centers = geodetic(origin, orbits.centers)
    copter = flight.options.vehicle == "multicopter"
    rate = (("CIRCLE_OPTIONS", 2.0), ("CIRCLE_RATE", math.degrees(orbits.rate))) if copter else ()
    missions = []
    for k in range(orbits.count):
        # clockwise is positive there, counter-clockwise here
        signed = float(-orbits.senses[k] * orbits.radii[k])
        speed = float(orbits.speeds[k])
        circles = [
            _placed(LOITER_TURNS, (turns, 0.0, signed, 0.0), centers[k], flight.altitude)
            for turns in _turns_per_item(flight.turns)
        ]
        entry = _placed(WAYPOINT, (0.0, 0.0, 0.0, _no_yaw(flight)), entries[k], flight.altitude)
        missions.append(Mission((_change_speed(flight, speed), entry, *circles), speed, rate))
    return missions, [*_radius_notes(flight), *_speed_notes(flight)]


def snapped_radii(radii: Array) -> Array:
    """Return the nearest radii that ArduPilot stores: whole metres, above 255 m tens of metres.

    Raises InputError above 2,550 m.
    """
    if radii.max(initial=0.0) > TENS_UP_TO:
        raise InputError(_too_large(float(radii.max())), key="orbit.radius_m")
    whole = np.clip(np.round(radii), 1.0, WHOLE_METRES_UP_TO)
    tens = np.maximum(10.0 * np.round(radii / 10.0), WHOLE_METRES_UP_TO + 5.0)
    return np.where(np.abs(whole - radii) <= np.abs(tens - radii), whole, tens)


def _stored_radius(radius: float) -> float:
    """What ArduPilot keeps of a radius, in m."""
    if radius <= WHOLE_METRES_UP_TO:
        return float(math.floor(radius))
    return 10.0 * math.floor(radius / 10.0)


def _turns_per_item(turns: int) -> list[float]:
    whole, rest = divmod(turns, MOST_TURNS_PER_ITEM)
    return [float(MOST_TURNS_PER_ITEM)] * whole + ([float(rest)] if rest else [])


# --- waypoints ----------------------------------------------------------------------------------


def _polygons(flight: Flight) -> tuple[list[Mission], list[str]]:
    """Missions of waypoints on the circle, evenly spaced in time, each flown at chord speed.

    A chord is shorter than its arc: flown at the speed of the circle, a polygon of 14 legs would
    run ahead by 3 deg a turn, and the meetings would be lost.
    """
    orbits, options = flight.plan.orbits, flight.options
    px4 = options.autopilot == "px4"
    # ArduPilot keeps the acceptance radius in whole metres, and takes 0 for its own default
    accepted = options.sagitta_m if px4 else float(max(1, math.ceil(options.sagitta_m)))
    missions, most = [], 0
    for k in range(orbits.count):
        legs = _legs_per_turn(float(orbits.radii[k]), options.sagitta_m)
        count = max(1, math.ceil(flight.duration / orbits.period * legs - 1e-9))
        most = max(most, count + 2)
        check_amount("waypoints", most * orbits.count, "sagitta_m", options.sagitta_m)
        if most > 65_535:
            raise InputError(
                f"{options.sagitta_m:g}: makes a mission of {most:,} items, and MAVLink counts to "
                "65,535; allow more, or fly fewer turns",
                key="sagitta_m",
            )
        places = geodetic(flight.origin, _corners(orbits, k, legs, count))
        radius = float(orbits.radii[k])
        speed = 2.0 * radius * math.sin(math.pi / legs) * legs / orbits.period
        passed = (0.0, accepted, 0.0, _no_yaw(flight))
        points = [_placed(WAYPOINT, passed, place, flight.altitude) for place in places]
        missions.append(Mission((_change_speed(flight, speed), *points), speed))
    notes = _speed_notes(flight)
    if most > LARGE_MISSION:
        notes.append(
            f"missions of up to {most} items: some autopilots hold fewer; fewer turns or a larger "
            "sagitta make them shorter"
        )
    return missions, notes


def _legs_per_turn(radius: float, sagitta: float) -> int:
    """Fewest legs a turn whose chords stay within `sagitta` m of the arc: R (1 - cos(pi / n))."""
    if sagitta >= radius:
        return FEWEST_LEGS
    return max(FEWEST_LEGS, math.ceil(math.pi / math.acos(1.0 - sagitta / radius)))


def _corners(orbits: Orbits, k: int, legs: int, count: int) -> Array:
    """(count + 1, 2) positions of vehicle k in m, `legs` of them a turn, the first at time 0."""
    phases = orbits.phases[k] + orbits.senses[k] * 2.0 * np.pi / legs * np.arange(count + 1)
    return np.asarray(orbits.centers[k] + orbits.radii[k] * unit(phases))


# --- items and notes ----------------------------------------------------------------------------


def _placed(
    command: int,
    parameters: tuple[float | None, float, float, float | None],
    place: Array,
    altitude: float,
) -> MissionItem:
    return MissionItem(
        command,
        FRAME_RELATIVE_ALTITUDE,
        parameters,
        float(place[0]),
        float(place[1]),
        altitude,
    )


def _no_yaw(flight: Flight) -> float | None:
    """Parameter 4 of a waypoint: PX4 takes 0 for north and nothing for the way it flies."""
    return None if flight.options.autopilot == "px4" else 0.0


def _change_speed(flight: Flight, speed: float) -> MissionItem:
    kind = _AIRSPEED if flight.options.vehicle == "fixed_wing" else _GROUND_SPEED
    return MissionItem(CHANGE_SPEED, FRAME_MISSION, (kind, speed, _UNCHANGED, 0.0))


def _radius_notes(flight: Flight) -> list[str]:
    radii = flight.plan.orbits.radii
    for name, radius in zip(flight.names, radii, strict=True):
        if radius > TENS_UP_TO:
            raise InputError(f"{name}: {_too_large(float(radius))}", key="orbit.radius_m")
        if radius < 1.0:
            raise InputError(
                f"{name}: {radius:g}: loiter turns hold whole metres; fly waypoints instead",
                key="orbit.radius_m",
            )
    stored = np.array([_stored_radius(float(radius)) for radius in radii])
    notes = []
    cut = np.flatnonzero(stored != radii)
    if cut.size:
        worst = int(cut[np.argmax(np.abs(stored - radii)[cut] / radii[cut])])
        drift = 2.0 * math.pi * (radii[worst] / stored[worst] - 1.0)
        notes.append(
            f"ArduPilot stores radii in {'tens of' if stored[worst] > 255 else 'whole'} metres: "
            f"{_listed([flight.names[k] for k in cut])} would fly smaller circles "
            f"({flight.names[worst]} {stored[worst]:g} m instead of {radii[worst]:g} m), at the "
            f"speed told up to {drift:.2g} rad ahead after each turn; snap the radii, or fly "
            "waypoints"
        )
    large = [flight.names[k] for k in np.flatnonzero(radii > WHOLE_METRES_UP_TO)]
    if large:
        notes.append(
            f"{_listed(large)}: older ArduPilot stores no radius above 255 m; "
            "check yours, or fly waypoints"
        )
    return notes


def _speed_notes(flight: Flight) -> list[str]:
    if flight.options.vehicle == "fixed_wing":
        return [
            "autopilots of fixed wings hold airspeed: in wind the speed over ground varies along "
            "the circle; correct by the times at which entry points are to be passed"
        ]
    if not flies_loiter_turns(flight):
        return []
    rate = math.degrees(flight.plan.orbits.rate)
    notes = [
        f"Copter circles at the rate of its own parameter: set CIRCLE_RATE to {rate:.6g} (deg/s) "
        "and CIRCLE_OPTIONS to 2 (nose along the path) on every vehicle; in older Copters "
        "its sign also says which way round, negative for ccw"
    ]
    if rate > 90.0:
        notes.append(f"CIRCLE_RATE goes up to 90 deg/s, and this plan needs {rate:.4g}")
    return notes


def _too_large(radius: float) -> str:
    return (
        f"{radius:g}: ArduPilot's loiter turns have at most {TENS_UP_TO:g} m; fly waypoints instead"
    )


def _listed(names: Sequence[str]) -> str:
    rest = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {rest} more" if rest > 0 else "")
