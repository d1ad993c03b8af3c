"""Recordings of teams on circles, written as the files that `syncplan replay` reads."""

import io
import tarfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from syncplan.errors import InputError
from syncplan.orbits.circles import Orbits, heading, position
from syncplan.recordings.log import Log, RobotLog
from syncplan.recordings.recording_formats import load_log
from tests.tools.serving import ROOT

REAL = ROOT.parent / "shared" / "data" / "mrclam6.tar.xz"
"""The recording of real robots that some tests need, beside the checkout."""

CLOCK = 1_248_444_000.25
"""When recordings begin, in s since 1970."""

LANDMARKS = {8: (25.0, 22.0), 6: (75.0, -20.0), 7: (130.0, 22.0)}
BARCODE_OF_NOBODY = 99


@dataclass(frozen=True, slots=True)
class Recipe:
    """What is recorded.

    Attributes
    ----------
    duration, period : s, of the recording and between readings
    jitter : share of the period by which times of readings scatter
    speed_sigma, turn_rate_sigma, bearing_sigma : m/s, rad/s, rad, of the readings
    wild : share of the bearings that are anything
    nobody : number of readings of a barcode that nobody carries
    """

    duration: float = 40.0
    period: float = 0.05
    jitter: float = 0.0
    speed_sigma: float = 0.0
    turn_rate_sigma: float = 0.0
    bearing_sigma: float = 0.0
    wild: float = 0.0
    nobody: int = 0


def write_recording(folder: Path, recipe: Recipe, seed: int = 0) -> Path:
    """Write the recording of three robots among three landmarks; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    orbits = Orbits(
        centers=np.array([[0.0, 0.0], [55.0, 0.0], [110.0, 0.0]]),
        radii=np.array([20.0, 18.0, 20.0]),
        senses=np.array([1.0, 1.0, -1.0]),
        phases=np.array([0.3, 3.0, 1.0]),
        rate=0.4,
    )
    codes = {subject: 10 * subject + 3 for subject in (1, 2, 3, *LANDMARKS)}
    _write(folder / "Barcodes.dat", "Subject, Barcode", [[s, codes[s]] for s in codes])
    _write(
        folder / "Landmark_Groundtruth.dat",
        "Subject, x, y, x std-dev, y std-dev",
        [[s, *place, 0.0001, 0.0001] for s, place in LANDMARKS.items()],
    )
    for k in range(3):
        name = f"Robot{k + 1}"
        # not all begin and end together
        known = np.arange(recipe.period * k, recipe.duration + 0.01 * k + 1e-9, 0.01)
        poses = np.column_stack([position(orbits, known)[:, k], heading(orbits, known)[:, k]])
        poses[:, 2] = np.angle(np.exp(1j * poses[:, 2]))
        _write(folder / f"{name}_Groundtruth.dat", "Time, x, y, heading", _at(known, poses))
        read = _scattered(np.arange(0.0, recipe.duration + 1.0, recipe.period), recipe, rng)
        moved = np.column_stack(
            [
                orbits.speeds[k] + recipe.speed_sigma * rng.standard_normal(len(read)),
                orbits.turn_rates[k] + recipe.turn_rate_sigma * rng.standard_normal(len(read)),
            ]
        )
        _write(folder / f"{name}_Odometry.dat", "Time, speed, turn rate", _at(read, moved))
        seen = _scattered(np.arange(recipe.period, recipe.duration, recipe.period), recipe, rng)
        rows = _sightings(orbits, k, seen, codes, recipe, rng)
        _write(folder / f"{name}_Measurement.dat", "Time, Barcode, range, bearing", rows)
    return folder


def write_csv(log: Log, folder: Path) -> Path:
    """Write a recording as a folder of CSV files; return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    names = names_of(log)
    odometry, sightings, truth = [], [], []
    for robot in log.robots:
        odometry += [(robot.name, *row) for row in robot.odometry.tolist()]
        truth += [(robot.name, *row) for row in robot.truth.tolist()]
        for time, subject, *seen in zip(
            robot.times.tolist(),
            robot.subjects.tolist(),
            robot.bearings.tolist(),
            robot.ranges.tolist(),
            strict=True,
        ):
            cells = ["" if np.isnan(one) else one for one in seen]
            sightings.append((robot.name, time, names.get(subject, ""), *cells))
    landmarks = [
        (names[subject], *place)
        for subject, place in zip(log.landmark_subjects.tolist(), log.landmarks, strict=True)
    ]
    _write_rows(folder / "odometry.csv", "robot,time_s,speed_mps,turn_rate_rad_s", odometry)
    _write_rows(folder / "sightings.csv", "robot,time_s,target,bearing_rad,range_m", sightings)
    _write_rows(folder / "landmarks.csv", "name,x_m,y_m", landmarks)
    if truth:
        _write_rows(folder / "truth.csv", "robot,time_s,x_m,y_m,heading_rad", truth)
    return folder


