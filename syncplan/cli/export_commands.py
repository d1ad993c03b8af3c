"""The command that writes plans in other programs' formats: export."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from syncplan.cli.arguments import MaxVehicles, SubjectFile
from syncplan.cli.console import check_output, say, say_notes
from syncplan.errors import InputError
from syncplan.exporting.format_table import (
    ALL,
    FORMATS,
    AutopilotName,
    VehicleName,
    default_altitudes,
)

if TYPE_CHECKING:
    from syncplan.exporting.formats import Export, ExportOptions

    FormatName = str
else:
    FormatName = Literal[*FORMATS, ALL]

exporters = typer.Typer()

ARCHIVE = ".zip"

SCENARIO_KEYS = ("geo_origin", "start_time", "orbit.radius_m")
"""Keys that exports find fault with: the file is named with them."""

FileFormat = Annotated[FormatName, typer.Option("--format", help="Format to write")]
Target = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        help="Folder to write the files to, or a .zip; - writes the .zip to standard output",
    ),
]
Altitude = Annotated[
    float | None,
    typer.Option(
        help=f"Altitude above the origin in m (default {default_altitudes()})", show_default=False
    ),
]
AltitudeStep = Annotated[
    float, typer.Option(help="Fly each vehicle this many metres higher than the last")
]
Duration = Annotated[
    float | None,
    typer.Option(help="Length of each run in s; the scenario's if not given", show_default=False),
]
Turns = Annotated[
    int | None, typer.Option(help="Whole turns to fly, instead of a duration", show_default=False)
]
SampleTime = Annotated[
    float | None,
    typer.Option(help="Time between poses in s; the scenario's if not given", show_default=False),
]
ForAutopilot = Annotated[
    AutopilotName,
    typer.Option(help="Autopilot of the missions; PX4 refuses loiter turns and gets waypoints"),
]
ForVehicle = Annotated[VehicleName, typer.Option(help="Kind of vehicle")]
Waypoints = Annotated[
    bool, typer.Option("--waypoints", help="Write missions of waypoints instead of loiter turns")
]
Sagitta = Annotated[
    float, typer.Option(help="Largest distance in m from the arc to the chord of two waypoints")
]
SnapRadius = Annotated[
    bool,
    typer.Option(
        "--snap-radius", help="Fly the nearest radii that ArduPilot can store, at the same rate"
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Write the files although the verdict is NO-GO")
]


@exporters.command(
    name="export",
    epilog="Example: syncplan export plan.json --format qgc -o missions --altitude-m 60",
)
def _export(
    subject: SubjectFile,
    format_: FileFormat,
    output: Target,
    altitude_m: Altitude = None,
    altitude_step_m: AltitudeStep = 0.0,
    duration: Duration = None,
    turns: Turns = None,
    sample_time_s: SampleTime = None,
    autopilot: ForAutopilot = "ardupilot",
    vehicle: ForVehicle = "multicopter",
    waypoints: Waypoints = False,
    sagitta_m: Sagitta = 0.5,
    snap_radius: SnapRadius = False,
    force: Force = False,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Write a plan for autopilots, ROS 2, Crazyswarm2 or maps, with a sidecar .sync.json.

    The sidecar holds what these formats can't: when and where each vehicle joins its circle, the
    speed it holds, who meets whom, and the verdict. A plan that a finding stops is refused with
    exit status 3, unless forced.
    """
    from syncplan.exporting.format_table import ExportOptions

    options = ExportOptions(
        altitude_m=altitude_m,
        altitude_step_m=altitude_step_m,
        duration=duration,
        turns=turns,
        sample_time_s=sample_time_s,
        autopilot=autopilot,
        vehicle=vehicle,
        waypoints=waypoints,
        sagitta_m=sagitta_m,
        snap_radius=snap_radius,
        force=force,
    )
    if output.suffix.lower() == ARCHIVE:
        check_output(output, subject)
    made = _exported(subject, format_, options, max_vehicles)
    say_notes(list(made.notes))
    _write(made, output)
    return 0


def _exported(
    subject: str, format_: str, options: "ExportOptions", max_vehicles: int | None
) -> "Export":
    """The files of a plan or scenario; faults of the scenario's keys name its file."""
    from syncplan.exporting.formats import export
    from syncplan.planning.plan_files import load, plan_of
    from syncplan.scenario.models import MAX_VEHICLES

    loaded = load(subject, max_vehicles=max_vehicles or MAX_VEHICLES)
    try:
        return export(plan_of(loaded), format_, options)
    except InputError as error:
        if error.source or error.key not in SCENARIO_KEYS:
            raise
        raise InputError(error.problem, key=error.key, source=subject) from error


def _write(made: "Export", output: Path) -> None:
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
