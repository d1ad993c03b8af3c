"""Exports: the table of formats, and the one function that writes a plan in any of them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from syncplan.errors import InputError
from syncplan.exporting.ardupilot import write_ardupilot
from syncplan.exporting.bags import write_mcap, write_rosbag2
from syncplan.exporting.crazyswarm import write_crazyswarm
from syncplan.exporting.export_options import ExportOptions
from syncplan.exporting.exported_files import Export, ExportedFile, Written, as_archive, write_files
from syncplan.exporting.flight import Flight, flight_of
from syncplan.exporting.geodesy import ground_error
from syncplan.exporting.geojson import write_geojson
from syncplan.exporting.kml import write_kml
from syncplan.exporting.loiter_turns import snapped_radii
from syncplan.exporting.missions import flies_loiter_turns
from syncplan.exporting.poses import write_poses
from syncplan.exporting.qgc import write_qgc
from syncplan.exporting.sidecar import sidecar_file
from syncplan.planning.planner import Plan, judge

__all__ = [
    "ALL",
    "FORMATS",
    "Export",
    "ExportFormat",
    "ExportOptions",
    "ExportedFile",
    "as_archive",
    "export",
    "write_files",
]

ALL = "all"
"""Every format at once, each in a folder of its name."""

PLANE_ERROR_M = 0.5
"""Difference of plane and ground from which the reader is told."""


@dataclass(frozen=True, slots=True)
class ExportFormat:
    """One format.

    Attributes
    ----------
    purpose : what it is, in one line
    write : from the flight to its files
    altitude_m : flown where the options name none
    on_earth : whether it needs the scenario's geo_origin
    mission : whether it is an autopilot's mission
    """

    purpose: str
    write: Callable[[Flight], Written]
    altitude_m: float
    on_earth: bool = False
    mission: bool = False


FORMATS: Mapping[str, ExportFormat] = MappingProxyType(
    {
        "qgc": ExportFormat("QGroundControl plan (.plan)", write_qgc, 50.0, True, True),
        "ardupilot": ExportFormat(
            "ArduPilot mission (QGC WPL 110)", write_ardupilot, 50.0, True, True
        ),
        "csv": ExportFormat("timed poses (CSV)", write_poses, 0.0),
        "rosbag2": ExportFormat("nav_msgs/Path in a ROS 2 bag (SQLite)", write_rosbag2, 0.0),
        "mcap": ExportFormat("nav_msgs/Path in a ROS 2 bag (MCAP)", write_mcap, 0.0),
        "crazyswarm": ExportFormat("Crazyswarm2 trajectories (CSV)", write_crazyswarm, 1.0),
        "geojson": ExportFormat("circles and points (GeoJSON)", write_geojson, 50.0, True),
        "kml": ExportFormat("circles and tracks (KML)", write_kml, 50.0, True),
    }
)
"""All formats by name."""


def export(plan: Plan, format: str, options: ExportOptions | None = None) -> Export:
    """Return a plan as the files of a format, with the sidecar that says what they can't.

    With `all`, those of every format, each in a folder of its name; formats that need a geo_origin
    are left out where there is none. Nothing is written to disk; equal input gives equal bytes.

    Raises InputError for an unknown format, a missing geo_origin or library, and what a format
    can't hold.
    """
    asked = ExportOptions() if options is None else options
    if format == ALL:
        return _all(plan, asked)
    if format not in FORMATS:
        raise InputError(f"{format!r}: must be one of {', '.join(FORMATS)} or {ALL}", key="format")
    chosen = FORMATS[format]
    flight = flight_of(plan, asked, chosen.altitude_m)
    notes = _ground_notes(flight) if chosen.on_earth else []
    if chosen.mission and asked.snap_radius and flies_loiter_turns(flight):
        flight, snapped = _snapped(flight)
        notes += snapped
    written = chosen.write(flight)
    written = replace(written, notes=(*notes, *written.notes))
    files = (*written.files, sidecar_file(flight, format, written))
    return Export(format, files, written.notes)


def _all(plan: Plan, options: ExportOptions) -> Export:
    """Every format that the scenario allows."""
    placed = plan.scenario.geo_origin is not None
    px4 = options.autopilot == "px4"
    left_out = [name for name, one in FORMATS.items() if one.on_earth and not placed]
    if px4 and placed:
        left_out.append("ardupilot")
    exports, refused = [], []
    for name in FORMATS:
        try:
            if name not in left_out:
                exports.append(export(plan, name, options))
        except InputError as error:
            # radii that a mission can't hold are no reason to go without the other formats
            if error.key != "orbit.radius_m":
                raise
            refused.append(f"{name} is left out: {error.problem}")
    notes = [f"{one.format}: {note}" for one in exports for note in one.notes]
    if left_out:
        why = "the autopilot is px4" if placed else "the scenario has no geo_origin"
        refused.insert(0, f"left out, for {why}: {', '.join(left_out)}")
    notes = [*refused, *notes]
    files = [
        ExportedFile(f"{one.format}/{file.name}", file.content)
        for one in exports
        for file in one.files
    ]
    return Export(ALL, tuple(files), tuple(notes))


def _ground_notes(flight: Flight) -> list[str]:
    orbits = flight.plan.orbits
    reach = float(np.max(np.hypot(*orbits.centers.T) + orbits.radii))
    error = ground_error(reach)
    if error < PLANE_ERROR_M:
        return []
    return [
        f"the team reaches {reach / 1000.0:.4g} km from geo_origin, where plane and ground differ "
        f"by {error:.2g} m; put the origin in the middle"
    ]


def _snapped(flight: Flight) -> tuple[Flight, list[str]]:
    """The flight with radii that ArduPilot can store, judged afresh by the exact code."""
    plan = flight.plan
    radii = snapped_radii(plan.orbits.radii)
    moved = np.abs(radii - plan.orbits.radii)
    if not moved.any():
        return flight, []
    orbit = plan.scenario.orbit.model_copy(
        update={
            "radius_m": radii.tolist(),
            "angular_rate_rad_s": plan.orbits.rate,
            "speed_mps": None,
        }
    )
    scenario = plan.scenario.model_copy(update={"orbit": orbit})
    judged = judge(scenario, replace(plan.orbits, radii=radii), bound="never")
    worst = int(np.argmax(moved))
    notes = [
        f"radii snapped to what ArduPilot stores, at most by {moved[worst]:.2g} m "
        f"({flight.names[worst]}: {plan.orbits.radii[worst]:g} to {radii[worst]:g} m); "
        "speeds keep the common period"
    ]
    if plan.observable and not judged.observable:
        notes.append("NOT observable any more with the radii snapped")
    before = {(item.a, item.b) for item in plan.links}
    lost = before - {(item.a, item.b) for item in judged.links}
    for a, b in sorted(lost):
        notes.append(f"{flight.names[a]} and {flight.names[b]} meet no more with the radii snapped")
    if len(judged.too_close) > len(plan.too_close):
        notes.append("vehicles come below min_separation_m with the radii snapped")
    return replace(flight, plan=judged), notes
