"""The command that reads files of the field: import."""

from pathlib import Path
from typing import Annotated

import typer

from syncplan.cli import console
from syncplan.cli.arguments import optional

importers = typer.Typer()


@importers.command(
    name="import",
    epilog="\b\nExample: syncplan import field.kml marks.csv --keep-out 'no fly*' -o scenario.yaml",
)
def _import(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="KML, KMZ, GeoJSON, GPX, QGroundControl plan, ArduPilot fence, CSV of points",
            show_default=False,
        ),
    ],
    *,
    area: Annotated[list[str] | None, optional(help="Name of the polygon to stay within")] = None,
    keep_out: Annotated[
        list[str] | None, optional(help="Names of polygons to avoid, such as 'no fly*'")
    ] = None,
    obstacle: Annotated[
        list[str] | None, optional(help="Names of polygons that block sight")
    ] = None,
    landmark: Annotated[list[str] | None, optional(help="Names of points to be sighted")] = None,
    leave_out: Annotated[list[str] | None, optional(help="Names of features to ignore")] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File to write the scenario to; else it is printed"),
    ] = None,
) -> int:
    """Read a field, its keep-outs and its landmarks, and write a scenario with them.

    Polygons that are named or coloured as no-fly, exclusion fences and holes become keep-outs, the
    largest other polygon the area, points landmarks. Circles and sensors are examples.
    """
    from syncplan.importing.imported_places import Patterns, import_places
    from syncplan.runtime.files import write_text

    console.check_output(output, *files)
    patterns: Patterns = {
        "area": area or [],
        "keep_out": keep_out or [],
        "obstacle": obstacle or [],
        "landmark": landmark or [],
        "none": leave_out or [],
    }
    places = import_places(files, patterns)
    text = places.scenario_text(Path(files[0]).stem)
    for each in places.features:
        section = "left out" if each.section == "none" else each.section.replace("_", "-")
        console.say(f"{each.label}: {section}, {each.reason}")
    console.say_notes(list(places.notes))
    if output is None:
        typer.echo(text, nl=False)
    else:
        write_text(output, text)
        console.say(f"wrote {output}")
    return 0
