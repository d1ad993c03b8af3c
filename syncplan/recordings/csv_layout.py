"""Recordings in a folder of CSV files, whose first lines name the columns.

    odometry.csv    robot, time_s, speed_mps, turn_rate_rad_s
    sightings.csv   robot, time_s, target, bearing_rad, range_m   either of the last two, or both
    landmarks.csv   name, x_m, y_m
    truth.csv       robot, time_s, x_m, y_m, heading_rad          where robots truly were; optional

Columns come in any order; rows of one robot are in order of time. An empty number, or nan, means
not recorded. A target that is empty, or neither another robot nor a landmark, was not recognised.
"""

import csv
import itertools
from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.errors import InputError
from syncplan.recordings.log import NOBODY, Log, NamedTeam, SeenBodies, landmark_problem
from syncplan.recordings.recorded_files import LARGEST_VALUE, check_file, name_problem

if TYPE_CHECKING:
    from _csv import Reader


ROWS_AT_ONCE = 2_000
"""Rows held as text at one time: few enough for the processor's cache."""

LONGEST_SHOWN = 60
"""Most characters of a cell in a message."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column: whether it holds names, may have empty cells, and may be left out."""

    name: str
    named: bool = False
    gaps: bool = False
    optional: bool = False


@dataclass(frozen=True, slots=True)
class NamedCells:
    """A column of names: each name once, (k,) indices into them; an empty cell has the name ""."""

    names: tuple[str, ...]
    places: Index

    def numbers(self, by_name: dict[str, int], otherwise: int) -> Index:
        """Return the (k,) number of each cell's name, `otherwise` for names without one."""
        table = [by_name.get(name, otherwise) for name in self.names]
        return np.array([*table, otherwise], dtype=np.int64)[self.places]


@dataclass(frozen=True, slots=True)
class CsvTable:
    """Content of a file: k rows below its header.

    Attributes
    ----------
    path, header : path of the file; its columns in order
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
    """A column of numbers under construction."""

    def __init__(self, column: Column) -> None:
        # the faster conversion first
        self._ways = (float, _number_or_none) if column.gaps else (float,)
        self._parts: list[Array] = []

    def add(self, cells: Sequence[str]) -> int | None:
        """Append cells; return the index of the first that is not a number, None if all are."""
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
    """A column of names under construction."""

    def __init__(self) -> None:
        self._places: defaultdict[str, int] = defaultdict(itertools.count().__next__)
        self._parts: list[Index] = []

    def add(self, cells: Sequence[str]) -> None:
        """Append cells."""
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

    Raises InputError naming the file, and the line, column and cell at fault.
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
    """Rows of a file, whose faults raise InputError."""
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
    """Columns named by the first line; raises InputError unless they are those of the file."""
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
    """Raise InputError for the first cell with a value that its column can't hold."""
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


# --- the files of a recording -------------------------------------------------------------------


_ROBOT, _TIME = Column("robot", named=True), Column("time_s")


def _readings(*names: str, optional: bool = False) -> Iterable[Column]:
    return (Column(name, gaps=True, optional=optional) for name in names)


FILES: Mapping[str, tuple[Column, ...]] = MappingProxyType(
    {
        "odometry.csv": (_ROBOT, _TIME, *_readings("speed_mps", "turn_rate_rad_s")),
        "sightings.csv": (
            _ROBOT,
            _TIME,
            Column("target", named=True, gaps=True),
            *_readings("bearing_rad", "range_m", optional=True),
        ),
        "landmarks.csv": (Column("name", named=True), Column("x_m"), Column("y_m")),
        "truth.csv": (_ROBOT, _TIME, *_readings("x_m", "y_m", "heading_rad")),
    }
)
"""Files of the layout and their columns; truth.csv may be left out."""


UNKNOWN = -2
"""Number of a name that no robot or landmark has."""


def holds_csv(path: Path) -> bool:
    """Return whether a folder holds a file of this layout; raises OSError if it can't be read."""
    return path.is_dir() and any(one.name in FILES for one in path.iterdir())


