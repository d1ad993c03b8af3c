"""The command that writes plans in other programs' formats: export."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from syncplan.cli.arguments import MaxVehicles, SubjectFile, takes_options
from syncplan.cli.console import check_output, say, say_notes
from syncplan.errors import InputError
from syncplan.exporting.format_table import ALL, FORMATS, ExportOptions

if TYPE_CHECKING:
    from syncplan.exporting.formats import Export

    FormatName = str
else:
    FormatName = Literal[*FORMATS, ALL]

exporters = typer.Typer()

ARCHIVE = ".zip"

SCENARIO_KEYS = ("geo_origin", "start_time", "orbit.radius_m")
"""Scenario keys that exports may reject: their errors name the file."""

FileFormat = Annotated[FormatName, typer.Option("--format", help="Format to write")]
Target = Annotated[
    Path,
    typer.Option(
        "-o",
        "--output",
        help="Folder to write the files to, or a .zip; - writes the .zip to standard output",
    ),
]


@exporters.command(
    name="export",
    epilog="\n\n".join(
        [
            "The files hold:",
            *(f"{name}: {form.holds}." for name, form in FORMATS.items()),
            "\b\nExample: syncplan export plan.json --format qgc -o missions --altitude-m 60",
        ]
    ),
)
@takes_options(ExportOptions)
def _export(
    subject: SubjectFile,
    format_: FileFormat,
    output: Target,
    *,
    options: ExportOptions,
    max_vehicles: MaxVehicles = None,
) -> int:
    """Write a plan for autopilots, ROS 2, Crazyswarm2 or maps, with a sidecar .sync.json.

    The sidecar holds what these formats can't: when and where each vehicle joins its circle, the
    speed it holds, who meets whom, and the verdict. A plan that a finding stops is refused with
    exit status 3, unless forced.
    """
    if output.suffix.lower() == ARCHIVE:
        check_output(output, subject)
    made = _exported(subject, format_, options, max_vehicles)
    say_notes(list(made.notes))
    _write(made, output)
    return 0


def _exported(
    subject: str, format_: str, options: ExportOptions, max_vehicles: int | None
) -> "Export":
    """Export a plan or scenario; faults in SCENARIO_KEYS name its file."""
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
