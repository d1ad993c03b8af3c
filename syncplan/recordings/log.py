"""Content of a recording in any layout, its overview and its bytes; named robots and landmarks."""

import io
import json
import re
from collections import Counter
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np

from syncplan.arrays import Array, Index
from syncplan.errors import InputError
from syncplan.phrases import listed
from syncplan.recordings.recorded_files import MOST_ROBOTS, name_problem

NOBODY = -1
"""Subject of a reading whose target is unknown."""

EQUAL_STAMPS = 3
"""Rows of odometry with one time, on average, above which its times cannot be right."""

EMPTY = "sightings have neither a bearing nor a distance: they do not count"
REPEATED = (
    "sightings repeat another one, with equal robot, time, target and values: each counts once"
)
"""What notes say, after a number, of sightings that were left out."""

MOST_LISTED, MOST_NAMED = 20, 8
"""Most landmarks that a message names; most targets that nobody knows."""


@dataclass(frozen=True, slots=True)
class RobotLog:
    """The recording of one robot; times in s never decrease.

    Attributes
    ----------
    name : name in reports
    subject : its number, unique among robots and landmarks
    truth : (k, 4) time s, x m, y m, heading rad; no rows if unknown
    odometry : (k, 3) time s, speed m/s, turn rate rad/s
    times, subjects, bearings, ranges : (s,) times in s; numbers of the subjects seen, NOBODY where
        unknown; bearings in rad and ranges in m, NaN where not recorded
    """

    name: str
    subject: int
    truth: Array
    odometry: Array
    times: Array
    subjects: Index
    bearings: Array
    ranges: Array


@dataclass(frozen=True, slots=True)
class Log:
    """A recording of n robots among m landmarks.

    Attributes
    ----------
    name : name of the folder or file
    robots : the n robots in order
    landmark_names : m names; numbers where the layout has no other names
    landmark_subjects : (m,) numbers of the landmarks in sightings
    landmarks : (m, 2) positions in m
    notes : sentences on what was left out of the files
    """

    name: str
    robots: tuple[RobotLog, ...]
    landmark_names: tuple[int | str, ...]
    landmark_subjects: Index
    landmarks: Array
    notes: tuple[str, ...] = ()

    @property
    def has_truth(self) -> bool:
        """Whether the true poses of every robot are recorded."""
        return all(len(robot.truth) for robot in self.robots)

    def landmark_places(self, names: Iterable[int | str] | None) -> Index:
        """Return the indices of the named landmarks, ascending; of all if None.

        Raises InputError naming one that does not exist.
        """
        return np.array(chosen_landmarks(self.landmark_names, names), dtype=np.int64)


def chosen_landmarks(known: Iterable[int | str], names: Iterable[int | str] | None) -> list[int]:
    """Return the indices of the named landmarks among the known ones, ascending; all if None.

    Raises InputError naming one that does not exist.
    """
    all_names = dict.fromkeys(known)
    wanted = dict.fromkeys(all_names if names is None else names)
    for name in wanted:
        if name not in all_names:
            there = listed([str(one) for one in all_names], MOST_LISTED) or "none"
            raise InputError(f"no landmark {name!r}; there are {there}", key="landmarks")
    return [place for place, name in enumerate(all_names) if name in wanted]


# --- readings that do not count ------------------------------------------------------------------


def tidied(log: Log) -> Log:
    """Return a recording without rows that lack a number, and with equal sightings once.

    Its notes count what was left out. A number is lacking where it is NaN. Sightings are equal if
    time, target and values are. Raises InputError for a robot whose times cannot be right.
    """
    robots, counts = [], Counter[str]()
    for given in log.robots:
        robot, left_out = _tidied(given)
        for name in ("odometry", "truth"):
            if len(getattr(given, name)) and not len(getattr(robot, name)):
                problem = f"no row of the {name} of {robot.name} has all its numbers"
                raise InputError(problem, source=log.name)
        _check_times(robot, log.name)
        robots.append(robot)
        counts += left_out
    notes = (f"{count} {phrase}" for phrase, count in counts.items())
    return replace(log, robots=tuple(robots), notes=(*log.notes, *notes))


