"""ArduPilot mission files (QGC WPL 110), one for each vehicle.

One item a line, tab-separated: index, current, frame, command, parameters 1 to 4, latitude,
longitude, altitude, autocontinue. Item 0 is home. Source: MAVLink, "File Formats".
"""

from syncplan.exporting.exported_files import Written
from syncplan.exporting.mission_items import WAYPOINT, Mission, MissionItem
from syncplan.exporting.missions import write_missions
from syncplan.exporting.scheduled_plan import ScheduledPlan

HEADER = "QGC WPL 110"
FRAME_GLOBAL = 0


def write_ardupilot(flown: ScheduledPlan) -> Written:
    """Return a .waypoints file for each vehicle; altitudes are above home, home's above the sea.

    Raises InputError as missions_of does.
    """
    return write_missions(flown, "waypoints", _text)


def _text(flown: ScheduledPlan, mission: Mission) -> str:
    origin = flown.origin
    home = MissionItem(
        WAYPOINT,
        FRAME_GLOBAL,
        (0.0, 0.0, 0.0, 0.0),
        origin.lat_deg,
        origin.lon_deg,
        origin.alt_m,
    )
    lines = [_line(item, number) for number, item in enumerate((home, *mission.items))]
    return "\n".join([HEADER, *lines]) + "\n"


def _line(item: MissionItem, number: int) -> str:
    fields = [
        str(number),
        "1" if number == 0 else "0",
        str(item.frame),
        str(item.command),
        *(f"{value or 0.0:.6f}" for value in item.parameters),
        f"{item.latitude:.9f}",
        f"{item.longitude:.9f}",
        f"{item.altitude:.6f}",
        "1",
    ]
    return "\t".join(fields)
