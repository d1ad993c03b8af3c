"""Routes of missions: loiter turns where the autopilot has them, else waypoints on the circle.

Items follow MAVLink (common.xml). ArduPilot treats loiter turns as follows:

- It stores turns and radius in one byte each (AP_Mission.cpp): the radius in whole metres up to
  255, in tens of metres up to 2,550, truncated, not rounded; turns up to 255, also truncated above
  one turn.
- Copter turns at its parameter CIRCLE_RATE, whatever speed is commanded, as far as its speed and
  half its acceleration in waypoint flight allow (AC_Circle::calc_velocities). The radius's sign
  gives the direction from 4.4 on (ArduPilot pull request 22834); before, and in some versions
  since, the parameter's sign does (pull request 34178). With both signs the same, all versions
  agree.
- Plane holds the airspeed commanded, if it lies between AIRSPEED_MIN and AIRSPEED_MAX.

A waypoint counts as reached half a leg from it, where the next leg is as near: the path cuts the
corners from middle to middle of the legs, between the arc and the chords. PX4's multicopters take
that radius from the item, its fixed wings do not (mission_block.cpp), nor does Copter
(AP_Mission.cpp).

No autopilot promises to hold its commanded speed round a corner. PX4 defines the speed of its
multicopters there (FlightTaskAutoLineSmoothVel, TrajMath), which is computed here; the others do
not.
"""

import math
from dataclasses import dataclass

import numpy as np

from syncplan.arrays import Array
from syncplan.errors import InputError
from syncplan.exporting.scheduled_plan import ScheduledPlan, check_amount, start_second
from syncplan.orbits.circles import Orbits, position, unit
from syncplan.phrases import listed
from syncplan.scenario.ground import lat_lon_of

Parameters = tuple[float | None, float, float, float | None]

WAYPOINT, LOITER_TURNS, DELAY, CHANGE_SPEED = 16, 18, 93, 178
FRAME_MISSION, FRAME_RELATIVE_ALTITUDE = 2, 3

_AIRSPEED, _GROUND_SPEED, _UNCHANGED = 0.0, 1.0, -1.0
_TIME_OF_DAY = -1.0


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One mission item: command and frame, parameters 1 to 4, latitude, longitude, altitude.

    A parameter of None is not set. Items without a position have zeros.
    """

    command: int
    frame: int
    parameters: Parameters
    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0

    @property
    def placed(self) -> bool:
        """Whether it has a position."""
        return self.frame == FRAME_RELATIVE_ALTITUDE


@dataclass(frozen=True, slots=True)
class Mission:
    """One vehicle's mission.

    Attributes
    ----------
    items : all items except home
    speed : commanded speed in m/s; along the chords if the items are waypoints
    start_item : number of the item that begins at time 0, where home is 0
    parameters : autopilot parameters it needs
    """

    items: tuple[MissionItem, ...]
    speed: float
    start_item: int
    parameters: tuple[tuple[str, float], ...] = ()


def speed_item(flown: ScheduledPlan, speed: float) -> MissionItem:
    """Return the change to a speed in m/s: airspeed for fixed wings, else over ground."""
    kind = _AIRSPEED if flown.vehicle.holds_airspeed else _GROUND_SPEED
    return MissionItem(CHANGE_SPEED, FRAME_MISSION, (kind, speed, _UNCHANGED, 0.0))


def waiting_items(flown: ScheduledPlan) -> tuple[MissionItem, ...]:
    """Return a Copter's wait for time 0, a time of day in whole seconds; empty if unknown."""
    moment = start_second(flown) if flown.is_copter else None
    if moment is None:
        return ()
    when = (_TIME_OF_DAY, float(moment.hour), float(moment.minute), float(moment.second))
    return (MissionItem(DELAY, FRAME_MISSION, when),)


def waypoint_item(
    flown: ScheduledPlan, place: Array, altitude: float, accepted: float
) -> MissionItem:
    """Return a waypoint with an acceptance radius of `accepted` m; 0 means the autopilot's own.

    Parameter 4 is the yaw: PX4 takes 0 for north, and no value for its direction of flight.
    """
    return _placed(WAYPOINT, (0.0, accepted, 0.0, flown.autopilot.yaw), place, altitude)


def circle_item(turns: float, radius: float, center: Array, altitude: float) -> MissionItem:
    """Return loiter turns about a centre; a positive radius in m is clockwise, as in MAVLink."""
    return _placed(LOITER_TURNS, (turns, 0.0, radius, 0.0), center, altitude)


def _placed(command: int, parameters: Parameters, place: Array, altitude: float) -> MissionItem:
    latitude, longitude = place.tolist()
    return MissionItem(command, FRAME_RELATIVE_ALTITUDE, parameters, latitude, longitude, altitude)


# --- loiter turns -------------------------------------------------------------------------------


WHOLE_METRES_UP_TO = 255.0
TENS_UP_TO = 2550.0
MOST_TURNS_PER_ITEM = 255

FASTEST_RATE = 90.0
"""Largest CIRCLE_RATE in deg/s."""

ACCELERATION = 2.5
LARGEST_ACCELERATION = 5.0
"""Copter's WPNAV_ACCEL in m/s^2: its default and the end of its range."""

NOSE_ALONG_THE_PATH = 2.0
"""Bit of CIRCLE_OPTIONS."""

_NAMED = 6


