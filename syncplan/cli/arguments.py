"""Arguments that several commands share, and how comma-separated ones are read."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from syncplan.cli.console import Format
from syncplan.errors import InputError

__all__ = [
    "Duration",
    "MaxVehicles",
    "Output",
    "ScenarioFile",
    "Seed",
    "Series",
    "Shown",
    "SubjectFile",
    "Threads",
    "Trials",
    "TruthKeys",
    "beginning_with",
    "numbers",
    "numeric_keys_from",
    "truth_of",
]

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


def numeric_keys_from(incomplete: str, before: str = "") -> list[str]:
    """Return the keys that begin so, without what all of those asked for have `before` them."""
    from syncplan.scenario.dotted_keys import numeric_keys

    found = [key.removeprefix(before) for key in numeric_keys() if key.startswith(before)]
    return [key for key in found if key.startswith(incomplete)]


def _true_keys(incomplete: str) -> list[str]:
    from syncplan.scenario.dotted_keys import IN_TRUTH

    return [f"{key}=" for key in numeric_keys_from(incomplete, IN_TRUTH)]


TruthKeys = Annotated[
    list[str] | None,
    typer.Option(
        "--truth",
        help="A key that the simulated world has in place of the scenario's own, which plan, "
        "prediction and filter keep: wind.gust_sigma_mps=0.6; may be given several times",
        metavar="KEY=VALUE",
        show_default=False,
        autocompletion=_true_keys,
    ),
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


def truth_of(texts: Iterable[str] | None) -> dict[str, Any] | None:
    """Return the keys of the simulated world that --truth names, None if none.

    Raises InputError naming the option.
    """
    from syncplan.scenario.dotted_keys import IN_TRUTH, nearest_keys, numeric_keys, with_number

    document: dict[str, Any] = {}
    for text in texts or ():
        key, equals, value = text.partition("=")
        if not equals:
            problem = f"{text!r}: give a key and its value, such as wind.gust_sigma_mps=0.6"
            raise InputError(problem, key="--truth")
        if IN_TRUTH + key not in numeric_keys():
            near = [one.removeprefix(IN_TRUTH) for one in nearest_keys(IN_TRUTH + key)]
            known = [one for one in dict.fromkeys(near) if IN_TRUTH + one in numeric_keys()]
            hint = f"did you mean {' or '.join(known[:3])}?" if known else "see docs/truth.md"
            problem = f"{key!r}: no such key of the simulated world holds a number; {hint}"
            raise InputError(problem, key="--truth")
        try:
            document = with_number(document, IN_TRUTH + key, float(value))
        except ValueError:
            problem = f"{value!r}: the value of {key} must be a number"
            raise InputError(problem, key="--truth") from None
    return document.get("truth")
