"""The table of export formats, and the options of an export.

A new format is a function that writes it and a line in FORMATS. Importing this module is cheap: a
format's own module is loaded when it writes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from syncplan.errors import InputError
from syncplan.options import RunOptions, option
from syncplan.scenario.altitudes import HIGHEST_M, LOWEST_M

if TYPE_CHECKING:
    from syncplan.exporting.exported_files import Written
    from syncplan.exporting.scheduled_plan import ScheduledPlan


AutopilotName = Literal["ardupilot", "px4"]
VehicleName = Literal["multicopter", "fixed_wing"]


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A kind of vehicle.

    Attributes
    ----------
    code : its MAV_TYPE
    holds_airspeed : whether its autopilot holds airspeed rather than ground speed
    """

    code: int
    holds_airspeed: bool


@dataclass(frozen=True, slots=True)
class Autopilot:
    """An autopilot.

    Attributes
    ----------
    code : its MAV_AUTOPILOT
    titles : its name on each kind of vehicle
    loiter_turns : whether its missions may hold loiter turns
    whole_metres : whether it stores acceptance radii in whole metres
    yaw : yaw of a waypoint that the vehicle passes nose first; None if it must be left unset
    """

    code: int
    titles: Mapping[VehicleName, str]
    loiter_turns: bool
    whole_metres: bool
    yaw: float | None


VEHICLES: Mapping[VehicleName, Vehicle] = MappingProxyType(
    {"multicopter": Vehicle(2, False), "fixed_wing": Vehicle(1, True)}
)
"""All kinds of vehicles by name."""

AUTOPILOTS: Mapping[AutopilotName, Autopilot] = MappingProxyType(
    {
        "ardupilot": Autopilot(
            code=3,
            titles={"multicopter": "ArduPilot Copter", "fixed_wing": "ArduPilot Plane"},
            loiter_turns=True,
            whole_metres=True,
            yaw=0.0,
        ),
        "px4": Autopilot(
            code=12,
            titles={"multicopter": "PX4 multicopter", "fixed_wing": "PX4 fixed wing"},
            loiter_turns=False,
            whole_metres=False,
            yaw=None,
        ),
    }
)
"""All autopilots by name."""


# --- formats ------------------------------------------------------------------------------------


ALL = "all"
"""Every format at once, each in a folder of its name."""


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One export format.

    Attributes
    ----------
    title : name in a list of choices
    holds : what its files contain and leave out, a noun phrase
    writer : module of this package and a function in it, from the plan to its files
    altitude_m : altitude where neither options nor scenario give one; with 0, none is meant
    on_earth : whether it needs the scenario's geo_origin
    mission : whether it is an autopilot's mission
    only_for : the only autopilot that the format is for; None if there are several
    """

    title: str
    holds: str
    writer: str
    altitude_m: float
    on_earth: bool = False
    mission: bool = False
    only_for: AutopilotName | None = None

    def write(self, flown: "ScheduledPlan") -> "Written":
        """Return a plan's files in this format; raises InputError if the format can't hold it."""
        module, _, function = self.writer.partition(".")
        written: Written = getattr(import_module(f"{__package__}.{module}"), function)(flown)
        return written


_GROUND = "no take-off, no landing"
_MISSION = f"{_GROUND}; parameters that a copter of ArduPilot needs are in the .sync.json"
_POSES = f"one bag, with positions and headings over time of each vehicle; no fences, {_GROUND}"

FORMATS: Mapping[str, ExportFormat] = MappingProxyType(
    {
        "qgc": ExportFormat(
            "QGroundControl missions",
            f"one mission for each vehicle, with area and keep-outs as its fence; {_MISSION}",
            "missions.write_qgc",
            50.0,
            on_earth=True,
            mission=True,
        ),
        "ardupilot": ExportFormat(
            "ArduPilot missions (WPL 110)",
            "one mission for each vehicle, and area and keep-outs as one fence list for all; "
            f"{_MISSION}",
            "missions.write_ardupilot",
            50.0,
            on_earth=True,
            mission=True,
            only_for="ardupilot",
        ),
        "csv": ExportFormat(
            "Timed poses (CSV)",
            "one table with positions, altitudes and headings over time of all vehicles; no "
            f"fences, {_GROUND}",
            "trajectories.write_poses",
            0.0,
        ),
        "rosbag2": ExportFormat("ROS 2 bag (sqlite3)", _POSES, "trajectories.write_rosbag2", 0.0),
        "mcap": ExportFormat("ROS 2 bag (MCAP)", _POSES, "trajectories.write_mcap", 0.0),
        "crazyswarm": ExportFormat(
            "Crazyswarm 2 trajectories",
            f"one trajectory for each vehicle, as polynomials; no fences, {_GROUND}",
            "trajectories.write_crazyswarm",
            1.0,
        ),
        "geojson": ExportFormat(
            "GeoJSON",
            "one map with circles, centres, entry points, landmarks, area, keep-outs and "
            "obstacles; no tracks over time",
            "map_files.write_geojson",
            50.0,
            on_earth=True,
        ),
        "kml": ExportFormat(
            "KML",
            "one map with circles and entry points at their altitudes, landmarks, area, keep-outs "
            "and obstacles, and with tracks over time where the scenario has a start_time",
            "map_files.write_kml",
            50.0,
            on_earth=True,
        ),
    }
)
"""All formats by name, in the order in which users see them."""


def default_altitudes() -> str:
    """Return the default altitudes in m of the formats in words, the most common first."""
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


# --- options ------------------------------------------------------------------------------------


LONGEST_S = 1e7
MOST_TURNS = 20_000
"""Most turns flown: as many as the periods that a scenario's run may have."""


@dataclass(frozen=True, slots=True)
class ExportOptions(RunOptions):
    """Options of an export; raises InputError naming the option whose value is not allowed."""

    altitude_m: float | None = option(
        None,
        "Altitude in m above the ground at the origin, of all vehicles; altitude_m of the scenario "
        f"if not given, else {default_altitudes()}",
        ge=LOWEST_M,
        le=HIGHEST_M,
    )
    altitude_step_m: float = option(
        0.0,
        "Fly each vehicle this many metres higher in turn, on top of its altitude",
        ge=0,
        le=1000,
    )
    duration: float | None = option(
        None, "Length of each run in s; the scenario's if not given", ge=1e-3, le=LONGEST_S
    )
    turns: int | None = option(
        None, "Whole turns to fly, instead of a duration", ge=1, le=MOST_TURNS
    )
    sample_time_s: float | None = option(
        None, "Time between poses in s; the scenario's if not given", ge=1e-4, le=LONGEST_S
    )
    autopilot: AutopilotName = option(
        "ardupilot", "Autopilot of the missions; PX4 refuses loiter turns and gets waypoints"
    )
    vehicle: VehicleName = option("multicopter", "Kind of vehicle")
    waypoints: bool = option(False, "Write missions of waypoints instead of loiter turns")
    sagitta_m: float = option(
        0.5,
        "Largest distance in m from the arc to the chord of two waypoints",
        ge=1e-3,
        le=1000,
    )
    snap_radius: bool = option(
        False, "Fly the nearest radii that ArduPilot can store, at the same rate"
    )
    force: bool = option(False, "Write the files although the verdict is NO-GO")

    def __post_init__(self) -> None:
        RunOptions.__post_init__(self)
        if self.duration is not None and self.turns is not None:
            raise InputError("goes without a duration; give one of the two", key="turns")
