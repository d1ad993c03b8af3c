"""QGroundControl plan files, one for each vehicle.

Source: QGroundControl developer guide, "Plan File Format".
"""

from typing import Any

from syncplan.exporting.exported_files import Written
from syncplan.exporting.mission_items import Mission, MissionItem
from syncplan.exporting.missions import write_missions
from syncplan.exporting.scheduled_plan import ScheduledPlan
from syncplan.runtime.files import as_text

RELATIVE_TO_HOME = 1


def write_qgc(flown: ScheduledPlan) -> Written:
    """Return a .plan file for each vehicle; altitudes are above home.

    Raises InputError as missions_of does.
    """
    return write_missions(flown, "plan", _text)


def _text(flown: ScheduledPlan, mission: Mission) -> str:
    return as_text(_plan(flown, mission))


def _plan(flown: ScheduledPlan, mission: Mission) -> dict[str, Any]:
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
            "items": [_item(item, number) for number, item in enumerate(mission.items, start=1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": []},
        "rallyPoints": {"version": 2, "points": []},
    }


def _item(item: MissionItem, number: int) -> dict[str, Any]:
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
