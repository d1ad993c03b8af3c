"""Tables of what can be chosen by name, from the tables that the code chooses from.

A page holds such a table between `<!-- table: NAME -->` and `<!-- end of table -->`, so that it
reads well unbuilt; `python -m docs.site --write` renews it, and a test holds it.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from api.metrics import METRICS
from syncplan.errors import InputError
from syncplan.exporting.format_table import ALL, FORMATS
from syncplan.plotting.figure_table import FIGURES, SUBJECTS
from syncplan.scenario.dotted_keys import IN_FLIGHT_ALONE, IN_TRUTH, SWEPT_KEYS, numeric_keys
from syncplan.scenario.filters import FILTERS
from syncplan.scenario.objectives import OBJECTIVES
from syncplan.studies.study_table import STUDIES
from syncplan.terms import TERMS

__all__ = ["TABLES", "renew", "with_tables"]

_TABLE = re.compile(
    r"^<!-- table: ([\w-]+) -->$.*?^<!-- end of table -->$", re.MULTILINE | re.DOTALL
)


def _formats() -> str:
    rows = [
        (
            f"`{name}`",
            form.title,
            form.holds,
            "yes" if form.on_earth else "no",
            f"{form.altitude_m:g}",
        )
        for name, form in FORMATS.items()
    ]
    folders = "all that the scenario allows, each in a folder of its own"
    rows.append((f"`{ALL}`", "every format", folders, "where there is one", ""))
    return _table(
        (
            "`--format`",
            "what it writes",
            "what the files hold",
            "needs `geo_origin`",
            "default altitude, m",
        ),
        rows,
    )


def _figures() -> str:
    rows = [
        (
            SUBJECTS[one.of],
            f"`{name}`",
            one.sentence + (f" Absent if {one.why_not}." if one.why_not else ""),
        )
        for name, one in FIGURES.items()
    ]
    return _table(("of", "figure", "shows"), rows)


def _objectives() -> str:
    rows = [
        (f"`{name}`", one.sentence, "less" if one.falls else "more")
        for name, one in OBJECTIVES.items()
    ]
    return _table(("objective", "improves", "better is"), rows)


def _filters() -> str:
    return _table(
        ("`--filter`", "what it does"),
        [(f"`{name}`", one.sentence) for name, one in FILTERS.items()],
    )


def _swept_keys() -> str:
    rows = [
        (f"`{one.option}`", f"`{one.key}`", one.many, f"`{name}`", f"`{one.request}`")
        for name, one in SWEPT_KEYS.items()
    ]
    return _table(("option", "key", "values", "in Python", "over HTTP"), rows)


def _numeric_keys() -> str:
    known = numeric_keys()
    scenarios = {*known, *IN_FLIGHT_ALONE}
    # keys of the truth are those of the scenario, but for some of its own
    rows = [
        (f"`{key}`", one.unit, one.allowed, one.meaning)
        for key, one in known.items()
        if not key.startswith(IN_TRUTH) or key.removeprefix(IN_TRUTH) not in scenarios
    ]
    return _table(("key", "unit", "allowed", "what it is"), rows)


def _terms() -> str:
    return _table(("term", "meaning"), [(name, one.meaning) for name, one in TERMS.items()])


def _metrics() -> str:
    rows = [
        (
            f"`{entry.name}{'_total' if entry.type == 'counter' else ''}`",
            entry.type,
            ", ".join(f"`{label}`" for label in entry.labels),
            entry.of,
            entry.meaning,
        )
        for entry in METRICS.values()
    ]
    return _table(("metric", "type", "labels", "of the", "meaning"), rows)


def _studies() -> str:
    rows = [
        (
            f"`POST /v1{re.sub(r'{.*}', 'ID', study.path)}`",
            f"`syncplan {study.verb}`",
            study.sentence,
            study.unit,
            f"`{study.name}`",
        )
        for study in STUDIES.values()
    ]
    return _table(("request", "command", "what it does", "progress counts", "kind"), rows)


TABLES: Mapping[str, Callable[[], str]] = {
    "figures": _figures,
    "filters": _filters,
    "formats": _formats,
    "metrics": _metrics,
    "numeric-keys": _numeric_keys,
    "objectives": _objectives,
    "studies": _studies,
    "swept-keys": _swept_keys,
    "terms": _terms,
}
"""Every table by the name that pages give."""


def with_tables(markdown: str, name: str) -> str:
    """Return a page with its tables as the code has them now.

    Raises InputError for a table that is not there.
    """
    return _TABLE.sub(lambda found: _marked(found[1], name), markdown)


def renew(folder: Path) -> None:
    """Rewrite the tables of all pages below a folder."""
    for path in sorted(folder.rglob("*.md")):
        text = path.read_text("utf-8")
        renewed = with_tables(text, path.name)
        if renewed != text:
            path.write_text(renewed, "utf-8")


def _marked(table: str, page: str) -> str:
    if table not in TABLES:
        raise InputError(f"no table {table!r}; there are {', '.join(TABLES)}", source=page)
    return f"<!-- table: {table} -->\n\n{TABLES[table]()}\n\n<!-- end of table -->"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    cells = [tuple(head), *map(tuple, rows)]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return "\n".join([lines[0], f"|{'---|' * len(cells[0])}", *lines[1:]])
