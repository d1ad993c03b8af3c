"""Stories: the lines and tables that present a result, in the order of reading.

Lines and cells are marked up as rich does it: [bold], [green] and the like, up to [/].
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel

from syncplan.results.quantities import MISSING, Quantity, plain, quantities_of, value_at

Row = dict[str, Any]
"""Values of a row of a data frame, by column."""


class Column(NamedTuple):
    """A column of a table: what it shows, and the marked-up texts of its cells."""

    quantity: Quantity
    cells: list[str]


@dataclass(frozen=True, slots=True)
class Table:
    """A table: a row for each part of a result, a column for each of its quantities.

    Columns without any value are left out, unless they have a word for that.

    Attributes
    ----------
    title : words above it
    rows : parts of one kind
    foot : part with the figures of all rows, under a line
    apart : number of first rows that a line sets apart
    first : head of the first column, where its own is too general
    beside : further columns, of what the rows do not hold
    without : paths of quantities that are left out
    stated : unit that the title states, and that heads leave out
    """

    title: str
    rows: Sequence[BaseModel]
    foot: BaseModel | None = None
    apart: int = 0
    first: str = ""
    beside: Sequence[Column] = ()
    without: Collection[str] = ()
    stated: str = ""

    def columns(self, most: int) -> list[Column]:
        """Return the columns of so many rows at most, and of the foot."""
        shown = [*self.rows[:most], *([] if self.foot is None else [self.foot])]
        columns = [
            Column(quantity.without_unit(self.stated), quantity.cells(path, shown))
            for path, quantity in quantities_of(type(self.rows[0])).items()
            if path not in self.without
            and (
                quantity.missing != MISSING or any(value_at(row, path) is not None for row in shown)
            )
        ]
        if self.foot is not None:
            columns[0].cells[-1] = "overall"
        if self.first:
            named = replace(columns[0].quantity, label=self.first)
            columns[0] = columns[0]._replace(quantity=named)
        return [*columns, *(Column(quantity, cells[:most]) for quantity, cells in self.beside)]


@dataclass(frozen=True, slots=True)
class Grid:
    """A table whose columns depend on the result: heads and rows of marked-up cells."""

    title: str
    heads: Sequence[str | Quantity]
    rows: Sequence[Sequence[str]]
    foot: None = None
    apart: int = 0

    def columns(self, most: int) -> list[Column]:
        """Return the columns of so many rows at most."""
        columns = zip(*self.rows[:most], strict=True)
        return [
            Column(Quantity(head) if isinstance(head, str) else head, list(cells))
            for head, cells in zip(self.heads, columns, strict=True)
        ]


Story = Iterable[str | Table | Grid]
"""Marked-up lines and tables; a table without rows is not shown."""


class Report:
    """Base class of what is reported: as JSON, by a story, and as rows of a data frame."""

    __slots__ = ()

    drawn_as: ClassVar[str] = ""
    """Kind of subject of its figures, as syncplan.plotting.figure_table has them."""

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        raise NotImplementedError

    def body(self) -> Story:
        """Yield its own lines and tables."""
        raise NotImplementedError

    def remarks(self) -> Sequence[str]:
        """Return the notes that its story ends with."""
        notes: list[str] = getattr(self, "notes", [])
        return notes

    def story(self) -> Story:
        """Yield the verdict, its own lines and tables, the findings and the notes."""
        verdict = getattr(self, "verdict", None)
        if verdict is not None:
            yield verdict.line
        yield from self.body()
        if verdict is not None:
            yield from verdict.finding_lines
        yield from (f"[yellow]note[/]: {plain(note)}" for note in self.remarks())

    def frame_rows(self) -> Iterator[Row]:
        """Yield its rows of a data frame."""
        raise NotImplementedError


_MARKS = re.compile(r"(?<!\\)\[([a-z ]+|/)\]")

FEW_NOTES = 3
"""Most notes that are not folded."""

MOST_ROWS = 100
"""Largest number of rows that a notebook shows; the data frame holds all."""


def html_of(story: Story) -> str:
    """Return a story as HTML: paragraphs and tables."""
    return "\n".join(
        f"<p>{marked(part)}</p>" if isinstance(part, str) else "".join(_table_lines(part))
        for part in story
        if isinstance(part, str) or part.rows
    )


def summary_of(report: Report) -> str:
    """Return as HTML what a result says, without its findings; many notes are folded."""
    verdict, notes = getattr(report, "verdict", None), report.remarks()
    lines = [] if verdict is None else [verdict.line]
    shown = "".join(f"<p>{escape(note[:1].upper() + note[1:])}.</p>" for note in notes)
    fold = "<details open>" if len(notes) <= FEW_NOTES else "<details>"
    folded = f"{fold}<summary>Notes on these figures</summary>{shown}</details>"
    return f"{html_of([*lines, *report.body()])}\n{folded if notes else ''}"


def _table_lines(table: Table | Grid) -> Iterator[str]:
    columns = table.columns(MOST_ROWS)
    heads = [f'<th scope="col">{escape(column.quantity.head)}</th>' for column in columns]
    title = f"<caption>{marked(table.title)}</caption>"
    yield f"<table>{title}<thead><tr>{''.join(heads)}</tr></thead><tbody>"
    for first, *rest in zip(*(column.cells for column in columns), strict=True):
        others = [f"<td>{marked(cell)}</td>" for cell in rest]
        yield f'<tr><th scope="row">{marked(first)}</th>{"".join(others)}</tr>'
    yield "</tbody></table>"
    if len(table.rows) > MOST_ROWS:
        yield f"<p>{len(table.rows) - MOST_ROWS} more rows: to_dataframe() holds all</p>"


def marked(text: str) -> str:
    """Return marked-up text as HTML: marks become classes."""
    shown = _MARKS.sub(
        lambda mark: "</span>" if mark[1] == "/" else f'<span class="{mark[1]}">',
        escape(text),
    )
    return shown.replace("\\[", "[")


def flat(values: Mapping[str, Any]) -> Row:
    """Return plain values alone; a point [x, y] becomes two columns, `center_x_m` and so on."""
    row: Row = {}
    for key, value in values.items():
        if isinstance(value, tuple) and len(value) == 2 and not isinstance(value[0], str):
            stem, _, unit = key.rpartition("_")
            row.update({f"{stem}_x_{unit}": value[0], f"{stem}_y_{unit}": value[1]})
        elif not isinstance(value, list | tuple | dict):
            row[key] = value
    return row