def _tidied(robot: RobotLog) -> tuple[RobotLog, Counter[str]]:
    """Robot without what does not count, and how much that is, by the rest of the note on it."""
    rows = np.column_stack([robot.times, robot.subjects, robot.bearings, robot.ranges])
    there = np.flatnonzero(~np.isnan(rows[:, 2:]).all(axis=1))
    # NaN differs from itself
    _, first = np.unique(np.nan_to_num(rows[there], nan=np.inf), axis=0, return_index=True)
    kept = np.sort(there[first])
    counts = {}
    changes = {name: getattr(robot, name)[kept] for name in SeenBodies._fields}
    for name in ("odometry", "truth"):
        table = getattr(robot, name)
        changes[name] = table[~np.isnan(table).any(axis=1)]
        phrase = f"rows of the {name} lack a number: they do not count"
        counts[phrase] = len(table) - len(changes[name])
    counts[EMPTY] = len(rows) - len(there)
    counts[REPEATED] = len(there) - len(kept)
    return replace(robot, **changes), Counter(counts)


def _check_times(robot: RobotLog, source: str) -> None:
    """Raise InputError if stamps of a robot's odometry or truth are equal in runs."""
    for name in ("odometry", "truth"):
        rows = getattr(robot, name)
        times = rows[:, 0]
        different = len(np.unique(times))
        if name == "truth" and different > 1:
            # entries may have been recorded again and again
            rows = np.unique(rows, axis=0)
        if len(rows) <= EQUAL_STAMPS * different:
            continue
        runs = (
            f"equal in runs of {len(rows) / different:.0f} rows" if different > 1 else "all equal"
        )
        cause = "were their digits cut off? Write all of them"
        if not times.any():
            cause = "were stamps left empty? --stamps received reads a bag by the times of receipt"
        problem = f"the times of the {name} of {robot.name} are {runs} ({times[0]:.10g} s)"
        raise InputError(f"{problem}: {cause}", source=source)


# --- overview -----------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Overview:
    """Overview of a recording.

    Attributes
    ----------
    name, robots, landmarks : names; numbers where the layout numbers landmarks
    begin_s, duration_s : begin and length of the odometry in s, by the recording's clock
    bearings, distances : numbers of readings with a bearing, with a distance
    has_truth : whether the true poses of every robot are recorded
    """

    name: str
    robots: tuple[str, ...]
    landmarks: tuple[int | str, ...]
    begin_s: float
    duration_s: float
    bearings: int
    distances: int
    has_truth: bool


def overview_of(log: Log) -> Overview:
    """Return the overview of a recording."""
    begin = min(float(robot.odometry[0, 0]) for robot in log.robots)
    end = max(float(robot.odometry[-1, 0]) for robot in log.robots)
    return Overview(
        name=log.name,
        robots=tuple(robot.name for robot in log.robots),
        landmarks=log.landmark_names,
        begin_s=begin,
        duration_s=end - begin,
        bearings=sum(int(np.isfinite(robot.bearings).sum()) for robot in log.robots),
        distances=sum(int(np.isfinite(robot.ranges).sum()) for robot in log.robots),
        has_truth=log.has_truth,
    )


# --- as bytes -----------------------------------------------------------------------------------


_NUMBERS = ("truth", "odometry", "times", "subjects", "bearings", "ranges")


def pack_log(log: Log) -> bytes:
    """Return a recording as compressed bytes."""
    words = {
        "name": log.name,
        "robots": [(robot.name, robot.subject) for robot in log.robots],
        "landmarks": log.landmark_names,
        "notes": log.notes,
    }
    arrays: dict[str, Any] = {
        f"{name}_{k}": getattr(robot, name)
        for k, robot in enumerate(log.robots)
        for name in _NUMBERS
    }
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        **arrays,
        landmark_subjects=log.landmark_subjects,
        landmarks=log.landmarks,
        words=np.frombuffer(json.dumps(words).encode(), np.uint8),
    )
    return buffer.getvalue()


