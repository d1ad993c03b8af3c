"""The table of export formats. A new format is a module that writes it and a line here.

Costs nothing to import: a format's own module is loaded once it writes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from syncplan.exporting.autopilots import AutopilotName

if TYPE_CHECKING:
    from syncplan.exporting.exported_files import Written
    from syncplan.exporting.scheduled_plan import ScheduledPlan

ALL = "all"
"""Every format at once, each in a folder of its name."""


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format.

    Attributes
    ----------
    title : what it is called where people choose one
    writer : module of this package and its function, from the plan to what is written
    altitude_m : flown where the options name none
    on_earth : whether it needs the scenario's geo_origin
    mission : whether it is an autopilot's mission
    only_for : the autopilot it is for, where it is for one alone
    """

    title: str
    writer: str
    altitude_m: float
    on_earth: bool = False
    mission: bool = False
    only_for: AutopilotName | None = None

    def write(self, flown: "ScheduledPlan") -> "Written":
        """Return a plan's files in this format; raises InputError for what it can't hold."""
        module, _, function = self.writer.partition(".")
        written: Written = getattr(import_module(f"{__package__}.{module}"), function)(flown)
        return written


FORMATS: Mapping[str, ExportFormat] = MappingProxyType(
    {
        "qgc": ExportFormat("QGroundControl missions", "qgc.write_qgc", 50.0, True, True),
        "ardupilot": ExportFormat(
            "ArduPilot missions (WPL 110)",
            "ardupilot.write_ardupilot",
            50.0,
            True,
            True,
            only_for="ardupilot",
        ),
        "csv": ExportFormat("Timed poses (CSV)", "poses.write_poses", 0.0),
        "rosbag2": ExportFormat("ROS 2 bag (sqlite3)", "bags.write_rosbag2", 0.0),
        "mcap": ExportFormat("ROS 2 bag (MCAP)", "bags.write_mcap", 0.0),
        "crazyswarm": ExportFormat("Crazyswarm 2 trajectories", "crazyswarm.write_crazyswarm", 1.0),
        "geojson": ExportFormat("GeoJSON", "geojson.write_geojson", 50.0, True),
        "kml": ExportFormat("KML", "kml.write_kml", 50.0, True),
    }
)
"""All formats by name, in the order people are shown them."""


def default_altitudes() -> str:
    """Return the altitudes that formats fly at by default, the commonest first, in words."""
    by_altitude: dict[float, list[str]] = {}
    for name, one in FORMATS.items():
        by_altitude.setdefault(one.altitude_m, []).append(name)
    common = max(by_altitude, key=lambda altitude: len(by_altitude[altitude]))
    others = [
        f"{', '.join(by_altitude[altitude])} {altitude:g}"
        for altitude in sorted(by_altitude, reverse=True)
        if altitude != common
    ]
    return "; ".join([f"{common:g}", *others])
