"""CSV files whose first line names the columns, read into numbers and names."""

import csv
import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.recordings.recorded_files import LARGEST_VALUE, check_file, name_problem

if TYPE_CHECKING:
    from _csv import Reader

ROWS_AT_ONCE = 2_000
"""Rows whose cells are held as text at one time: few enough for the processor's cache."""

LONGEST_SHOWN = 60
"""Characters of a cell in a message."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column: whether it holds names, may have empty cells, and may be left out."""

    name: str
    named: bool = False
    gaps: bool = False
    optional: bool = False


@dataclass(frozen=True, slots=True)
class NamedCells:
    """A column of names: (k,) places among the names that occur; an empty cell has the name ""."""

    names: tuple[str, ...]
    places: Index

    def numbers(self, by_name: dict[str, int], otherwise: int) -> Index:
        """Return (k,) the number of each cell's name, `otherwise` where it has none."""
        table = [by_name.get(name, otherwise) for name in self.names]
        return np.array([*table, otherwise], dtype=np.int64)[self.places]


@dataclass(frozen=True, slots=True)
class CsvTable:
    """What a file holds: k rows below its header.

    Attributes
    ----------
    path, header : of the file; its columns in its order
    names : columns of names
    numbers : columns of numbers (k,), NaN in empty cells
    """

    path: Path
    header: tuple[str, ...]
    names: dict[str, NamedCells]
    numbers: dict[str, Array]

    @property
    def count(self) -> int:
        """Number of rows."""
        columns = [*(one.places for one in self.names.values()), *self.numbers.values()]
        return len(columns[0])

    def stacked(self, *names: str) -> Array:
        """Return columns of numbers side by side, (k, c)."""
        return np.column_stack([self.numbers[name] for name in names])

    def fault(self, row: int, column: str, problem: str) -> InputError:
        """Return the error of a cell, with its line and text."""
        line, cells = _line_of(self.path, row)
        text = cells[self.header.index(column)].strip()[:LONGEST_SHOWN]
        return InputError(f"line {line}: {column} is {text!r}; {problem}", source=str(self.path))


class _Numbers:
    """A column of numbers on its way."""

    def __init__(self, column: Column) -> None:
        # the faster first
        self._ways = (float, _number_or_none) if column.gaps else (float,)
        self._parts: list[Array] = []

    def add(self, cells: Sequence[str]) -> int | None:
        """Take cells in; return the place of the first that is no number."""
        for number in self._ways:
            with suppress(ValueError):
                self._parts.append(np.fromiter(map(number, cells), np.float64, len(cells)))
                return None
        return next(place for place, cell in enumerate(cells) if not self._takes(cell))

    def whole(self) -> Array:
        """All numbers so far."""
        return np.concatenate([np.zeros(0), *self._parts])

    def _takes(self, cell: str) -> bool:
        try:
            self._ways[-1](cell)
        except ValueError:
            return False
        return True


class _Names:
    """A column of names on its way."""

    def __init__(self) -> None:
        self._places: defaultdict[str, int] = defaultdict(itertools.count().__next__)
        self._parts: list[Index] = []

    def add(self, cells: Sequence[str]) -> None:
        """Take cells in."""
        self._parts.append(np.fromiter(map(self._places.__getitem__, cells), np.int64, len(cells)))

    def whole(self) -> NamedCells:
        """All names so far, without the spaces around them."""
        numbers: defaultdict[str, int] = defaultdict(itertools.count().__next__)
        renumbered = np.array([numbers[cell.strip()] for cell in self._places], np.int64)
        places = np.concatenate([np.zeros(0, np.int64), *self._parts])
        return NamedCells(tuple(numbers), renumbered[places])


def _number_or_none(cell: str) -> float:
    return float(cell.strip() or "nan")


