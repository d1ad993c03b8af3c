"""Recordings as a folder of CSV files, whose first lines name their columns.

    odometry.csv    robot, time_s, speed_mps, turn_rate_rad_s
    sightings.csv   robot, time_s, target, bearing_rad, range_m   either of the last two, or both
    landmarks.csv   name, x_m, y_m
    truth.csv       robot, time_s, x_m, y_m, heading_rad          where robots truly were; optional

Columns come in any order; rows of one robot are in order of time. An empty bearing_rad or range_m
was not recorded, an empty target was not recognised.
"""

from collections.abc import Container, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from syncplan.arrays import Array, Flags, Index
from syncplan.errors import InputError
from syncplan.recordings.csv_tables import Column, CsvTable, read_table
from syncplan.recordings.log import NOBODY, Log
from syncplan.recordings.named_teams import NamedTeam, SeenBodies, landmark_problem

_ROBOT = Column("robot", named=True)
_TIME = Column("time_s")

FILES: Mapping[str, tuple[Column, ...]] = MappingProxyType(
    {
        "odometry.csv": (_ROBOT, _TIME, Column("speed_mps"), Column("turn_rate_rad_s")),
        "sightings.csv": (
            _ROBOT,
            _TIME,
            Column("target", named=True, gaps=True),
            Column("bearing_rad", gaps=True, optional=True),
            Column("range_m", gaps=True, optional=True),
        ),
        "landmarks.csv": (Column("name", named=True), Column("x_m"), Column("y_m")),
        "truth.csv": (_ROBOT, _TIME, Column("x_m"), Column("y_m"), Column("heading_rad")),
    }
)
"""Files of the layout and their columns; truth.csv may be left out."""


UNKNOWN = -2
"""Number of a name that nobody has."""

NAMED_ELSEWHERE = (
    "name it in odometry.csv or landmarks.csv, or leave the cell empty where nobody knows it"
)


def holds_csv(path: Path) -> bool:
    """Return whether a folder holds a file of this layout; raises OSError if it can't be read."""
    return path.is_dir() and any(one.name in FILES for one in path.iterdir())


def read_csv(folder: Path) -> Log:
    """Return the recording in a folder.

    Raises InputError naming the file, and the line, column and cell that are at fault.
    """
    odometry = _table(folder, "odometry.csv")
    read = _by_robot(odometry, "time_s", "speed_mps", "turn_rate_rad_s")
    if not read:
        raise InputError("holds no rows below its first line", source=str(odometry.path))
    team = NamedTeam.of(read, _landmarks(_table(folder, "landmarks.csv"), read), str(folder))
    seen = _seen(_table(folder, "sightings.csv"), team)
    truth: dict[str, Array] = {}
    if (folder / "truth.csv").exists():
        known = _table(folder, "truth.csv")
        _check_robots(known, team)
        truth = _by_robot(known, "time_s", "x_m", "y_m", "heading_rad")
        for robot in team.robots:
            if robot not in truth:
                problem = f"holds no rows of robot {robot!r}; add them, or remove the file"
                raise InputError(problem, source=str(known.path))
    return team.log(folder.resolve().name, read, seen, truth)


def _table(folder: Path, name: str) -> CsvTable:
    return read_table(folder / name, FILES[name])


def _landmarks(table: CsvTable, robots: Container[str]) -> dict[str, tuple[float, float]]:
    """Places by name."""
    cells = table.names["name"]
    for row, place in enumerate(cells.places.tolist()):
        # places count names as they first occur
        problem = "it is there twice" if place < row else ""
        problem = problem or landmark_problem(cells.names[place], robots)
        if problem:
            raise table.fault(row, "name", problem)
    places = zip(table.numbers["x_m"].tolist(), table.numbers["y_m"].tolist(), strict=True)
    return dict(zip(cells.names, places, strict=True))


def _by_robot(table: CsvTable, *columns: str) -> dict[str, Array]:
    """Columns of numbers, the time first, of each robot's rows."""
    rows = _rows_by_robot(table)
    return {robot: table.stacked(*columns)[places] for robot, places in rows.items()}


def _rows_by_robot(table: CsvTable) -> dict[str, Index]:
    """Places of each robot's rows; raises InputError where its time goes back."""
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
    """What each robot saw."""
    recorded = [name for name in ("bearing_rad", "range_m") if name in table.header]
    if not recorded:
        problem = "line 1: names neither bearing_rad nor range_m; at least one is needed"
        raise InputError(problem, source=str(table.path))
    _check_robots(table, team)
    times, not_recorded = table.numbers["time_s"], np.full(table.count, np.nan)
    observers = table.names["robot"].numbers(team.subjects, UNKNOWN)
    subjects = table.names["target"].numbers({**team.subjects, "": NOBODY}, UNKNOWN)
    bearings, ranges = (table.numbers.get(one, not_recorded) for one in ("bearing_rad", "range_m"))
    for wrong, column, problem in (
        (subjects == UNKNOWN, "target", f"it is no robot and no landmark; {NAMED_ELSEWHERE}"),
        (subjects == observers, "target", "no robot sees itself"),
        (ranges < 0.0, "range_m", "allowed is 0 or more"),
        (np.isnan(bearings) & np.isnan(ranges), recorded[0], f"needed is {' or '.join(recorded)}"),
    ):
        _refuse(wrong, table, column, problem)
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
