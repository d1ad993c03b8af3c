"""Missions of waypoints on the circle, for autopilots that refuse loiter turns.

A waypoint counts as reached half a leg from it, where the next leg is as near: the corners are cut
from middle to middle, between the arc and the chords. PX4's multicopters take that radius from the
item, its fixed wings do not (mission_block.cpp), nor does Copter (AP_Mission.cpp).

No autopilot promises to hold its commanded speed round a corner. PX4's multicopters state how fast
they fly there (FlightTaskAutoLineSmoothVel, TrajMath), which is computed here; the others do not.
"""

import math

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting.geodesy import geodetic
from syncplan.exporting.mission_items import (
    Mission,
    speed_item,
    waiting_items,
    waypoint_item,
)
from syncplan.exporting.scheduled_plan import ScheduledPlan, check_amount
from syncplan.orbits.circles import Orbits, unit

FEWEST_LEGS = 6
MOST_ITEMS = 65_535
LARGE_MISSION = 500
"""Items from which on some autopilots' storage is too small."""

LARGEST_ACCEPTANCE_M = 255.0
"""As ArduPilot stores it: in one byte."""

ACCELERATION, JERK, TRAJECTORY_GAIN = 3.0, 4.0, 0.5
"""PX4's defaults of MPC_ACC_HOR in m/s^2, MPC_JERK_AUTO in m/s^3 and MPC_XY_TRAJ_P in 1/s."""


def waypoint_missions(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, evenly spaced in time, and what not to miss.

    A chord is shorter than its arc: flown at the speed of the circle, a polygon of 14 legs would
    run ahead by 3 deg a turn, and the meetings would be lost. So the commanded speed is that of the
    chords. A Copter waits at the first waypoint for time 0, where that moment is known. Raises
    InputError where the missions would be too long.
    """
    orbits, sagitta = flown.plan.orbits, flown.options.sagitta_m
    waits, missions, most = waiting_items(flown), [], 0
    for k in range(orbits.count):
        radius, altitude = float(orbits.radii[k]), flown.altitudes[k]
        legs = _legs_per_turn(radius, sagitta)
        count = max(1, math.ceil(flown.duration / orbits.period * legs - 1e-9))
        most = max(most, count + 2 + len(waits))
        check_amount("waypoints", most * orbits.count, "sagitta_m", sagitta)
        if most > MOST_ITEMS:
            raise InputError(
                f"{sagitta:g}: makes a mission of {most:,} items, and MAVLink counts to "
                f"{MOST_ITEMS:,}; allow more, or fly fewer turns",
                key="sagitta_m",
            )
        speed = _chord_speed(flown, radius, legs)
        accepted = _acceptance(flown, radius, legs)
        first, *others = (
            waypoint_item(flown, place, altitude, accepted)
            for place in geodetic(flown.origin, _corners(orbits, k, legs, count))
        )
        before = (speed_item(flown, speed), first, *waits)
        missions.append(Mission((*before, *others), speed, start_item=len(before) + 1))
    return missions, [*_pace_notes(flown), *_length_notes(most)]


def px4_corner_speed(radius: float, legs: int) -> float:
    """Return the speed in m/s at which PX4's multicopters pass the corners, by their defaults.

    Least of what the corner's angle allows, sqrt(gain a d tan(alpha / 2)) with d half a leg and
    alpha the angle between legs, and of the speed that may be braked from within the next leg.
    """
    leg = _leg(radius, legs)
    corner = math.sqrt(TRAJECTORY_GAIN * ACCELERATION * leg / 2.0 / math.tan(math.pi / legs))
    delay = 4.0 * ACCELERATION**2 / JERK
    braking = 0.5 * (math.sqrt(delay**2 + 8.0 * ACCELERATION * leg) - delay)
    return min(corner, braking, TRAJECTORY_GAIN * leg)


def _legs_per_turn(radius: float, sagitta: float) -> int:
    """Fewest legs a turn whose chords stay within `sagitta` m of the arc: R (1 - cos(pi / n))."""
    if sagitta >= radius:
        return FEWEST_LEGS
    return max(FEWEST_LEGS, math.ceil(math.pi / math.acos(1.0 - sagitta / radius)))


def _leg(radius: float, legs: int) -> float:
    return 2.0 * radius * math.sin(math.pi / legs)


def _chord_speed(flown: ScheduledPlan, radius: float, legs: int) -> float:
    """Speed in m/s along the chords that takes one period for a turn."""
    return _leg(radius, legs) * legs / flown.plan.orbits.period


def _acceptance(flown: ScheduledPlan, radius: float, legs: int) -> float:
    """Half a leg in m; ArduPilot's Plane keeps whole metres, and takes 0 for its own default."""
    half = _leg(radius, legs) / 2.0
    if not flown.autopilot.whole_metres:
        return half
    return float(min(max(1, round(half)), LARGEST_ACCEPTANCE_M))


def _corners(orbits: Orbits, k: int, legs: int, count: int) -> Array:
    """(count + 1, 2) positions of vehicle k in m, `legs` of them a turn, the first at time 0."""
    phases = orbits.phases[k] + orbits.senses[k] * 2.0 * np.pi / legs * np.arange(count + 1)
    return np.asarray(orbits.centers[k] + orbits.radii[k] * unit(phases))


# --- notes --------------------------------------------------------------------------------------


def _pace_notes(flown: ScheduledPlan) -> list[str]:
    """Whether corners cost time, and with it the meetings."""
    if flown.vehicle.holds_airspeed:
        return [
            "fixed wings cut and overshoot the corners of short legs, so that turns of waypoints "
            "do not take the time planned; where the autopilot has loiter turns, fly those"
        ]
    if flown.autopilot.loiter_turns:
        return [
            "Copter slows down for corners, so that turns of waypoints take longer than planned "
            "and meetings are lost; fly loiter turns where you can"
        ]
    orbits = flown.plan.orbits
    slowest, fastest, name = math.inf, 0.0, ""
    for k, radius in enumerate(orbits.radii.tolist()):
        legs = _legs_per_turn(radius, flown.options.sagitta_m)
        speed = _chord_speed(flown, radius, legs)
        corner = px4_corner_speed(radius, legs)
        if corner < speed and corner / speed < slowest:
            slowest, fastest, name = corner / speed, speed, flown.names[k]
    if not name:
        return []
    return [
        f"by default PX4 passes the corners of {name} at {slowest * fastest:.2g} m/s where the "
        f"mission commands {fastest:.3g} m/s: turns take longer than planned and meetings are "
        "lost; fly slower, allow a larger sagitta, or raise MPC_ACC_HOR and MPC_JERK_AUTO"
    ]


def _length_notes(items: int) -> list[str]:
    if items <= LARGE_MISSION:
        return []
    return [
        f"missions of up to {items} items: some autopilots hold fewer; fewer turns or a larger "
        "sagitta make them shorter"
    ]