def read_table(path: Path, columns: Sequence[Column]) -> CsvTable:
    """Return the columns of a file, which may come in any order.

    Raises InputError naming the file, and the line, column and cell that are at fault.
    """
    check_file(path, missing=f"is missing; its first line names the columns {_listed(columns)}")
    with _rows_of(path) as rows:
        header = _header(next(rows, []), columns, path)
        named = {one.name: _Names() for one in columns if one.named and one.name in header}
        numbers = {
            one.name: _Numbers(one) for one in columns if not one.named and one.name in header
        }
        before = 0
        while chunk := list(itertools.islice(filter(None, rows), ROWS_AT_ONCE)):
            _check_widths(chunk, before, header, path)
            for name, cells in zip(header, zip(*chunk, strict=True), strict=True):
                wrong = (named.get(name) or numbers[name]).add(cells)
                if wrong is not None:
                    seen = CsvTable(path, header, {}, {})
                    raise seen.fault(before + wrong, name, "a number is needed")
            before += len(chunk)
    table = CsvTable(
        path=path,
        header=header,
        names={name: one.whole() for name, one in named.items()},
        numbers={name: one.whole() for name, one in numbers.items()},
    )
    for column in columns:
        if column.name in header:
            _check_cells(table, column)
    return table


@contextmanager
def _rows_of(path: Path) -> Iterator["Reader"]:
    """The rows of a file, whose faults raise InputError."""
    rows = None
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            rows = csv.reader(stream, strict=True)
            yield rows
    except UnicodeDecodeError:
        raise InputError("is not a text file in UTF-8", source=str(path)) from None
    except csv.Error as error:
        line = rows.line_num if rows else 1
        raise InputError(f"line {line}: {error}", source=str(path)) from None
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror}", source=str(path)) from None


def _line_of(path: Path, row: int) -> tuple[int, list[str]]:
    """The line, counted from 1, on which a row below the header ends, and its cells."""
    with _rows_of(path) as rows:
        next(rows)
        cells = next(itertools.islice(filter(None, rows), row, None))
        return rows.line_num, cells


def _header(cells: list[str], columns: Sequence[Column], path: Path) -> tuple[str, ...]:
    """The columns that the first line names."""
    header = tuple(cell.strip() for cell in cells)
    known = {column.name: column for column in columns}
    wanted = f"the columns are {_listed(columns)}"
    needed = [name for name, column in known.items() if not column.optional]
    unknown = [name for name in header if name not in known]
    missing = [name for name in needed if name not in header]
    problem = ""
    if len(header) < 2:
        problem = f"line 1 must name columns, with commas between; {wanted}"
    elif unknown:
        problem = f"line 1: no column is named {unknown[0][:LONGEST_SHOWN]!r}; {wanted}"
    elif missing:
        problem = f"line 1: column {missing[0]} is missing; {wanted}"
    elif len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        problem = f"line 1: column {twice} is there twice"
    if problem:
        raise InputError(problem, source=str(path))
    return header


def _listed(columns: Sequence[Column]) -> str:
    return ", ".join(f"{one.name} (optional)" if one.optional else one.name for one in columns)


def _check_widths(rows: list[list[str]], before: int, header: tuple[str, ...], path: Path) -> None:
    """Raise InputError if a row has more or fewer cells than the header."""
    if {len(row) for row in rows} != {len(header)}:
        wrong = next(place for place, row in enumerate(rows) if len(row) != len(header))
        line, cells = _line_of(path, before + wrong)
        problem = f"line {line} has {len(cells)} cells; line 1 names {len(header)} columns"
        raise InputError(problem, source=str(path))


def _check_cells(table: CsvTable, column: Column) -> None:
    """Raise InputError for the first cell that can't be what its column holds."""
    if column.named:
        cells = table.names[column.name]
        for place, name in enumerate(cells.names):
            problem = "" if column.gaps and not name else name_problem(name)
            if problem:
                row = int(np.argmax(cells.places == place))
                raise table.fault(row, column.name, problem)
        return
    values = table.numbers[column.name]
    unread = np.isinf(values) if column.gaps else ~np.isfinite(values)
    for wrong, problem in (
        (unread, "a finite number is needed"),
        (np.abs(values) > LARGEST_VALUE, f"allowed is up to {LARGEST_VALUE:g} either way"),
    ):
        if wrong.any():
            raise table.fault(int(wrong.argmax()), column.name, problem)
