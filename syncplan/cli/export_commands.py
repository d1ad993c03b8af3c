"""The command that writes plans in other programs' formats: export."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from syncplan.cli.arguments import Duration, MaxVehicles, SubjectFile
from syncplan.cli.console import say, say_notes
from syncplan.errors import InputError

if TYPE_CHECKING:
    from syncplan.exporting.formats import Export

__all__ = ["exporters"]

exporters = typer.Typer()

ARCHIVE = ".zip"

SCENARIO_KEYS = ("geo_origin", "start_time", "orbit.radius_m")
"""Keys that exports find fault with: the file is named with them."""


class ExportFormat(StrEnum):
    """Formats of syncplan.exporting.formats.FORMATS, and all of them."""

    qgc = "qgc"
    ardupilot = "ardupilot"
    csv = "csv"
    rosbag2 = "rosbag2"
    mcap = "mcap"
    crazyswarm = "crazyswarm"
    geojson = "geojson"
    kml = "kml"
    all = "all"


class Autopilot(StrEnum):
    """Autopilots that missions are written for."""

    ardupilot = "ardupilot"
    px4 = "px4"


class Vehicle(StrEnum):
    """Kinds of vehicles."""

    multicopter = "multicopter"
    fixed_wing = "fixed_wing"


@exporters.command(
    name="export",
    epilog="Example: syncplan export plan.json --format qgc -o missions --altitude-m 60",
)
def _export(
    subject: SubjectFile,
    format_: Annotated[ExportFormat, typer.Option("--format", help="What to write")],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="Folder to write the files to, or a .zip; - writes the .zip to standard output",
        ),
    ],
    altitude_m: Annotated[
        float | None,
        typer.Option(
            help="Height above the origin (default 50; crazyswarm 1; csv, rosbag2, mcap 0)",
            show_default=False,
        ),
    ] = None,
    altitude_step_m: Annotated[
        float, typer.Option(help="Each vehicle so much above the one before")
    ] = 0.0,
    duration: Duration = None,
    turns: Annotated[
        int | None,
        typer.Option(help="Whole turns to fly, instead of a duration", show_default=False),
    ] = None,
    sample_time_s: Annotated[
        float | None,
        typer.Option(help="Time between poses; the scenario's if not given", show_default=False),
    ] = None,
    autopilot: Annotated[
        Autopilot, typer.Option(help="Missions for; PX4 refuses loiter turns and gets waypoints")
    ] = Autopilot.ardupilot,
    vehicle: Annotated[Vehicle, typer.Option(help="Kind of vehicle")] = Vehicle.multicopter,
    waypoints: Annotated[
        bool, typer.Option("--waypoints", help="Missions of waypoints instead of loiter turns")
    ] = False,
    sagitta_m: Annotated[
        float, typer.Option(help="Most between the chord of two waypoints and the arc")
    ] = 0.5,
    snap_radius: Annotated[
        bool,
        typer.Option(
            "--snap-radius", help="Fly the nearest radii that ArduPilot stores, at the same rate"
        ),
    ] = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Write a plan for autopilots, ROS 2, Crazyswarm2 or maps, with a sidecar .sync.json.

    The sidecar holds what these formats can't: when and where each vehicle joins its circle, what
    speed it holds, and who meets whom.
    """
    from syncplan.exporting.formats import ExportOptions, export
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.scenario.models import MAX_VEHICLES

    options = ExportOptions(
        altitude_m=altitude_m,
        altitude_step_m=altitude_step_m,
        duration=duration,
        turns=turns,
        sample_time_s=sample_time_s,
        autopilot=autopilot.value,
        vehicle=vehicle.value,
        waypoints=waypoints,
        sagitta_m=sagitta_m,
        snap_radius=snap_radius,
    )
    loaded = load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)
    try:
        made = export(plan_of(loaded), format_.value, options)
    except InputError as error:
        if error.source or error.key not in SCENARIO_KEYS:
            raise
        raise InputError(error.problem, key=error.key, source=subject) from error
    say_notes(list(made.notes))
    _deliver(made, output)
    return 0


def _deliver(made: "Export", output: Path) -> None:
    from syncplan.exporting.formats import as_archive, write_files
    from syncplan.runtime.files import write_bytes

    if str(output) == "-":
        sys.stdout.buffer.write(as_archive(made))
        return
    if output.suffix.lower() == ARCHIVE:
        write_bytes(output, as_archive(made))
    else:
        write_files(made, output)
    say(f"wrote {output}: {len(made.files)} files")
