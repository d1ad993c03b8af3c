"""Recordings of a team of ground robots, in the file format of the UTIAS MRCLAM data sets.

A folder holds text files with columns of numbers and comments after "#". Times are in s by one
clock common to all files and never decrease; angles are in rad:

    Barcodes.dat               subject, barcode        the number a camera reads off a subject
    Landmark_Groundtruth.dat   subject, x, y           m; further columns are not read
    Robot1_Groundtruth.dat     time, x, y, heading     m, rad: where the robot truly was; optional
    Robot1_Odometry.dat        time, speed, turn rate  m/s, rad/s
    Robot1_Measurement.dat     time, barcode, range, bearing   m, rad from the robot's heading

Each robot has the last three files, or none has Groundtruth; its number is its subject's.

Source: Leung, Halpern, Barfoot, Liu, "The UTIAS multi-robot cooperative localization and mapping
dataset", International Journal of Robotics Research 30(8):969-974, 2011.
"""

import re
import warnings
from pathlib import Path

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.recordings.log import NOBODY, Log, RobotLog
from syncplan.recordings.recorded_files import LARGEST_VALUE, MOST_ROBOTS, check_file

_OF_ROBOT = re.compile(r"Robot([1-9][0-9]{0,5})_(?:Groundtruth|Odometry|Measurement)\.dat")


def holds_mrclam(path: Path) -> bool:
    """Return whether a folder holds a file of this layout; raises OSError if it can't be read."""
    return path.is_dir() and any(
        one.name == "Barcodes.dat" or _OF_ROBOT.fullmatch(one.name) for one in path.iterdir()
    )


def read_mrclam(folder: Path) -> Log:
    """Return the recording in a folder; raises InputError naming file, line and fault."""
    numbers = _robots_in(folder)
    landmark_subjects, landmarks = _landmarks(folder / "Landmark_Groundtruth.dat", numbers)
    carried = _barcodes(folder / "Barcodes.dat", {*numbers, *landmark_subjects.tolist()})
    has_truth = _has_truth(folder, numbers)
    robots = tuple(_robot(folder, number, carried, has_truth=has_truth) for number in numbers)
    return Log(
        name=folder.resolve().name,
        robots=robots,
        landmark_names=tuple(landmark_subjects.tolist()),
        landmark_subjects=landmark_subjects,
        landmarks=landmarks,
    )


def _robots_in(folder: Path) -> list[int]:
    found = [_OF_ROBOT.fullmatch(path.name) for path in folder.iterdir()]
    numbers = sorted({int(match[1]) for match in found if match})
    if not numbers:
        raise InputError("holds no Robot1_Odometry.dat", source=str(folder))
    if len(numbers) > MOST_ROBOTS:
        problem = f"holds {len(numbers)} robots, more than {MOST_ROBOTS}"
        raise InputError(problem, source=str(folder))
    return numbers


def _landmarks(path: Path, robots: list[int]) -> tuple[Index, Array]:
    table = _table(path, "subject, x, y", whole=(0,))
    subjects = table[:, 0].astype(np.int64)
    for subject in subjects.tolist():
        if subject < 1:
            raise InputError(f"subject {subject} is below 1", source=str(path))
        if subject in robots:
            raise InputError(f"subject {subject} is a robot as well", source=str(path))
    _refuse_twice(subjects, "subject", path)
    return subjects, np.ascontiguousarray(table[:, 1:3])


def _barcodes(path: Path, known: set[int]) -> dict[int, int]:
    """Subjects by barcode."""
    table = _table(path, "subject, barcode", whole=(0, 1)).astype(np.int64)
    _refuse_twice(table[:, 1], "barcode", path)
    for subject in table[:, 0].tolist():
        if subject not in known:
            raise InputError(
                f"subject {subject} has neither files such as Robot{subject}_Odometry.dat nor a "
                "place in Landmark_Groundtruth.dat; remove its line, or add what is missing",
                source=str(path),
            )
    return {barcode: subject for subject, barcode in table.tolist()}


def _has_truth(folder: Path, numbers: list[int]) -> bool:
    """Return whether robots have truth; raises InputError if only some of them have it."""
    paths = [folder / f"Robot{number}_Groundtruth.dat" for number in numbers]
    missing = [path for path in paths if not path.exists()]
    if 0 < len(missing) < len(paths):
        problem = "is missing, but others have truth; add it, or remove theirs"
        raise InputError(problem, source=str(missing[0]))
    return not missing


