"""All benchmarks one after the other: python -m benchmarks [--write]."""

import argparse
import sys
from pathlib import Path

from benchmarks import (
    Figure,
    contacts,
    designs,
    exports,
    filters,
    flights,
    growth,
    guidance,
    losses,
    montecarlo,
    navigator,
    objectives,
    observability,
    obstacles,
    page,
    plans,
    print_figures,
    refinement,
    service,
    startup,
    states,
    trials,
)
from benchmarks import figures as drawings
from benchmarks.readme_tables import README, machine, markdown, write_between

BEGIN, END = "<!-- figures: python -m benchmarks --write -->", "<!-- end of figures -->"
BEGIN_ERRORS, END_ERRORS = "<!-- errors: python -m benchmarks --write -->", "<!-- end of errors -->"


PARTS = (
    startup,
    growth,
    plans,
    states,
    contacts,
    obstacles,
    observability,
    losses,
    montecarlo,
    trials,
    filters,
    flights,
    guidance,
    navigator,
    refinement,
    designs,
    service,
    drawings,
    page,
    exports,
)
"""Modules whose `main` measures and whose `figures` turns the result into rows, in order."""


def main() -> list[Figure]:
    """Run all benchmarks with figures and return these."""
    rows: list[Figure] = []
    for part in PARTS:
        _announce(part.__name__.rpartition(".")[2])
        rows += part.figures(part.main())
    return rows


def _announce(name: str) -> None:
    print(f"{name} ...", file=sys.stderr, flush=True)


def write_table(figures: list[Figure], readme: Path) -> None:
    """Put the table between the markers of `readme`. Raises ValueError where they are missing."""
    rows = [["", "Measured", "Target"]]
    rows += [[figure.what, figure.text, figure.target_text] for figure in figures]
    table = markdown(rows, ["---", "---:", "---"])
    write_between(BEGIN, END, f"Measured on {machine()}.\n\n{table}", readme)


def write_errors(errors: objectives.Errors, readme: Path) -> None:
    """As `write_table`, for the errors by objective."""
    rows = objectives.rows(errors)
    table = markdown(rows, ["---"] * len(rows[0]))
    write_between(BEGIN_ERRORS, END_ERRORS, table, readme)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--write", action="store_true", help="rewrite the table in README.md")
    wanted = parser.parse_args()
    measured = main()
    print_figures(measured)
    _announce("objectives")
    errors = objectives.main()
    print(markdown(objectives.rows(errors), ["---"] * (1 + len(errors))))
    if wanted.write:
        write_table(measured, README)
        write_errors(errors, README)
