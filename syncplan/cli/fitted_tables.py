"""Stories at a terminal: narrow tables leave out whole columns, and never part of a number."""

from collections.abc import Iterator, Sequence

from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.table import Table
from rich.text import Text

from syncplan.results import stories
from syncplan.results.quantities import Quantity

_BETWEEN = 3
"""Width of the gap between two columns, drawn by box.SIMPLE_HEAD."""

MOST_ROWS = 40
"""Most rows shown; the rest are counted."""

_EDGES = 2
_FEWEST_COLUMNS = 2
_LEAST_NAME = 6


def show_story(story: stories.Story, console: Console) -> None:
    """Print the lines and tables of a story."""
    for part in story:
        if isinstance(part, str):
            console.print(part)
        elif part.rows:
            console.print(FittedTable(part))


class FittedTable:
    """A table whose first column is text, and whose other columns go where they have no room.

    The first column and one more always stay.
    """

    def __init__(self, table: stories.Table | stories.Grid) -> None:
        self._table = table
        self.columns = table.columns(MOST_ROWS)
        self._widths = [_width(*column) for column in self.columns]

    def shown_columns(self, width: int) -> list[int]:
        """Return the positions of the columns that fit into `width`."""
        shown = list(range(len(self.columns)))
        # those that go first, and then from the right
        order = sorted(shown, key=lambda k: (self.columns[k].quantity.drop or 99, -k))
        for k in order:
            if self._total(shown) <= width or len(shown) <= _FEWEST_COLUMNS:
                break
            if k:
                shown.remove(k)
        return shown

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Table | Text]:
        """Yield the table at the available width, and lines on what it leaves out."""
        shown = self.shown_columns(options.max_width)
        # a name too long for the rest is folded
        rest = options.max_width - self._total(shown[1:]) - _BETWEEN
        widths = [min(self._widths[0], max(rest, _LEAST_NAME)), *self._widths[1:]]
        title = self._table.title
        made = Table(title=title, box=box.SIMPLE_HEAD, title_justify="left", pad_edge=False)
        for k in shown:
            quantity = self.columns[k].quantity
            made.add_column(
                quantity.head,
                justify="left" if k == 0 or quantity.text or quantity.folds else "right",
                overflow="fold",
                min_width=widths[k],
                max_width=None if quantity.folds else widths[k],
            )
        rows = list(zip(*(self.columns[k].cells for k in shown), strict=True))
        apart = len(rows) - 1 if self._table.foot is not None else self._table.apart
        for number, cells in enumerate(rows, start=1):
            made.add_row(*cells, end_section=number == apart)
        yield made
        if (hidden := len(self._table.rows) - MOST_ROWS) > 0:
            yield Text(f"... and {hidden} more rows (see the JSON)")
        left = [column.quantity.head for k, column in enumerate(self.columns) if k not in shown]
        if left:
            yield Text(f"not shown at this width: {', '.join(left)}")

    def _total(self, shown: Sequence[int]) -> int:
        return sum(self._widths[k] for k in shown) + _BETWEEN * (len(shown) - 1) + _EDGES


def _width(quantity: Quantity, cells: Sequence[str]) -> int:
    """Width that a column needs: to avoid line breaks or, if it folds, breaks within words."""
    texts = [quantity.head, *(Text.from_markup(cell).plain for cell in cells)]
    if quantity.folds:
        texts = " ".join(texts).split()
    return max(map(cell_len, texts))