def _robot(folder: Path, number: int, carried: dict[int, int], *, has_truth: bool) -> RobotLog:
    truth = np.zeros((0, 4))
    odometry = _table(
        folder / f"Robot{number}_Odometry.dat", "time, speed, turn rate", ordered=True
    )
    tables = [(odometry, "Odometry")]
    if has_truth:
        path = folder / f"Robot{number}_Groundtruth.dat"
        truth = _table(path, "time, x, y, heading", ordered=True)
        tables.insert(0, (truth, "Groundtruth"))
    path = folder / f"Robot{number}_Measurement.dat"
    seen = _table(path, "time, barcode, range, bearing", whole=(1,), ordered=True)
    for table, kind in tables:
        if not len(table):
            source = str(folder / f"Robot{number}_{kind}.dat")
            raise InputError("holds no rows of numbers", source=source)
    # no robot sees itself: such a barcode was misread
    others = {code: subject for code, subject in carried.items() if subject != number}
    subjects = [others.get(code, NOBODY) for code in seen[:, 1].astype(np.int64).tolist()]
    return RobotLog(
        name=f"robot{number}",
        subject=number,
        truth=truth,
        odometry=odometry,
        times=np.ascontiguousarray(seen[:, 0]),
        subjects=np.array(subjects, dtype=np.int64),
        bearings=np.ascontiguousarray(seen[:, 3]),
        ranges=np.ascontiguousarray(seen[:, 2]),
    )


def _table(
    path: Path, columns: str, *, whole: tuple[int, ...] = (), ordered: bool = False
) -> Array:
    """(k, c) named columns of a file; `whole` ones hold integers, `ordered` rows are by time."""
    names = columns.split(", ")
    # readings may lack numbers, and do not count then
    needed = 1 if ordered else len(names)
    check_file(path)
    try:
        with warnings.catch_warnings():
            # a file of measurements may hold no rows
            warnings.simplefilter("ignore", UserWarning)
            values = np.loadtxt(
                path, comments="#", usecols=range(len(names)), ndmin=2, encoding="utf-8-sig"
            )
    except UnicodeDecodeError:
        raise InputError("is not a text file", source=str(path)) from None
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror}", source=str(path)) from None
    except ValueError:
        raise _no_number(path, names) from None
    faults = [
        (~np.isfinite(values[:, :needed]).all(axis=1), "holds a value that is not finite"),
        (np.isinf(values).any(axis=1), "holds a value that is not finite"),
        *((values[:, c] != np.rint(values[:, c]), f"{names[c]} is not whole") for c in whole),
        ((np.abs(values) > LARGEST_VALUE).any(axis=1), f"holds a value over {LARGEST_VALUE:g}"),
    ]
    if ordered:
        back = np.diff(values[:, 0], prepend=-np.inf) < 0.0
        faults.append((back, "its time is before that of the line above"))
    for wrong, problem in faults:
        if wrong.any():
            number, row = _rows(path)[int(wrong.argmax())]
            raise InputError(f"line {number}, {' '.join(row)!r}: {problem}", source=str(path))
    return values


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Rows of words with their line numbers, without comments."""
    lines = path.read_text("utf-8-sig").splitlines()
    rows = [(number, line.split("#")[0].split()) for number, line in enumerate(lines, 1)]
    return [(number, row) for number, row in rows if row]


def _no_number(path: Path, names: list[str]) -> InputError:
    """Error of the first line that lacks numbers in the named columns."""
    for number, row in _rows(path):
        if len(row) < len(names):
            there = "1 column" if len(row) == 1 else f"{len(row)} columns"
            problem = (
                f"line {number} has {there}; needed are {', '.join(names)}, with spaces or tabs "
                "between"
            )
            return InputError(problem, source=str(path))
        for name, text in zip(names, row, strict=False):
            try:
                float(text)
            except ValueError:
                problem = f"line {number}: {name} is {text[:60]!r}; a number is needed"
                return InputError(problem, source=str(path))
    return InputError("holds something other than numbers", source=str(path))


def _refuse_twice(values: Index, what: str, path: Path) -> None:
    found, count = np.unique(values, return_counts=True)
    if (count > 1).any():
        raise InputError(f"{what} {found[count > 1][0]} appears twice", source=str(path))