def loiter_missions(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, and notes for the reader.

    Each sets the speed, flies to the vehicle's position at time 0, waits for that moment if the
    vehicle is a Copter and the moment is known, and circles for as many whole turns as cover the
    duration. Raises InputError for a radius that loiter turns can't have.
    """
    orbits = flown.plan.orbits
    notes = [*_radius_notes(flown), *_rate_notes(flown)]
    entries = lat_lon_of(flown.origin, position(orbits, 0.0))
    centers = lat_lon_of(flown.origin, orbits.centers)
    waits, missions = waiting_items(flown), []
    for k in range(orbits.count):
        # clockwise is positive in MAVLink, counter-clockwise here
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
    """Return the radius that ArduPilot stores, in m."""
    if radius <= WHOLE_METRES_UP_TO:
        return float(math.floor(radius))
    return 10.0 * math.floor(radius / 10.0)


def _turns_per_item(turns: int) -> list[float]:
    whole, rest = divmod(turns, MOST_TURNS_PER_ITEM)
    return [float(MOST_TURNS_PER_ITEM)] * whole + ([float(rest)] if rest else [])


# --- notes on loiter turns ----------------------------------------------------------------------


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
    """Notes on how a Copter keeps the rate of the plan, and on why it may fail to."""
    if not flown.is_copter:
        return []
    orbits = flown.plan.orbits
    rate = math.degrees(orbits.rate)
    turning = {
        f"{-sense * rate:.6g}": [flown.names[k] for k in np.flatnonzero(orbits.senses == sense)]
        for sense in (-1, 1)
    }
    rates = [
        f"{value} (deg/s) on {listed(names, _NAMED)}" for value, names in turning.items() if names
    ]
    notes = [
        "Copter circles at the rate of its own parameter: set CIRCLE_RATE to "
        f"{' and to '.join(rates)}, and CIRCLE_OPTIONS to 2 (nose along the path)"
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
            f"Copter circles with at most half its acceleration in waypoint flight, WPNAV_ACCEL: "
            f"{listed(named, _NAMED)} would turn too slowly at its default of "
            f"{ACCELERATION:g} m/s^2; set {most:.3g} m/s^2 or more{beyond}"
        )
    return notes


def _too_large(radius: float) -> str:
    return (
        f"{radius:g}: ArduPilot's loiter turns have at most {TENS_UP_TO:g} m; fly waypoints instead"
    )


# --- waypoints ----------------------------------------------------------------------------------


FEWEST_LEGS = 6
MOST_ITEMS = 65_535
LARGE_MISSION = 500
"""Number of items above which some autopilots' storage is too small."""

LARGEST_ACCEPTANCE_M = 255.0
"""Largest acceptance radius, which ArduPilot stores in one byte."""

PX4_ACCELERATION, PX4_JERK, PX4_TRAJECTORY_GAIN = 3.0, 4.0, 0.5
"""PX4's defaults of MPC_ACC_HOR in m/s^2, MPC_JERK_AUTO in m/s^3 and MPC_XY_TRAJ_P in 1/s."""


def waypoint_missions(flown: ScheduledPlan) -> tuple[list[Mission], list[str]]:
    """Return the mission of each vehicle, evenly spaced in time, and notes for the reader.

    A chord is shorter than its arc: at the speed of the circle, a vehicle on a polygon of 14 legs
    would run ahead by 3 deg a turn and lose its meetings. So the commanded speed is that along the
    chords. A Copter waits at the first waypoint for time 0, if that moment is known. Raises
    InputError if the missions would be too long.
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
            for place in lat_lon_of(flown.origin, _corners(orbits, k, legs, count))
        )
        before = (speed_item(flown, speed), first, *waits)
        missions.append(Mission((*before, *others), speed, start_item=len(before) + 1))
    return missions, [*_pace_notes(flown), *_length_notes(most)]


def px4_corner_speed(radius: float, legs: int) -> float:
    """Return the speed in m/s at which PX4's multicopters pass the corners by default.

    The least of the speed that the corner's angle allows, sqrt(gain a d tan(alpha / 2)) with d half
    a leg and alpha the angle between legs, and of the speed that allows braking in the next leg.
    """
    leg = _leg(radius, legs)
    corner = math.sqrt(
        PX4_TRAJECTORY_GAIN * PX4_ACCELERATION * leg / 2.0 / math.tan(math.pi / legs)
    )
    delay = 4.0 * PX4_ACCELERATION**2 / PX4_JERK
    braking = 0.5 * (math.sqrt(delay**2 + 8.0 * PX4_ACCELERATION * leg) - delay)
    return min(corner, braking, PX4_TRAJECTORY_GAIN * leg)


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
    """Half a leg in m; ArduPilot's Plane stores whole metres, and takes 0 for its own default."""
    half = _leg(radius, legs) / 2.0
    if not flown.autopilot.whole_metres:
        return half
    return float(min(max(1, round(half)), LARGEST_ACCEPTANCE_M))


def _corners(orbits: Orbits, k: int, legs: int, count: int) -> Array:
    """(count + 1, 2) positions of vehicle k in m, `legs` of them a turn, the first at time 0."""
    phases = orbits.phases[k] + orbits.senses[k] * 2.0 * np.pi / legs * np.arange(count + 1)
    return np.asarray(orbits.centers[k] + orbits.radii[k] * unit(phases))


# --- notes on waypoints -------------------------------------------------------------------------


def _pace_notes(flown: ScheduledPlan) -> list[str]:
    """Notes on the time that corners cost, and with it the meetings."""
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
