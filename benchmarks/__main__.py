"""All benchmarks one after the other: python -m benchmarks [--write]."""

import argparse
import os
import platform
import sys
from pathlib import Path

from benchmarks import Figure, contacts, montecarlo, observability, print_figures, startup

README = Path(__file__).with_name("README.md")
BEGIN, END = "<!-- figures: python -m benchmarks --write -->", "<!-- end of figures -->"


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
    """Run the four benchmarks and return all their figures."""
    figures = []
    _announce("startup")
    figures += startup.figures(startup.main())
    _announce("contacts")
    figures += contacts.figures(contacts.main())
    _announce("observability")
    figures += observability.figures(observability.main())
    _announce("montecarlo")
    figures += montecarlo_figures(montecarlo.main())
    return figures


def _announce(name: str) -> None:
    print(f"{name} ...", file=sys.stderr, flush=True)


def machine() -> str:
    """Return the machine in general terms."""
    return f"{os.cpu_count()} cores, Python {platform.python_version()}"


def write_table(figures: list[Figure], readme: Path) -> None:
    """Put the table between the markers of `readme`. Raises ValueError where they are missing."""
    text = readme.read_text(encoding="utf-8")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{readme.name}: the table goes between the lines {BEGIN} and {END}")
    rows = [f"| {figure.what} | {figure.text} | {figure.target_text} |" for figure in figures]
    table = "\n".join(["| | Measured | Target |", "|---|---:|---|", *rows])
    block = f"{BEGIN}\n\nMeasured on {machine()}.\n\n{table}\n\n{END}"
    readme.write_text(before + block + after, encoding="utf-8")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--write", action="store_true", help="rewrite the table in README.md")
    wanted = parser.parse_args()
    measured = main()
    print_figures(measured)
    if wanted.write:
        write_table(measured, README)
