"""All benchmarks one after the other: python -m benchmarks [--write]."""

import argparse
import os
import platform
import sys
from pathlib import Path

from benchmarks import (
    Figure,
    contacts,
    exports,
    montecarlo,
    objectives,
    observability,
    page,
    print_figures,
    refinement,
    service,
    startup,
)
from benchmarks import figures as drawings

README = Path(__file__).with_name("README.md")
BEGIN, END = "<!-- figures: python -m benchmarks --write -->", "<!-- end of figures -->"
BEGIN_ERRORS, END_ERRORS = "<!-- errors: python -m benchmarks --write -->", "<!-- end of errors -->"


def montecarlo_figures(result: dict[str, float]) -> list[Figure]:
    """Return what is shown of the Monte Carlo's result."""
    name = "Monte Carlo, a trial of 6 vehicles over 200 s"
    return [
        Figure(f"{name}: filterpy", result["filterpy_s"], "s"),
        Figure(f"{name}: one thread", result["one_thread_s"], "s"),
        Figure(f"{name}: all cores", result["all_cores_s"], "s"),
        Figure(f"{name}: faster than filterpy, one thread", result["ratio_one_thread"], "x"),
        Figure(f"{name}: faster than filterpy, all cores", result["ratio_all_cores"], "x", 200.0),
    ]


def main() -> list[Figure]:
    """Run all benchmarks with figures and return these."""
    figures = []
    _announce("startup")
    figures += startup.figures(startup.main())
    _announce("contacts")
    figures += contacts.figures(contacts.main())
    _announce("observability")
    figures += observability.figures(observability.main())
    _announce("montecarlo")
    figures += montecarlo_figures(montecarlo.main())
    _announce("refinement")
    figures += refinement.main()
    _announce("service")
    figures += service.figures(service.main())
    _announce("figures")
    figures += drawings.figures(drawings.main())
    _announce("page")
    figures += page.figures(page.main())
    _announce("exports")
    figures += exports.figures(exports.main())
    return figures


def _announce(name: str) -> None:
    print(f"{name} ...", file=sys.stderr, flush=True)


def machine() -> str:
    """Return the machine in general terms."""
    return f"{os.cpu_count()} cores, Python {platform.python_version()}"


def write_table(figures: list[Figure], readme: Path) -> None:
    """Put the table between the markers of `readme`. Raises ValueError where they are missing."""
    rows = [["", "Measured", "Target"]]
    rows += [[figure.what, figure.text, figure.target_text] for figure in figures]
    table = _markdown(rows, ["---", "---:", "---"])
    _write_between(BEGIN, END, f"Measured on {machine()}.\n\n{table}", readme)


def write_errors(errors: objectives.Errors, readme: Path) -> None:
    """As `write_table`, for the errors by objective."""
    rows = objectives.rows(errors)
    table = _markdown(rows, ["---"] * len(rows[0]))
    _write_between(BEGIN_ERRORS, END_ERRORS, table, readme)


def _markdown(rows: list[list[str]], rule: list[str]) -> str:
    header = "|" + "|".join(rule) + "|"
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], header, *lines[1:]])


def _write_between(begin: str, end: str, block: str, readme: Path) -> None:
    text = readme.read_text(encoding="utf-8")
    before, found, rest = text.partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise ValueError(f"{readme.name}: the table goes between the lines {begin} and {end}")
    readme.write_text(f"{before}{begin}\n\n{block}\n\n{end}{after}", encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--write", action="store_true", help="rewrite the table in README.md")
    wanted = parser.parse_args()
    measured = main()
    print_figures(measured)
    _announce("objectives")
    errors = objectives.main()
    print(_markdown(objectives.rows(errors), ["---"] * (1 + len(errors))))
    if wanted.write:
        write_table(measured, README)
        write_errors(errors, README)