def read_csv(folder: Path) -> Log:
    """Return the recording in a folder.

    Raises InputError naming the file, and the line, column and cell at fault.
    """
    odometry = _table(folder, "odometry.csv")
    read = _by_robot(odometry, "time_s", "speed_mps", "turn_rate_rad_s")
    if not read:
        raise InputError("holds no rows below its first line", source=str(odometry.path))
    team = NamedTeam.of(read, _landmarks(_table(folder, "landmarks.csv"), read), str(folder))
    sightings = _table(folder, "sightings.csv")
    seen, targets = _seen(sightings, team), sightings.names["target"]
    truth: dict[str, Array] = {}
    if (folder / "truth.csv").exists():
        known = _table(folder, "truth.csv")
        _check_robots(known, team)
        truth = _by_robot(known, "time_s", "x_m", "y_m", "heading_rad")
        for robot in team.robots:
            if robot not in truth:
                problem = f"holds no rows of robot {robot!r}; add them, or remove the file"
                raise InputError(problem, source=str(known.path))
    counts = np.bincount(targets.places, minlength=len(targets.names)).tolist()
    notes = team.notes_on(dict(zip(targets.names, counts, strict=True)))
    return team.log(folder.resolve().name, read, seen, truth, notes)


def _table(folder: Path, name: str) -> CsvTable:
    return read_table(folder / name, FILES[name])


def _landmarks(table: CsvTable, robots: Container[str]) -> dict[str, tuple[float, float]]:
    """Positions by name."""
    cells = table.names["name"]
    for row, place in enumerate(cells.places.tolist()):
        # names are numbered as they first occur
        problem = "it is there twice" if place < row else ""
        problem = problem or landmark_problem(cells.names[place], robots)
        if problem:
            raise table.fault(row, "name", problem)
    places = zip(table.numbers["x_m"].tolist(), table.numbers["y_m"].tolist(), strict=True)
    return dict(zip(cells.names, places, strict=True))


def _by_robot(table: CsvTable, *columns: str) -> dict[str, Array]:
    """Columns of numbers of each robot, the time first."""
    rows = _rows_by_robot(table)
    return {robot: table.stacked(*columns)[places] for robot, places in rows.items()}


def _rows_by_robot(table: CsvTable) -> dict[str, Index]:
    """Indices of each robot's rows; raises InputError if its time decreases."""
    cells, times = table.names["robot"], table.numbers["time_s"]
    order = np.argsort(cells.places, kind="stable")
    ends = np.searchsorted(cells.places[order], np.arange(1, len(cells.names)))
    by_robot = dict(zip(cells.names, np.split(order, ends), strict=True)) if len(order) else {}
    back = [
        int(places[1 + np.argmax(late)])
        for places in by_robot.values()
        if (late := np.diff(times[places]) < 0.0).any()
    ]
    if back:
        problem = "the row before of this robot is later; sort the rows by time"
        raise table.fault(min(back), "time_s", problem)
    return by_robot


def _seen(table: CsvTable, team: NamedTeam) -> dict[str, SeenBodies]:
    """Sightings of each robot."""
    if not {"bearing_rad", "range_m"} & set(table.header):
        problem = "line 1: names neither bearing_rad nor range_m; at least one is needed"
        raise InputError(problem, source=str(table.path))
    _check_robots(table, team)
    times, not_recorded = table.numbers["time_s"], np.full(table.count, np.nan)
    observers = table.names["robot"].numbers(team.subjects, UNKNOWN)
    subjects = table.names["target"].numbers(team.subjects, NOBODY)
    # no robot sees itself: such a target was misread
    subjects = np.where(subjects == observers, NOBODY, subjects)
    bearings, ranges = (table.numbers.get(one, not_recorded) for one in ("bearing_rad", "range_m"))
    _refuse(ranges < 0.0, table, "range_m", "allowed is 0 or more")
    return {
        robot: SeenBodies(times[rows], subjects[rows], bearings[rows], ranges[rows])
        for robot, rows in _rows_by_robot(table).items()
    }


def _check_robots(table: CsvTable, team: NamedTeam) -> None:
    robots = dict.fromkeys(team.robots, 1)
    numbers = table.names["robot"].numbers(robots, UNKNOWN)
    _refuse(numbers == UNKNOWN, table, "robot", "it has no rows in odometry.csv")


def _refuse(wrong: Flags, table: CsvTable, column: str, problem: str) -> None:
    if wrong.any():
        raise table.fault(int(wrong.argmax()), column, problem)
