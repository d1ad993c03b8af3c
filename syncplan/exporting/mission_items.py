"""Items of missions, as MAVLink has them (common.xml), and the missions made of them."""

from dataclasses import dataclass

from syncplan.arrays import Array
from syncplan.exporting.scheduled_plan import ScheduledPlan, start_second

Parameters = tuple[float | None, float, float, float | None]

WAYPOINT, LOITER_TURNS, DELAY, CHANGE_SPEED = 16, 18, 93, 178
FRAME_MISSION, FRAME_RELATIVE_ALTITUDE = 2, 3

_AIRSPEED, _GROUND_SPEED, _UNCHANGED = 0.0, 1.0, -1.0
_TIME_OF_DAY = -1.0


@dataclass(frozen=True, slots=True)
class MissionItem:
    """One item: command and frame, parameters 1 to 4, latitude, longitude, altitude.

    A parameter of None is not set. Items without a place have zeros.
    """

    command: int
    frame: int
    parameters: Parameters
    latitude: float = 0.0
    longitude: float = 0.0
    altitude: float = 0.0

    @property
    def placed(self) -> bool:
        """Whether it is about a place."""
        return self.frame == FRAME_RELATIVE_ALTITUDE


@dataclass(frozen=True, slots=True)
class Mission:
    """One vehicle's mission.

    Attributes
    ----------
    items : without home
    speed : m/s, as commanded; along the chords where the items are waypoints
    start_item : number, home being 0, of the item that begins at time 0
    parameters : autopilot parameters it rests on
    """

    items: tuple[MissionItem, ...]
    speed: float
    start_item: int
    parameters: tuple[tuple[str, float], ...] = ()


def speed_item(flown: ScheduledPlan, speed: float) -> MissionItem:
    """Return the change to a speed in m/s: of the air for fixed wings, else over ground."""
    kind = _AIRSPEED if flown.vehicle.holds_airspeed else _GROUND_SPEED
    return MissionItem(CHANGE_SPEED, FRAME_MISSION, (kind, speed, _UNCHANGED, 0.0))


def waiting_items(flown: ScheduledPlan) -> tuple[MissionItem, ...]:
    """Return a Copter's wait for time 0, a time of day in whole seconds; none if not known."""
    moment = start_second(flown) if flown.is_copter else None
    if moment is None:
        return ()
    when = (_TIME_OF_DAY, float(moment.hour), float(moment.minute), float(moment.second))
    return (MissionItem(DELAY, FRAME_MISSION, when),)


def waypoint_item(
    flown: ScheduledPlan, place: Array, altitude: float, accepted: float
) -> MissionItem:
    """Return a waypoint that counts as reached `accepted` m from it; 0: the autopilot's own.

    Parameter 4 is the yaw: PX4 takes 0 for north and nothing for the way it flies.
    """
    return _placed(WAYPOINT, (0.0, accepted, 0.0, flown.autopilot.yaw), place, altitude)


def circle_item(turns: float, radius: float, center: Array, altitude: float) -> MissionItem:
    """Return turns about a centre; a positive radius in m is clockwise, as MAVLink has it."""
    return _placed(LOITER_TURNS, (turns, 0.0, radius, 0.0), center, altitude)


def _placed(command: int, parameters: Parameters, place: Array, altitude: float) -> MissionItem:
    latitude, longitude = place.tolist()
    return MissionItem(command, FRAME_RELATIVE_ALTITUDE, parameters, latitude, longitude, altitude)