def with_robots(log: Log, change: Callable[[RobotLog], RobotLog]) -> Log:
    """Return a recording whose robots are changed one by one."""
    return replace(log, robots=tuple(map(change, log.robots)))


def part_of(log: Log, begin: float, end: float) -> Log:
    """Return a recording from one share of the time that its truth covers to another."""
    first = max(robot.truth[0, 0] for robot in log.robots)
    last = min(robot.truth[-1, 0] for robot in log.robots)
    low, high = first + begin * (last - first), first + end * (last - first)

    def within(robot: RobotLog) -> RobotLog:
        seen = (robot.times >= low) & (robot.times <= high)
        return replace(
            robot,
            truth=_between(robot.truth, low, high),
            odometry=_between(robot.odometry, low, high),
            times=robot.times[seen],
            subjects=robot.subjects[seen],
            bearings=robot.bearings[seen],
            ranges=robot.ranges[seen],
        )

    return with_robots(log, within)


def _between(rows: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rows of times in between, and the one before them and after: values there are between."""
    begin, end = np.searchsorted(rows[:, 0], (low, high))
    return rows[max(begin - 1, 0) : end + 1]


def names_of(log: Log) -> dict[int, str]:
    """Return the names of robots and landmarks by number."""
    names = {robot.subject: robot.name for robot in log.robots}
    landmarks = zip(log.landmark_subjects.tolist(), map(str, log.landmark_names), strict=True)
    return names | dict(landmarks)


def refusal_of(path: Path) -> str:
    """Return the complaint with which a recording is refused."""
    with pytest.raises(InputError) as refusal:
        load_log(path)
    return str(refusal.value)


def assert_same(log: Log, other: Log) -> None:
    """Compare all that two recordings hold."""
    assert (log.name, log.landmark_names) == (other.name, other.landmark_names)
    np.testing.assert_array_equal(log.landmarks, other.landmarks)
    np.testing.assert_array_equal(log.landmark_subjects, other.landmark_subjects)
    for first, second in zip(log.robots, other.robots, strict=True):
        for field in fields(first):
            np.testing.assert_array_equal(
                getattr(first, field.name), getattr(second, field.name), strict=True
            )


def zipped(files: dict[str, bytes]) -> bytes:
    """Return a zip archive of files by name."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def tarred(files: dict[str, bytes], kind: str = "") -> bytes:
    """Return a tar archive of files by name, compressed by `kind`: gz, xz or bz2."""
    stream, mode = io.BytesIO(), f"w:{kind}"
    with tarfile.open(fileobj=stream, mode=cast(Any, mode)) as archive:
        for name, content in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    return stream.getvalue()


def _write_rows(path: Path, header: str, rows: list[tuple[object, ...]]) -> None:
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")


def _sightings(
    orbits: Orbits,
    observer: int,
    times: np.ndarray,
    codes: dict[int, int],
    recipe: Recipe,
    rng: np.random.Generator,
) -> list[list[float]]:
    where, facing = position(orbits, times), heading(orbits, times)[:, observer]
    places = {k + 1: where[:, k] for k in range(3) if k != observer}
    places |= {s: np.broadcast_to(place, (len(times), 2)) for s, place in LANDMARKS.items()}
    rows = []
    for subject, place in places.items():
        away = place - where[:, observer]
        reach = np.hypot(*away.T)
        bearings = np.arctan2(away[:, 1], away[:, 0]) - facing
        bearings += recipe.bearing_sigma * rng.standard_normal(len(times))
        wild = rng.random(len(times)) < recipe.wild
        bearings[wild] = rng.uniform(-np.pi, np.pi, wild.sum())
        bearings = np.angle(np.exp(1j * bearings))
        for i in np.flatnonzero(reach < 30.0):
            rows.append([CLOCK + times[i], codes[subject], reach[i], bearings[i]])
    for time in rng.uniform(0.0, recipe.duration, recipe.nobody):
        rows.append([CLOCK + time, BARCODE_OF_NOBODY, 1.0, 0.0])
    return sorted(rows)


def _scattered(times: np.ndarray, recipe: Recipe, rng: np.random.Generator) -> np.ndarray:
    if not recipe.jitter:
        return times
    return np.sort(times + recipe.jitter * recipe.period * rng.uniform(-0.5, 0.5, len(times)))


def _at(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([CLOCK + times, values])


def _write(path: Path, columns: str, rows: list[list[float]] | np.ndarray) -> None:
    lines = ["# a recording of circles", f"# {columns}"]
    lines += ["\t".join(f"{value:.9f}".rstrip("0").rstrip(".") for value in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
