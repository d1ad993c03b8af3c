"""The command that reads files of the field: import."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from syncplan.cli import console
from syncplan.cli.arguments import takes_options
from syncplan.importing.import_options import ImportOptions

importers = typer.Typer()


@importers.command(
    name="import",
    epilog="\b\nExample: syncplan import field.kml marks.csv --keep-out 'no fly*' -o scenario.yaml",
)
@takes_options(ImportOptions)
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
    options: ImportOptions,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="File to write the scenario to; else it is printed"),
    ] = None,
) -> int:
    """Read a field, its keep-outs and its landmarks, and write a scenario with them.

    Polygons that are named or coloured as no-fly, exclusion fences and holes become keep-outs, the
    largest other polygon the area, points landmarks. Files hold no vehicles: the scenario's orbit,
    formation and sensor are examples.
    """
    from syncplan.importing.imported_places import import_places
    from syncplan.runtime.files import as_text, write_text

    console.check_output(output, *files)
    places = import_places(files, **asdict(options))
    for feature in places.features:
        section = feature.section.replace("_", "-")
        console.say(f"{feature.name or feature.geometry}: {section}, {feature.reason}")
    console.say_notes(places.notes)
    if output is None or str(output) == "-":
        typer.echo(places.scenario_text(), nl=False)
    else:
        as_json = output.suffix.lower() == ".json"
        write_text(output, as_text(places.scenario) if as_json else places.scenario_text())
        console.say(f"wrote {output}")
    return 0