def unpack_log(data: bytes) -> Log:
    """Return the recording in bytes from `pack_log`; raises InputError for other bytes."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as stored:
            words = json.loads(stored["words"].tobytes())
            robots = tuple(
                RobotLog(name, subject, **{one: stored[f"{one}_{k}"] for one in _NUMBERS})
                for k, (name, subject) in enumerate(words["robots"])
            )
            return Log(
                name=words["name"],
                robots=robots,
                landmark_names=tuple(words["landmarks"]),
                landmark_subjects=stored["landmark_subjects"],
                landmarks=stored["landmarks"],
                notes=tuple(words.get("notes", ())),
            )
    except (OSError, EOFError, BadZipFile, ValueError, KeyError) as error:
        raise InputError(f"not a recording: {error}", key="recording") from None


# --- robots and landmarks with names --------------------------------------------------------------


RESERVED = ("all", "none")
"""Words that can't be names, because they stand for choices of landmarks."""


class SeenBodies(NamedTuple):
    """Sightings of one robot in order of time, as in a RobotLog."""

    times: Array
    subjects: Index
    bearings: Array
    ranges: Array


@dataclass(frozen=True, slots=True)
class NamedTeam:
    """Robots in order of their names, which are subjects 1 to n, and landmarks, which follow.

    Attributes
    ----------
    robots : names
    landmarks : positions in m by name
    """

    robots: tuple[str, ...]
    landmarks: Mapping[str, tuple[float, float]]

    @classmethod
    def of(
        cls, robots: Iterable[str], landmarks: Mapping[str, tuple[float, float]], source: str
    ) -> "NamedTeam":
        """Return the team; raises InputError if there are too many robots."""
        ordered = tuple(sorted(robots, key=_by_number))
        if len(ordered) > MOST_ROBOTS:
            problem = f"holds {len(ordered)} robots, more than {MOST_ROBOTS}"
            raise InputError(problem, source=source)
        return cls(ordered, dict(landmarks))

    @property
    def subjects(self) -> dict[str, int]:
        """Subject numbers of robots and landmarks by name."""
        return {name: number for number, name in enumerate((*self.robots, *self.landmarks), 1)}

    def log(
        self,
        name: str,
        odometry: Mapping[str, Array],
        seen: Mapping[str, SeenBodies],
        truth: Mapping[str, Array],
        notes: tuple[str, ...] = (),
    ) -> Log:
        """Return the recording of each robot's odometry, sightings and truth, as in a RobotLog."""
        nothing = SeenBodies(np.zeros(0), np.zeros(0, np.int64), np.zeros(0), np.zeros(0))
        unknown = np.zeros((0, 4))
        robots = tuple(
            RobotLog(
                robot,
                number,
                truth.get(robot, unknown),
                odometry[robot],
                **seen.get(robot, nothing)._asdict(),
            )
            for number, robot in enumerate(self.robots, 1)
        )
        count = len(self.robots)
        return Log(
            name=name,
            robots=robots,
            landmark_names=tuple(self.landmarks),
            landmark_subjects=count + 1 + np.arange(len(self.landmarks), dtype=np.int64),
            landmarks=np.array(list(self.landmarks.values()), np.float64).reshape(-1, 2),
            notes=notes,
        )

    def notes_on(self, counts: Mapping[str, int]) -> tuple[str, ...]:
        """Return the note on targets that nobody knows, by their counts; "" has no name."""
        strangers = {name: counts[name] for name in counts if name and name not in self.subjects}
        if not strangers:
            return ()
        named = listed([f"{name} ({count})" for name, count in strangers.items()], MOST_NAMED)
        return (f"targets that are neither robots nor landmarks count as not recognised: {named}",)


def landmark_problem(name: str, robots: Container[str]) -> str:
    """Return the fault of a landmark's name, given the robots' names, or "" if there is none."""
    if name in robots:
        return "a robot has this name as well"
    if name in RESERVED:
        return "it stands for landmarks where some are chosen"
    return name_problem(name)


def _by_number(name: str) -> list[str]:
    """Key that sorts robot2 before robot10."""
    return [part.zfill(20) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
