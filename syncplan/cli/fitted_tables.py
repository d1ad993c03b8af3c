"""Tables that leave out whole columns on a narrow terminal, and never part of a number."""

from collections.abc import Iterator, Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.table import Table
from rich.text import Text

_BETWEEN = 3
"""Width of the gap between two columns, drawn by box.SIMPLE_HEAD."""

MOST_ROWS = 40
"""Most rows shown; the rest are counted."""

_EDGES = 2
_FEWEST_COLUMNS = 2
_LEAST_NAME = 6


def cell(value: float | None, form: str = ".3g") -> str:
    """Return a number as a cell of a table, a dash if there is none."""
    return "-" if value is None else format(value, form)


class FittedTable:
    """A table whose first column is text and whose others are numbers.

    Parameters
    ----------
    title : title above the table
    columns : heads of the columns; each row has one cell a column
    goes : heads of the columns to leave out first if the width is too small, in that order; then
        others go from the right. The first column and one more always stay
    texts : heads of further columns of text
    """

    def __init__(
        self,
        title: str,
        columns: Sequence[str],
        *,
        goes: Sequence[str] = (),
        texts: Sequence[str] = (),
    ) -> None:
        self.title = title
        self.columns = tuple(columns)
        self.texts = frozenset({self.columns[0], *texts})
        rest = [head for head in reversed(self.columns[1:]) if head not in goes]
        self._order = [*(head for head in goes if head in self.columns), *rest]
        self._rows: list[tuple[str, ...]] = []
        self._sections: set[int] = set()
        self._hidden = 0

    @property
    def row_count(self) -> int:
        """Number of rows."""
        return len(self._rows)

    def add_row(self, *cells: str) -> None:
        """Add a row of marked-up text."""
        self._rows.append(cells)

    def add_section(self) -> None:
        """Draw a line after the last row."""
        self._sections.add(len(self._rows) - 1)

    def count_hidden(self, rows: int) -> None:
        """State below the table that this many rows are not shown."""
        self._hidden = max(rows, 0)

    def shown_columns(self, width: int) -> list[int]:
        """Return the positions of the columns that fit into `width`."""
        widths = self._widths()
        shown = list(range(len(self.columns)))
        for head in self._order:
            if self._total(widths, shown) <= width or len(shown) <= _FEWEST_COLUMNS:
                break
            shown.remove(self.columns.index(head))
        return shown

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Table | Text]:
        """Yield the table at the available width, and lines on what it leaves out."""
        widths, width = self._widths(), options.max_width
        shown = self.shown_columns(width)
        # a name too long for the rest is folded
        spare = max(width - self._total(widths, shown[1:]) - _BETWEEN, _LEAST_NAME)
        table = Table(title=self.title, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
        for k in shown:
            least = widths[k] if k else min(widths[0], spare)
            table.add_column(
                self.columns[k],
                justify="left" if self.columns[k] in self.texts else "right",
                overflow="fold",
                min_width=least,
                max_width=least,
            )
        for k, cells in enumerate(self._rows):
            table.add_row(*(cells[j] for j in shown), end_section=k in self._sections)
        yield table
        if self._hidden:
            yield Text(f"... and {self._hidden} more rows (see the JSON)")
        left = [head for k, head in enumerate(self.columns) if k not in shown]
        if left:
            yield Text(f"not shown at this width: {', '.join(left)}")

    def _widths(self) -> list[int]:
        """Width that each column needs to avoid line breaks."""
        cells = [
            [self.columns[k], *(Text.from_markup(row[k]).plain for row in self._rows)]
            for k in range(len(self.columns))
        ]
        return [max(map(cell_len, column)) for column in cells]

    @staticmethod
    def _total(widths: Sequence[int], shown: Sequence[int]) -> int:
        return sum(widths[k] for k in shown) + _BETWEEN * (len(shown) - 1) + _EDGES
