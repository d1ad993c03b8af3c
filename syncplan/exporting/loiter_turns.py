"""Missions of loiter turns about the centre, as ArduPilot flies them.

What ArduPilot makes of them:

- It keeps turns and radius in one byte each (AP_Mission.cpp): the radius in whole metres up to
  255, in tens of metres up to 2,550, fractions cut off, not rounded; turns up to 255, and of more
  than one turn the fraction is cut off as well.
- Copter turns at its parameter CIRCLE_RATE, whatever speed is commanded, at no more than half of
  its acceleration in waypoint flight and its speed allow (AC_Circle::calc_velocities). Which way
  round is the radius's sign from 4.4 on (ArduPilot pull request 22834), but the parameter's before
  and in some versions since (pull request 34178): with a parameter of the same sign all agree.
- Plane holds the airspeed commanded, if it lies between AIRSPEED_MIN and AIRSPEED_MAX.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting.geodesy import geodetic
from syncplan.exporting.mission_items import (
    Mission,
    circle_item,
    speed_item,
    waiting_items,
    waypoint_item,
)
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.orbits.circles import position
from syncplan.phrases import listed

WHOLE_METRES_UP_TO = 255.0
TENS_UP_TO = 2550.0
MOST_TURNS_PER_ITEM = 255

FASTEST_RATE = 90.0
"""deg/s, of CIRCLE_RATE."""

ACCELERATION = 2.5
LARGEST_ACCELERATION = 5.0
"""m/s^2, of Copter's WPNAV_ACCEL: its default and the end of its range."""

NOSE_ALONG_THE_PATH = 2.0
"""Of CIRCLE_OPTIONS, a sum of bits."""

_NAMED = 6


def loiter_missions(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, and what the reader must not miss.

    Each sets the speed, flies to where the vehicle is at time 0, waits for that moment if the
    vehicle is a Copter and the moment is known, and circles for as many whole turns as cover the
    duration. Raises InputError for a radius that loiter turns can't have.
    """
    orbits = flown.plan.orbits
    notes = [*_radius_notes(flown), *_rate_notes(flown)]
    entries = geodetic(flown.origin, position(orbits, 0.0))
    centers = geodetic(flown.origin, orbits.centers)
    waits, missions = waiting_items(flown), []
    for k in range(orbits.count):
        # clockwise is positive there, counter-clockwise here
        clockwise, altitude = -float(orbits.senses[k]), flown.altitudes[k]
        radius, speed = clockwise * float(orbits.radii[k]), float(orbits.speeds[k])
        before = (
            speed_item(flown, speed),
            waypoint_item(flown, entries[k], altitude, 0.0),
            *waits,
        )
        circles = (
            circle_item(turns, radius, centers[k], altitude)
            for turns in _turns_per_item(flown.turns)
        )
        rate = clockwise * math.degrees(orbits.rate)
        parameters = (("CIRCLE_OPTIONS", NOSE_ALONG_THE_PATH), ("CIRCLE_RATE", rate))
        missions.append(
            Mission(
                (*before, *circles),
                speed,
                start_item=len(before) + 1,
                parameters=parameters if flown.is_copter else (),
            )
        )
    return missions, notes


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


# --- notes --------------------------------------------------------------------------------------


def _radius_notes(flown: ScheduledPlan) -> list[str]:
    radii = flown.plan.orbits.radii
    for name, radius in zip(flown.names, radii, strict=True):
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
            f"{listed([flown.names[k] for k in cut], _NAMED)} would fly smaller circles "
            f"({flown.names[worst]} {stored[worst]:g} m instead of {radii[worst]:g} m) and, at "
            f"the commanded speed, be up to {drift:.2g} rad ahead after each turn; snap the radii, "
            "or fly waypoints"
        )
    large = [flown.names[k] for k in np.flatnonzero(radii > WHOLE_METRES_UP_TO)]
    if large:
        notes.append(
            f"{listed(large, _NAMED)}: older ArduPilot stores no radius above 255 m; "
            "check yours, or fly waypoints"
        )
    return notes


def _rate_notes(flown: ScheduledPlan) -> list[str]:
    """What keeps a Copter from the rate of the plan."""
    if not flown.is_copter:
        return []
    orbits = flown.plan.orbits
    rate = math.degrees(orbits.rate)
    notes = [
        f"Copter circles at the rate of its own parameter: set CIRCLE_RATE to {rate:.6g} (deg/s), "
        f"on vehicles that turn ccw to -{rate:.6g}, and CIRCLE_OPTIONS to 2 (nose along the path)"
    ]
    if rate > FASTEST_RATE:
        notes.append(f"CIRCLE_RATE goes up to {FASTEST_RATE:g} deg/s, and this plan needs more")
    needed = 2.0 * orbits.radii * orbits.rate**2
    slow = np.flatnonzero(needed > ACCELERATION)
    if slow.size:
        most = float(needed.max())
        beyond = f"; its range ends at {LARGEST_ACCELERATION:g}" * (most > LARGEST_ACCELERATION)
        named = [flown.names[k] for k in slow]
        notes.append(
            f"Copter circles with at most half its acceleration in waypoint flown, WPNAV_ACCEL: "
            f"{listed(named, _NAMED)} would turn too slowly at its default of "
            f"{ACCELERATION:g} m/s^2; set {most:.3g} m/s^2 or more{beyond}"
        )
    return notes


def _too_large(radius: float) -> str:
    return (
        f"{radius:g}: ArduPilot's loiter turns have at most {TENS_UP_TO:g} m; fly waypoints instead"
    )
