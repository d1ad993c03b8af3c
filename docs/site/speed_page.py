"""The page of speeds: the benchmarks' own tables, and above them those that matter most.

Every number comes from the tables that `python -m benchmarks --write` puts into
benchmarks/README.md; the summary here names their rows, so it can't state anything else.
"""

import re
from collections.abc import Mapping
from pathlib import Path

from syncplan.errors import InputError

__all__ = ["BENCHMARKS", "SUMMARY", "measured", "speed_page"]

BENCHMARKS = Path(__file__).parents[2] / "benchmarks" / "README.md"

SUMMARY = (
    (
        "Monte Carlo, a trial of 6 vehicles over 2,000 steps",
        "{Monte Carlo, a trial of 6 vehicles over 200 s: all cores}",
        "filterpy, the same filter: "
        "{Monte Carlo, a trial of 6 vehicles over 200 s: faster than filterpy, all cores} slower",
    ),
    (
        "windowed matrix and rank, 6 vehicles",
        "{observability, 6 vehicles: closed form, rank 18 of 18}",
        "pybounds, empirical: "
        "{observability, 6 vehicles: faster than pybounds, discrete, rank 18 of 18} slower",
    ),
    (
        "contact windows of 1,000 vehicles",
        "{windows, one sense: exact} one sense, {windows, alternating: exact} alternating",
        "sampling and bisection pair by pair: "
        "{windows, one sense: faster than 200 samples pair by pair, 0 pairs missed} and "
        "{windows, alternating: faster than 200 samples pair by pair, 0 pairs missed} slower; "
        "all pairs at once: "
        "{windows, one sense: faster than 200 samples all at once, 0 pairs missed} and "
        "{windows, alternating: faster than 200 samples all at once, 0 pairs missed}",
    ),
    (
        "the same with a field of view of 115 degrees",
        "{windows, one sense, 115 deg: exact} and {windows, alternating, 115 deg: exact}",
        "all pairs at once, with the samples that miss nothing: "
        "{windows, one sense, 115 deg: faster than 4,000 samples all at once, 0 pairs missed} and "
        "{windows, alternating, 115 deg: faster than 32,000 samples all at once, 0 pairs missed} "
        "slower",
    ),
    (
        "refinement for `logdet`, one start, 6 vehicles",
        "{refinement, 6 vehicles: syncplan, *}; a further start "
        "{refinement, 6 vehicles: syncplan, a further *}",
        "SciPy's SLSQP on differences of a vectorised cost: "
        "{refinement, 6 vehicles: SLSQP, last stage, *} to "
        "{refinement, 6 vehicles: SLSQP in stages, *}; trust-constr: "
        "{refinement, 6 vehicles: trust-constr, *}",
    ),
    (
        "refinement for `logdet`, one start, 24 vehicles",
        "{refinement, 24 vehicles: syncplan, *}",
        "SLSQP: {refinement, 24 vehicles: SLSQP in stages, *} to "
        "{refinement, 24 vehicles: SLSQP, last stage, *}",
    ),
    (
        "`syncplan refine --starts 1 --objective logdet`, a whole process",
        "{refine, logdet, one start, 6 vehicles: *} for 6 vehicles, "
        "{refine, logdet, one start, 24 vehicles: *} for 24, "
        "{refine, logdet, one start, 50 vehicles: *} for 50",
        "",
    ),
    (
        "`syncplan refine --starts 1`, a whole process",
        "{refine, predicted_rms, one start, 6 vehicles: *} for 6 vehicles, "
        "{refine, predicted_rms, one start, 24 vehicles: *} for 24",
        "",
    ),
    (
        "`syncplan plan`, a cold process",
        "{syncplan plan, 6 vehicles, flown} for 6 vehicles; on paper "
        "{syncplan plan --paper, 6 vehicles} for 6, {syncplan plan --paper, 100 vehicles} for 100, "
        "{syncplan plan --paper, 1,000 vehicles} for 1,000",
        "",
    ),
    (
        "`syncplan export --format all`, 6 vehicles, a cold process",
        "{syncplan export --format all, 6 vehicles}",
        "",
    ),
    (
        "the service, 6 vehicles",
        "plans at {service: POST /v1/plans, 6 vehicles}, 99 % within "
        "{service: POST /v1/plans, 99 % take less than}; reads at {service: GET /v1/plans/{id}}",
        "",
    ),
    (
        "the web page",
        "first load {page: first load over the wire}, a plan drawn after "
        "{page: plan drawn, nothing cached}; a circle of 12 dragged: verdict after "
        "{page: 12 vehicles (ccw): drag *} (ccw) and "
        "{page: 12 vehicles (alternate): drag *} (alternating), medians",
        "",
    ),
    ("`syncplan --help`", "{syncplan --help}", ""),
)
"""What is shown first: a name, what was measured, what stands beside it; `{row}` is that row of the
benchmarks' table, and `*` ends a row's beginning, whose first row counts."""

_ROW = re.compile(
    r"^\| (?P<name>.+?) \| (?P<value>[^|]+?) \| (?P<target>[^|]*?) ?\|$", re.MULTILINE
)
_PLACE = re.compile(r"\{((?:[^{}]|\{[^{}]*\})+)\}")


def speed_page() -> str:
    """Return the page: the summary, then the benchmarks' README.

    Raises InputError where the summary names a row that the benchmarks do not have.
    """
    readme = BENCHMARKS.read_text("utf-8")
    rows = measured(readme)
    lines = ["| | measured | beside |", "|---|---|---|"]
    lines += [f"| {' | '.join(_filled(cell, rows) for cell in row)} |" for row in SUMMARY]
    title, _, rest = readme.partition("\n")
    assert title == "# Benchmarks"
    table = "\n".join(lines)
    return (
        "# Speed\n\nMeasured on 2 cores by the benchmarks that `make benchmarks` runs, each beside "
        f"its peer in the same run.\n\n{table}\n\n## The benchmarks\n{rest}"
    )


def measured(readme: str) -> Mapping[str, str]:
    """Return what was measured, by the name of its row, in order."""
    return {found["name"]: found["value"] for found in _ROW.finditer(readme)}


def _filled(cell: str, rows: Mapping[str, str]) -> str:
    return _PLACE.sub(lambda found: _value(found[1], rows), cell)


def _value(name: str, rows: Mapping[str, str]) -> str:
    begin = name.removesuffix("*")
    alike = [row for row in rows if (row.startswith(begin) if begin != name else row == name)]
    if not alike:
        raise InputError(f"no row {name!r}", source="benchmarks/README.md")
    value = rows[alike[0]]
    return f"{value.removesuffix(' x')} times" if value.endswith(" x") else value
