"""Arguments that several commands share, and how comma-separated ones are read."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated

import typer

from syncplan.cli.console import Format
from syncplan.errors import InputError

ScenarioFile = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="Scenario file, YAML or JSON; - is standard input")
]
SubjectFile = Annotated[
    str, typer.Argument(metavar="PLAN|SCENARIO", help="Plan or scenario file; - is standard input")
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", help="File to write the JSON to", show_default=False),
]
Shown = Annotated[
    Format,
    typer.Option("--format", help="Standard output: auto is a table at a terminal, JSON elsewhere"),
]
Trials = Annotated[int, typer.Option(help="Number of Monte Carlo trials")]
Seed = Annotated[int, typer.Option(help="Seed of all random numbers")]
Duration = Annotated[
    float | None,
    typer.Option(help="Length of each run in s; the scenario's if not given", show_default=False),
]
Series = Annotated[
    bool, typer.Option("--series", help="Add errors and sigmas over time to the report")
]
Threads = Annotated[
    int | None, typer.Option(help="Threads; all cores if not given", show_default=False)
]
MaxVehicles = Annotated[
    int | None,
    typer.Option(min=1, help="Accept teams up to this size (default 2000)", show_default=False),
]


def beginning_with(names: Iterable[str], *, listed: bool = False) -> Callable[[str], list[str]]:
    """Return what a shell completes an option with; `listed` options take names with commas."""
    known = tuple(names)

    def completed(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",") if listed else ("", "", incomplete)
        taken = before.split(",")
        return [
            f"{before}{comma}{name}"
            for name in known
            if name.startswith(last) and name not in taken
        ]

    return completed


def numbers(text: str, option: str) -> list[float]:
    """Return the numbers of a comma-separated option; raises InputError naming it."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(
            f"{text!r}: must be numbers with commas between, such as 0.2,0.4", key=option
        ) from None
